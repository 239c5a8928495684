//! Noise of values that were multiplied or averaged before curves are fitted.

/// Factors of the noise of values, relative to values of single frames.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct NoiseFactors {
    /// Factor of the variance over the mean.
    gain: f64,
    /// Factor of the standard deviation without light.
    read_noise: f64,
}

impl NoiseFactors {
    /// Values as they are in the frames.
    pub(crate) const ONE: Self = Self::multiplied(1.0);

    /// Values that were multiplied by this factor.
    pub(crate) const fn multiplied(factor: f64) -> Self {
        Self { gain: factor, read_noise: factor }
    }

    /// Interpolated values: `share` of one frame and the rest of another, with the variance of a single
    /// frame times (1 − share)² + share².
    pub(crate) fn interpolated(share: f64) -> Self {
        let variance = libm::fma(share, share, (1.0 - share).powi(2));
        Self { gain: variance, read_noise: variance.sqrt() }
    }

    /// Variance over mean of these values, from the one of single frames.
    pub(crate) const fn gain(self, gain: f64) -> f64 {
        self.gain * gain
    }

    /// Standard deviation of these values without light, from the one of single frames.
    pub(crate) const fn read_noise(self, read_noise: f64) -> f64 {
        self.read_noise * read_noise
    }

    /// True if the values have the noise of single frames.
    pub(crate) fn is_one(self) -> bool {
        self == Self::ONE
    }
}
