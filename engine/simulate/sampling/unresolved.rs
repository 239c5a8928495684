//! Structure that rays do not resolve, such as bundles of fibres: rays spread evenly over what mask
//! steps open, and the error that they leave.
//!
//! Rectangles are not split where rays differ from their neighbours: differences are chance there, and
//! rays that are bent far would lose weight. Trial rays set the number of rays; choosing it from the rays
//! themselves is biased. If the number is larger than the trial, the patch gets new rays. They lie on
//! shifted lines, more for more rays, all at places of their own along x, at even distances; heights in a
//! line are a Kronecker sequence. The error follows from the mean square of the change from a ray to the next along
//! x: 1/12 of it if few see a jump, which may lie anywhere between two rays, and 1/2 if rays differ as
//! much as any two, each then being a random sample. The change to the ray after the next decides between
//! the two: it is twice as large if jumps are few, and no larger if nothing is resolved.

use super::error_estimate::{Estimator, SPREAD};
use super::patch::{self, Even, Node, Patch};
use super::patch_error::{NarrowComponent, PatchError};
use super::response::{Landed, Opening};
use super::step_shares::{StepRun, is_open, step_runs};
use beamlet_core::numbers;
use beamlet_interface::RayResult;

/// Crossings of a ray, on average, from which on structure may be too fine for rays.
const FINE_CROSSINGS: u64 = 8;
/// Error of the mean of two neighbours over their difference, squared: 3/4 for random light, 1/4 at a
/// jump, 0 for smooth light.
const UNLIKE: f32 = 0.5;
/// Fraction of the budget that the number of rays aims at for the worst mask step.
const AIM: f64 = 0.4;
/// The same with a single step, where the root mean square should be a third of the budget.
const AIM_OF_ONE: f64 = 0.3;
/// Part of the budget up to which rays that were settled on are left as they are.
const ACCEPTED: f64 = 0.9;
/// Rays of the first trial.
pub(super) const FIRST: u32 = 48;
/// Largest growth of the number of rays after a trial. If more are needed, another trial follows.
const MOST_GROWTH: f64 = 100.0;
/// The same after a trial of fewer than [`FEW`] rays, which is less exact.
const MOST_GROWTH_OF_FEW: f64 = 8.0;
const FEW: f64 = 256.0;
/// Rectangles are compared where their widths differ by no more than this.
const AS_WIDE: f32 = 1.5;

/// A rectangle.
struct Sample {
    /// Light without the sample as it counts, share of open beam.
    area: f32,
    width: f32,
    /// Its ray from the centre of the beamlet, m.
    x: f32,
    /// Transmitted fraction of the light.
    passed: f32,
    displacement: f32,
    landed: Landed,
    runs: Vec<StepRun>,
}

/// Mean squares of changes of the light at one mask step.
#[derive(Debug, Clone, Copy, Default)]
struct Changes {
    /// To the next ray, weighted by the squares of areas; and to the one after it.
    near: f64,
    far: f64,
    /// Weights of both.
    weights: [f64; 2],
    /// Squares of all areas.
    areas: f64,
}

impl Changes {
    /// Error of the light.
    fn error(&self) -> f64 {
        let least = f64::from(SPREAD * SPREAD);
        let [near, growth] = self.near_and_growth();
        (self.areas * near * (least + (0.5 - least) * (2.0 - growth))).sqrt()
    }

    /// Mean square of the change to the next ray, and how much more that to the one after it is: 2
    /// where jumps are few, 1 where nothing is resolved.
    fn near_and_growth(&self) -> [f64; 2] {
        let [near, far] = [self.near / self.weights[0], self.far / self.weights[1]];
        if near > 0.0 && far.is_finite() {
            [near, (far / near).clamp(1.0, 2.0)]
        } else {
            [if near > 0.0 { near } else { 0.0 }, 1.0]
        }
    }

    /// Factor by which the number of rays has to grow for an error that is smaller by the factor
    /// `less`. The square of the error is inverse to the number of rays, and proportional to the mean
    /// square of the change from one to the next.
    fn times(&self, less: f64) -> f64 {
        let [_, growth] = self.near_and_growth();
        less.powf(2.0 / (1.0 + growth.log2()))
    }
}

