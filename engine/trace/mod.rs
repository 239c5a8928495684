//! Tracing: rays through the sample to moments and laws, and cells refined from them.

mod crossings;
mod lattice;
mod line;
mod media;
mod moments;
mod occupancy;
mod rows;
mod strips;
mod tracer;
mod upload;

pub use crate::gpu::interface::{Law, MetSurface, Ray};
pub use crossings::CrossingFinder;
pub use lattice::{Lattice, column, deviation};
pub(crate) use line::{DEPTH_TOLERANCE, FULL_SHARE, Integrals, first_places};
pub use media::Media;
pub use moments::{Moment, Moments};
pub use occupancy::{Shadow, shadows};
pub use strips::{CellMoments, ExactCell, Keep, Strips, Take, View, empty_strips, trace_strips};
pub(crate) use strips::{blank_strips, empty_cell, empty_strip};
pub use tracer::{TraceKernels, Tracer, push_bytes};
pub use upload::DeviceSample;
