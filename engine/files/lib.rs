//! Internal to beamlet: stacks of frames and the sinks that take them.
//!
//! A stack is `[step][row][column]` per view, f32 intensities, row 0 on top. With noise there is a second
//! stack of detector numbers beside each, and a stack of dark frames. The engine knows only [`Sink`]; the
//! destination of the frames (a run directory, arrays, a callback) is chosen here. Files here use one
//! another by their own names, never by this one.

mod apart;
mod array;
mod array_frames;
mod callback;
mod frame_files;
mod frames;
mod geometry_file;
mod image_folder;
mod inputs;
pub mod layout;
mod own_files;
mod part;
mod progress_log;
mod read;
mod record;
mod run_directory;
mod run_file;
mod scene_file;
mod shape;
mod sink;
mod values;
mod verify;

pub use apart::{canonical, is_of_run, is_same_place, refuse_overlap};
pub use array::{ArraySink, CountStacks, Stacks};
pub use beamlet_core::array_file::{Abilities, Format};
pub use callback::CallbackSink;
pub use geometry_file::{GeometryFile, Order, index_of, place_of};
pub use image_folder::{ImageDirectory, Kind};
pub use inputs::{InputHashes, refuse_changed, working_directory};
pub use part::{ViewRange, views_of_part};
pub use read::{FrameOrder, Maps, OpenRun, StackFile};
pub use record::{
    AuditedError, FacetKink, Platform, RunProfile, RunRecord, RunStart, SamplingError,
    SamplingSummary, SearchCounts,
};
pub use run_directory::{JoinOptions, RunDirectory, join};
pub use run_file::{FORMAT_VERSION, JoinedPart, RunFile, RunState, now};
pub use shape::{StackShape, ViewAngles, views};
pub use sink::Sink;
pub use verify::{RunCheck, check_run};