/// Borders of columns, m: of about `count`, as wide as one another over those parts of the period that
/// lie in an opening, and wider where bars let a share `leak` of the light through. A part that gets no
/// light is one column. `half`: half the period.
pub(super) fn columns(openings: &[Opening], half: f32, leak: f32, count: u32) -> Vec<f32> {
    let seen = seen(openings);
    let open: f32 = seen.iter().map(|[low, high]| high - low).sum();
    let width = (open + leak * (2.0 * half - open).max(0.0)) / count as f32;
    let parts = |[low, high]: [f32; 2], width: f32| {
        numbers::whole::<u32>(f64::from(((high - low) / width).round().max(1.0)))
    };
    let mut borders = vec![-half];
    let dark = |borders: &mut Vec<f32>, high: f32| {
        let low = borders[borders.len() - 1];
        let count = if leak > 0.0 { parts([low, high], width / leak) } else { 1 };
        borders.extend((1..=count).map(|i| patch::part([low, high], i - 1, count)[1]));
    };
    for [low, high] in seen {
        let first = borders[borders.len() - 1];
        // No sliver at the border of the period.
        let low = if low - first > 0.5 * width { low } else { first };
        if low > first {
            dark(&mut borders, low);
        }
        let parts = parts([low, high], width);
        borders.extend((1..=parts).map(|i| patch::part([low, high], i - 1, parts)[1]));
    }
    let last = borders.len() - 1;
    if half - borders[last] > 0.5 * width {
        dark(&mut borders, half);
    } else {
        borders[last] = half;
    }
    borders
}

/// Intervals of x that openings show together; they do not touch.
fn seen(openings: &[Opening]) -> Vec<[f32; 2]> {
    let mut sorted: Vec<[f32; 2]> = openings.iter().map(|opening| opening.x).collect();
    sorted.sort_unstable_by(|a, b| a[0].total_cmp(&b[0]));
    let mut seen: Vec<[f32; 2]> = Vec::new();
    for [low, high] in sorted {
        match seen.last_mut() {
            Some(last) if low <= last[1] => last[1] = last[1].max(high),
            _ => seen.push([low, high]),
        }
    }
    seen
}

/// True if rays cross too many surfaces on average to resolve them.
pub(super) fn cross_many<'r>(results: impl Iterator<Item = &'r RayResult>) -> bool {
    let all = |(crossings, count): (u64, u64), result: &RayResult| {
        (crossings + u64::from(result.crossings), count + 1)
    };
    let (crossings, count) = results.fold((0, 0), all);
    crossings > FINE_CROSSINGS * count
}

