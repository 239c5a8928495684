//! Normal equations of the doses and mask offsets of the frames of a view.
//!
//! The value of a pixel at mask offset f in a frame of dose d and displacement j is d (C(f + j) + r), with
//! the curve C of the pixel and the residual r of the flat; f and j have the axes of the steps. In empty beam C is the
//! curve of the flat. In the other pixels C has unknowns of its own, which are eliminated: such pixels contribute what
//! their curves cannot follow.

use super::pixels::{Pixel, PixelSet};
use crate::retrieve::diagnosis::FittedCurve;
use crate::retrieve::equations::{Equations, Unknowns as OfCurve};
use rayon::prelude::*;

/// Least expected value, as a share of the amplitude, for the variance of a value.
const LEAST: f64 = 0.01;
/// Systematic difference of fitted curves from the curves of the masks, as a share of the amplitude: it is
/// common to all pixels, and limits what pixels of the sample contribute however many there are.
const SYSTEMATIC: f64 = 1e-3;
/// Fewest pixels of a group of empty beam, and most groups.
const GROUP: usize = 16;
const GROUPS: usize = 16;
/// Sum of squares, in medians, above which a pixel is an outlier.
const OUTLIER: f64 = 10.0;

/// Which numbers of a frame are unknown; others are common to all frames.
#[derive(Debug, Clone, Copy)]
pub(super) struct Unknowns {
    pub(super) frames: usize,
    pub(super) dose: bool,
    pub(super) steps: bool,
    /// Axes of the steps: 1 or 2.
    pub(super) axes: usize,
}

impl Unknowns {
    /// Number of unknown doses.
    pub(super) const fn doses(self) -> usize {
        if self.dose { self.frames } else { 1 }
    }

    /// Number of unknown displacements along an axis.
    pub(super) const fn shifts(self) -> usize {
        if self.steps { self.frames } else { 1 }
    }

    pub(super) const fn count(self) -> usize {
        self.doses() + self.axes * self.shifts()
    }

    /// Index of the displacement of a frame along an axis.
    pub(super) const fn shift(self, frame: usize, axis: usize) -> usize {
        self.doses() + axis * self.shifts() + if self.steps { frame } else { 0 }
    }

    /// Index of the dose of a frame.
    pub(super) const fn dose(self, frame: usize) -> usize {
        if self.dose { frame } else { 0 }
    }

    /// Indices of the dose and of the displacements of a frame.
    pub(super) fn of(self, frame: usize) -> impl Iterator<Item = usize> + Clone {
        let shifts = (0..self.axes).map(move |axis| self.shift(frame, axis));
        std::iter::once(self.dose(frame)).chain(shifts)
    }

    /// Mask offsets of displaced frames, m. `offsets`: those that were set; `widths`: of the curve, the unit of `at`, m.
    pub(super) fn displaced(
        self,
        at: &[f64],
        offsets: &[[f64; 2]],
        widths: [f64; 2],
    ) -> Vec<[f64; 2]> {
        let displaced = |(frame, offset): (usize, &[f64; 2])| {
            [0, 1].map(|axis| match axis < self.axes {
                true => libm::fma(at[self.shift(frame, axis)], widths[axis], offset[axis]),
                false => offset[axis],
            })
        };
        offsets.iter().enumerate().map(displaced).collect()
    }
}

/// Equations of the changes of the unknowns: logarithms of doses, and displacements in widths of the curve.
pub(super) struct System {
    pub(super) matrix: Vec<Vec<f64>>,
    pub(super) right: Vec<f64>,
    /// Squares of the residuals over their variances.
    pub(super) squares: f64,
    /// Mean square of the residuals of empty beam over their variances by the assumed noise.
    pub(super) noise: f64,
}

/// Residuals of a pixel with their slopes by dose and displacements along x and z.
struct Row {
    residual: Vec<f64>,
    slopes: Vec<[f64; 3]>,
    variance: Vec<f64>,
    /// Slopes by the unknowns of the pixel's own curve.
    own: Vec<OfCurve>,
    /// Equations of these unknowns, without values.
    equations: Equations,
}

impl Row {
    /// Squares over the variances.
    fn squares(&self) -> f64 {
        self.residual.iter().zip(&self.variance).map(|(r, v)| r * r / v).sum()
    }

    /// Largest expected value.
    fn most(&self) -> f64 {
        self.slopes.iter().map(|[value, ..]| value.abs()).fold(0.0, f64::max)
    }
}

