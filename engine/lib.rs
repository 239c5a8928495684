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
mod error;
mod folder;
pub mod geometry;
mod gpu;
mod illuminate;
mod image;
mod input_file;
mod interface;
#[doc(hidden)]
pub mod internals;
mod interpolation;
mod locked_file;
pub mod material;
pub mod moments;
mod numbers;
mod open_file;
mod optics;
mod parallel;
mod printed;
mod random;
pub mod reconstruct;
mod reserve;
pub mod retrieve;
mod run;
mod sampling;
pub mod scene;
pub mod spectrum;
mod spot;
pub mod stack;
mod suggestion;
mod trace;
mod units;
mod whole_file;

pub use ndarray;

pub use accel::Backend;
pub use cancel::Cancel;
pub use error::{Error, Place, Result};
pub use gpu::{DeviceDescription, DeviceKind};
pub use optics::{MaskMeshOptions, MaskPlace, mask_meshes};
pub use run::{
    Control, EdgeBlur, Engine, EngineOptions, MemoryEstimate, Progress, RowsControl, RunEstimate,
    Simulation, ViewProgress, devices, load_sample,
};
pub(crate) use stack::layout;
pub use stack::{RunRecord, SamplingSummary, SearchCounts};
pub use trace::{Ray, SurfaceCrossing, Tally, uncovered};