impl Estimator<'_> {
    /// True if the rays of a patch do not resolve it: they cross many surfaces, and their neighbours do not
    /// predict their light.
    pub(super) fn is_unresolved(&self, patch: &Patch) -> bool {
        if !cross_many(patch.leaves().map(|leaf| &patch.nodes[leaf as usize].result)) {
            return false;
        }
        // Squared error of the mean of two neighbours along an axis, and squared difference of the two.
        let (mut missed, mut differ) = (0.0, 0.0);
        for leaf in patch.leaves() {
            let node = &patch.nodes[leaf as usize];
            let neighbours = self.neighbours(patch, node);
            for side in [0, 2] {
                if let (Some(a), Some(b)) = (&neighbours[side], &neighbours[side + 1]) {
                    let [a, b] = [&a.result, &b.result];
                    missed += self.change_between(patch, node, &node.result, &mean(a, b)).powi(2);
                    differ += self.change_between(patch, node, a, b).powi(2);
                }
            }
        }
        missed > UNLIKE * differ
    }

    /// Change of the light between two results, at the ray of a rectangle.
    fn change_between(&self, patch: &Patch, node: &Node, a: &RayResult, b: &RayResult) -> f32 {
        let column = self.column(patch.beamlet);
        let x = patch.place(node.centre())[0];
        let half = 0.5 * self.response.magnification.abs() * node.width();
        let landed = |result: &RayResult| {
            let at = self.response.landing(column, x, result.displacement_x);
            [self.light(result), at]
        };
        self.response.change(column, landed(a), landed(b), half)
    }

    /// The error of a patch whose rays are spread evenly, and the number of rays that it needs, if it
    /// has not enough. `openings`: of its beamlet. `narrow`: components that may hide.
    pub(super) fn unresolved_error(
        &self,
        patch: &Patch,
        openings: &[Opening],
        narrow: &[NarrowComponent],
    ) -> PatchError {
        let samples = self.samples(patch, openings);
        let steps = self.changes(patch, &samples);
        let light = steps.iter().map(Changes::error).fold(0.0, f64::max);
        let mut result = PatchError { light, ..PatchError::default() };
        let seen = samples.iter().filter(|sample| !sample.runs.is_empty());
        let lines = patch.lines() as f32;
        let hides = seen.clone().any(|sample| self.hides(sample, narrow, lines));
        let off = light / self.budget.light;
        if patch.even == Some(Even::Settled) && off <= ACCEPTED && !hides {
            return result;
        }
        let count = numbers::count(seen.count());
        let aim = if steps.len() > 1 { AIM } else { AIM_OF_ONE };
        let times = |step: &Changes| step.times(step.error() / (aim * self.budget.light));
        let least = if hides { 3.0 } else { 1.0 };
        let growth = steps.iter().map(times).fold(least, f64::max);
        // The same number of new rays would give the same.
        if patch.even == Some(Even::Trial) && growth <= 1.0 {
            return result;
        }
        let count = f64::from(count);
        let most = if count < FEW { MOST_GROWTH_OF_FEW } else { MOST_GROWTH };
        let even = if growth > most { Even::Trial } else { Even::Settled };
        let rays = (growth.min(most) * count).max(f64::from(FIRST));
        result.even = Some((numbers::whole(rays.ceil()), even));
        result
    }

    /// Changes of the light between rays, by mask step.
    fn changes(&self, patch: &Patch, samples: &[Sample]) -> Vec<Changes> {
        let lattice_column = self.column(patch.beamlet);
        let mut steps = vec![Changes::default(); self.response.steps()];
        for (at, sample) in samples.iter().enumerate() {
            for (step, share) in sample.runs.iter().flat_map(StepRun::steps) {
                let area = self.response.lit(share) * sample.area;
                steps[step as usize].areas += f64::from(area).powi(2);
            }
            for apart in [1, 2] {
                let Some(other) = samples.get(at + apart) else { continue };
                if !is_beside(sample, other, apart, patch.lines() as f32) {
                    continue;
                }
                let at = self.response.landing(lattice_column, sample.x, other.displacement);
                let change = self.response.change_from(&sample.landed, [other.passed, at]);
                let change = f64::from(change);
                for (step, share) in sample.runs.iter().flat_map(StepRun::steps) {
                    let area = self.response.lit(share) * sample.area;
                    let weight = f64::from(area).powi(2);
                    let all = &mut steps[step as usize];
                    all.weights[apart - 1] += weight;
                    *(if apart == 1 { &mut all.near } else { &mut all.far }) +=
                        weight * change * change;
                }
            }
        }
        steps
    }

    /// The rectangles of a patch by the places of their rays along x.
    fn samples(&self, patch: &Patch, openings: &[Opening]) -> Vec<Sample> {
        let lattice_column = self.column(patch.beamlet);
        // How far light goes up and down, rows.
        let down = |leaf: u32| self.down(&patch.nodes[leaf as usize].result);
        let farthest = patch
            .leaves()
            .map(down)
            .fold([0.0, 0.0], |[up, low]: [f32; 2], down| [up.min(down), low.max(down)]);
        let of = |leaf: u32| {
            let node = &patch.nodes[leaf as usize];
            let passed = self.light(&node.result);
            let [x, _] = patch.ray(leaf);
            let at = self.response.landing(lattice_column, x, node.result.displacement_x);
            let half = 0.5 * self.response.magnification.abs() * node.width();
            let mut runs = Vec::new();
            step_runs(patch, leaf, openings, self.response.leaking(), &mut runs);
            let weight = farthest
                .map(|down| self.weight(patch.row, node.z, down))
                .into_iter()
                .fold(0.0, f32::max);
            Sample {
                area: node.width() * node.height() * self.response.weight * weight,
                width: node.width(),
                x,
                passed,
                displacement: node.result.displacement_x,
                landed: self.response.landed(lattice_column, [passed, at], half),
                runs,
            }
        };
        let mut samples: Vec<Sample> = patch.leaves().map(of).collect();
        samples.sort_by(|a, b| a.x.total_cmp(&b.x));
        samples
    }

    /// True if a component may hide between the rays of a patch with this number of lines.
    fn hides(&self, sample: &Sample, narrow: &[NarrowComponent], lines: f32) -> bool {
        let lit = if is_open(&sample.runs) { 1.0 } else { self.response.lit(0.0) };
        let worth = f64::from(SPREAD * lit * sample.area * sample.passed);
        let [low, high] = [-0.5, 0.5].map(|side| sample.x + side * sample.width);
        worth > ACCEPTED * self.budget.light
            && narrow.iter().any(|n| {
                let overlaps = n.x[0] < high && n.x[1] > low;
                let apart = sample.width / lines;
                overlaps && n.z[0] < 1.0 && n.z[1] > 0.0 && apart > n.width
            })
    }
}

