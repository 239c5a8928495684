//! Lines of rays of an audit.

use super::super::even::seen;
use super::super::heights::Interval;
use super::super::line::{
    LinePlace, MOST_DRAWS, MOST_PIECES, NARROWEST, PER_BEND, PER_JUMP, Piece, open_share,
};
use super::super::patches::LinePatch;
use super::super::slopes::Slopes;
use super::{Auditor, Drawn, LandedLight, Part, SETS, Sampled};
use crate::sampling::Landed;
use crate::trace::Tracer;
use beamlet_core::numbers::single;
use beamlet_core::random::Draws;
use beamlet_core::{Result, numbers};
use beamlet_interface::{Ray, RayResult};
use rayon::prelude::*;

/// Lines of a set.
const LINES: u32 = 6;
/// Share of the heights that are spread evenly; others follow the estimated errors of intervals.
const EVEN_HEIGHTS: f64 = 0.2;
/// Rays of a line before an interval between them is divided.
const RAYS: f64 = 12.0;
/// Parts of an interval between rays that cross different surfaces.
const PARTS_OF_CUT: u32 = 4;
/// Error of an interval that is not divided, share of the budget: a larger one makes the measured error uncertain, not
/// wrong.
const RESOLVED: f64 = 0.02;

/// Line of rays of a set.
pub(super) struct FreshLine {
    /// Index of its patch.
    pub(super) drawn: usize,
    pub(super) set: usize,
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

/// Division of an interval between two rays.
struct Division {
    parts: u32,
    /// Estimated error of the interval, in the unit of light.
    error: f64,
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
        Some(Piece::plain(self.x(), self.ray.result?))
    }

    /// Its interval with the light at its place that is linear between both ends, or that of the nearer one.
    fn linear(&self) -> Option<Piece> {
        let [low, high] = self.ends;
        let [a, b] = [low.result?, high.result?];
        let share = (self.ray.x - low.x) / (high.x - low.x);
        let is_cut = a.signature != b.signature;
        let result = between(&a, &b, if is_cut { 0.0 } else { share });
        Some(Piece::plain(self.x(), if is_cut && share > 0.5 { b } else { result }))
    }
}

