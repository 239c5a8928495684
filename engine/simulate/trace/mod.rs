//! Tracing: rays through the sample, to results and moments.

mod crossings;
mod moments;
mod ray;
mod tracer;
mod upload;

pub use beamlet_interface::RayResult;
pub use crossings::{CrossingFinder, SurfaceCrossing, uncovered};
pub use moments::{Moment, Moments, grazing};
pub use ray::Ray;
pub(crate) use tracer::{FIRST_BATCH, LARGEST_BATCH, LISTS_BYTES, RAY_BYTES};
pub use tracer::{TraceKernels, Tracer};
pub use upload::DeviceSample;
pub(crate) use upload::{FIRST_ORDER_ERROR, hash as component_hash, least_cosine};