/// The mean of two results.
fn mean(a: &RayResult, b: &RayResult) -> RayResult {
    RayResult {
        optical_depth: 0.5 * (a.optical_depth + b.optical_depth),
        displacement_x: 0.5 * (a.displacement_x + b.displacement_x),
        displacement_variance: 0.5 * (a.displacement_variance + b.displacement_variance),
        ..*a
    }
}

/// True if consecutive rays at this distance in the order are evenly spaced.
fn is_beside(sample: &Sample, other: &Sample, apart: usize, lines: f32) -> bool {
    let [narrow, wide] = [sample.width.min(other.width), sample.width.max(other.width)];
    let distance = other.x - sample.x;
    wide <= AS_WIDE * narrow && distance * lines <= (apart as f32 + 0.5) * wide
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Changes between `count` values, all of one area.
    fn changes(count: u32, value: impl Fn(u32) -> f64) -> Changes {
        let squares = |apart: u32| -> f64 {
            (0..count - apart).map(|i| (value(i + apart) - value(i)).powi(2)).sum()
        };
        Changes {
            near: squares(1),
            far: squares(2),
            weights: [f64::from(count - 1), f64::from(count - 2)],
            areas: f64::from(count),
        }
    }

    #[test]
    fn error_is_that_of_a_jump_between_two_rays_and_that_of_samples() {
        let close = |got: f64, want: f64| assert!((got / want - 1.0).abs() < 0.05, "{got} {want}");
        // Anywhere between two of 100 rays: a share of one area, spread evenly.
        let jump = changes(100, |i| f64::from(u8::from(i > 30)));
        close(jump.error(), (1.0_f64 / 12.0).sqrt());
        close(jump.times(3.0), 3.0);
        // Values of 0 and 1 by chance have a variance of 1/4 each.
        let random = |i: u32| f64::from(i.wrapping_mul(0x9e37_79b9).reverse_bits() >> 7 & 1);
        let hashed = |i: u32| random(i.wrapping_mul(0x85eb_ca6b) ^ (i << 13 | i >> 3));
        let samples = changes(40_000, hashed);
        close(samples.error(), 0.5 * 200.0);
        close(samples.times(3.0), 9.0);
        assert_eq!(changes(10, |_| 1.0).error().to_bits(), 0.0_f64.to_bits());
    }

    #[test]
    fn columns_cover_the_period_and_are_even_where_it_is_open() {
        let opening = |low, high| Opening { step: 0, x: [low, high] };
        let openings = [opening(-20e-6, -5e-6), opening(-10e-6, 5e-6), opening(30e-6, 40e-6)];
        let borders = columns(&openings, 50e-6, 0.0, 35);
        let ends = [borders[0], borders[borders.len() - 1]];
        assert_eq!(ends.map(f32::to_bits), [-50e-6_f32, 50e-6].map(f32::to_bits));
        let widths: Vec<f32> = borders.windows(2).map(|pair| pair[1] - pair[0]).collect();
        // 35 of 1 um, and the gaps before, between and behind them.
        let even = widths.iter().filter(|width| (**width - 1e-6).abs() < 1e-9).count();
        assert_eq!([even, widths.len()], [35, 38]);
        // Where bars let a quarter of the light through columns are four times as wide.
        let borders = columns(&openings, 50e-6, 0.25, 205);
        let widths: Vec<f32> = borders.windows(2).map(|pair| pair[1] - pair[0]).collect();
        let count = |low: f32, high: f32| {
            widths.iter().filter(|width| (low..high).contains(*width)).count()
        };
        assert_eq!([count(0.24e-6, 0.26e-6), count(0.9e-6, 1.1e-6)], [140, 65]);
        assert_eq!(widths.len(), 205);
    }
}
