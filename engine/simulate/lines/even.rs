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
mod patch;

use super::line::{NARROWEST, PER_JUMP};
use crate::sampling::{ColumnOpenings, Landed, Opening, Response, ViewContext};
use beamlet_core::numbers::{self, single};
use beamlet_interface::RayResult;
use changes::Changes;
use columns::columns;
pub(super) use columns::seen;
pub(super) use patch::Bodies;
pub(crate) use patch::{EvenCell, EvenPatch};
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
