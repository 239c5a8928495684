//! What edges of bars that all energies share leave out of the light, by the angle of a column.
//!
//! A group sees one soft edge for each mask, with the mean place and the common variance of its energies.
//! Two effects are neglected. Energies whose edges lie farther in at one mask do so at the other, too: a
//! covariance as large as the variances themselves. And an edge as one Gaussian has no third and fourth
//! moment. Both grow with the square of the angle and more; where they are too large, light goes energy
//! by energy, with the layers of each.

use beamlet_interface::{EDGE_FLATNESS, EDGE_SKEWNESS};
use beamlet_model::optics::MaskShape;

/// Largest neglected light of a group of energies, of open beam. Estimates are within a factor of two of
/// measured errors.
const TOLERANCE: f64 = 1e-5;

/// Spread of the edges of both masks over the energies; lengths on the analyser.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct SharedEdges {
    /// Standard deviation of the place of an edge of each mask, m per unit of dx/dy.
    deviation: [f64; 2],
    /// Standard deviation of a soft edge of each mask, m per unit of dx/dy.
    edge_variance: [f64; 2],
    /// Bars of a mask have several layers: edges of an aperture differ from one another.
    layered: bool,
    /// Greatest dx/dy of the walls of each mask.
    walls: [f64; 2],
    /// Blur of light at edges, m.
    blur: f64,
    /// Period of the detector mask, also if absent, m.
    period: f64,
}

impl SharedEdges {
    /// Edges of masks whose lengths are in planes that the analyser magnifies by these.
    /// `weights`: light of each energy that bars stop.
    pub(super) fn of(
        masks: [Option<&[MaskShape]>; 2],
        magnifications: [f64; 2],
        weights: &[f64],
        blur: f64,
        period: f64,
    ) -> Self {
        let mut edges = Self {
            deviation: [0.0; 2],
            edge_variance: [0.0; 2],
            layered: false,
            walls: [0.0; 2],
            blur,
            period,
        };
        for (i, shapes) in masks.into_iter().enumerate() {
            let Some(shapes) = shapes else { continue };
            let (mut all, mut sums) = (f64::MIN_POSITIVE, [0.0; 3]);
            for (shape, weight) in shapes.iter().zip(weights) {
                let leak = shape.leak(1.0);
                let weight = weight * (1.0 - leak);
                // Either edge moves by half of what narrows the aperture.
                let place = 0.5 * shape.thickness * shape.narrowing(1.0, leak);
                let variance = shape.thickness * shape.thickness * shape.edge_variance();
                all += weight;
                sums[0] += weight * place;
                sums[1] += weight * place * place;
                sums[2] += weight * variance;
            }
            let [place, square, variance] = sums.map(|sum| sum / all);
            let spread = (square - place * place).max(0.0);
            edges.deviation[i] = magnifications[i] * spread.sqrt();
            edges.layered |= shapes.iter().any(|it| it.layers.len() > 1);
            edges.walls[i] = shapes.iter().map(|it| it.wall_slope.abs()).fold(0.0, f64::max);
            edges.edge_variance[i] = magnifications[i] * (spread + variance).sqrt();
        }
        edges
    }

    /// True if all energies may share edges in a column of this dx/dy.
    pub(super) fn are_close(&self, slope: f64) -> bool {
        let slopes = self.walls.map(|wall| slope.abs() + wall);
        let deviation = slopes[0] * self.deviation[0] + slopes[1] * self.deviation[1];
        // The covariance of two edges times the curvature of what passes both.
        let blur = self.blur.max(deviation).max(f64::MIN_POSITIVE);
        let together = deviation * deviation / (2.0 * (std::f64::consts::TAU).sqrt() * blur);
        let alone = [0, 1].map(|mask| {
            let width = slopes[mask] * self.edge_variance[mask];
            let variance = width * width;
            let narrow = variance / (variance + self.blur * self.blur).max(f64::MIN_POSITIVE);
            width * (EDGE_SKEWNESS * narrow + EDGE_FLATNESS * narrow * narrow)
        });
        !self.layered && together + alone[0] + alone[1] <= TOLERANCE * self.period
    }
}
