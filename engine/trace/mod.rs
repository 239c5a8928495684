//! Tracing: rays through the sample to moments and laws, and cells refined from them.

mod lattice;
mod line;
mod media;
mod moments;
mod occupancy;
mod rows;
mod strips;
mod tracer;
mod upload;

pub use crate::gpu::interface::{Law, Ray};
pub use lattice::{Lattice, column, deviation};
pub(crate) use line::{DEPTH_TOLERANCE, FULL_SHARE};
pub use media::Media;
pub use moments::{Moment, Moments};
pub use occupancy::{Shadow, shadows};
pub use strips::{CellMoments, ExactCell, Strips, Take, View, empty_strips, trace_strips};
pub use tracer::{TraceKernels, Tracer, push_bytes};
pub use upload::DeviceSample;
