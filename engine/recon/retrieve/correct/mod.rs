//! Corrections of dose, mask offsets and drift from pixels with nothing in the beam (`--correct`).
//!
//! Files in the order of the data:
//! - `chosen.rs`: the corrections that a caller chooses, and their results in the record;
//! - `pixels.rs`: values of the pixels of a view, and the curves of their flat;
//! - `equations.rs`: normal equations of doses and offsets of the frames;
//! - `frames.rs`: their solution, with uncertainties;
//! - `plane.rs`: shift and plane of the refraction angle;
//! - `corrector.rs`: one view after the other;
//! - `table.rs`: corrections.csv.

mod chosen;
mod corrector;
mod equations;
mod frames;
mod pixels;
mod plane;
mod table;

pub(super) use chosen::undetermined;
pub use chosen::{Corrections, Plane, ViewCorrection};
pub(crate) use corrector::{Corrector, FrameCorrection};
pub(crate) use pixels::Rectangle;
pub(super) use table::table;
