//! Patches of many bodies, such as bundles of fibres: rays spread evenly over what mask steps open, and the error that
//! they leave.
//!
//! Trial rays show whether rays resolve the bodies; lines are for those that do. Else trial rays set the number of rays,
//! and the patch gets new ones: a number chosen from the rays themselves is biased, and so is a choice of places. Rays
//! lie on shifted lines, more for more rays, all at places of their own along x, at even distances; heights in a line
//! are a Kronecker sequence. The error follows from the mean square of the change from a ray to the next along x: 1/12
//! of it if few see a jump, which may lie anywhere between two rays, and 1/2 if rays differ as much as any two, each
//! then being a random sample. The change to the ray after the next decides between the two: it is twice as large if
//! jumps are few, and no larger if nothing is resolved.

mod changes;
mod columns;

use super::line::{NARROWEST, PER_JUMP};
use crate::sampling::{ColumnOpenings, Landed, Opening, Response, ViewContext};
use beamlet_core::numbers::{self, single};
use beamlet_core::random::GOLDEN;
use beamlet_interface::{BUNDLE_LANES, RAYS_PER_LANE, Ray, RayResult};
use changes::Changes;
pub(super) use columns::seen;
use columns::{columns, part};
use std::f64::consts::SQRT_2;
use std::ops::Range;

/// Crossings of a ray, on average, from which on structure may be too fine for rays.
const FINE_CROSSINGS: u64 = 8;
/// Error of the mean of two neighbours over their difference, squared: 3/4 for random light, 1/4 at a jump, 0 for smooth
/// light.
const UNLIKE: f64 = 0.5;
/// Fraction of the budget that the number of rays aims at for the worst mask step.
const AIM: f64 = 0.4;
/// The same with a single step, where the root mean square should be a third of the budget.
const AIM_OF_ONE: f64 = 0.3;
/// Part of the budget up to which rays that were settled on are left as they are.
const ACCEPTED: f64 = 0.9;
/// Most bodies of a patch that lines may resolve: a line through a thousand fibres takes as long as 100,000 rays.
const MOST_OF_LINES: u32 = 128;
/// Rays of the first trial.
const FIRST: u32 = 48;
/// Largest growth of the number of rays after a trial of fewer than [`FEW`] rays, which is not exact: if more are needed,
/// another trial follows. For trials of all sizes errors of fibres would rise by a third (`measured_errors_are_true_ones`).
const MOST_GROWTH: f64 = 8.0;
const FEW: f64 = 256.0;
/// Fewest lines of a patch. If no patch had more, light of a foam over borders of rows would err by 3.8e-3
/// (`light_of_foams_is_that_of_random_rays`).
const FEWEST_LINES: u32 = 4;
/// Rays that walk together where a device walks them in bundles.
const BUNDLE: u32 = BUNDLE_LANES * RAYS_PER_LANE;

/// A patch whose rays are spread evenly.
#[derive(Debug)]
pub(crate) struct EvenPatch {
    pub beamlet: i64,
    pub row: i64,
    /// Borders of its cells along x, m from the middle of the beamlet.
    borders: Vec<f32>,
    lines: u32,
    bodies: Bodies,
    /// Number of its trials so far; 0 where the number of rays is settled.
    trial: u32,
    /// Results of its rays, ordered by line, then x.
    pub(super) results: Vec<RayResult>,
    /// Rays of it and of its trials.
    pub(super) rays: u32,
    /// Estimated error of its light, share of open beam.
    pub(super) error: f64,
}

/// A cell of a patch.
#[derive(Debug, Clone, Copy)]
pub(crate) struct EvenCell {
    pub x: [f32; 2],
    /// Share of the row, downwards.
    pub z: [f32; 2],
    /// Place of its ray.
    pub ray: [f32; 2],
    pub result: RayResult,
}

impl EvenPatch {
    /// Cells, by height, then x.
    pub(crate) fn cells(&self) -> impl Iterator<Item = EvenCell> {
        (0..self.count()).map(|index| self.cell(index))
    }

    /// A cell by its index.
    pub(super) fn cell(&self, index: u32) -> EvenCell {
        let (x, z, ray) = self.place(index);
        EvenCell { x, z, ray, result: self.results[index as usize] }
    }

