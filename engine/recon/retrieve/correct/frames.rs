//! Doses and mask offsets of the frames of a view.
//!
//! The unknowns are found by Gauss-Newton steps on the equations of `equations.rs`. Values that the pixels do
//! not determine stay near the mean of the frames: doses and displacements scatter about their means with
//! deviations that are estimated with them (empirical Bayes by expectation maximisation). Covariances
//! include this scatter, so that an undetermined value has it as its uncertainty.

use super::equations::{System, Unknowns};
use super::pixels::PixelSet;
use crate::retrieve::diagnosis::inverted;
use beamlet_core::{Cancel, Result};

/// Scatter of logarithms of doses, and of displacements along x and z in widths of the curve, to begin with.
const SCATTER: [f64; 3] = [0.2, 0.3, 0.3];
/// Least scatter.
const LEAST: [f64; 3] = [1e-5; 3];
/// Largest change of an unknown in one step.
const STEP: f64 = 0.3;
/// Changes of logarithms of doses and of displacements below which the unknowns have settled.
const SETTLED: f64 = 1e-6;
/// Least variance of a value over its own size, of values of f32.
const ROUNDING: f64 = 1e-14;
/// Factor of the equation of an unknown that keeps its value.
const HELD: f64 = 1e12;
/// Number of steps, at most.
const STEPS: usize = 40;
/// Updates of the scatter in each step.
const UPDATES: usize = 3;
/// Uncertainty of a dose, and of a displacement in widths of the curve, above which it is unknown.
const UNKNOWN: [f64; 2] = [0.02, 0.06];
/// Distance from the peak of the curve, in its widths, within which a frame may as well lie on the other
/// side of the peak.
const NEAR_PEAK: f64 = 0.7;
/// Most frames, or axes of frames, of which both sides of the peak are tried.
const SIDES: usize = 4;
/// Squares by which one side of the peak has to be better than the other.
const SURE: f64 = 9.0;
/// Relative error of the slope of the curve of the masks, which displacements are in proportion to.
const OF_SLOPE: f64 = 0.03;

/// Doses and displacements (m), each with its uncertainty.
pub(super) struct Frames {
    /// Dose of each frame.
    pub(super) dose: Vec<[f64; 2]>,
    /// Displacements along x and z; z of slits is 0.
    pub(super) shift: [Vec<[f64; 2]>; 2],
}

impl Frames {
    /// Values that are known well enough: doses, and displacements along x and z for a curve of these widths.
    pub(super) fn known(&self, widths: [f64; 2]) -> [Vec<Option<[f64; 2]>>; 3] {
        let of = |values: &[[f64; 2]], most: f64| {
            values.iter().map(|pair| (pair[1] <= most).then_some(*pair)).collect()
        };
        let [x, z] = [0, 1].map(|axis| of(&self.shift[axis], UNKNOWN[1] * widths[axis]));
        [of(&self.dose, UNKNOWN[0]), x, z]
    }
}

/// Unknowns with their covariance.
struct Solution {
    at: Vec<f64>,
    covariance: Vec<Vec<f64>>,
    /// Products of slopes over the variances, without the scatter.
    data: Vec<Vec<f64>>,
    /// Squares of residuals and of the scatter.
    objective: f64,
}

impl Solution {
    /// Deviations of the dose of a frame and of its displacements in widths by its own pixels, without the scatter of the
    /// frames, which stands for pixels that do not tell a dose from a displacement; infinite where one follows from the
    /// others, and 0 where one of them alone is unknown.
    fn by_data(&self, of: Unknowns, frame: usize) -> [f64; 3] {
        if !(of.dose && of.steps) {
            return [0.0; 3];
        }
        let own: Vec<usize> = of.of(frame).collect();
        let row = |i: &usize| own.iter().map(|j| self.data[*i][*j]).collect::<Vec<f64>>();
        let inverse = scaled_inverse(&own.iter().map(row).collect::<Vec<_>>());
        std::array::from_fn(|i| match &inverse {
            _ if i >= own.len() => 0.0,
            Some(inverse) => inverse[i][i].max(0.0).sqrt(),
            None => f64::INFINITY,
        })
    }
}

