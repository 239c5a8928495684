//! Values that fits take, and their noise.

use super::fitter::Weights;
use super::flags;
use super::noise_factors::NoiseFactors;
use super::options::RetrieveOptions;

/// Noise and limits that all curves of flat or sample share.
#[derive(Debug, Clone, Copy)]
pub(super) struct ValueNoise {
    /// Values from here on are left out.
    pub(super) saturation: f64,
    /// Value of one count, where the values are counts.
    pub(super) gain: Option<f64>,
    /// Standard deviation of a value without light.
    pub(super) read_noise: f64,
    /// Weights of the values.
    pub(super) weights: Weights,
}

impl ValueNoise {
    /// Noise of a stack with these options, whose values are means of several frames or sums.
    pub(super) fn of(options: &RetrieveOptions, factors: NoiseFactors) -> Self {
        Self {
            saturation: options.saturation.map_or(f64::INFINITY, f64::from),
            gain: options.gain.map(|gain| factors.gain(gain)),
            read_noise: factors.read_noise(options.read_noise),
            weights: options.weights,
        }
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