    /// Places of its rays, in the order in which they are traced.
    pub(super) fn rays(&self) -> impl Iterator<Item = [f32; 2]> {
        self.traced().map(|index| self.place(index).2)
    }

    /// Indices of its rays in the order in which they are traced: by bands of lines, and column by column in a band, forth
    /// and back, so that rays which follow one another are neighbours.
    pub(super) fn traced(&self) -> impl Iterator<Item = u32> {
        let (columns, lines) = (self.columns(), self.band());
        let of_band = columns * lines;
        (0..self.count()).map(move |at| {
            let (band, within) = (at / of_band, at % of_band);
            let from_end = columns - 1 - within / lines;
            let column = if band % 2 == 0 { within / lines } else { from_end };
            (band * lines + within % lines) * columns + column
        })
    }

    /// Lines whose rays are traced together, a power of two. A bundle of rays meets the fewest bodies where it is as much
    /// wider than high as they are.
    fn band(&self) -> u32 {
        let widths = self.borders.windows(2).map(|pair| f64::from(pair[1] - pair[0]));
        let column = widths.fold(f64::INFINITY, f64::min);
        let slimness = self.bodies.lowest / self.bodies.narrowest;
        let band = (f64::from(BUNDLE * self.lines) * column * slimness).sqrt();
        // The nearest power.
        let band = (SQRT_2 * band).max(1.0).min(self.lines.into());
        1 << numbers::whole::<u32>(band).ilog2()
    }

    /// Takes the results of its rays, in the order in which they are traced.
    fn add(&mut self, results: &[RayResult]) {
        self.rays += numbers::count(results.len());
        let mut ordered = results.to_vec();
        for (index, result) in self.traced().zip(results) {
            ordered[index as usize] = *result;
        }
        self.results = ordered;
    }

    const fn columns(&self) -> u32 {
        numbers::count(self.borders.len()) - 1
    }

    /// Bytes of its rays and results.
    pub(super) fn bytes(&self) -> u64 {
        u64::from(self.count()) * (size_of::<Ray>() + 2 * size_of::<RayResult>()) as u64
    }

    /// Number of its rays.
    pub(super) fn count(&self) -> u32 {
        self.lines * self.columns()
    }

    /// Cell of a ray, and its place.
    fn place(&self, index: u32) -> ([f32; 2], [f32; 2], [f32; 2]) {
        let columns = self.columns();
        let (line, column) = (index / columns, (index % columns) as usize);
        let x = [self.borders[column], self.borders[column + 1]];
        let z = part([0.0, 1.0], line, self.lines);
        // No two lines have rays above one another.
        let reversed = line.reverse_bits() >> (32 - self.lines.ilog2());
        let share = (reversed as f32 + 0.5) / self.lines as f32;
        // Any cells that follow one another cover the line.
        let height = single((0.5 + f64::from(index) * GOLDEN).fract());
        let ray = [x[0] + share * (x[1] - x[0]), z[0] + height * (z[1] - z[0])];
        (x, z, ray)
    }
}

/// Bodies whose shadows fall on a patch.
#[derive(Debug, Clone, Copy)]
pub(super) struct Bodies {
    pub count: u32,
    /// Width of the narrowest, m.
    pub narrowest: f64,
    /// Height of the lowest, rows.
    pub lowest: f64,
}

impl Default for Bodies {
    fn default() -> Self {
        Self { count: 0, narrowest: f64::INFINITY, lowest: f64::INFINITY }
    }
}

/// Next step for a patch whose rays are traced.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Next {
    Done,
    /// Its rays resolve it: it is one of lines.
    Lines,
    /// Another number of rays.
    Rays {
        count: u32,
        is_settled: bool,
    },
}

/// A ray with its cell.
struct Sample {
    /// Light without the sample, share of open beam.
    area: f32,
    cell: [f32; 2],
    /// Its place from the centre of the beamlet, m.
    x: f32,
    /// Share of the light that passes the sample and lands in rows that are recorded.
    passed: f32,
    displacement: f32,
    landed: Landed,
    /// Column of its beamlet in the lattice.
    column: usize,
    crossings: u32,
}

impl Sample {
    fn width(&self) -> f32 {
        self.cell[1] - self.cell[0]
    }

