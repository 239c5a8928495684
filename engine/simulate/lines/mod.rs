//! Lines: a beamlet at one height. Their heights in a row, and lines through the surfaces of a sample.
//!
//! Files in the order of the data flow, with the tests that notice them:
//! - `patch_places`: patches on which shadows fall (`tests/sampling/traps.rs`).
//! - `critical`: heights at which surfaces end, jump or bend light there (`tests/metamorphic/parts/`).
//! - `by_facets`, `by_shapes`: surfaces that the plane of a line cuts (`tests/sampling/truth/`, `rims.rs`).
//! - `sections`: pieces of a line between the ends of these surfaces (`tilted_faces.rs`, `level_faces.rs`).
//! - `line`, `window_light`, `light`: a line, and its light by the windows that it reaches (`estimated.rs`);
//!   `combined_light`: behind the masks of several designs (`designs.rs`).
//! - `heights`: lines of a row, and the error of their sum (`heights/tests.rs`, `tests/physics/waves/heights.rs`).
//! - `even`: evenly spread rays among many bodies (`unresolved.rs`, `foam.rs`).
//! - `patches`: lines or rays of patches (`kinds.rs`, `borders.rs`); `work`: patches in work.
//! - `slopes`: light over the height of a cell (`apertures.rs`).
//! - `audit`: measured errors of patches (`audit.rs`, `tests/metamorphic/audits.rs`).

mod audit;
mod by_facets;
mod by_shapes;
mod combined_light;
mod critical;
mod even;
mod heights;
mod light;
mod line;
mod patch_places;
mod patches;
mod sections;
mod slopes;
mod window_light;
mod work;

pub(crate) use critical::SampleImage;
pub(crate) use even::{EvenCell, EvenPatch};
pub(crate) use heights::{Features, Heights, Judged, JudgedLight, LEAST_OF_RAYS, Limits, Uneven};
pub(crate) use line::{LinePlace, Piece};
pub(crate) use patch_places::PatchPlaces;
pub(crate) use patches::{LinePatch, LineSampler, Sampled};
pub(crate) use slopes::Slopes;
pub(crate) use window_light::Values;
pub(crate) use work::{PATCHES_AT_ONCE, PIECES_AT_ONCE, cells_at_once};
