//! Dose and offsets that change from step to step, from the residuals that all pixels share.
//!
//! A dose 1 + e of step k adds e m to every fitted value m there, and an offset that is off by j adds
//! j dm/df; the fit follows a part of both. The residuals of the flat are subtracted pixel by pixel:
//! they hold what the method's curve leaves of the curve of the masks. The rest is solved by least
//! squares for one number per step, once as doses and once as offsets, with all values of a pixel of one
//! weight: in the tails of a curve fits of few counts are biased. The scatter about the solution gives
//! the noise.

use super::chi_square::reduced;
use super::leverage::Leverage;
use crate::retrieve::misfit::median;

/// Share of the mean diagonal that is added to the equations: doses of all steps together, and drifts,
/// leave no residual.
const DAMPING: f64 = 1e-3;
/// Sum of squares, in medians, from which on a pixel is an outlier.
const OUTLIER: f64 = 10.0;
/// Standard deviations of chi squared above its mean from which on residuals are no noise.
const SIGNIFICANT: f64 = 6.0;
/// Least changes that count.
#[derive(Debug, Clone, Copy)]
pub(super) struct Steady {
    /// Least change of the dose, part of it.
    dose: f64,
    /// Least offset, widths of the curve.
    offset: f64,
}

/// Least changes in pixels with a sample, where a Gaussian leaves other residuals than in the flat, up to this share of the
/// height.
pub(super) const STEADY: Steady = Steady { dose: 1e-2, offset: 1e-2 };
/// The same in pixels whose curve lies as in the flat, where a Gaussian leaves nearly the same residuals: a
/// sound scan of masks with a fringe has up to 2e-3, and one of 40 with noise has offsets above 3e-3.
pub(super) const STEADY_IN_AIR: Steady = Steady { dose: 3e-3, offset: 5e-3 };
/// Bias of fits of counts, in relative variances of the highest value, at most.
const BIAS: f64 = 2.0;
/// Fewest pixels that decide.
const FEWEST: usize = 16;

/// A pixel's residuals over the amplitude, sample less flat, and the changes of its values.
pub(super) struct PixelSteps {
    residuals: Vec<f64>,
    /// Weights of residuals that the fit does not follow.
    remainder: Vec<Vec<f64>>,
    /// Change of each value by its dose, and by its offset along x and z in widths of the curve; slits have no z.
    changes: Vec<Vec<f64>>,
    /// Variance of the highest value over the square of the amplitude, by the assumed gain.
    variance: f64,
    /// Mean variance of all values over it.
    share: f64,
}

/// Changes from step to step, as standard deviations: either explains the residuals.
#[derive(Debug, Clone, Copy)]
pub(super) struct Unsteady {
    /// Part of the dose.
    pub(super) dose: f64,
    /// Offset along x and z, in widths of the curve; 0 along an axis without steps.
    pub(super) offsets: [f64; 2],
}

/// One number per step.
struct Solution {
    changes: Vec<f64>,
    /// Squares that changes of variance 1 would explain.
    capacity: f64,
    /// Squares that it explains, and numbers that the residuals determine.
    explained: f64,
    freedom: f64,
}

impl PixelSteps {
    /// Residuals of flat and sample, each with its measured values; `widths`: of the curve along the axes of the steps, m.
    pub(super) fn of(
        [flat, sample]: [&Leverage; 2],
        [of_flat, of_sample]: [&[f64]; 2],
        [flat_height, height]: [f64; 2],
        widths: &[f64],
    ) -> Option<Self> {
        let residual = |k: usize| {
            (of_sample[k] - sample.values[k]) / height - (of_flat[k] - flat.values[k]) / flat_height
        };
        let of_step = |k: usize| {
            sample.variances[k] / (height * height)
                + flat.variances[k] / (flat_height * flat_height)
        };
        let variances: Vec<f64> = (0..of_sample.len()).map(of_step).collect();
        let variance = variances.iter().copied().fold(0.0, f64::max);
        let count = variances.len() as f64;
        let residuals: Vec<f64> = (0..of_sample.len()).map(residual).collect();
        residuals.iter().all(|value| value.is_finite()).then_some(())?;
        Some(Self {
            residuals,
            remainder: sample.remainder(variance)?,
            changes: std::iter::once(sample.values.iter().map(|value| value / height).collect())
                .chain(widths.iter().enumerate().map(|(axis, width)| {
                    sample.slopes.iter().map(|slope| slope[1 + axis] * width / height).collect()
                }))
                .collect(),
            variance,
            share: variances.iter().sum::<f64>() / count / variance,
        })
    }

    /// Weighted squares of the residuals less these changes of their steps.
    fn squares(&self, [of, changes]: [&[f64]; 2]) -> f64 {
        let left: Vec<f64> = self
            .residuals
            .iter()
            .zip(of.iter().zip(changes))
            .map(|(r, (c, e))| r - c * e)
            .collect();
        let rows = self.remainder.iter().zip(&left);
        rows.map(|(row, r)| r * times(row, &left)).sum()
    }
}

