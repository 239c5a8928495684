//! Fourier transforms of rows.

use rustfft::{Fft, FftPlannerScalar};
use std::sync::Arc;

/// The transforms of rows of `length` values, both without a factor: forward and inverse.
///
/// Planned here, so that the library of transforms is compiled once rather than in each crate that plans.
#[must_use]
pub fn transforms(length: usize) -> [Arc<dyn Fft<f64>>; 2] {
    let mut planner = FftPlannerScalar::new();
    [planner.plan_fft_forward(length), planner.plan_fft_inverse(length)]
}
