//! Geometry: shapes, files, closedness, orientation, nesting, clearance.

mod clearance;
mod defects;
mod experiments;
mod export;
mod files;
mod folds;
mod formats;
mod gaps;
mod meshes;
mod motions;
mod nesting;
mod overlap;
mod rounding;
pub(super) mod set_up;
mod shapes;
mod threemf;
mod united;