impl PixelSet<'_> {
    /// The equations at these unknowns. `noise`: variance of a value over that by the assumed noise.
    pub(super) fn system(&self, of: Unknowns, at: &[f64], noise: f64) -> Option<System> {
        let empty: Vec<Row> =
            self.empty.par_iter().map(|pixel| self.empty_row(pixel, of, at)).collect();
        let inner: Vec<Row> =
            self.inner.par_iter().filter_map(|pixel| self.inner_row(pixel, of, at)).collect();
        let n = of.count();
        let mut system =
            System { matrix: vec![vec![0.0; n]; n], right: vec![0.0; n], squares: 0.0, noise: 0.0 };
        let mut count = 0;
        for row in near(&empty) {
            let of_row = row.squares();
            system.noise += of_row;
            system.squares += of_row / noise;
            count += row.residual.len();
        }
        let empty = near(&empty);
        for k in 0..of.frames {
            system.add_empty(&empty, k, of, noise);
        }
        system.noise /= count.saturating_sub(n) as f64;
        let inner = near(&inner);
        let systematic = inner.len() as f64 * SYSTEMATIC.powi(2);
        for row in inner {
            system.add_inner(row, of, noise, systematic);
        }
        system.noise.is_finite().then_some(system)
    }

    fn empty_row(&self, pixel: &Pixel, of: Unknowns, at: &[f64]) -> Row {
        let least = LEAST * pixel.curve.amplitude;
        self.row(pixel, &pixel.curve, of, at, |k, dose, value| {
            dose * dose * self.variance((value + pixel.residual[k]).max(least))
        })
    }

    fn inner_row(&self, pixel: &Pixel, of: Unknowns, at: &[f64]) -> Option<Row> {
        let curve = self.fitted(pixel, of, at)?;
        let (least, ratio) = (LEAST * curve.amplitude, curve.amplitude / pixel.curve.amplitude);
        Some(self.row(pixel, &curve, of, at, |_, _, value| {
            ratio * ratio * self.variance((value / ratio).max(least))
        }))
    }

    /// The row of a pixel whose sample has this curve. `of_flat`: variance by the noise of the flat, for a frame, its dose
    /// and the value of the curve.
    fn row(
        &self,
        pixel: &Pixel,
        curve: &FittedCurve,
        of: Unknowns,
        at: &[f64],
        of_flat: impl Fn(usize, f64, f64) -> f64,
    ) -> Row {
        let (residual, slopes, variance) = (Vec::new(), Vec::new(), Vec::new());
        let equations = curve.equations();
        let mut row = Row { residual, slopes, variance, own: Vec::new(), equations };
        let (least, ratio) = (LEAST * curve.amplitude, curve.amplitude / pixel.curve.amplitude);
        let places = of.displaced(at, self.offsets, self.widths);
        let [width_x, width_z] = self.widths;
        for (k, [value, own @ ..]) in curve.at(&places).into_iter().enumerate() {
            let dose = at[of.dose(k)].exp();
            let expected = dose * libm::fma(ratio, pixel.residual[k], value);
            row.residual.push(pixel.values[k] - expected);
            row.slopes.push([expected, -dose * own[1] * width_x, -dose * own[2] * width_z]);
            row.variance.push(self.variance(expected.max(least)) + of_flat(k, dose, value));
            row.own.push(own.map(|slope| dose * slope));
        }
        row
    }
}

/// Rows that are no outliers.
fn near(rows: &[Row]) -> Vec<&Row> {
    let squares: Vec<f64> = rows.iter().map(Row::squares).collect();
    let most = crate::retrieve::misfit::median(squares.clone()).map_or(0.0, |m| OUTLIER * m);
    rows.iter().zip(squares).filter(|(_, squares)| *squares <= most).map(|(row, _)| row).collect()
}

impl System {
    /// Adds a frame of the pixels of empty beam, in groups side by side: the mean of all has the noise alone,
    /// the groups beside one another have the systematic error, too. Groups are large enough for the noise of
    /// the flat, which slopes and residuals have in common.
    fn add_empty(&mut self, rows: &[&Row], k: usize, of: Unknowns, noise: f64) {
        let mut add = |weight: f64, slopes: [f64; 3], residual: f64| {
            for (i, slope) in of.of(k).zip(slopes) {
                self.right[i] += weight * slope * residual;
                for (j, other) in of.of(k).zip(slopes) {
                    self.matrix[i][j] += weight * slope * other;
                }
            }
        };
        let groups = (rows.len() / GROUP).clamp(1, GROUPS);
        let systematic = groups as f64 * SYSTEMATIC.powi(2);
        let (mut sums, mut all, mut of_differences) = ([0.0; 4], 0.0, 0.0);
        for group in rows.chunks(rows.len().div_ceil(groups).max(1)) {
            let (mut of_group, mut own, mut most) = ([0.0; 4], 0.0, 0.0_f64);
            for row in group {
                let weight = 1.0 / (noise * row.variance[k]);
                let [dose, x, z] = row.slopes[k];
                for (sum, value) in of_group.iter_mut().zip([dose, x, z, row.residual[k]]) {
                    *sum += weight * value;
                }
                own += weight;
                most = most.max(row.most());
            }
            let weight = 1.0 / (1.0 / own + systematic * most * most);
            let [dose, x, z, residual] = of_group.map(|sum| sum / own);
            add(weight, [dose, x, z], residual);
            sums.iter_mut().zip(of_group).for_each(|(sum, value)| *sum += value);
            all += own;
            of_differences += weight;
        }
        let [dose, x, z, residual] = sums.map(|sum| sum / all);
        if all > 0.0 {
            add(all - of_differences, [dose, x, z], residual);
        }
    }

    /// Adds a pixel without the part that its own curve follows. `systematic`: variance of what all pixels
    /// have in common, over the squared largest value.
    fn add_inner(&mut self, row: &Row, of: Unknowns, noise: f64, systematic: f64) {
        let more = systematic * row.most().powi(2);
        let weights: Vec<f64> =
            row.variance.iter().map(|variance| 1.0 / libm::fma(noise, *variance, more)).collect();
        let Some(influence) = row.equations.influence(&row.own, &weights) else { return };
        // Weights less the part that the own curve follows.
        for k in 0..of.frames {
            for l in 0..of.frames {
                let own = if k == l { weights[k] } else { 0.0 };
                let weight = libm::fma(-weights[k] * influence[k][l], weights[l], own);
                self.squares += weight * row.residual[k] * row.residual[l];
                for (i, slope) in of.of(k).zip(row.slopes[k]) {
                    self.right[i] += weight * slope * row.residual[l];
                    for (j, other) in of.of(l).zip(row.slopes[l]) {
                        self.matrix[i][j] += weight * slope * other;
                    }
                }
            }
        }
    }
}
