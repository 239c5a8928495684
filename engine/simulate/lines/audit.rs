//! Audit of the light of patches: the mean square of their errors, by fresh rays.
//!
//! A share of the patches is drawn, those of larger estimated errors more often. Two independent sets of rays of a drawn
//! patch are compared with the light that its lines have at the same places. Each set estimates the error of the patch
//! without bias, so the product of both estimates its square without bias, whatever rule chose the lines and whatever
//! that rule missed. Rays lie on lines of their own at random heights, also where the lines of the patch follow from
//! facets without a ray. Patches of evenly spread rays are compared with rays at random places of even cells.
//!
//! The sum over drawn patches is weighted by the inverse of their probability. With p of a patch, its product x and half
//! the difference s of the squares of both estimates, whose variance is that of x by the places of rays, the variance
//! of the sum is that of x² (1 − p) / p² + s² / p. Light is compared at each mask step in each window and row where it
//! lands.

use super::even::{EvenCell, EvenPatch, EvenSampler, seen};
use super::heights::Interval;
use super::light::Illumination;
use super::line::{LinePlace, Piece, Source, open_share};
use super::patches::LinePatch;
use crate::sampling::{Opening, ViewContext};
use crate::trace::Tracer;
use beamlet_core::numbers::single;
use beamlet_core::random::Draws;
use beamlet_core::tally::{Audit, AuditSums};
use beamlet_core::{Result, numbers};
use beamlet_interface::{Ray, RayResult};
use rayon::prelude::*;

/// Independent sets of rays of a patch.
const SETS: usize = 2;
/// Lines of a set.
const LINES: u32 = 6;
/// Kind of the random numbers of audits ([`Draws::new`]).
const KIND: u8 = 7;
/// Estimated error above which a patch is drawn more often, share of the tolerance.
const USUAL: f64 = 0.1;
/// Share of the heights that are spread evenly; others follow the estimated errors of intervals.
const EVEN_HEIGHTS: f64 = 0.2;
/// Rays of a line before an interval between them is divided.
const RAYS: f64 = 12.0;
/// Rays of a line that draw normals: intervals between them are not divided.
const RANDOM_RAYS: f64 = 64.0;
/// Parts of an interval between rays that cross different surfaces.
const PARTS_OF_CUT: u32 = 4;
/// Error of an interval that is not divided, share of the budget: a larger one makes the measured error uncertain, not
/// wrong.
const RESOLVED: f64 = 0.02;
/// Error of an interval that needs no ray at a random place, share of the budget.
const NEGLIGIBLE: f64 = 0.002;
/// Error of a jump at a random place of an interval over its light: 1/√12.
const PER_JUMP: f64 = 0.29;
/// Error of light that is linear between three rays, over what the middle one is off the line through the others: it is
/// off by a quarter between two, on average by two thirds of that.
const PER_BEND: f64 = 1.0 / 6.0;
/// Narrower intervals are not divided, m: places of rays are as coarse in f32 across a detector.
const NARROWEST: f64 = 4e-9;
/// Most rounds of rays.
const ROUNDS: usize = 8;
/// Most rays of a line.
const MOST_RAYS: usize = 2000;
/// Rows beside that of a patch whose light is apart.
const ROWS: [i64; 3] = [-1, 0, 1];
/// Half the width of the light of a ray at its place, m.
const POINT: f64 = 1e-9;
/// Half the height over which a ray is spread at the border of a row, rows.
const SPREAD: f64 = 1e-6;

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

/// Line of rays of a set.
struct FreshLine {
    /// Index of its patch.
    drawn: usize,
    set: usize,
    place: LinePlace,
    /// Rows below the upper border of the patch.
    z: f64,
    /// Part of the row that it represents.
    weight: f64,
    /// Rays by open part of the period, in the order of x.
    parts: Vec<Vec<FreshRay>>,
    /// Rays draw normals: they are not divided.
    is_random: bool,
    /// Rays at random places of intervals between two rays.
    checks: Vec<Check>,
}

/// Ray at a random place between two: what it differs by from light that is linear between them is what that misses,
/// on average.
#[derive(Debug, Clone, Copy)]
struct Check {
    ends: [FreshRay; 2],
    ray: FreshRay,
}

