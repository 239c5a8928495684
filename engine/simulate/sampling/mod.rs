//! Sampling: which rays are traced, and the cells that are made of them (docs/developers/sampling.md).
//! A patch is one beamlet and one detector row; each patch is an adaptive quadrature of the recorded
//! values over (x, z), refined until its error budget holds.

mod alignment;
mod base_lattice;
mod cell_batch;
mod cell_moments;
mod cell_rows;
mod crowding;
mod dissection;
mod edges_along_z;
mod emission;
mod error_budget;
mod error_estimate;
mod facet_lists;
mod facet_means;
mod hardening;
mod lattice;
mod layout;
mod leaves;
mod lit_heights;
mod moment_recording;
mod narrow_components;
mod neighbours;
mod patch;
mod patch_error;
mod patch_facet;
mod patch_grid;
mod piece;
mod polygon;
mod projected_bounds;
mod ray_error;
mod rectangle;
mod refinement;
mod response;
mod room;
mod row_spread;
mod rows;
mod sample_facets;
mod sheets;
mod step_errors;
mod step_shares;
mod survey;
mod touched;
mod unresolved;
mod view_context;
mod walls;
mod windows;

pub(crate) use base_lattice::{BaseLattice, ROWS_TOGETHER};
pub(crate) use cell_batch::{
    CellBatch, blank_cell_rows, blank_cells, empty_cell, empty_cell_row, empty_cell_rows,
};
pub(crate) use cell_moments::{CellMoments, ExactCell};
pub(crate) use edges_along_z::EdgesAlongZ;
pub(crate) use error_budget::ErrorBudget;
pub(crate) use hardening::Hardening;
pub use lattice::{Lattice, beamlet_geometry};
pub(crate) use leaves::{bytes_of_leaf, cells_of_leaves};
pub(crate) use lit_heights::LitHeights;
pub(crate) use moment_recording::MomentRecording;
pub(crate) use projected_bounds::{ProjectedBounds, projected_bounds, touches_pixel};
pub(crate) use response::{Opening, Response};
pub use room::Room;
pub(crate) use rows::{Take as TakeCells, sample_rows, take_blank};
pub(crate) use sample_facets::SampleFacets;
pub(crate) use survey::{PatchCost, RowsCost, spread, survey_rows};
pub(crate) use view_context::ViewContext;
pub(crate) use walls::Walls;
