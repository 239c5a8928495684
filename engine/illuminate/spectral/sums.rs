//! Light of a cell summed over a band of energies, and how far one cell can stand for it.

use super::run::Fitted;
use std::ops::Range;

/// Sums over the energies of a group, at the ends and the middle of a cell.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Sums {
    pub(super) light: [f64; 3],
    pub(super) x: [f64; 3],
    pub(super) x2: f64,
    pub(super) z: f64,
    pub(super) slope_x: f64,
    /// By mask.
    pub(super) shade: [f64; 2],
    pub(super) shade_x: [f64; 2],
}

impl Sums {
    pub(super) fn over(
        nodes: Range<usize>,
        shares: &[f64],
        passing: &[[f64; 3]],
        laws: &[Fitted],
        shades: &[Vec<f64>; 2],
    ) -> Self {
        let mut sums = Self::default();
        for node in nodes {
            let Fitted { ends: [low, high], residual } = &laws[node];
            let x = [low.x, 0.5 * (low.x + high.x), high.x];
            for i in 0..3 {
                let light = shares[node] * passing[node][i];
                sums.light[i] += light;
                sums.x[i] += light * x[i];
            }
            let light = shares[node] * passing[node][1];
            sums.x2 += light * (x[1] * x[1] + residual);
            sums.z += light * 0.5 * (low.z + high.z);
            sums.slope_x += light * 0.5 * (low.slope_x + high.slope_x);
            for (mask, shades) in shades.iter().enumerate() {
                let shade = light * shades.get(node).copied().unwrap_or(0.0);
                sums.shade[mask] += shade;
                sums.shade_x[mask] += shade * x[1];
            }
        }
        sums
    }

    /// Optical depth in the middle less the mean of that at the ends.
    pub(super) fn bend(&self) -> f64 {
        (self.light[1] / (self.light[0] * self.light[2]).sqrt()).ln().abs()
    }

    /// The same of the displacement.
    pub(super) fn drift(&self) -> f64 {
        let x = |i: usize| self.x[i] / self.light[i];
        (x(1) - 0.5 * (x(0) + x(2))).abs()
    }

    /// Variance of the displacement over the energies, in the middle.
    pub(super) fn spread(&self) -> f64 {
        let mean = self.x[1] / self.light[1];
        (self.x2 / self.light[1] - mean * mean).max(0.0)
    }

    /// Covariance over the energies of what bars shade and the displacement, in the middle.
    pub(super) fn lean(&self, mask: usize) -> f64 {
        let [light, x] = [self.light[1], self.x[1]];
        self.shade_x[mask] / light - self.shade[mask] / light * (x / light)
    }

    /// Adds the sums of a cell of this width, by its middle.
    pub(super) fn add(&mut self, other: &Self, width: f64) {
        let scaled = |sum: &mut f64, other: f64| *sum += width * other;
        scaled(&mut self.light[1], other.light[1]);
        scaled(&mut self.x[1], other.x[1]);
        scaled(&mut self.x2, other.x2);
        scaled(&mut self.z, other.z);
        scaled(&mut self.slope_x, other.slope_x);
        for mask in 0..2 {
            scaled(&mut self.shade[mask], other.shade[mask]);
            scaled(&mut self.shade_x[mask], other.shade_x[mask]);
        }
    }
}