/// Cells of a set of an even patch.
struct FreshCells {
    /// Index of its patch.
    drawn: usize,
    set: usize,
    beamlet: i64,
    row: i64,
    cells: Vec<EvenCell>,
}

#[derive(Debug, Clone, Copy)]
struct FreshRay {
    /// From the centre of the beamlet, m.
    x: f64,
    result: Option<RayResult>,
}

impl FreshLine {
    /// Rays without a result, at the place of the line.
    fn open_rays(&mut self) -> Vec<(LinePlace, &mut FreshRay)> {
        let rays = self.parts.iter_mut().flatten().filter(|ray| ray.result.is_none());
        rays.map(|ray| (self.place, ray)).collect()
    }

    /// Rays of its checks, at the place of the line.
    fn check_rays(&mut self) -> Vec<(LinePlace, &mut FreshRay)> {
        self.checks.iter_mut().map(|check| (self.place, &mut check.ray)).collect()
    }
}

impl FreshRay {
    /// Hash of the surfaces that it crosses.
    fn signature(&self) -> Option<u32> {
        self.result.map(|it| it.signature)
    }
}

impl Check {
    fn x(&self) -> [f64; 2] {
        self.ends.map(|end| end.x)
    }

    /// Its interval with the light of its ray.
    fn seen(&self) -> Option<Piece> {
        Some(plain(self.x(), self.ray.result?))
    }

    /// Its interval with the light at its place that is linear between both ends, or that of the nearer one.
    fn linear(&self) -> Option<Piece> {
        let [low, high] = self.ends;
        let [a, b] = [low.result?, high.result?];
        let share = (self.ray.x - low.x) / (high.x - low.x);
        let is_cut = a.signature != b.signature;
        let result = between(&a, &b, if is_cut { 0.0 } else { share });
        Some(plain(self.x(), if is_cut && share > 0.5 { b } else { result }))
    }
}

/// Part of the light of a patch that a piece gives.
#[derive(Debug, Clone, Copy)]
struct Part {
    /// Heights of its light, rows below the upper border.
    z: [f64; 2],
    /// Share of the row.
    weight: f64,
}

/// Audits patches of a view.
#[derive(Debug, Clone, Copy)]
pub(super) struct Auditor<'a> {
    pub view: &'a ViewContext<'a>,
    pub illumination: &'a Illumination<'a>,
    pub even: &'a EvenSampler<'a>,
    /// Openings of the beamlets of the lattice.
    pub openings: &'a [Vec<Opening>],
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
        let mut differences = vec![[0; SETS].map(|_| vec![0.0; self.values()]); drawn.len()];
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
            of_set.iter_mut().zip(of_line).for_each(|(sum, it)| *sum += it);
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
    fn sums(&self, a: &[f64], b: &[f64], probability: f64) -> AuditSums {
        let product = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let budget = &self.view.budget;
        let unit = (budget.by_grid * budget.tolerance).powi(2) * self.view.response.steps() as f64;
        let square = product(a, b) / unit;
        let noise = 0.5 * (product(a, a) - product(b, b)) / unit;
        if !(square.is_finite() && noise.is_finite()) {
            return AuditSums::default();
        }
        let variance = square.powi(2) * (1.0 - probability) / probability.powi(2)
            + noise.powi(2) / probability;
        AuditSums::new(square / probability, variance)
    }

    /// Values of a patch: light in each row where it lands, by kind of window, mask step and window.
    fn values(&self) -> usize {
        ROWS.len() * self.illumination.values_of_light()
    }

    /// Adds the light of pieces of a patch, by the rows where it lands.
    fn add_light(
        &self,
        [beamlet, row]: [i64; 2],
        pieces: &[Piece],
        part: impl Fn(&Piece) -> Part,
        sums: &mut [f64],
    ) {
        let lattice = self.view.lattice;
        let column = lattice.column(beamlet);
        let all = i64::from(self.view.optics.detector.pixels[1]);
        let count = self.illumination.values_of_light();
        for (sums, aside) in sums.chunks_exact_mut(count).zip(ROWS) {
            // A wide blur takes light to many rows: then all of it is one value.
            let rows = match (lattice.has_wide_row_blur(), aside) {
                (true, 0) => 0..all,
                (true, _) => continue,
                (false, _) => (row + aside).max(0)..(row + aside + 1).min(all),
            };
            let share = |piece: &Piece| {
                let down = row as f64 + f64::from(self.illumination.down(piece));
                let Part { z, weight } = part(piece);
                let [top, bottom] = z.map(|z| z + down);
                single(weight * lattice.share_in_rows([top - SPREAD, bottom + SPREAD], &rows))
            };
            if rows.is_empty() || pieces.iter().all(|piece| share(piece) == 0.0) {
                continue;
            }
            let light = self.illumination.pass(column, &self.openings[column], pieces, share);
            let values = light.light(count).iter();
            sums.iter_mut().zip(values).for_each(|(sum, it)| *sum += f64::from(*it));
        }
    }
}