    /// True if another ray is the next one, or the one after it, at the even distance of rays on some lines.
    fn is_beside(&self, other: &Self, apart: usize, lines: u32) -> bool {
        let distance = other.x - self.x;
        distance * lines as f32 <= (apart as f32 + 0.5) * self.width().min(other.width())
    }
}

/// Chooses the rays of patches of many bodies.
#[derive(Debug)]
pub(super) struct EvenSampler<'a> {
    view: &'a ViewContext<'a>,
    /// Rows of the detector.
    rows: Range<i64>,
}

impl<'a> EvenSampler<'a> {
    pub(super) fn new(view: &'a ViewContext<'a>) -> Self {
        Self { view, rows: 0..i64::from(view.optics.detector.pixels[1]) }
    }

    /// A patch of the first trial.
    pub(super) fn begin(
        &self,
        beamlet: i64,
        row: i64,
        openings: &ColumnOpenings,
        bodies: Bodies,
    ) -> EvenPatch {
        EvenPatch { bodies, ..self.patch([beamlet, row], &openings.widest, FIRST, 1) }
    }

    /// A patch of about this number of rays.
    fn patch(
        &self,
        [beamlet, row]: [i64; 2],
        openings: &[Opening],
        count: u32,
        trial: u32,
    ) -> EvenPatch {
        // What refraction throws over a border of the row comes from the rays of the first or last line, which are to
        // lie near it.
        let wanted = numbers::whole::<u32>(f64::from(count).sqrt() / 2.0).max(FEWEST_LINES);
        let lines = 1 << wanted.ilog2();
        let half = 0.5 * single(self.view.lattice.period);
        let leak = self.view.responses.lit(0.0);
        let borders = columns(openings, half, leak, count.div_ceil(lines).max(1));
        let (bodies, results) = (Bodies::default(), Vec::new());
        EvenPatch { beamlet, row, borders, lines, bodies, trial, results, rays: 0, error: 0.0 }
    }

    /// Takes the results of the rays of a patch; another patch of other rays where they do not suffice.
    pub(super) fn take(
        &self,
        patch: &mut EvenPatch,
        results: &[RayResult],
        openings: &ColumnOpenings,
    ) -> Next {
        patch.add(results);
        let next = self.next(patch, openings);
        let Next::Rays { count, is_settled } = next else { return next };
        let left = self.view.budget.max_rays.saturating_sub(patch.rays);
        let most = self.view.lattice.period / NARROWEST;
        let possible = count.min(left).min(numbers::whole(most));
        let trial = if is_settled { 0 } else { patch.trial.max(1) + 1 };
        let place = [patch.beamlet, patch.row];
        let mut new = self.patch(place, &openings.widest, possible, trial);
        // Rays fill whole lines and gaps.
        let over = new.count().saturating_sub(left);
        if over > 0 {
            new = self.patch(place, &openings.widest, possible.saturating_sub(over), trial);
        }
        let is_no_gain = possible < count && possible <= patch.count();
        if is_no_gain || new.count() > left {
            return Next::Done;
        }
        let EvenPatch { bodies, rays, error, .. } = *patch;
        *patch = EvenPatch { bodies, rays, error, ..new };
        next
    }

    fn next(&self, patch: &mut EvenPatch, openings: &ColumnOpenings) -> Next {
        let samples = self.samples(patch);
        let is_few = patch.bodies.count <= MOST_OF_LINES;
        if patch.trial == 1 && is_few && !self.is_unresolved(&samples) {
            return Next::Lines;
        }
        let budget = self.view.budget.light;
        let steps = self.changes(&samples, openings, patch.lines);
        patch.error = steps.iter().map(Changes::error).fold(0.0, f64::max);
        let seen: Vec<&Sample> =
            samples.iter().filter(|it| self.is_seen(it, &openings.widest)).collect();
        let hides = seen.iter().any(|it| {
            let apart = f64::from(it.width() / patch.lines as f32);
            let worth = PER_JUMP * f64::from(it.area * it.passed);
            apart > patch.bodies.narrowest && worth > ACCEPTED * budget
        });
        if patch.trial == 0 && patch.error <= ACCEPTED * budget && !hides {
            return Next::Done;
        }
        let aim = if self.view.responses.fewest_steps() > 1 { AIM } else { AIM_OF_ONE };
        let times = |step: &Changes| step.times(step.error() / (aim * budget));
        let growth = steps.iter().map(times).fold(if hides { 3.0 } else { 1.0 }, f64::max);
        // The same number of new rays would give the same.
        if patch.trial > 0 && growth <= 1.0 {
            return Next::Done;
        }
        let count = seen.len() as f64;
        let most = if count < FEW { MOST_GROWTH } else { f64::INFINITY };
        let rays = (growth.min(most) * count).max(f64::from(FIRST));
        Next::Rays { count: numbers::whole(rays.ceil()), is_settled: growth <= most }
    }

