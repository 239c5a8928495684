//! Audit of the light of patches: the mean square of their errors, by fresh rays.
//!
//! A share of the patches is drawn, those of larger estimated errors more often. Two independent sets of rays of a drawn
//! patch are compared with the light that its lines have at the same places. Each set estimates the error of the patch
//! without bias, so the product of both estimates its square without bias, whatever rule chose the lines and whatever
//! that rule missed. Rays lie on lines of their own at random heights, also where the lines of the patch follow from
//! facets without a ray. Patches of evenly spread rays are compared with rays at random places of even cells.
//!
//! The sum over drawn patches is weighted by the inverse of their probability. With p of a patch, its product x and half
//! the difference s of the squares of both estimates, the variance of the sum is that of x² (1 − p) / p² +
//! (x² + s²) / 2p: the mean square of s is the variance of x by the places of rays, of x at least that, and both are
//! rarely small by chance together. Light is compared at each mask step in each window and row where it lands.

mod fresh_cells;
mod fresh_line;

use super::even::EvenPatch;
use super::light::Illumination;
use super::line::Piece;
use super::patches::{LEAST, LinePatch};
use super::window_light::WindowLight;
use crate::sampling::{
    ColumnOpenings, Fall, Opening, Response, StripPair, StripResponses, ViewContext,
};
use crate::trace::Tracer;
use beamlet_core::numbers::single;
use beamlet_core::random::Draws;
use beamlet_core::tally::{Audit, AuditSums};
use beamlet_core::{Result, numbers};
use beamlet_interface::{NO_LIGHT, RayResult};
use fresh_cells::FreshCells;
use fresh_line::FreshLine;
use rayon::prelude::*;
use std::ops::{Range, RangeInclusive};

/// Independent sets of rays of a patch.
const SETS: usize = 2;
/// Kind of the random numbers of audits ([`Draws::new`]).
const KIND: u8 = 7;
/// Estimated error above which a patch is drawn more often, share of the tolerance.
const USUAL: f64 = 0.1;

/// A patch that is drawn.
struct Drawn<'p> {
    patch: Sampled<'p>,
    probability: f64,
    draws: Draws,
}

/// Patch of an audit.
enum Sampled<'p> {
    Lines(&'p LinePatch),
    Even(&'p EvenPatch),
}

/// Light of a patch by the row where it lands, downwards; that of the patch is in the middle.
type LandedLight = Vec<WindowLight>;

/// Part of the light of a patch that a piece gives.
#[derive(Debug, Clone, Copy)]
struct Part {
    piece: Piece,
    /// Height of its light on the sample, rows below the upper border.
    z: f64,
    /// Ends along z of where it lands, rows below the upper border.
    landing: [f64; 2],
    /// Share of the row.
    weight: f64,
}

/// Audits patches of a view.
#[derive(Debug, Clone, Copy)]
pub(super) struct Auditor<'a> {
    pub view: &'a ViewContext<'a>,
    pub illumination: &'a Illumination<'a>,
    /// Openings of the beamlets of the lattice.
    pub openings: &'a [ColumnOpenings],
    /// Materials scatter.
    pub scatters: bool,
}

