//! Sums over volumes and sinograms in f64, in an order that no thread changes.

use rayon::prelude::*;

/// Values that one thread sums.
const PART: usize = 1 << 14;

/// Scalar product.
pub(super) fn dot(a: &[f32], b: &[f32]) -> f64 {
    let parts: Vec<f64> = a
        .par_chunks(PART)
        .zip(b.par_chunks(PART))
        .map(|(a, b)| a.iter().zip(b).map(|(a, b)| f64::from(*a) * f64::from(*b)).sum::<f64>())
        .collect();
    parts.iter().sum()
}

/// Changes each value of `a` by the value of `b`.
pub(super) fn change(a: &mut [f32], b: &[f32], value: impl Fn(f32, f32) -> f32 + Sync) {
    a.par_chunks_mut(PART).zip(b.par_chunks(PART)).for_each(|(a, b)| {
        a.iter_mut().zip(b).for_each(|(a, b)| *a = value(*a, *b));
    });
}