    /// The rays of a patch by their places along x.
    fn samples(&self, patch: &EvenPatch) -> Vec<Sample> {
        let column = self.view.lattice.column(patch.beamlet);
        let response = self.view.responses.first();
        let of = |EvenCell { x: cell, z, ray, result }: EvenCell| {
            let down = f64::from(self.view.down(&result));
            let lands = |down: f64| {
                let ends = z.map(|z| patch.row as f64 + f64::from(z) + down);
                self.view.lattice.share_in_rows(ends, &self.rows)
            };
            let recorded = lands(down).max(lands(down * self.view.delta_ratio()));
            let passed = single(recorded) * response.hardening.light(result.optical_depth);
            let at = response.landing(column, ray[0], result.displacement_x);
            let width = cell[1] - cell[0];
            Sample {
                area: width * (z[1] - z[0]) * response.weight,
                cell,
                x: ray[0],
                passed,
                displacement: result.displacement_x,
                landed: Landed { light: passed, at },
                column,
                crossings: result.crossings,
            }
        };
        let mut samples: Vec<Sample> = patch.cells().map(of).collect();
        samples.sort_by(|a, b| a.x.total_cmp(&b.x));
        samples
    }

    /// Change of the light of a ray if it had this light and displacement, in each of the distinct windows.
    fn changes_in_windows(
        &self,
        own: &Sample,
        [passed, displacement]: [f32; 2],
    ) -> impl Iterator<Item = f64> {
        let response = self.view.responses.first();
        let at = response.landing(own.column, own.x, displacement);
        let half = 0.5 * response.magnification.abs() * own.width();
        let results = [own.landed, Landed { light: passed, at }];
        self.view.responses.changes(own.column, results, half).map(f64::from)
    }

    /// The largest of these changes.
    fn change(&self, own: &Sample, result: [f32; 2]) -> f64 {
        self.changes_in_windows(own, result).fold(0.0, f64::max)
    }

    /// True if rays cross many surfaces, and their neighbours do not predict their light.
    fn is_unresolved(&self, samples: &[Sample]) -> bool {
        let crossings: u64 = samples.iter().map(|it| u64::from(it.crossings)).sum();
        if crossings <= FINE_CROSSINGS * samples.len() as u64 {
            return false;
        }
        let (mut missed, mut differ) = (0.0, 0.0);
        for three in samples.windows(3) {
            let [a, own, b] = three else { continue };
            let mean = [0.5 * (a.passed + b.passed), 0.5 * (a.displacement + b.displacement)];
            missed += self.change(own, mean).powi(2);
            differ += self.change(a, [b.passed, b.displacement]).powi(2);
        }
        missed > UNLIKE * differ
    }

    /// Shares of a cell that the mask steps of a judge open.
    fn shares(sample: &Sample, openings: &[Opening], steps: usize) -> Vec<f32> {
        let mut shares = vec![0.0; steps];
        for opening in openings {
            let open = sample.cell[1].min(opening.x[1]) - sample.cell[0].max(opening.x[0]);
            shares[opening.step as usize] += (open / sample.width()).max(0.0);
        }
        shares
    }

    /// True if some step opens a part of a cell, or bars let light through it.
    fn is_seen(&self, sample: &Sample, openings: &[Opening]) -> bool {
        let [low, high] = sample.cell;
        self.view.responses.lit(0.0) > 0.0
            || openings.iter().any(|it| it.x[0] < high && it.x[1] > low)
    }