/// Patches of lines.
impl Auditor<'_> {
    /// Begins the lines of both sets of a patch.
    fn begin(
        &self,
        drawn: usize,
        patch: &LinePatch,
        draws: &mut Draws,
        lines: &mut Vec<FreshLine>,
    ) {
        let intervals = patch.heights.intervals();
        let is_random = patch.heights.light().any(|line| line.draws.are_any());
        for set in 0..SETS {
            for line in 0..LINES {
                let share = (f64::from(line) + draws.uniform()) / f64::from(LINES);
                let (z, density) = height(&intervals, share);
                let place = LinePlace { beamlet: patch.beamlet, row: patch.row as f64 + z };
                let weight = 1.0 / (f64::from(LINES) * density);
                let parts = self.first_rays(patch.beamlet, is_random, draws);
                let checks = Vec::new();
                lines.push(FreshLine { drawn, set, place, z, weight, parts, is_random, checks });
            }
        }
    }

    /// First rays of a line: at even distances from a random place on, and at the ends of what mask steps open.
    fn first_rays(&self, beamlet: i64, is_random: bool, draws: &mut Draws) -> Vec<Vec<FreshRay>> {
        let half = 0.5 * self.view.lattice.period;
        let open = match self.view.response.leak > 0.0 {
            true => vec![[-half, half]],
            false => {
                let openings = &self.openings[self.view.lattice.column(beamlet)];
                seen(openings).into_iter().map(|ends| ends.map(f64::from)).collect()
            }
        };
        let whole: f64 = open.iter().map(|[low, high]| high - low).sum();
        let distance = whole / if is_random { RANDOM_RAYS } else { RAYS };
        let of_part = |[low, high]: [f64; 2]| {
            let first = draws.uniform();
            let count = numbers::whole::<u32>(((high - low) / distance).ceil().max(2.0));
            let step = (high - low) / f64::from(count);
            let inner = (0..count).map(|at| low + step * (f64::from(at) + first));
            let places = std::iter::once(low).chain(inner).chain([high]);
            places.map(|x| FreshRay { x, result: None }).collect()
        };
        open.into_iter().map(of_part).collect()
    }

    /// Traces rays until lines are resolved.
    fn trace(&self, tracer: &mut Tracer, lines: &mut [FreshLine]) -> Result<()> {
        for _ in 0..ROUNDS {
            tracer.cancel().check()?;
            let rays: Vec<_> = lines.iter_mut().flat_map(FreshLine::open_rays).collect();
            if rays.is_empty() {
                break;
            }
            self.trace_rays(tracer, rays)?;
            lines.par_iter_mut().filter(|line| !line.is_random).for_each(|line| self.divide(line));
        }
        // Rays of the last round that are not traced.
        for part in lines.iter_mut().flat_map(|line| &mut line.parts) {
            part.retain(|ray| ray.result.is_some());
        }
        Ok(())
    }

    fn trace_rays(&self, tracer: &mut Tracer, rays: Vec<(LinePlace, &mut FreshRay)>) -> Result<()> {
        let ray = |(place, ray): &(LinePlace, &mut FreshRay)| {
            self.view.lattice.ray(place.beamlet, ray.x, place.row, self.view.pose)
        };
        let results = tracer.trace(&rays.iter().map(ray).collect::<Vec<Ray>>())?;
        rays.into_iter()
            .zip(results)
            .for_each(|((_, ray), result)| ray.result = Some(self.narrowed(result)));
        Ok(())
    }

    /// Traces rays at random places of intervals whose light may not be linear.
    fn check(
        &self,
        tracer: &mut Tracer,
        lines: &mut [FreshLine],
        drawn: &mut [Drawn<'_>],
    ) -> Result<()> {
        let limit = NEGLIGIBLE * self.view.budget.light;
        for line in lines.iter_mut().filter(|line| !line.is_random) {
            let column = self.view.lattice.column(line.place.beamlet);
            let draws = &mut drawn[line.drawn].draws;
            for part in &line.parts {
                for (ends, error) in part.windows(2).zip(self.errors(column, part)) {
                    if error > limit
                        && let [low, high] = *ends
                    {
                        let x = low.x + (high.x - low.x) * draws.uniform();
                        let ray = FreshRay { x, result: None };
                        line.checks.push(Check { ends: [low, high], ray });
                    }
                }
            }
        }
        self.trace_rays(tracer, lines.iter_mut().flat_map(FreshLine::check_rays).collect())
    }

    /// Adds rays where the light between two is not known.
    fn divide(&self, line: &mut FreshLine) {
        let column = self.view.lattice.column(line.place.beamlet);
        let mut count: usize = line.parts.iter().map(Vec::len).sum();
        for part in &mut line.parts {
            let parts = self.divisions(column, part);
            count += parts.iter().map(|it| *it as usize - 1).sum::<usize>();
            if count > MOST_RAYS {
                return;
            }
            let mut divided = Vec::with_capacity(part.len());
            for (pair, parts) in part.windows(2).zip(parts) {
                divided.push(pair[0]);
                let step = (pair[1].x - pair[0].x) / f64::from(parts);
                let between = (1..parts).map(|at| pair[0].x + step * f64::from(at));
                divided.extend(between.map(|x| FreshRay { x, result: None }));
            }
            divided.extend(part.last());
            *part = divided;
        }
    }

    /// Number of parts of each interval between traced rays.
    fn divisions(&self, column: usize, rays: &[FreshRay]) -> Vec<u32> {
        let limit = RESOLVED * self.view.budget.light;
        let parts = |(pair, error): (&[FreshRay], f64)| match pair {
            _ if error <= limit => 1,
            [a, b] if b.x - a.x < NARROWEST * f64::from(PARTS_OF_CUT) => 1,
            [a, b] if a.signature() != b.signature() => PARTS_OF_CUT,
            _ => 2,
        };
        rays.windows(2).zip(self.errors(column, rays)).map(parts).collect()
    }

    /// Errors of light that is linear in each interval between traced rays, in the unit of light.
    fn errors(&self, column: usize, rays: &[FreshRay]) -> Vec<f64> {
        let response = self.view.response;
        let change = |at: f64, a: &RayResult, b: &RayResult| {
            let light = [a, b].map(|it| response.hardening.light(it.optical_depth));
            let [own, other] =
                [a, b].map(|it| response.landing(column, single(at), it.displacement_x));
            let change = response.change(column, [light[0], own], [light[1], other], 0.0);
            let rows = (self.view.down(a) - self.view.down(b)).abs().min(1.0);
            f64::from(change.max(rows * light[0].max(light[1])))
        };
        let open = |x: [f64; 2]| {
            let share = response.lit(single(open_share(&self.openings[column], x)));
            (x[1] - x[0]) * f64::from(response.weight * share)
        };
        let of_pair = |pair: &[FreshRay]| {
            let [low, high] = [pair[0], pair[1]];
            let (Some(a), Some(b)) = (low.result, high.result) else { return [0.0; 2] };
            let all = change(f64::midpoint(low.x, high.x), &a, &b) * open([low.x, high.x]);
            if a.signature == b.signature { [0.0, PER_BEND * all] } else { [PER_JUMP * all, 0.0] }
        };
        let of_three = |three: &[FreshRay]| {
            let [low, own, high] = [three[0], three[1], three[2]];
            let [Some(a), Some(it), Some(b)] = [low, own, high].map(|ray| ray.result) else {
                return None;
            };
            let is_same = a.signature == it.signature && it.signature == b.signature;
            let linear = between(&a, &b, (own.x - low.x) / (high.x - low.x));
            is_same.then(|| PER_BEND * change(own.x, &it, &linear) * open([low.x, high.x]))
        };
        let bends: Vec<Option<f64>> = rays.windows(3).map(of_three).collect();
        let bend = |at: Option<usize>| bends.get(at?).copied().flatten();
        let error = |(at, pair): (usize, &[FreshRay])| {
            let [jump, alone] = of_pair(pair);
            match (bend(at.checked_sub(1)), bend(Some(at))) {
                (None, None) => jump.max(alone),
                (a, b) => a.unwrap_or(0.0).max(b.unwrap_or(0.0)),
            }
        };
        rays.windows(2).enumerate().map(error).collect()
    }

    /// Light of the patch at the place of a line less that of the line, for the part of the row that it represents.
    fn difference(&self, line: &FreshLine, patch: &Sampled<'_>) -> Vec<f64> {
        let mut sums = vec![0.0; self.values()];
        let Sampled::Lines(patch) = patch else { return sums };
        let place = [patch.beamlet, patch.row];
        let part =
            |share: f64| move |_: &Piece| Part { z: [line.z; 2], weight: share * line.weight };
        for (own, share) in patch.heights.at(line.z) {
            self.add_light(place, &own.pieces, part(share), &mut sums);
        }
        let pairs = line.parts.iter().flat_map(|part| part.windows(2));
        let pieces: Vec<Piece> = pairs.flat_map(pieces_between).collect();
        self.add_light(place, &pieces, part(-1.0), &mut sums);
        let seen: Vec<Piece> = line.checks.iter().filter_map(Check::seen).collect();
        self.add_light(place, &seen, part(-1.0), &mut sums);
        let linear: Vec<Piece> = line.checks.iter().filter_map(Check::linear).collect();
        self.add_light(place, &linear, part(1.0), &mut sums);
        sums
    }
}

