//! Retrieval: from illumination curves to transmission, refraction and dark field.
//!
//! Formulas, validity and bias of each method: docs/retrieval.md.

mod curves;
mod fitter;
pub mod flags;

pub use curves::Curves;
pub use fitter::{FitOptions, Fitter, Weights};
