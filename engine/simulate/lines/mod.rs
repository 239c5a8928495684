//! Lines: a beamlet at one height. Their heights in a row, and lines through the surfaces of a sample.

mod audit;
mod by_facets;
mod by_shapes;
mod even;
mod heights;
mod light;
mod line;
mod patches;
mod sections;
mod window_light;

pub(crate) use even::{EvenCell, EvenPatch};
pub(crate) use heights::{Features, Heights, Judged, LEAST_OF_RAYS, Limits, Uneven};
pub(crate) use line::Piece;
pub(crate) use patches::{LinePatch, LineSampler, PatchPlaces, Sampled};
pub(crate) use window_light::Values;
