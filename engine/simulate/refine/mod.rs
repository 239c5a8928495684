//! Refinement on the device: base rays, estimates, splits and cells of a group of patches, level by level, in
//! submissions that the host only counts.

mod buffers;
mod group;
mod kernels;
mod refiner;
mod tables;

pub(crate) use kernels::RefineKernels;
pub(crate) use refiner::{DeviceRefiner, MadeCells, RefineRoom};