/// Patches of lines.
impl Auditor<'_> {
    /// Begins the lines of both sets of a patch.
    pub(super) fn begin(
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
        let open = match self.view.responses.first().leak > 0.0 {
            true => vec![[-half, half]],
            false => {
                let openings = self.openings[self.view.lattice.column(beamlet)].first();
                seen(openings).into_iter().map(|ends| ends.map(f64::from)).collect()
            }
        };
        let whole: f64 = open.iter().map(|[low, high]| high - low).sum();
        let distance = whole / if is_random { MOST_DRAWS } else { RAYS };
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
    pub(super) fn trace(&self, tracer: &mut Tracer, lines: &mut [FreshLine]) -> Result<()> {
        loop {
            tracer.cancel().check()?;
            let rays: Vec<_> = lines.iter_mut().flat_map(FreshLine::open_rays).collect();
            if rays.is_empty() {
                break;
            }
            self.trace_rays(tracer, rays)?;
            lines.par_iter_mut().filter(|line| !line.is_random).for_each(|line| self.divide(line));
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

    /// Traces rays at random places of all intervals.
    pub(super) fn check(
        &self,
        tracer: &mut Tracer,
        lines: &mut [FreshLine],
        drawn: &mut [Drawn<'_>],
    ) -> Result<()> {
        for line in lines.iter_mut().filter(|line| !line.is_random) {
            let draws = &mut drawn[line.drawn].draws;
            for ends in line.parts.iter().flat_map(|part| part.windows(2)) {
                let x = ends[0].x + (ends[1].x - ends[0].x) * draws.uniform();
                let ray = FreshRay { x, result: None };
                line.checks.push(Check { ends: [ends[0], ends[1]], ray });
            }
        }
        self.trace_rays(tracer, lines.iter_mut().flat_map(FreshLine::check_rays).collect())
    }

    /// Adds rays where the light between two is not known, where it is known least if a line has room for few.
    fn divide(&self, line: &mut FreshLine) {
        let column = self.view.lattice.column(line.place.beamlet);
        let mut divisions: Vec<Vec<Division>> =
            line.parts.iter().map(|part| self.divisions(column, part)).collect();
        let mut room = MOST_PIECES.saturating_sub(line.parts.iter().map(Vec::len).sum());
        let mut wanted: Vec<&mut Division> = divisions.iter_mut().flatten().collect();
        wanted.sort_by(|a, b| b.error.total_cmp(&a.error));
        for division in wanted {
            let more = division.parts as usize - 1;
            if more > room {
                division.parts = 1;
            } else {
                room -= more;
            }
        }
        for (part, divisions) in line.parts.iter_mut().zip(divisions) {
            let mut divided = Vec::with_capacity(part.len());
            for (pair, Division { parts, .. }) in part.windows(2).zip(divisions) {
                divided.push(pair[0]);
                let step = (pair[1].x - pair[0].x) / f64::from(parts);
                let between = (1..parts).map(|at| pair[0].x + step * f64::from(at));
                divided.extend(between.map(|x| FreshRay { x, result: None }));
            }
            divided.extend(part.last());
            *part = divided;
        }
    }

    /// Divisions of the intervals between traced rays.
    fn divisions(&self, column: usize, rays: &[FreshRay]) -> Vec<Division> {
        let limit = RESOLVED * self.view.budget.light;
        let parts = |pair: &[FreshRay], error: f64| match pair {
            _ if error <= limit => 1,
            [a, b] if b.x - a.x < 2.0 * NARROWEST * f64::from(PARTS_OF_CUT) => 1,
            [a, b] if a.signature() != b.signature() => PARTS_OF_CUT,
            _ => 2,
        };
        let of_pair =
            |(pair, error): (&[FreshRay], f64)| Division { parts: parts(pair, error), error };
        rays.windows(2).zip(self.errors(column, rays)).map(of_pair).collect()
    }

    /// Errors of light that is linear in each interval between traced rays, in the unit of light.
    fn errors(&self, column: usize, rays: &[FreshRay]) -> Vec<f64> {
        let response = self.view.responses.first();
        let change = |at: f64, a: &RayResult, b: &RayResult| {
            let landed = [a, b].map(|it| Landed {
                light: response.hardening.light(it.optical_depth),
                at: response.landing(column, single(at), it.displacement_x),
            });
            let change = response.change(column, landed, 0.0);
            let rows = (self.view.down(a) - self.view.down(b)).abs().min(1.0);
            f64::from(change.max(rows * landed[0].light.max(landed[1].light)))
        };
        let open = |x: [f64; 2]| {
            let share = response.lit(single(open_share(self.openings[column].first(), x)));
            (x[1] - x[0]) * f64::from(response.weight * share)
        };
        let of_pair = |pair: &[FreshRay]| {
            let [low, high] = [pair[0], pair[1]];
            let (Some(a), Some(b)) = (low.result, high.result) else { return [0.0; 2] };
            let open = open([low.x, high.x]);
            if a.signature == b.signature {
                return [0.0, PER_BEND * change(f64::midpoint(low.x, high.x), &a, &b) * open];
            }
            // Beside an edge between them light may land where neither does.
            let light = |it: &RayResult| f64::from(response.hardening.light(it.optical_depth));
            [PER_JUMP * light(&a).max(light(&b)) * open, 0.0]
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
    pub(super) fn difference(&self, line: &FreshLine, patch: &Sampled<'_>) -> LandedLight {
        let mut sums = self.no_light();
        let Sampled::Lines(patch) = patch else { return sums };
        let part = |piece: &Piece, share: f64| self.part(piece, line.z, share * line.weight);
        let mut parts = Vec::new();
        for (number, share) in patch.heights.at(line.z) {
            let own = self.parts_of_line(line, patch, number);
            parts.extend(own.map(|it| Part { weight: share * it.weight, ..it }));
        }
        // Light between two rays lands between them along z as well.
        for pair in line.parts.iter().flat_map(|part| part.windows(2)) {
            for (piece, ends) in pieces_between(pair) {
                let mut landing = ends.map(|end| line.z + f64::from(self.view.down(&end)));
                landing.sort_unstable_by(f64::total_cmp);
                parts.push(Part { landing, ..part(&piece, -1.0) });
            }
        }
        parts.extend(line.checks.iter().filter_map(Check::seen).map(|it| part(&it, -1.0)));
        parts.extend(line.checks.iter().filter_map(Check::linear).map(|it| part(&it, 1.0)));
        self.add_light([patch.beamlet, patch.row], &parts, &mut sums);
        sums
    }

    /// Light of a line of a patch at the height of a fresh one.
    fn parts_of_line<'p>(
        &self,
        fresh: &FreshLine,
        patch: &'p LinePatch,
        number: usize,
    ) -> impl Iterator<Item = Part> + use<'_, 'p> {
        let (z, weight) = (fresh.z, fresh.weight);
        let optics = self.view.optics;
        let slopes = match self.view.lattice.heights {
            true => patch.slopes(number, single(optics.gap())),
            false => Vec::new(),
        };
        let [top, bottom] = patch.heights.nearest(number);
        let share = if bottom > top { (z - top) / (bottom - top) } else { 0.5 };
        let pieces = patch.heights.line(number).into_iter().flat_map(|line| &line.pieces);
        pieces.enumerate().map(move |(at, piece)| {
            let part = self.part(piece, z, weight);
            let Some(Slopes { landing, tilt }) = slopes.get(at) else { return part };
            let [up, low] = landing.map(f64::from);
            let down = -(up + (low - up) * share) / optics.detector.pitch[1];
            let weight = weight * (1.0 + f64::from(*tilt) * (share - 0.5));
            Part { landing: [z + down; 2], weight, ..part }
        })
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

/// Pieces between two rays, with the results at their ends: one where both cross the same surfaces, else a half for each.
fn pieces_between(pair: &[FreshRay]) -> Vec<(Piece, [RayResult; 2])> {
    let [(low, Some(a)), (high, Some(b))] = [0, 1].map(|at| (pair[at].x, pair[at].result)) else {
        return Vec::new();
    };
    let piece = |x: [f64; 2], ends: [RayResult; 2]| {
        let piece = Piece {
            depth: ends.map(|it| it.optical_depth),
            displacement: ends.map(|it| it.displacement_x),
            scattering: ends.map(|it| it.displacement_variance),
            ..Piece::plain(x, between(&ends[0], &ends[1], 0.5))
        };
        (piece, ends)
    };
    if a.signature == b.signature {
        return vec![piece([low, high], [a, b])];
    }
    let middle = f64::midpoint(low, high);
    vec![piece([low, middle], [a, a]), piece([middle, high], [b, b])]
}
