//! beamlet simulates edge-illumination X-ray phase contrast imaging from CAD models.
//!
//! A [`scene::Scene`] is loaded or built, an [`Engine`] opens a Vulkan device, and a run streams stacks
//! of frames, one per mask step, to a [`stack::Sink`] or returns them as `ndarray` arrays. Lengths are
//! metres, angles radians and energies keV unless a name says otherwise. Frame of reference and signs:
//! docs/physics.md.
//!
//! ```no_run
//! use beamlet::{Engine, EngineOptions, scene::Scene};
//!
//! let scene = Scene::load("scene.toml")?;
//! let stacks = Engine::open(&EngineOptions::default())?.simulate(&scene)?;
//! println!("{:?}", stacks.sample.shape());
//! # Ok::<(), beamlet::Error>(())
//! ```
//!
//! The engine never prints, exits or panics on input; messages go through the `log` crate.

#[macro_use]
mod setters;

mod accel;
mod array_file;
mod cancel;
pub mod check;
#[doc(hidden)]
pub mod cli_support;
pub mod compare;
mod csv_table;
mod detector;
mod engine;
mod error;
mod folder;
pub mod geometry;
mod gpu;
mod ideal;
mod illuminate;
mod image;
mod input_file;
#[doc(hidden)]
pub mod interface;
#[doc(hidden)]
pub mod internals;
mod interpolation;
mod labels;
mod locked_file;
pub mod material;
mod media;
pub mod moments;
mod numbers;
mod open_file;
mod optics;
mod parallel;
mod printed;
mod program;
mod random;
pub mod reconstruct;
mod reserve;
pub mod retrieve;
mod rows_control;
mod run;
mod sampling;
pub mod scene;
#[doc(hidden)]
pub mod shaders;
pub mod spectrum;
mod spot;
pub mod stack;
mod suggestion;
mod tally;
mod trace;
mod units;
mod whole_file;

pub use ndarray;

pub use cancel::Cancel;
pub use engine::{Engine, devices};
pub use error::{Error, Place, Result};
pub use geometry::{MaskMeshOptions, MaskPlace, mask_meshes};
pub use gpu::{Backend, Compute, DeviceDescription, DeviceKind, EngineOptions};
pub use ideal::{IdealImages, IdealOptions, ideal};
pub use labels::truth;
pub use rows_control::RowsControl;
pub use run::{
    Control, EdgeBlur, MemoryEstimate, Progress, RunEstimate, Simulation, ViewProgress, load_sample,
};
pub(crate) use stack::layout;
pub use stack::{RunRecord, SamplingSummary, SearchCounts};
pub use tally::Tally;
pub use trace::{Ray, SurfaceCrossing, uncovered};
