//! Refinement on the device: base rays, estimates, splits and cells of a group of patches, level by level, in
//! submissions that the host only counts.

mod buffers;
mod group;
mod group_run;
mod heights;
mod kernels;
mod leaves;
mod params;
mod refiner;
mod room;
mod spectrum;
mod tables;

pub(crate) use group_run::MadeCells;
pub(crate) use kernels::{CellMaker, RefineKernels};
pub(crate) use refiner::{DeviceRefiner, Take};
pub(crate) use room::RefineRoom;
