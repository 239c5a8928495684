//! Residuals over the noise of photons.

use super::leverage::Leverage;
use crate::retrieve::misfit::median;

/// A pixel: its residuals squared, of the sample as they are, and less the residuals of the flat.
pub(super) struct PixelResiduals {
    /// Found and expected.
    pub(super) own: [f64; 2],
    /// Found and expected.
    pub(super) beyond_flat: [f64; 2],
}

impl PixelResiduals {
    /// Residuals of flat and sample, each with its measured values.
    pub(super) fn of(
        [flat, sample]: [&Leverage; 2],
        [of_flat, of_sample]: [&[f64]; 2],
        [flat_height, height]: [f64; 2],
    ) -> Self {
        let ratio = height / flat_height;
        let shape: Vec<f64> = (0..of_sample.len())
            .map(|k| libm::fma(-ratio, of_flat[k] - flat.values[k], of_sample[k]))
            .collect();
        let [found, expected] = sample.squares(&shape);
        let of_noise = sample.weighted(&flat.residual_variances());
        let beyond_flat = [found, libm::fma(ratio * ratio, of_noise, expected)];
        Self { own: sample.squares(of_sample), beyond_flat }
    }
}

/// Median of found over expected sums of squares, in units of the median that the noise of so many
/// degrees of freedom has: 1 where nothing but noise is there.
pub(super) fn reduced(pairs: impl Iterator<Item = [f64; 2]>, freedom: usize) -> Option<f64> {
    if freedom == 0 {
        return None;
    }
    // Wilson and Hilferty's median of chi squared, over its mean.
    let of_noise = (1.0 - 2.0 / (9.0 * freedom as f64)).powi(3);
    Some(median(pairs.map(|[found, expected]| found / expected).collect())? / of_noise)
}
