//! Tracing, sampling and illumination of beamlet.

pub mod accel;
pub mod detector;
pub mod illuminate;
mod lines;
mod refine;
pub mod run;
pub mod sampling;
pub mod trace;
pub mod wave;
