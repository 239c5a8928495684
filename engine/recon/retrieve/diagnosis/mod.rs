//! Faults of measured data that values and images show, and what pixels of empty beam say of dose and
//! drift. Nothing here changes an image.
//!
//! Files in the order of the data:
//! - `watched.rs`: values of a few thousand pixels, kept while rows are read;
//! - `fitted.rs`: value and slopes of the curve that was fitted to a pixel;
//! - `leverage.rs`: share of a value that the fit follows;
//! - `chi_square.rs`: residuals over the noise of photons;
//! - `excess.rs`: residuals of the sample beside those of the flat;
//! - `exchanged.rs`: neighbouring steps in the other order;
//! - `below_zero.rs`: frames with more negative values than noise has;
//! - `steps.rs`: dose and offsets of steps, from residuals that all pixels share;
//! - `light.rs`: samples with more light than the flat, or divided by it;
//! - `transposed.rs`: views and steps in another order;
//! - `estimate.rs`: medians with their uncertainty;
//! - `region.rs`: a rectangle of pixels;
//! - `empty_beam.rs`: transmission, refraction, dose and drift where nothing is in the beam;
//! - `moments.rs`: errors of the method `moments` at the offsets of a scan;
//! - `borders.rs`: the same at both sides of an image, where they look empty;
//! - `warnings.rs`: all of them, as lines for the log and the record;
//! - `collected.rs`: the diagnosis of a retrieval, view by view.

mod below_zero;
mod borders;
mod chi_square;
mod collected;
mod empty_beam;
mod estimate;
mod excess;
mod exchanged;
mod fitted;
mod leverage;
mod light;
mod moments;
mod region;
mod steps;
mod transposed;
mod warnings;
mod watched;

pub(super) use borders::Borders;
pub(crate) use collected::{Diagnosis, ExaminedView};
pub use empty_beam::{EmptyBeam, EmptyBeamOfView};
pub(super) use fitted::{FittedCurve, is_usable};
pub use region::Region;
pub(super) use steps::inverted;
