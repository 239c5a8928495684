//! Retrieval: from illumination curves to transmission, refraction and dark field.
//!
//! Formulas, validity and bias of each method: docs/retrieval.md.

mod beamlet_fit;
pub(crate) mod beamlets;
mod closed;
mod correct;
pub(crate) mod curves;
mod diagnosis;
mod equations;
pub(crate) mod fitter;
pub mod flags;
mod images;
mod input;
pub(crate) mod joined;
mod least_squares;
pub(crate) mod method;
mod misfit;
mod noise_factors;
mod options;
mod periods;
mod phase;
mod quadrature;
mod record;
mod retriever;
mod run;
mod shape;

pub(crate) use closed::three_step_uncertainties;
pub use correct::{Corrections, Plane, ViewCorrection};
pub(crate) use curves::Curves;
pub use diagnosis::{EmptyBeam, EmptyBeamOfView, Region};
pub use fitter::Weights;
pub(crate) use fitter::{FitOptions, Fitter};
pub(crate) use images::FLAGS;
pub use images::Images;
pub use input::{Columns, Input, offsets};
pub use method::Method;
pub(crate) use method::different_offsets;
pub(crate) use misfit::median;
pub use options::{ReadRows, RetrieveOptions};
pub use phase::Drift;
pub(crate) use phase::{DriftSum, borders, integrated_row};
pub use record::Record;
pub use retriever::Retriever;
pub use run::{ImagesTo, RetrievedArrays, retrieve, retrieve_arrays};
