//! Lines of a row: a line is a beamlet at one height, whatever computes its light.
//!
//! - `heights`: heights of the lines of a beamlet and row, their weights, and the error of their sum.

mod heights;

pub(crate) use heights::{Features, Heights, Limits};
