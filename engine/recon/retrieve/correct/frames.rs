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

/// Scatter of logarithms of doses, and of displacements in widths of the curve, to begin with.
const SCATTER: [f64; 2] = [0.2, 0.3];
/// Least scatter.
const LEAST: [f64; 2] = [1e-5, 1e-5];
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
/// Most frames of which both sides of the peak are tried.
const SIDES: usize = 4;
/// Squares by which one side of the peak has to be better than the other.
const SURE: f64 = 9.0;
/// Relative error of the slope of the curve of the masks, which displacements are in proportion to.
const OF_SLOPE: f64 = 0.03;

/// Doses and displacements (m), each with its uncertainty.
pub(super) struct Frames {
    /// Dose of each frame.
    pub(super) dose: Vec<[f64; 2]>,
    pub(super) shift: Vec<[f64; 2]>,
}

impl Frames {
    /// Values that are known well enough: doses, and displacements for a curve of this width.
    pub(super) fn known(&self, width: f64) -> [Vec<Option<[f64; 2]>>; 2] {
        let of = |values: &[[f64; 2]], most: f64| {
            values.iter().map(|pair| (pair[1] <= most).then_some(*pair)).collect()
        };
        [of(&self.dose, UNKNOWN[0]), of(&self.shift, UNKNOWN[1] * width)]
    }
}

/// Unknowns with their covariance.
struct Solution {
    at: Vec<f64>,
    covariance: Vec<Vec<f64>>,
    /// Squares of residuals and of the scatter.
    objective: f64,
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
        for (bit, (frame, place)) in near.iter().enumerate() {
            if sides >> bit & 1 == 1 {
                at[of.of(*frame)[1]] -= 2.0 * place;
            }
        }
        found.push(search.descend(at, cancel)?);
    }
    let objective =
        |sides: usize| found[sides].as_ref().map_or(f64::INFINITY, |solution| solution.objective);
    let order = |a: &usize, b: &usize| objective(*a).total_cmp(&objective(*b));
    let chosen = (0..found.len()).min_by(order).unwrap_or(0);
    let mut unsure = vec![0.0_f64; of.frames];
    let side = |sides: usize, frame: usize| {
        found[sides].as_ref().map_or(0.0, |solution| place(solution, set, of, frame))
    };
    for (frame, _) in &near {
        let own = side(chosen, *frame);
        let is_other = |sides: &usize| side(*sides, *frame) * own < 0.0;
        let other = (0..found.len()).filter(is_other).min_by(order);
        if let Some(other) = other.filter(|it| objective(*it) - objective(chosen) < SURE) {
            unsure[*frame] = (side(other, *frame) - own).abs();
        }
    }
    if let Some(solution) = found.swap_remove(chosen) {
        best = solution;
    }
    Ok(Some(frames(&best, set, of, &unsure)))
}

/// Distance of a frame from the peak of the curve, in widths.
fn place(solution: &Solution, set: &PixelSet<'_>, of: Unknowns, frame: usize) -> f64 {
    solution.at[of.of(frame)[1]] + (set.offsets[frame] - set.centre) / set.width
}

/// Frames near the peak of the curve, each with its distance from there in widths, the nearest first.
fn near_peak(best: &Solution, set: &PixelSet<'_>, of: Unknowns) -> Vec<(usize, f64)> {
    let all = (0..of.frames).map(|frame| (frame, place(best, set, of, frame)));
    let mut near: Vec<(usize, f64)> = all.filter(|(_, place)| place.abs() < NEAR_PEAK).collect();
    near.sort_by(|a, b| a.1.abs().total_cmp(&b.1.abs()));
    near.truncate(SIDES);
    near
}

/// Values with their uncertainties.
fn frames(best: &Solution, set: &PixelSet<'_>, of: Unknowns, unsure: &[f64]) -> Frames {
    let sigma = |i: usize| best.covariance[i][i].max(0.0).sqrt();
    let dose = |k: usize| {
        let [i, _] = of.of(k);
        let dose = best.at[i].exp();
        [dose, dose * sigma(i)]
    };
    let shift = |k: usize| {
        let [_, i] = of.of(k);
        let sigma = sigma(i).hypot(unsure[k]).hypot(OF_SLOPE * best.at[i]);
        [set.width * best.at[i], set.width * sigma]
    };
    Frames { dose: (0..of.frames).map(dose).collect(), shift: (0..of.frames).map(shift).collect() }
}

#[derive(Clone, Copy)]
struct Search<'a> {
    set: &'a PixelSet<'a>,
    of: Unknowns,
    /// Variance of a value over that by the assumed noise.
    noise: f64,
    scatter: [f64; 2],
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
                return Ok(Some(Solution { at, covariance, objective }));
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

    /// Start, count and scatter of doses and of displacements.
    const fn blocks(&self) -> [(usize, usize, f64); 2] {
        let (doses, shifts) = (self.of.doses(), self.of.shifts());
        [(0, doses, self.scatter[0]), (doses, shifts, self.scatter[1])]
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
