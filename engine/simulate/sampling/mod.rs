//! Sampling: patches of a view and the cells that are made of their lines and rays (docs/developers/sampling.md).
//! A patch is one beamlet and one detector row.

mod absorption;
mod cell_batch;
mod cell_moments;
mod cell_rows;
mod emission;
mod error_budget;
mod hardening;
mod lattice;
mod line_cells;
mod moment_recording;
mod patch_grid;
mod projected_bounds;
mod rectangle;
mod response;
mod responses;
mod room;
mod row_spread;
mod rows;
mod sample_facets;
mod strips;
mod survey;
mod view_context;
mod windows;

pub(crate) use absorption::{linear_change, mean_passed};
pub(crate) use cell_batch::{CellBatch, balance, empty_cell_row, empty_cell_rows, lands_near};
pub(crate) use cell_moments::CellMoments;
pub(crate) use error_budget::{ErrorBudget, SAFETY, safety, tally_of};
pub(crate) use hardening::Hardening;
pub use lattice::{Lattice, beamlet_geometry};
pub(crate) use moment_recording::MomentRecording;
pub(crate) use patch_grid::PatchGrid;
pub(crate) use projected_bounds::{ProjectedBounds, projected_bounds, touches_pixel};
pub(crate) use response::{Opening, Response};
pub(crate) use responses::{ColumnOpenings, Responses};
pub use room::Room;
pub(crate) use row_spread::tilt_by_depth;
pub(crate) use rows::sample_rows;
pub(crate) use sample_facets::{SampleFacets, SurfaceStep};
pub(crate) use strips::{Fall, StripPair, StripResponses};
pub(crate) use survey::{RowsCost, count_patches, survey_rows};
pub(crate) use view_context::ViewContext;
pub(crate) use windows::Landed;