/// Solves for the frames of a view; `None` where the equations are singular.
pub(super) fn solve(set: &PixelSet<'_>, of: Unknowns, cancel: &Cancel) -> Result<Option<Frames>> {
    let mut search = Search { set, of, noise: 1.0, scatter: SCATTER, held: false };
    let Some(mut best) = search.descend(vec![0.0; of.count()], cancel)? else { return Ok(None) };
    // Both sides of a peak are compared at one noise and one scatter.
    search.held = true;
    let near = if of.steps { near_peak(&best, set, of) } else { Vec::new() };
    let mut found: Vec<Option<Solution>> = Vec::new();
    for sides in 0..1_usize << near.len() {
        let mut at = best.at.clone();
        for (bit, (of_frame, place)) in near.iter().enumerate() {
            if sides >> bit & 1 == 1 {
                at[of.shift(of_frame.frame, of_frame.axis)] -= 2.0 * place;
            }
        }
        found.push(search.descend(at, cancel)?);
    }
    let objective =
        |sides: usize| found[sides].as_ref().map_or(f64::INFINITY, |solution| solution.objective);
    let order = |a: &usize, b: &usize| objective(*a).total_cmp(&objective(*b));
    let chosen = (0..found.len()).min_by(order).unwrap_or(0);
    let mut unsure = [0, 1].map(|_| vec![0.0_f64; of.frames]);
    let side = |sides: usize, frame: FrameAxis| {
        found[sides].as_ref().map_or(0.0, |solution| place(solution, set, of, frame))
    };
    for (frame, _) in &near {
        let own = side(chosen, *frame);
        let is_other = |sides: &usize| side(*sides, *frame) * own < 0.0;
        let other = (0..found.len()).filter(is_other).min_by(order);
        if let Some(other) = other.filter(|it| objective(*it) - objective(chosen) < SURE) {
            unsure[frame.axis][frame.frame] = (side(other, *frame) - own).abs();
        }
    }
    if let Some(solution) = found.swap_remove(chosen) {
        best = solution;
    }
    Ok(Some(frames(&best, set, of, &unsure)))
}

/// An axis of a frame.
#[derive(Debug, Clone, Copy)]
struct FrameAxis {
    frame: usize,
    axis: usize,
}

/// Distance of a frame from the peak of the curve along an axis, in widths.
fn place(solution: &Solution, set: &PixelSet<'_>, of: Unknowns, at: FrameAxis) -> f64 {
    let FrameAxis { frame, axis } = at;
    let from_peak = (set.offsets[frame][axis] - set.centre[axis]) / set.widths[axis];
    solution.at[of.shift(frame, axis)] + from_peak
}

/// Axes of frames near the peak of the curve, each with its distance from there in widths, the nearest first.
fn near_peak(best: &Solution, set: &PixelSet<'_>, of: Unknowns) -> Vec<(FrameAxis, f64)> {
    let all = (0..of.frames)
        .flat_map(|frame| (0..of.axes).map(move |axis| FrameAxis { frame, axis }))
        .map(|at| (at, place(best, set, of, at)));
    let mut near: Vec<(FrameAxis, f64)> =
        all.filter(|(_, place)| place.abs() < NEAR_PEAK).collect();
    near.sort_by(|a, b| a.1.abs().total_cmp(&b.1.abs()));
    near.truncate(SIDES);
    near
}

/// Values with their uncertainties.
fn frames(best: &Solution, set: &PixelSet<'_>, of: Unknowns, unsure: &[Vec<f64>; 2]) -> Frames {
    let by_data: Vec<[f64; 3]> = (0..of.frames).map(|k| best.by_data(of, k)).collect();
    let sigma = |i: usize, by_data: f64, most: f64| match by_data > most {
        true => f64::INFINITY,
        false => best.covariance[i][i].max(0.0).sqrt(),
    };
    let dose = |k: usize| {
        let i = of.dose(k);
        let dose = best.at[i].exp();
        [dose, dose * sigma(i, by_data[k][0], UNKNOWN[0])]
    };
    let shift = |axis: usize, k: usize| {
        if axis >= of.axes {
            return [0.0; 2];
        }
        let (i, width) = (of.shift(k, axis), set.widths[axis]);
        let sigma = sigma(i, by_data[k][1 + axis], UNKNOWN[1]);
        let sigma = sigma.hypot(unsure[axis][k]).hypot(OF_SLOPE * best.at[i]);
        [width * best.at[i], width * sigma]
    };
    Frames {
        dose: (0..of.frames).map(dose).collect(),
        shift: [0, 1].map(|axis| (0..of.frames).map(|k| shift(axis, k)).collect()),
    }
}

#[derive(Clone, Copy)]
struct Search<'a> {
    set: &'a PixelSet<'a>,
    of: Unknowns,
    /// Variance of a value over that by the assumed noise.
    noise: f64,
    scatter: [f64; 3],
    /// True if noise and scatter keep their values.
    held: bool,
}

