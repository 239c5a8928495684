//! Light of a cell summed over a band of energies, and how far one cell can stand for it.

use super::node_result::NodeResult;
use std::ops::Range;

/// Light of a cell at one energy, by the weight of which it is summed: all that sums are made of.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Terms([f64; 14]);

// At the low end, the middle and the high end: light, and light times displacement. In the
// middle: times its square, displacement along z and its square, slope; for either mask times narrowing, and times
// narrowing and displacement.
const LIGHT: usize = 0;
const X: usize = 3;
const X2: usize = 6;
const Z: usize = 7;
const SLOPE_X: usize = 8;
const NARROWING: usize = 9;
const NARROWING_X: usize = 11;
const Z2: usize = 13;

impl Terms {
    /// Terms of a cell with these results at its ends, which lets these shares through there; `spread`:
    /// variance of its displacement about a straight line.
    pub(super) fn new(
        [low, high]: &[NodeResult; 2],
        light: [f64; 2],
        spread: f64,
        narrowings: [f64; 2],
    ) -> Self {
        let middle = (light[0] * light[1]).sqrt();
        let x = 0.5 * (low.x + high.x);
        let light_x = middle * x;
        let z = 0.5 * (low.z + high.z);
        Self([
            light[0],
            middle,
            light[1],
            light[0] * low.x,
            light_x,
            light[1] * high.x,
            light_x * x + middle * spread,
            middle * z,
            middle * 0.5 * (low.slope_x + high.slope_x),
            middle * narrowings[0],
            middle * narrowings[1],
            light_x * narrowings[0],
            light_x * narrowings[1],
            middle * z * z,
        ])
    }

    /// Light in the middle.
    pub(super) const fn light(&self) -> f64 {
        self.0[LIGHT + 1]
    }
}

/// Sums over the energies of a group, at the ends and the middle of a cell.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct BandSums([f64; 14]);

impl BandSums {
    pub(super) fn over(nodes: Range<usize>, shares: &[f64], terms: &[Terms]) -> Self {
        let mut sums = Self::default();
        for (share, Terms(terms)) in shares[nodes.clone()].iter().zip(&terms[nodes]) {
            for (sum, term) in sums.0.iter_mut().zip(terms) {
                *sum += share * term;
            }
        }
        sums
    }

    /// At the low end, the middle and the high end.
    pub(super) fn light(&self) -> [f64; 3] {
        std::array::from_fn(|i| self.0[LIGHT + i])
    }

    /// Mean displacements there.
    pub(super) fn x(&self) -> [f64; 3] {
        std::array::from_fn(|i| self.0[X + i] / self.0[LIGHT + i])
    }

    /// Mean of one of the other sums.
    fn mean(&self, of: usize) -> f64 {
        self.0[of] / self.0[LIGHT + 1]
    }

    pub(super) fn z(&self) -> f64 {
        self.mean(Z)
    }

    pub(super) fn slope_x(&self) -> f64 {
        self.mean(SLOPE_X)
    }

    pub(super) fn narrowing(&self, mask: usize) -> f64 {
        self.mean(NARROWING + mask)
    }

    /// Optical depth in the middle less the mean of that at the ends, to first order.
    pub(super) fn depth_curvature(&self) -> f64 {
        let [low, middle, high] = self.light();
        (middle / (low * high).sqrt() - 1.0).abs()
    }

    /// The same of the displacement.
    pub(super) fn drift(&self) -> f64 {
        let [low, middle, high] = self.x();
        (middle - 0.5 * (low + high)).abs()
    }

    /// Variance of the displacement over the energies, in the middle.
    pub(super) fn displacement_variance(&self) -> f64 {
        let mean = self.mean(X + 1);
        (self.mean(X2) - mean * mean).max(0.0)
    }

    /// Variance of the displacement along z over the energies, in the middle.
    pub(super) fn variance_z(&self) -> f64 {
        (self.mean(Z2) - self.z() * self.z()).max(0.0)
    }

    /// Covariance over the energies of what bars narrowing and the displacement, in the middle.
    pub(super) fn covariance(&self, mask: usize) -> f64 {
        self.mean(NARROWING_X + mask) - self.narrowing(mask) * self.mean(X + 1)
    }

    /// Adds the sums of a cell of this width, by its middle.
    pub(super) fn add(&mut self, other: &Self, width: f64) {
        for (sum, other) in self.0.iter_mut().zip(&other.0) {
            *sum += width * other;
        }
    }

    /// Sums per metre of consecutive cells, as of one cell with these straight lines of light and
    /// displacement: the spread of the displacement about its line stays.
    pub(super) fn joined(&self, width: f64, light: [f64; 2], x: [f64; 2]) -> Self {
        let mut one = Self::default();
        one.add(self, 1.0 / width);
        let mean = one.mean(X + 1);
        let explained = (x[1] - x[0]).powi(2) / 12.0;
        let spread = (one.displacement_variance() - explained).max(0.0);
        let middle = one.0[LIGHT + 1];
        one.0[X2] = middle * (mean * mean + spread);
        // Light of a cell falls off exponentially between its ends: they are chosen so that the
        // cell has the light of its parts, which lands where theirs lands on average.
        let within =
            |[low, high]: [f64; 2]| low > 0.0 && high > 0.0 && low.max(high) <= 2.0 * low.min(high);
        let [low, high] = if within(light) {
            let fall = (light[1] / light[0]).ln();
            let mean = (light[0] * light[1]).sqrt() * (1.0 + fall * fall / 24.0);
            light.map(|end| end * middle / mean)
        } else {
            [middle; 2]
        };
        let leaning = (x[1] - x[0]) * (high - low) / (12.0 * middle);
        let off = mean - 0.5 * (x[0] + x[1]) - leaning;
        (one.0[LIGHT], one.0[LIGHT + 2]) = (low, high);
        (one.0[X], one.0[X + 2]) = (low * (x[0] + off), high * (x[1] + off));
        one
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_joined_cell_has_the_light_of_its_parts() {
        let result = |x: f64| NodeResult { x, ..NodeResult::default() };
        let cell = |light: [f64; 2], x: [f64; 2]| {
            let terms = [Terms::new(&x.map(result), light, 0.0, [0.0; 2])];
            BandSums::over(0..1, &[1.0], &terms)
        };
        let mut parts = BandSums::default();
        parts.add(&cell([1.0, 0.97], [0.0, 1.0]), 1.0);
        parts.add(&cell([0.97, 0.86], [1.0, 2.0]), 1.0);
        for (light, even) in [([1.01, 0.86], false), ([1.4, 0.4], true)] {
            let joined = parts.joined(2.0, light, [0.0, 2.0]);
            let [low, middle, high] = joined.light();
            // As the kernel integrates between the ends.
            let fall = (high / low).ln();
            let integral = (low * high).sqrt() * (1.0 + fall * fall / 24.0);
            assert!((integral / middle - 1.0).abs() < 1e-12, "{integral} {middle}");
            assert_eq!((low - high).abs() < 1e-12, even, "{low} {high}");
            let [from, mean, to] = joined.x();
            let lands = 0.5 * (from + to) + (to - from) * (high - low) / (12.0 * middle);
            assert!((lands - mean).abs() < 1e-12, "{lands} {mean}");
            assert!(joined.displacement_variance() < 1e-3, "{}", joined.displacement_variance());
        }
    }
}