/// Patches of evenly spread rays.
impl Auditor<'_> {
    fn light_of_even(&self, patch: &EvenPatch) -> Vec<f64> {
        let cells: Vec<EvenCell> = patch.cells().collect();
        let piece = |(at, cell): (u32, &EvenCell)| Piece {
            interval: at,
            ..plain(cell.x.map(f64::from), self.narrowed(cell.result))
        };
        let pieces: Vec<Piece> = (0..).zip(&cells).map(piece).collect();
        let part = |piece: &Piece| {
            let z = cells[piece.interval as usize].z.map(f64::from);
            Part { z, weight: z[1] - z[0] }
        };
        let mut sums = vec![0.0; self.values()];
        self.add_light([patch.beamlet, patch.row], &pieces, part, &mut sums);
        sums
    }

    /// As many cells, with rays at random places.
    fn random_cells(&self, patch: &EvenPatch, draws: &mut Draws) -> Vec<EvenCell> {
        let place = [patch.beamlet, patch.row];
        let openings = &self.openings[self.view.lattice.column(patch.beamlet)];
        let mut cells = self.even.empty_cells(place, openings, patch.count());
        for cell in &mut cells {
            let within = |[low, high]: [f32; 2], share: f64| low + (high - low) * single(share);
            let [x, z] = draws.pair();
            cell.ray = [within(cell.x, x), within(cell.z, z)];
        }
        cells
    }

    /// Traces the rays of cells.
    fn trace_cells(&self, tracer: &mut Tracer, sets: &mut [FreshCells]) -> Result<()> {
        let rays_of = |set: &FreshCells| {
            let FreshCells { beamlet, row, cells, .. } = set;
            let ray = |cell: &EvenCell| self.view.ray(*beamlet, *row, cell.ray[0], cell.ray[1]);
            cells.iter().map(ray).collect::<Vec<Ray>>()
        };
        let rays = sets.par_iter().map(rays_of).collect::<Vec<_>>().concat();
        let cells = sets.iter_mut().flat_map(|set| &mut set.cells);
        cells
            .zip(tracer.trace(&rays)?)
            .for_each(|(cell, result)| cell.result = self.narrowed(result));
        Ok(())
    }

    /// Light of a patch less that of rays at random places.
    fn difference_of_even(&self, patch: &EvenPatch, cells: &[EvenCell]) -> Vec<f64> {
        let mut sums = self.light_of_even(patch);
        // Light at its place alone: a mask step may open a part of its cell.
        let piece = |(at, cell): (u32, &EvenCell)| {
            let x = f64::from(cell.ray[0]);
            Piece { interval: at, ..plain([x - POINT, x + POINT], cell.result) }
        };
        let pieces: Vec<Piece> = (0..).zip(cells).map(piece).collect();
        let part = |piece: &Piece| {
            let cell = &cells[piece.interval as usize];
            let [width, height] = [cell.x, cell.z].map(|[low, high]| f64::from(high - low));
            Part { z: [cell.ray[1].into(); 2], weight: -height * width / (2.0 * POINT) }
        };
        self.add_light([patch.beamlet, patch.row], &pieces, part, &mut sums);
        sums
    }
}