    /// Changes of the light between rays, by judge and mask step.
    fn changes(&self, samples: &[Sample], openings: &ColumnOpenings, lines: u32) -> Vec<Changes> {
        let responses = self.view.responses;
        let mut all = vec![Changes::default(); responses.judges().map(Response::steps).sum()];
        let is_seen = |it: &&Sample| self.is_seen(it, &openings.widest);
        for (at, sample) in samples.iter().enumerate().filter(|(_, it)| is_seen(it)) {
            let changes = [1, 2].map(|apart| {
                let other = samples.get(at + apart)?;
                let result = [other.passed, other.displacement];
                let is_beside = sample.is_beside(other, apart, lines);
                is_beside.then(|| self.changes_in_windows(sample, result).collect::<Vec<f64>>())
            });
            let mut rest = &mut all[..];
            for (judge, response) in responses.judges().enumerate() {
                let (steps, others) = rest.split_at_mut(response.steps());
                rest = others;
                let windows = responses.windows_of(judge);
                let shares = Self::shares(sample, &openings.judges[judge], steps.len());
                for (step, share) in steps.iter_mut().zip(shares) {
                    let weight = f64::from(response.lit(share.min(1.0)) * sample.area).powi(2);
                    step.areas += weight;
                    for (apart, change) in changes.iter().enumerate() {
                        if let Some(change) = change {
                            step.weights[apart] += weight;
                            step.squares[apart] += weight * change[windows] * change[windows];
                        }
                    }
                }
            }
        }
        all
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bytemuck::Zeroable;

    fn patch(lines: u32, columns: u16, bodies: Bodies) -> EvenPatch {
        let borders = (0..=columns).map(|it| 1e-6 * (f32::from(it) - 40.0)).collect();
        let results = Vec::new();
        EvenPatch {
            beamlet: 3,
            row: 5,
            borders,
            lines,
            bodies,
            trial: 1,
            results,
            rays: 0,
            error: 0.0,
        }
    }

    #[test]
    fn each_ray_is_traced_once_and_takes_its_own_result() {
        let bodies = [[2e-6, 20.0], [2e-6, 2e-2], [1e-3, 1e-3], [f64::INFINITY; 2], [1e-6, 0.0]];
        for [narrowest, lowest] in bodies {
            for (lines, columns) in [(4, 1), (4, 12), (8, 75), (32, 7)] {
                let mut patch = patch(lines, columns, Bodies { count: 40, narrowest, lowest });
                let traced: Vec<u32> = patch.traced().collect();
                let result = |index: &u32| RayResult { crossings: *index, ..Zeroable::zeroed() };
                patch.add(&traced.iter().map(result).collect::<Vec<_>>());
                let found: Vec<u32> = patch.cells().map(|cell| cell.result.crossings).collect();
                assert_eq!(found, (0..patch.count()).collect::<Vec<_>>());
            }
        }
    }

    #[test]
    fn bundles_are_as_narrow_or_as_flat_as_bodies() {
        // 8 lines of 80 columns of 1 um, 1/8 of a row high: size of a bundle, um and rows.
        let size = |narrowest, lowest| {
            let patch = patch(8, 80, Bodies { count: 40, narrowest, lowest });
            let rays: Vec<[f32; 2]> = patch.rays().collect();
            let extent = |axis: usize| {
                let of = |bundle: &[[f32; 2]]| {
                    let all = || bundle.iter().map(|ray| ray[axis]);
                    all().fold(f32::MIN, f32::max) - all().fold(f32::MAX, f32::min)
                };
                rays.chunks(BUNDLE as usize).map(of).fold(0.0, f32::max)
            };
            [1e6 * extent(0), extent(1)]
        };
        // Upright fibres of 5 um, bubbles of 5 um in rows of 40 um, and fibres that lie.
        let [upright, bubbles, lying] = [size(2e-6, 10.0), size(2e-6, 0.05), size(1e-3, 0.05)];
        assert!(upright[0] <= 4.0 && upright[1] > 0.8, "{upright:?}");
        assert!(bubbles[0] <= 17.0 && bubbles[1] <= 0.25, "{bubbles:?}");
        // Where a line ends, a bundle goes on in the next.
        assert!(lying[0] <= 32.0 && lying[1] <= 0.25, "{lying:?}");
    }
}
