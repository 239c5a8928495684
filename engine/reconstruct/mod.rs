//! Reconstruction: from sinograms of attenuation, refraction and dark field to volumes.
//!
//! Filtered back-projection in parallel beams, fans and cones. Formulas: docs/physics.md.
//!
//! From retrieved images to files: [`Input`] reads sinograms (`prepare.rs` fills their gaps),
//! [`GridChoice`] chooses voxels, a [`Method`] makes a [`Volume`], [`reconstruct`] writes a folder of
//! them (`write.rs`, `record.rs`) with means of [`Region`]s and a [`Truth`], [`OpenVolumes`] reads it.

mod back_projector;
mod choice;
mod estimate;
mod fbp;
mod filter;
mod geometry;
mod grid;
mod input;
mod method;
mod open;
mod plan;
mod prepare;
mod quantity;
mod record;
mod redundancy;
mod regions;
mod resampling;
mod run;
mod scan;
mod truth;
mod write;

pub use choice::GridChoice;
pub use estimate::{VolumeEstimate, estimate};
pub use fbp::{FbpOptions, fbp};
pub use filter::Filter;
pub use geometry::ScanGeometry;
pub use grid::{Volume, VolumeGrid};
pub use input::Input;
pub use method::Method;
pub use open::OpenVolumes;
pub use plan::VolumePlan;
pub use prepare::PixelCounts;
pub use quantity::Quantity;
pub use record::VolumeRecord;
pub use regions::{Region, RegionMean, RegionShape, region_table};
pub use run::{Reconstructed, VolumesTo, reconstruct};
pub use truth::Truth;
pub use write::VolumeFormat;