/// Height for a uniform number, rows below the upper border, and the density of heights there.
fn height(intervals: &[Interval], share: f64) -> (f64, f64) {
    let whole: f64 = intervals.iter().map(|it| it.error).sum();
    let of_errors = if whole > 0.0 { 1.0 - EVEN_HEIGHTS } else { 0.0 };
    let mut left = share;
    for (at, it) in intervals.iter().enumerate() {
        let height = it.z[1] - it.z[0];
        let own = (1.0 - of_errors) * height
            + if whole > 0.0 { of_errors * it.error / whole } else { 0.0 };
        if left < own || at + 1 == intervals.len() {
            let part = (left / own).min(1.0);
            return (it.z[0] + part * height, own / height);
        }
        left -= own;
    }
    (0.5, 1.0)
}

/// Result between two rays that cross the same surfaces.
fn between(a: &RayResult, b: &RayResult, share: f64) -> RayResult {
    let share = single(share);
    let mix = |a: f32, b: f32| a + (b - a) * share;
    RayResult {
        optical_depth: mix(a.optical_depth, b.optical_depth),
        displacement_x: mix(a.displacement_x, b.displacement_x),
        displacement_z: mix(a.displacement_z, b.displacement_z),
        slope_x: mix(a.slope_x, b.slope_x),
        slope_z: mix(a.slope_z, b.slope_z),
        displacement_variance: mix(a.displacement_variance, b.displacement_variance),
        ..*a
    }
}

