//! Values that fits take, and their noise.

use super::flags;
use super::options::RetrieveOptions;
use beamlet_core::options::{Choice, Word};
use serde::Serialize;

/// How values of a curve count in a fit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Weights {
    /// All the same.
    #[default]
    None,
    /// One over the variance of counts, from the fitted curve: the fit is the maximum of the
    /// Poisson likelihood.
    Poisson,
}

impl Choice for Weights {
    const CHOICES: &'static [Self] = &[Self::None, Self::Poisson];

    fn word(self) -> Word {
        match self {
            Self::None => Word { name: "none", help: "Equal weights" },
            Self::Poisson => Word {
                name: "poisson",
                help: "For counts, from the fit: the maximum of the Poisson likelihood",
            },
        }
    }
}

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

    /// True if the values have the noise of single frames.
    pub(crate) fn is_one(self) -> bool {
        self == Self::ONE
    }
}

/// Noise and limits that all curves of flat or sample share.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ValueNoise {
    /// Values from here on are left out.
    pub saturation: f64,
    /// Value of one count, where the values are counts.
    pub gain: Option<f64>,
    /// Standard deviation of a value without light.
    pub read_noise: f64,
    /// Weights of the values.
    pub weights: Weights,
}

impl Default for ValueNoise {
    /// Intensities without weights and noise, of which all count.
    fn default() -> Self {
        Self { saturation: f64::INFINITY, gain: None, read_noise: 0.0, weights: Weights::None }
    }
}

impl ValueNoise {
    /// Noise of a stack with these options, whose values are means of several frames or sums.
    pub(super) fn of(options: &RetrieveOptions, factors: NoiseFactors) -> Self {
        Self {
            saturation: options.saturation.map_or(f64::INFINITY, f64::from),
            gain: options.gain.map(|gain| factors.gain * gain),
            read_noise: factors.read_noise * options.read_noise,
            weights: options.weights,
        }
    }

    /// As [`Self::of`]; the noise of values that are no counts is relative to that of single frames.
    pub(super) fn relative(options: &RetrieveOptions, factors: NoiseFactors) -> Self {
        let gain = factors.gain * options.gain.unwrap_or(1.0);
        Self { gain: Some(gain), ..Self::of(options, factors) }
    }

    /// Variance of a value; `NaN` where values are no counts.
    pub(super) fn variance(&self, value: f64) -> f64 {
        let read_noise = self.read_noise;
        self.gain.map_or(f64::NAN, |gain| gain * value.max(0.0) + read_noise * read_noise)
    }

    /// Variance of a value by a fit: of one count at least.
    pub(super) fn variance_of_fit(&self, value: f64) -> f64 {
        let (gain, least) = (self.gain.unwrap_or(1.0), self.gain.unwrap_or(0.0));
        gain * value.max(least) + self.read_noise * self.read_noise
    }

    /// One over the variance of a value by a fit whose height above its background is `peak`; far from the peak at
    /// least over the variance of a thousandth of it.
    pub(super) fn weight(&self, value: f64, peak: f64) -> f64 {
        let least = 1e-3 * self.gain.unwrap_or(1.0) * peak.abs();
        1.0 / self.variance_of_fit(value).max(least).max(f64::MIN_POSITIVE)
    }

    /// Sorts out values and hands the others to `keep`, by their place in the curve. Returns flags, which say why
    /// there is no answer, and least and greatest value. `needed`: fewest values.
    pub(super) fn sort_out(
        &self,
        curve: impl Iterator<Item = f32>,
        needed: usize,
        mut keep: impl FnMut(usize, f64),
    ) -> (u32, [f64; 2]) {
        let (mut flags, mut range) = (0, [f64::INFINITY, f64::NEG_INFINITY]);
        let mut kept = 0;
        for (index, value) in curve.enumerate() {
            let value = f64::from(value);
            if !value.is_finite() {
                flags |= flags::NOT_FINITE;
            } else if value >= self.saturation {
                flags |= flags::SATURATED;
            } else {
                kept += 1;
                range = [range[0].min(value), range[1].max(value)];
                keep(index, value);
            }
        }
        if kept < needed {
            flags |= flags::FEW;
        } else if range[1] <= range[0] {
            flags |= flags::DEAD;
        }
        (flags, range)
    }
}
