//! Reconstruction: from sinograms of attenuation, refraction and dark field to volumes.
//!
//! Parallel beams, fans and cones, on a circle; iterative methods with any motion of the sample. Formulas: docs/physics.md.
//!
//! [`write_astra`] writes filled images for the ASTRA toolbox.
//!
//! From retrieved images to files: [`Input`] reads sinograms (`prepare.rs` fills their gaps),
//! [`GridChoice`] chooses voxels, a [`VolumePlan`] has what is to be made, within a limit of memory
//! (`memory.rs`), a [`Method`] makes a [`Volume`], [`reconstruct`] writes a folder of them (`write.rs`,
//! `record.rs`) with a [`Truth`], [`OpenVolumes`] reads it.
//!
//! From sinograms to volumes, in the order of the data:
//!
//! - `geometry`, `motions`, `grid`, `quantity`, `data`: the scan, the voxels, what values are.
//! - `centre`, `rings`, `hardening`, `phase`: sinograms corrected.
//! - `moment`, `view_runs`, `lost_views`, `lost_record`: views that lost their refraction, left out of δ.
//! - `redundancy`, `resampling`, `filter`, `extrapolation`, `filtering`: rows weighted and filtered.
//! - `back_projector`, `fbp_options`, `fbp`: filtered back-projection.
//! - `joseph`, `moved`, `projector`, `model`: projections of a volume, and the transpose.
//! - `solver`, `measured`, `preconditioner`, `vectors`, `problem`, `iterative`: least squares.
//! - `gradient_bias`: slices corrected.
//! - `work`: progress of several stages.

mod arguments;
mod astra;
mod back_projector;
mod centre;
mod choice;
mod data;
mod estimate;
mod extrapolation;
mod fbp;
mod fbp_options;
mod filter;
mod filtering;
mod geometry;
mod gradient_bias;
mod grid;
mod hardening;
mod input;
mod iterative;
mod joseph;
mod lost_record;
mod lost_views;
mod measured;
mod memory;
mod method;
mod model;
mod moment;
mod motions;
mod moved;
mod open;
mod phase;
mod plan;
mod preconditioner;
mod prepare;
mod problem;
mod projector;
mod quantity;
mod record;
mod redundancy;
mod resampling;
mod resident;
mod rings;
mod run;
mod scan;
mod sinogram_volume;
mod sinograms;
mod solver;
mod stream;
mod truth;
mod vectors;
mod view_runs;
mod voxel_mask;
mod voxel_shape;
mod work;
mod write;

pub use arguments::{Centre, ReconstructArguments};
pub use astra::{AstraFile, write_astra};
pub use centre::find_axis;
pub use choice::GridChoice;
pub use data::Data;
pub use estimate::{VolumeEstimate, estimate};
pub use fbp::fbp;
pub use fbp_options::FbpOptions;
pub use filter::Filter;
pub use geometry::ScanGeometry;
pub use gradient_bias::{add_gradient_bias, gradient_bias};
pub use grid::{Volume, VolumeGrid};
pub use hardening::{BeamEnergy, BeamHardening, HardeningChoice};
pub use input::Input;
pub use iterative::{Iterated, iterate};
pub use lost_record::{LostUse, LostView, MomentRecord};
pub use lost_views::LostViews;
pub use measured::{Measured, deviation_weights};
pub use method::{Made, Method};
pub use model::Model;
pub use moment::reaching_ends;
pub use open::OpenVolumes;
pub use phase::phase_along_rows;
pub use plan::VolumePlan;
pub use prepare::{PixelCounts, fill_images, prepare_sinograms};
pub use quantity::Quantity;
pub use record::{HardeningRecord, VolumeRecord};
pub use rings::suppress_rings;
pub use run::{LABELS, Reconstructed, VolumesTo, reconstruct};
pub use sinogram_volume::{SinogramVolume, Sinograms, reconstruct_sinograms};
pub use solver::{IterativeOptions, Solver};
pub use truth::Truth;
pub use voxel_mask::VoxelMask;
pub use voxel_shape::VoxelShape;
pub use write::VolumeFormat;