/// Changes of dose or offsets from step to step; `None` where there are none beyond noise and `least`. `freedom`: steps
/// less unknowns of a fit.
pub(super) fn unsteady(pixels: &[&PixelSteps], least: Steady, freedom: usize) -> Option<Unsteady> {
    let steps = pixels.first()?.residuals.len();
    let none = vec![0.0; steps];
    let squares: Vec<f64> = pixels.iter().map(|p| p.squares([&none, &none])).collect();
    let most = OUTLIER * median(squares.clone())?;
    let near = pixels.iter().zip(&squares).filter(|(_, squares)| **squares <= most);
    let near: Vec<&PixelSteps> = near.map(|(pixel, _)| *pixel).collect();
    if near.len() < FEWEST || freedom == 0 {
        return None;
    }
    let kinds = 0..near.first()?.changes.len();
    let solutions: Vec<Solution> =
        kinds.clone().map(|kind| solution(&near, kind)).collect::<Option<_>>()?;
    let explained = |kind: &usize| solutions[*kind].explained;
    let better = kinds.max_by(|a, b| explained(a).total_cmp(&explained(b)))?;
    let left = near.iter().map(|pixel| {
        let squares = pixel.squares([&pixel.changes[better], &solutions[better].changes]);
        [squares, freedom as f64]
    });
    let noise = reduced(left, freedom)?;
    let [dose, x, z] = [0, 1, 2].map(|kind| solutions.get(kind).map_or(0.0, |it| it.size(noise)));
    let middle = |of: fn(&PixelSteps) -> f64| median(near.iter().map(|pixel| of(pixel)).collect());
    let variance = noise * middle(|pixel| pixel.variance)? / middle(|pixel| pixel.share)?;
    let beyond = |size: f64, least: f64| size > least.max(BIAS * variance);
    let is_unsteady =
        beyond(dose, least.dose) || beyond(x, least.offset) || beyond(z, least.offset);
    is_unsteady.then_some(Unsteady { dose, offsets: [x, z] })
}

/// The numbers of all steps that explain the residuals, as changes of this kind.
fn solution(pixels: &[&PixelSteps], kind: usize) -> Option<Solution> {
    let n = pixels.first()?.residuals.len();
    let mut matrix = vec![vec![0.0; n]; n];
    let mut right = vec![0.0; n];
    for pixel in pixels {
        let changes = &pixel.changes[kind];
        for (i, row) in pixel.remainder.iter().enumerate() {
            right[i] += changes[i] * times(row, &pixel.residuals);
            for (j, weight) in row.iter().enumerate() {
                matrix[i][j] += changes[i] * weight * changes[j];
            }
        }
    }
    let damping = DAMPING * (0..n).map(|i| matrix[i][i]).sum::<f64>() / n as f64;
    let mut damped = matrix.clone();
    (0..n).for_each(|i| damped[i][i] += damping);
    let inverse = inverted(damped)?;
    let changes: Vec<f64> = inverse.iter().map(|row| times(row, &right)).collect();
    let product = |i: usize, j: usize| (0..n).map(|k| inverse[i][k] * matrix[k][j]).sum::<f64>();
    let capacity = (0..n).map(|i| matrix[i][i]).sum();
    let freedom = (0..n).map(|i| product(i, i)).sum();
    Some(Solution { explained: times(&changes, &right), changes, capacity, freedom })
}

impl Solution {
    /// Standard deviation of the changes that explain as much beyond the noise; 0 where noise does.
    fn size(&self, noise: f64) -> f64 {
        let Self { explained, freedom, capacity, .. } = self;
        let of_noise = noise * freedom;
        match *explained < noise * libm::fma(SIGNIFICANT, (2.0 * freedom).sqrt(), *freedom) {
            true => 0.0,
            false => ((explained - of_noise).max(0.0) / capacity).sqrt(),
        }
    }
}

fn times(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Inverse of a symmetric positive matrix; `None` where it is singular.
pub(in crate::retrieve) fn inverted(mut matrix: Vec<Vec<f64>>) -> Option<Vec<Vec<f64>>> {
    let n = matrix.len();
    let mut inverse: Vec<Vec<f64>> =
        (0..n).map(|i| (0..n).map(|j| f64::from(u8::from(i == j))).collect()).collect();
    for i in 0..n {
        let pivot = matrix[i][i];
        if pivot.is_nan() || pivot <= 0.0 {
            return None;
        }
        for row in [&mut matrix[i], &mut inverse[i]] {
            row.iter_mut().for_each(|value| *value /= pivot);
        }
        let [above, above_inverse] = [matrix[i].clone(), inverse[i].clone()];
        for k in (0..n).filter(|k| *k != i) {
            let factor = matrix[k][i];
            for j in 0..n {
                matrix[k][j] -= factor * above[j];
                inverse[k][j] -= factor * above_inverse[j];
            }
        }
    }
    Some(inverse)
}
