//! Residuals of a sample beside those of its flat, which need no known gain.

use super::chi_square::reduced;
use crate::retrieve::misfit::median;

/// Reduced chi squared of the sample over that of the flat from which on the curves of the sample are others.
const RATIO: f64 = 10.0;
/// Least residual of the sample, rms over the height, for that.
const LEAST: f64 = 0.005;
/// Residual, rms over the height, from which on fits do not follow the values, where it exceeds the flat's noise.
const LARGE: f64 = 0.1;
const BEYOND_NOISE: f64 = 2.0;

/// Residuals of a pixel.
pub(super) struct PixelExcess {
    /// Weighted squares of the flat, found and expected by an assumed gain.
    pub(super) flat: [f64; 2],
    /// The same of the sample.
    pub(super) sample: [f64; 2],
    /// Residual of the sample, rms over the height of its curve.
    pub(super) residual: f64,
}

/// Residuals of the sample of a view that the flat does not have.
#[derive(Debug, Clone, Copy)]
pub(super) struct Excess {
    /// Reduced chi squared of the sample over that of the flat.
    pub(super) ratio: f64,
    /// Median residual, rms over the height.
    pub(super) residual: f64,
}

impl Excess {
    /// Reduced chi squared of the sample over that of the flat.
    pub(super) fn ratio_of<'a>(
        pixels: impl Iterator<Item = &'a PixelExcess> + Clone,
        freedom: usize,
    ) -> Option<f64> {
        let flat = reduced(pixels.clone().map(|of| of.flat), freedom)?;
        Some(reduced(pixels.map(|of| of.sample), freedom)? / flat)
    }

    /// `None` where the residuals are those of noise, or of a curve that flat and sample have in common.
    pub(super) fn of<'a>(
        pixels: impl Iterator<Item = &'a PixelExcess> + Clone,
        freedom: usize,
    ) -> Option<Self> {
        let ratio = Self::ratio_of(pixels.clone(), freedom)?;
        let residual = median(pixels.map(|of| of.residual).collect())?;
        let is_other = ratio > RATIO && residual > LEAST;
        let is_large = ratio > BEYOND_NOISE && residual > LARGE;
        (is_other || is_large).then_some(Self { ratio, residual })
    }
}