impl<'a> Auditor<'a> {
    /// Audits a share of some patches. `lines`: with their estimated errors, share of open beam.
    ///
    /// # Errors
    /// As [`Tracer::trace`].
    pub(super) fn audit(
        &self,
        tracer: &mut Tracer,
        lines: &[(&LinePatch, f64)],
        even: &[EvenPatch],
    ) -> Result<Audit> {
        // Variances by both are one number of a ray.
        if self.scatters && self.view.facets.steps.iter().any(|step| step.roughness > 0.0) {
            return Ok(Audit::default());
        }
        let of_lines = lines.iter().filter_map(|(patch, error)| {
            self.draw(Sampled::Lines(patch), patch.beamlet, patch.row, *error)
        });
        let of_even = even.iter().filter_map(|patch| {
            let error = patch.error / self.view.budget.by_grid;
            self.draw(Sampled::Even(patch), patch.beamlet, patch.row, error)
        });
        let mut drawn: Vec<Drawn<'_>> = of_lines.chain(of_even).collect();
        if drawn.is_empty() {
            return Ok(Audit::default());
        }
        let no_light = || [0; SETS].map(|_| self.no_light());
        let mut differences: Vec<[LandedLight; SETS]> = drawn.iter().map(|_| no_light()).collect();
        let mut lines = Vec::new();
        let mut cells: Vec<FreshCells> = Vec::new();
        for (at, it) in drawn.iter_mut().enumerate() {
            match it.patch {
                Sampled::Lines(patch) => self.begin(at, patch, &mut it.draws, &mut lines),
                Sampled::Even(patch) => {
                    for set in 0..SETS {
                        let EvenPatch { beamlet, row, .. } = *patch;
                        let own = self.random_cells(patch, &mut it.draws);
                        cells.push(FreshCells { drawn: at, set, beamlet, row, cells: own });
                    }
                }
            }
        }
        self.trace_cells(tracer, &mut cells)?;
        for FreshCells { drawn: at, set, cells, .. } in &cells {
            if let Sampled::Even(patch) = drawn[*at].patch {
                differences[*at][*set] = self.difference_of_even(patch, cells);
            }
        }
        self.trace(tracer, &mut lines)?;
        self.check(tracer, &mut lines, &mut drawn)?;
        let of_line = |line: &FreshLine| self.difference(line, &drawn[line.drawn].patch);
        for (line, of_line) in lines.iter().zip(lines.par_iter().map(of_line).collect::<Vec<_>>()) {
            let of_set = &mut differences[line.drawn][line.set];
            of_set.iter_mut().zip(of_line).for_each(|(sum, it)| sum.add(&it));
        }
        let mut audit = Audit::default();
        for (it, [a, b]) in drawn.iter().zip(&differences) {
            let class = match it.patch {
                Sampled::Even(_) => &mut audit.unresolved,
                Sampled::Lines(patch) if patch.is_cut => &mut audit.silhouettes,
                Sampled::Lines(_) => &mut audit.rest,
            };
            *class = *class + self.sums(a, b, it.probability);
        }
        Ok(audit)
    }

    /// A result with its variance by materials alone: light of lines is judged without that by rough surfaces.
    fn narrowed(&self, result: RayResult) -> RayResult {
        let displacement_variance = if self.scatters { result.displacement_variance } else { 0.0 };
        RayResult { displacement_variance, ..result }
    }

