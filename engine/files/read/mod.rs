//! Reading stacks: beamlet's own and measured ones, frame by frame or band by band.
//!
//! One type serves every format, so that callers need not know the source of frames. Values become f32:
//! whole numbers of 8 and 16 bits exactly, f64 and 32-bit numbers rounded.

mod checksums;
mod folder;
mod frame_order;
mod maps;
mod run;
mod stack_file;

pub use frame_order::FrameOrder;
pub use maps::Maps;
pub use run::OpenRun;
pub(crate) use run::read_scene;
pub use stack_file::StackFile;
