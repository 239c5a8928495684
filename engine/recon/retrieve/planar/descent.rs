//! Levenberg-Marquardt for the unknowns of a fit in two directions.

use super::super::background::BackgroundTerm;
use super::super::damping::{Damping, SETTLED, WEIGHED, WEIGHINGS};
use super::equations::Equations;
use super::fit::Correlated;
use super::scan::PlanarValues;
use super::shape::{PlanarShape, Tables, UNKNOWNS, Valued};

/// Steps of a descent, at most.
const STEPS: usize = 100;

/// Limits of the unknowns.
#[derive(Debug, Clone, Copy)]
pub(super) struct Held {
    /// Unknowns that keep their value.
    pub(super) unknowns: [bool; UNKNOWNS],
    /// Least variances of the blur, xx and zz.
    pub(super) least: [f64; 2],
    /// Background of the curve.
    pub(super) background: BackgroundTerm,
}

/// A descent to the least squares of values.
#[derive(Debug)]
pub(super) struct Descent<'a> {
    shape: &'a PlanarShape,
    values: &'a PlanarValues,
    held: Held,
    tables: Tables,
    fitted: Vec<Valued>,
    /// Second moments of the light without blur.
    own: [f64; 2],
}

impl<'a> Descent<'a> {
    pub(super) fn new(shape: &'a PlanarShape, values: &'a PlanarValues, held: Held) -> Self {
        let own = shape.own_variances();
        Self { shape, values, held, tables: Tables::default(), fitted: Vec::new(), own }
    }

    /// Values and slopes at the points.
    pub(super) fn fitted(&mut self, p: &[f64; UNKNOWNS]) -> &[Valued] {
        let mut fitted = std::mem::take(&mut self.fitted);
        self.shape.evaluate(&self.values.points, p, &mut self.tables, &mut fitted);
        self.fitted = fitted;
        &self.fitted
    }

    /// Normal equations and the weighted sum of squares.
    pub(super) fn normal(&mut self, p: &[f64; UNKNOWNS], weights: &[f64]) -> (Equations, f64) {
        let Held { unknowns: held, background, .. } = self.held;
        let values = &self.values.values;
        let (mut equations, mut squares) = (Equations::new(&held), 0.0);
        for ((fitted, value), weight) in self.fitted(p).iter().zip(values).zip(weights) {
            let [at, slopes @ ..] = fitted;
            let mut slopes = *slopes;
            if let BackgroundTerm::PerArea(share) = background {
                slopes[0] += share;
            }
            for (slope, held) in slopes.iter_mut().zip(held) {
                if held {
                    *slope = 0.0;
                }
            }
            let rest = value - at;
            squares += weight * rest * rest;
            equations.add(&slopes, *weight, rest);
        }
        equations.complete();
        (equations, squares)
    }

    /// Runs from `start`. `weigh`: weights of the values for these unknowns and fitted values; they follow the
    /// fit if `follows`. Returns unknowns, whether they settled, and the weights.
    pub(super) fn run(
        &mut self,
        start: [f64; UNKNOWNS],
        weigh: impl Fn(&[f64; UNKNOWNS], &[Valued]) -> Vec<f64>,
        follows: bool,
    ) -> ([f64; UNKNOWNS], bool, Vec<f64>) {
        let mut weights = vec![1.0; self.values.values.len()];
        let (mut p, mut settled) = self.descend(start, &weights);
        for _ in 0..if follows { WEIGHINGS } else { 0 } {
            weights = weigh(&p, self.fitted(&p));
            let (next, next_settled) = self.descend(p, &weights);
            let moved = self.length(&p, &next);
            (p, settled) = (next, next_settled && moved < 100.0 * WEIGHED);
            if moved < WEIGHED {
                break;
            }
        }
        (p, settled, weights)
    }

    /// Largest difference of two sets of unknowns, in their units.
    fn length(&self, p: &[f64; UNKNOWNS], q: &[f64; UNKNOWNS]) -> f64 {
        let [half_x, half_z] = self.values.points.half();
        let [xx, zz] = [p[3] + self.own[0], p[4] + self.own[1]];
        let range = self.values.range[1] - self.values.range[0];
        let units = [p[0].abs(), half_x, half_z, xx, zz, (xx * zz).sqrt(), range];
        let parts = p.iter().zip(q).zip(units).map(|((p, q), unit)| (p - q).abs() / unit);
        parts.fold(0.0, f64::max)
    }

    /// Unknowns within their limits.
    fn limited(&self, p: &[f64; UNKNOWNS], step: &[f64; UNKNOWNS]) -> [f64; UNKNOWNS] {
        let mut next: [f64; UNKNOWNS] = std::array::from_fn(|k| p[k] + step[k]);
        for axis in [0, 1] {
            let at = 3 + axis;
            if !self.held.unknowns[at] {
                next[at] = next[at].clamp(0.1 * p[at], 10.0 * p[at]).max(self.held.least[axis]);
            }
        }
        next[5] = next[5].clamp_to(next[3] * next[4]);
        next[6] = self.held.background.of_area(next[0]).unwrap_or(next[6]);
        next
    }

    /// Levenberg-Marquardt with fixed weights.
    fn descend(&mut self, mut p: [f64; UNKNOWNS], weights: &[f64]) -> ([f64; UNKNOWNS], bool) {
        let (mut equations, mut squares) = self.normal(&p, weights);
        let (mut damping, mut settled) = (Damping::new(), false);
        for _ in 0..STEPS {
            let Some(step) = equations.solve(damping.value()) else {
                if damping.is_hopeless() {
                    break;
                }
                damping.lift();
                continue;
            };
            let next = self.limited(&p, &step);
            let (next_equations, next_squares) = self.normal(&next, weights);
            let length = self.length(&p, &next);
            if next_squares <= squares {
                let part = |k: usize| [step[k], equations.matrix[k][k], equations.right[k]];
                damping.ease(squares - next_squares, (0..UNKNOWNS).map(part));
                (p, equations, squares) = (next, next_equations, next_squares);
                settled = length < SETTLED;
            } else {
                damping.tighten();
                // No better place near: at the bottom, to the last digits.
                settled = length < 10.0 * SETTLED;
            }
            if settled || damping.is_hopeless() {
                break;
            }
        }
        (p, settled)
    }
}