    /// A patch, if it is drawn.
    fn draw<'p>(
        &self,
        patch: Sampled<'p>,
        beamlet: i64,
        row: i64,
        error: f64,
    ) -> Option<Drawn<'p>> {
        let budget = &self.view.budget;
        let probability = (budget.audit * (error / (USUAL * budget.tolerance)).max(1.0)).min(1.0);
        let [beamlet, row] = [beamlet, row].map(|it| numbers::low_word(it.cast_unsigned()));
        let seed = self.view.optics.sampling.seed;
        let mut draws = Draws::new(seed, [self.view.pose, row, beamlet], KIND);
        (draws.uniform() < probability).then_some(Drawn { patch, probability, draws })
    }

    /// Sums of a drawn patch, whose errors by two sets are `a` and `b`.
    fn sums(&self, a: &[WindowLight], b: &[WindowLight], probability: f64) -> AuditSums {
        let product = |a: &[WindowLight], b: &[WindowLight]| {
            a.iter().zip(b).map(|(a, b)| a.product(b)).sum::<f64>()
        };
        let budget = &self.view.budget;
        let unit = (budget.by_grid * budget.tolerance).powi(2) * self.response().steps() as f64;
        let square = product(a, b) / unit;
        let difference = 0.5 * (product(a, a) - product(b, b)) / unit;
        if !(square.is_finite() && difference.is_finite()) {
            return AuditSums::default();
        }
        let by_rays = 0.5 * (square.powi(2) + difference.powi(2));
        let variance =
            square.powi(2) * (1.0 - probability) / probability.powi(2) + by_rays / probability;
        AuditSums::new(square / probability, variance)
    }

    /// Response whose windows and mask steps light is compared in.
    fn response(&self) -> &'a Response {
        let response = self.view.responses.first();
        response.strips.as_ref().map_or(response, |it| &it.detector[0].response)
    }

    fn no_light(&self) -> LandedLight {
        let none = self.illumination.with_response(self.response()).no_light();
        vec![none; self.rows_aside().count()]
    }

    /// Rows where light of a patch lands that is not thrown far, from that of the patch.
    fn rows_aside(&self) -> RangeInclusive<i64> {
        let of_parts =
            self.view.responses.first().strips.as_ref().map_or(0.0, StripResponses::reach);
        let reach = (NO_LIGHT * self.view.lattice.row_blur()).max(of_parts);
        let farthest = numbers::whole::<i64>(reach.ceil().max(1.0));
        -farthest..=farthest
    }

    /// The part of a row at a height that a piece of a line gives.
    fn part(&self, piece: &Piece, z: f64, weight: f64) -> Part {
        let landing = [z + f64::from(self.illumination.down(piece)); 2];
        Part { piece: *piece, z, landing, weight }
    }

    /// Adds the light of parts of a patch, by the rows where it lands.
    fn add_light(&self, [beamlet, row]: [i64; 2], parts: &[Part], sums: &mut [WindowLight]) {
        let lattice = self.view.lattice;
        let column = lattice.column(beamlet);
        let all = i64::from(self.view.optics.detector.pixels[1]);
        for (sum, aside) in sums.iter_mut().zip(self.rows_aside()) {
            let rows = row + aside..row + aside + 1;
            if !(0..all).contains(&rows.start) {
                continue;
            }
            if let Some(strips) = &self.view.responses.first().strips {
                self.add_behind_strips(strips, [column as i64, row], parts, &rows, sum);
                continue;
            }
            let share = |part: &Part| {
                let [top, bottom] = part.landing.map(|z| row as f64 + z);
                part.weight * lattice.share_in_rows([top - LEAST, bottom + LEAST], &rows)
            };
            let openings = self.openings[column].first();
            add_shares(self.illumination, column, openings, parts, share, sum);
        }
    }

    /// Adds the light of parts of a patch that strips of both masks let pass to some rows.
    fn add_behind_strips(
        &self,
        strips: &StripResponses,
        [column, row]: [i64; 2],
        parts: &[Part],
        rows: &Range<i64>,
        sum: &mut WindowLight,
    ) {
        let (column, row) = (numbers::narrow(column), row as f64);
        for before in &strips.sample {
            let openings = self.view.responses.first().openings_of(&before.openings, column);
            let is_alike = |a: &Opening, b: &Opening| a.step == b.step || !before.ends();
            for behind in &strips.detector {
                let illumination = self.illumination.with_response(&behind.response);
                let pair = StripPair { sample: before, detector: behind };
                for some in openings.chunk_by(is_alike) {
                    let share = |part: &Part| {
                        let down = f64::midpoint(part.landing[0], part.landing[1]) - part.z;
                        let fall = Fall { row: row + part.z, down };
                        part.weight * strips.share(pair, some[0].step as usize, fall, rows)
                    };
                    add_shares(&illumination, column, some, parts, share, sum);
                }
            }
        }
    }
}

/// Adds the light of shares of parts of a patch behind openings.
fn add_shares(
    illumination: &Illumination<'_>,
    column: usize,
    openings: &[Opening],
    parts: &[Part],
    share: impl Fn(&Part) -> f64,
    sum: &mut WindowLight,
) {
    let share = |part: &Part| single(share(part));
    let shares: Vec<f32> = parts.iter().map(share).collect();
    let lit = parts.iter().zip(shares).filter(|(_, share)| *share != 0.0);
    let mut lit = lit.map(|(part, share)| (&part.piece, share)).peekable();
    if lit.peek().is_some() {
        sum.add(&illumination.pass(column, openings, lit).light);
    }
}
