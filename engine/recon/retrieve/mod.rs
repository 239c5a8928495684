//! Retrieval: from illumination curves to transmission, refraction and dark field.
//!
//! Formulas, validity and bias of each method: docs/retrieval.md.

mod background;
mod beamlet_fit;
pub mod beamlets;
mod closed;
mod correct;
pub mod curves;
mod damping;
mod diagnosis;
mod equations;
mod fit;
pub mod fitter;
pub mod flags;
mod images;
mod input;
pub mod joined;
mod mask_curve;
pub mod method;
mod misfit;
mod model;
mod noise_factors;
mod options;
mod phase;
mod planar;
mod profile;
mod quadrature;
mod record;
mod response;
mod retriever;
mod rims;
mod run;
mod scan;
mod shape;
mod strips;
mod value_noise;

pub use background::{Background, BackgroundTerm};
pub use correct::{Corrections, Plane, ViewCorrection};
pub use curves::Curves;
pub use diagnosis::{EmptyBeam, EmptyBeamOfView, Region};
pub use fitter::{FitOptions, Fitter, Weights};
pub(crate) use images::FLAGS;
pub use images::Images;
pub use input::{Columns, Input, centre_of_lights, columns_of_images, offsets};
pub use mask_curve::MaskCurve;
pub use method::{Method, different_offsets};
pub use misfit::median;
pub use options::{ReadRows, RetrieveOptions};
pub use phase::{Drift, borders};
pub(crate) use phase::{DriftSum, integrated_row};
pub use planar::{Aperture, Lattice, sigmas_in_two_directions};
pub use record::Record;
pub use response::{LARGE_ERROR, Response};
pub use retriever::Retriever;
pub use rims::{RimError, rim_errors};
pub use run::{ImagesTo, RetrievedArrays, retrieve, retrieve_arrays};
