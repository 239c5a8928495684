//! Reconstruction: from sinograms of attenuation, refraction and dark field to volumes.
//!
//! Filtered back-projection in parallel beams, fans and cones. Formulas: docs/physics.md.

mod back_projector;
mod fbp;
mod filter;
mod geometry;
mod grid;
mod quantity;
mod redundancy;
mod resampling;

pub use fbp::{FbpOptions, fbp};
pub use filter::Filter;
pub use geometry::ScanGeometry;
pub use grid::{Volume, VolumeGrid};
pub use quantity::Quantity;