impl Search<'_> {
    /// Steps from these unknowns to the next minimum.
    fn descend(&mut self, mut at: Vec<f64>, cancel: &Cancel) -> Result<Option<Solution>> {
        for step in 0..STEPS {
            cancel.check()?;
            let Some(system) = self.set.system(self.of, &at, self.noise) else { return Ok(None) };
            let Some((changes, covariance)) = self.update(&system, &at) else { return Ok(None) };
            let largest = changes.iter().fold(0.0_f64, |most, change| most.max(change.abs()));
            let part = (STEP / largest).min(1.0);
            at.iter_mut().zip(&changes).for_each(|(at, change)| *at += part * change);
            let noise = system.noise.max(ROUNDING);
            let settled = largest < SETTLED && (noise / self.noise - 1.0).abs() < 1e-3;
            if !self.held {
                self.noise = noise;
            }
            let settled = settled || (self.held && largest < SETTLED);
            if settled || step + 1 == STEPS {
                let objective = system.squares + self.prior(&at);
                let data = system.matrix;
                return Ok(Some(Solution { at, covariance, data, objective }));
            }
        }
        Ok(None)
    }

    /// Changes of the unknowns and their covariance, with the scatter that goes with both.
    fn update(&mut self, system: &System, at: &[f64]) -> Option<(Vec<f64>, Vec<Vec<f64>>)> {
        let mut last = None;
        for _ in 0..UPDATES {
            let mut matrix = system.matrix.clone();
            let mut right = system.right.clone();
            for (start, count, scatter) in self.blocks() {
                let mean = at[start..start + count].iter().sum::<f64>() / count as f64;
                let weight = scatter.powi(-2);
                for i in 0..count {
                    right[start + i] -= weight * (at[start + i] - mean);
                    for j in 0..count {
                        let own = if i == j { 1.0 } else { 0.0 };
                        matrix[start + i][start + j] += weight * (own - 1.0 / count as f64);
                    }
                }
            }
            if !self.of.dose {
                // One dose for all frames, the dose of the flat.
                matrix[0][0] *= HELD;
            }
            let inverse = scaled_inverse(&matrix)?;
            let changes: Vec<f64> = inverse
                .iter()
                .map(|row| row.iter().zip(&right).map(|(a, b)| a * b).sum())
                .collect();
            for (kind, (start, count, _)) in self.blocks().into_iter().enumerate() {
                let value = |i: usize| at[start + i] + changes[start + i];
                let mean = (0..count).map(value).sum::<f64>() / count as f64;
                let deviations: f64 = (0..count).map(|i| (value(i) - mean).powi(2)).sum();
                let own: f64 = (0..count).map(|i| inverse[start + i][start + i]).sum();
                let common: f64 = (0..count)
                    .flat_map(|i| (0..count).map(move |j| (i, j)))
                    .map(|(i, j)| inverse[start + i][start + j])
                    .sum();
                let freedom = count.saturating_sub(1) as f64;
                if freedom > 0.0 && !self.held {
                    let variance = (deviations + own - common / count as f64) / freedom;
                    self.scatter[kind] = variance.max(0.0).sqrt().max(LEAST[kind]);
                }
            }
            last = Some((changes, inverse));
        }
        last
    }

    /// Start, count and scatter of doses and of displacements along each axis.
    fn blocks(&self) -> Vec<(usize, usize, f64)> {
        let (doses, shifts) = (self.of.doses(), self.of.shifts());
        let of_axis = |axis: usize| (doses + axis * shifts, shifts, self.scatter[1 + axis]);
        std::iter::once((0, doses, self.scatter[0])).chain((0..self.of.axes).map(of_axis)).collect()
    }

    /// Squares of deviations from the means over their scatter, with the normalisation of the scatter.
    fn prior(&self, at: &[f64]) -> f64 {
        let of_block = |(start, count, scatter): (usize, usize, f64)| {
            let mean = at[start..start + count].iter().sum::<f64>() / count as f64;
            let squares: f64 =
                at[start..start + count].iter().map(|value| (value - mean).powi(2)).sum();
            squares / (scatter * scatter) + 2.0 * (count as f64 - 1.0) * scatter.ln()
        };
        self.blocks().into_iter().map(of_block).sum()
    }
}

/// Inverse of a symmetric positive matrix, scaled to a unit diagonal.
fn scaled_inverse(matrix: &[Vec<f64>]) -> Option<Vec<Vec<f64>>> {
    let scale: Vec<f64> =
        (0..matrix.len()).map(|i| matrix[i][i].max(f64::MIN_POSITIVE).sqrt().recip()).collect();
    let row = |(i, row): (usize, &Vec<f64>)| {
        row.iter().zip(&scale).map(|(value, other)| scale[i] * value * other).collect()
    };
    let mut inverse = inverted(matrix.iter().enumerate().map(row).collect())?;
    for (row, own) in inverse.iter_mut().zip(&scale) {
        row.iter_mut().zip(&scale).for_each(|(value, other)| *value *= own * other);
    }
    inverse.iter().flatten().all(|value| value.is_finite()).then_some(inverse)
}
