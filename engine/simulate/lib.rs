//! Internal to beamlet: tracing, sampling and illumination.

pub mod accel;
pub mod detector;
pub mod illuminate;
mod lines;
pub mod run;
pub mod sampling;
pub mod trace;
pub mod wave;
