//! Values that are fitted.

use super::super::value_noise::ValueNoise;
use super::shape::{Points, UNKNOWNS};

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
        noise: &ValueNoise,
        needed: usize,
    ) -> Self {
        let (mut kept, mut kept_places) = (Vec::new(), Vec::new());
        let (flags, range) = noise.sort_out(values.take(places.len()), needed, |index, value| {
            kept.push(value);
            kept_places.push(places[index]);
        });
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
