//! Values that are fitted, and their noise.

use super::super::fitter::Weights;
use super::super::flags;
use super::shape::{Points, UNKNOWNS};

/// Noise and limits that all curves of flat or sample share.
#[derive(Debug, Clone, Copy)]
pub(super) struct PlanarNoise {
    /// Values from here on are left out.
    pub(super) saturation: f64,
    /// Value of one count, where the values are counts.
    pub(super) gain: Option<f64>,
    /// Standard deviation of a value without light.
    pub(super) read_noise: f64,
    /// Weights of the values.
    pub(super) weights: Weights,
}

impl PlanarNoise {
    /// Variance of a value of this mean.
    pub(super) fn variance(&self, mean: f64) -> f64 {
        let gain = self.gain.unwrap_or(f64::NAN);
        gain * mean.max(0.0) + self.read_noise * self.read_noise
    }

    /// Variance of a value by a fit: of one count at least.
    pub(super) fn variance_of_fit(&self, mean: f64) -> f64 {
        let (gain, least) = (self.gain.unwrap_or(1.0), self.gain.unwrap_or(0.0));
        gain * mean.max(least) + self.read_noise * self.read_noise
    }

    /// Weight of a value by a fit whose height above its background is `peak`: one over its variance, and
    /// over the variance of a thousandth of the peak at most.
    pub(super) fn weight(&self, mean: f64, peak: f64) -> f64 {
        if self.weights == Weights::None {
            return 1.0;
        }
        let least = 1e-3 * self.gain.unwrap_or(1.0) * peak.abs();
        1.0 / self.variance_of_fit(mean).max(least).max(f64::MIN_POSITIVE)
    }
}

/// Values of a curve that count.
#[derive(Debug, Clone)]
pub(super) struct PlanarValues {
    pub(super) points: Points,
    pub(super) values: Vec<f64>,
    pub(super) flags: u32,
    /// Least and greatest value.
    pub(super) range: [f64; 2],
}

impl PlanarValues {
    /// Sorts out values at places, m; flags say why there is no answer. `needed`: fewest values.
    pub(super) fn of(
        places: &[[f64; 2]],
        values: impl Iterator<Item = f32>,
        saturation: f64,
        needed: usize,
    ) -> Self {
        let (mut flags, mut range) = (0, [f64::INFINITY, f64::NEG_INFINITY]);
        let (mut kept, mut kept_places) = (Vec::new(), Vec::new());
        for (place, value) in places.iter().zip(values) {
            let value = f64::from(value);
            if !value.is_finite() {
                flags |= flags::NOT_FINITE;
            } else if value >= saturation {
                flags |= flags::SATURATED;
            } else {
                kept.push(value);
                kept_places.push(*place);
                range = [range[0].min(value), range[1].max(value)];
            }
        }
        if kept.len() < needed {
            flags |= flags::FEW;
        } else if range[1] <= range[0] {
            flags |= flags::DEAD;
        }
        Self { points: Points::of(&kept_places), values: kept, flags, range }
    }

    /// Fewest values of a fit of all unknowns.
    pub(super) const NEEDED: usize = UNKNOWNS + 1;

    /// Sum above the least value, its centroid, and second moments about it, of the points.
    pub(super) fn about_least(&self) -> (f64, [f64; 2], [f64; 3]) {
        let mut sums = [0.0; 6];
        let origin = self.points.place(0);
        for (point, value) in self.values.iter().enumerate() {
            let above = value - self.range[0];
            let [x, z] = self.points.place(point);
            let [x, z] = [x - origin[0], z - origin[1]];
            let all = [1.0, x, z, x * x, z * z, x * z];
            sums.iter_mut().zip(all).for_each(|(sum, part)| *sum += above * part);
        }
        let [sum, x, z, xx, zz, xz] = sums;
        let [x, z] = [x / sum, z / sum];
        let second = [xx / sum - x * x, zz / sum - z * z, xz / sum - x * z];
        (sum, [x + origin[0], z + origin[1]], second)
    }
}
