//! Sampling: which rays are traced, and the cells that are made of them (docs/developers/sampling.md).
//! A patch is one beamlet and one detector row; each patch is an adaptive quadrature of the recorded
//! values over (x, z), refined until its error budget holds.

mod alignment;
mod base_lattice;
mod cell_batch;
mod cell_moments;
mod cell_rows;
mod edges_along_z;
mod emission;
mod error_budget;
mod error_estimate;
mod hardening;
mod lattice;
mod line_cells;
mod lit_heights;
mod moment_recording;
mod narrow_components;
mod neighbours;
mod patch;
mod patch_error;
mod patch_grid;
mod projected_bounds;
mod ray_error;
mod rectangle;
mod refinement;
mod response;
mod room;
mod row_spread;
mod rows;
mod sample_facets;
mod step_errors;
mod step_shares;
mod survey;
mod unresolved;
mod view_context;
mod windows;

pub(crate) use base_lattice::BaseLattice;
pub(crate) use cell_batch::{CellBatch, empty_cell_row, empty_cell_rows};
pub(crate) use cell_moments::{CellMoments, ExactCell};
pub(crate) use error_budget::{ErrorBudget, safety, tally_of};
pub(crate) use hardening::Hardening;
pub use lattice::{Lattice, beamlet_geometry};
pub(crate) use moment_recording::MomentRecording;
pub(crate) use patch_grid::PatchGrid;
pub(crate) use projected_bounds::{ProjectedBounds, projected_bounds, touches_pixel};
pub(crate) use response::{Opening, Response};
pub use room::Room;
pub(crate) use rows::sample_rows;
pub(crate) use sample_facets::{SampleFacets, SurfaceStep};
pub(crate) use survey::{RowsCost, survey_rows};
pub(crate) use view_context::ViewContext;