/// Pieces between two rays: one where both cross the same surfaces, else a half for each.
fn pieces_between(pair: &[FreshRay]) -> Vec<Piece> {
    let [(low, Some(a)), (high, Some(b))] = [0, 1].map(|at| (pair[at].x, pair[at].result)) else {
        return Vec::new();
    };
    let piece = |x: [f64; 2], ends: [&RayResult; 2]| Piece {
        depth: ends.map(|it| it.optical_depth),
        displacement: ends.map(|it| it.displacement_x),
        scattering: ends.map(|it| it.displacement_variance),
        ..plain(x, between(ends[0], ends[1], 0.5))
    };
    if a.signature == b.signature {
        return vec![piece([low, high], [&a, &b])];
    }
    let middle = f64::midpoint(low, high);
    vec![piece([low, middle], [&a, &a]), piece([middle, high], [&b, &b])]
}

/// A piece whose light is that of one ray.
fn plain(x: [f64; 2], result: RayResult) -> Piece {
    Piece {
        x,
        depth: [result.optical_depth; 2],
        displacement: [result.displacement_x; 2],
        scattering: [result.displacement_variance; 2],
        result,
        source: Source::FirstOrder,
        extent: 0.0,
        interval: 0,
        is_curved: false,
        draws: false,
    }
}
