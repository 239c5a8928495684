//! Heights of the lines of a beamlet and row: the closed rule over z.
//!
//! Light along z is linear between two lines, so a row sums to trapezoids, and what a window along z (blurred rows,
//! apertures that end along z) receives is the integral of that linear light in closed form. Lines lie at both
//! borders of the row, where the row beside has the same line, and between; an interval between two lines is halved
//! until the bends of its light are within the tolerance. A height at which light jumps has two lines, just above and
//! just below it.

use super::line::PER_JUMP;
use super::window_light::{Values, places};
use crate::sampling::ProjectedBounds;
use beamlet_core::numbers;

/// Part of the larger of both bends of an interval that counts, per height of the interval beside where that is lower:
/// a jump in that interval bends light, too, and three lines may be in line by chance.
const PER_LARGER: f64 = 0.25;
/// Least bend of an interval that has one beside it over the slope of its light: three lines may be in line by chance;
/// with 1/4 light that changes evenly takes more lines
/// (`light_that_changes_evenly_takes_few_lines_and_fills_windows_exactly`).
const PER_SLOPE: f64 = 1.0 / 6.0;
/// Part of its light that an interval may hide where light jumps in it: while an edge nearly along x crosses an
/// aperture, light may be anywhere (`light_of_edges_that_cross_an_aperture_within_little_height_is_found`).
const HIDDEN: f64 = 0.5;
/// Slope of light beside a jump over that of the jump, at most.
const BESIDE_JUMP: f64 = 0.25;
/// Part of the squared limit of errors that intervals which stay whole may have: where a few jumps have most of the
/// error, halving all others is in vain.
const WHOLE: f64 = 0.3;
/// [`Limits::least`] of lines of rays: above the rounding of rays 1,000 rows off the axis (6e-5), and a jump that is missed
/// errs by less than 2e-4 of it (`jumps_at_known_heights_take_two_lines`).
pub(crate) const LEAST_OF_RAYS: f64 = 1.0 / 4096.0;
/// Square of the bend of independent lines, of the worst of many values, over the square of their error: the second
/// difference has a standard deviation of 0.29·√6 of it, and the largest of some dozens of values is 2.5 deviations off.
const NOISE: f64 = 3.2;
/// Most height of the end of a body that counts as a jump, rows: its light is linear there, or halved as any other.
const FLAT: f64 = 1.0 / 32.0;
/// Most jumps of a row with lines of their own, or that may hide light: light that jumps more often swings, and its
/// bends tell its error.
const MOST_JUMPS: usize = 4;
/// Most intervals of a row before its first light, and lines at ends of bodies that are not flat: of few bodies each end
/// counts, of many the light between lines varies anyway.
const MOST_PARTS: u32 = 26;

/// Light of a line, as heights are judged by it.
pub(crate) trait Judged {
    /// Recorded values.
    fn values(&self) -> Values<'_>;

    /// Light times its displacement along x, of each mask step, as an error of light; none where that does not count.
    fn displaced(&self) -> &[f32] {
        &[]
    }

    /// Light times its displacement, rows downwards, of each mask step; none where light stays in its row.
    fn moved(&self) -> &[f32] {
        &[]
    }

    /// Largest displacement of the light, rows.
    fn farthest(&self) -> f64 {
        0.0
    }

    /// Hash of the surfaces that its rays cross, in their order.
    fn structure(&self) -> u32 {
        0
    }

    /// Its rays that are random samples; nothing where that is unknown.
    fn draws(&self) -> Option<Draws> {
        None
    }
}

/// Rays that are independent random samples, of a line or of all lines.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Draws {
    count: u32,
    /// Sum of the squares of their areas, in the unit of light.
    squares: f64,
    /// Sums over areas: of the squared light of their rays; of those that have a next one beside them the areas, and of
    /// half the squared change to it.
    light: f64,
    compared: f64,
    changes: f64,
}

impl Draws {
    /// Adds a ray that passes a share of the light of an area, and its change of light to the next one.
    pub(crate) fn add(&mut self, area: f64, passed: f64, change: Option<f64>) {
        self.count += 1;
        self.squares += area * area;
        self.light += area * passed * passed;
        if let Some(change) = change {
            self.compared += area;
            self.changes += 0.5 * area * change * change;
        }
    }

    fn and(self, other: Self) -> Self {
        Self {
            count: self.count + other.count,
            squares: self.squares + other.squares,
            light: self.light + other.light,
            compared: self.compared + other.compared,
            changes: self.changes + other.changes,
        }
    }

    /// True if there are any.
    pub(crate) const fn are_any(&self) -> bool {
        self.count > 0
    }

    /// Variance of the light of an area of 1. Draws that agree leave a share of 1 / (count + 2) open.
    fn variance(&self) -> f64 {
        let seen = if self.compared > 0.0 { self.changes / self.compared } else { 0.0 };
        let area = (self.squares * f64::from(self.count)).sqrt().max(f64::MIN_POSITIVE);
        seen.max(0.25 / f64::from(self.count + 2) * self.light / area)
    }
}

/// Bodies of a beamlet and row, before its first line.
#[derive(Debug, Clone)]
pub(crate) struct Features {
    /// Height of intervals that hides no body, rows; infinite where light is the same at all heights.
    pub height: f64,
    /// Flat ends of bodies: ranges of z, rows below the upper border.
    ends: Vec<[f64; 2]>,
    /// Ends and middles of ends of bodies that are not flat, rows below the upper border: light may be deflected there
    /// alone.
    lids: Vec<f64>,
    /// True if surfaces are rough: light differs from line to line, whatever edges there are.
    pub rough: bool,
}

impl Features {
    /// Adds a body whose shadow falls on a row.
    pub(crate) fn add(&mut self, shadow: &ProjectedBounds, row: i64) {
        // Upright bodies are the same at all heights, unless they are rough.
        if shadow.throws(row) || shadow.rough {
            self.height = self.height.min(shadow.height);
        }
        self.rough |= shadow.rough;
        for lid in shadow.lids {
            self.add_end(lid.map(|z| z - row as f64));
        }
    }

    /// Adds a range of z over which a body ends, rows below the upper border, if it is flat and near the row.
    fn add_end(&mut self, [low, high]: [f64; 2]) {
        let is_flat = low <= high && high - low <= FLAT;
        if !is_flat && high - low < 1.0 {
            let heights = [low, f64::midpoint(low, high), high];
            self.lids.extend(
                heights.into_iter().filter(|z| *z > LEAST_OF_RAYS && *z < 1.0 - LEAST_OF_RAYS),
            );
        }
        if is_flat && low < 1.0 + FLAT && high > -FLAT {
            self.ends.push([low, high]);
        }
    }
}

impl Default for Features {
    /// No body that ends or leans.
    fn default() -> Self {
        Self { height: f64::INFINITY, ends: Vec::new(), lids: Vec::new(), rough: false }
    }
}

/// Limits of a beamlet and row.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Limits {
    /// Error of the sum over lines, in the unit of their light.
    pub error: f64,
    /// Most lines.
    pub lines: usize,
    /// Distance from a border of the row within which blur takes light over it, rows.
    pub reach: f64,
    /// Light between two lines that is that of either up to the middle.
    pub uneven: Uneven,
    /// Least height of an interval, and distance of a line from the jump beside it, rows.
    pub least: f64,
}

/// Windows along z whose light is not the integral of light that is linear between two lines.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Uneven {
    /// None.
    Never,
    /// Rows, blurred by a standard deviation, rows.
    Rows { blur: f64 },
    /// Apertures that end along z.
    Apertures,
}

impl Uneven {
    /// Error of light that changes by 1 over an interval of this height, rows.
    fn error(self, height: f64) -> f64 {
        match self {
            Self::Never => 0.0,
            // The centroid is off by 1/24 of the height, before the steepest part of a Gaussian.
            Self::Rows { blur } => (0.4 / 24.0 * height / blur).min(0.125) * height,
            // An edge in the middle.
            Self::Apertures => 0.125 * height,
        }
    }
}

/// A line at its height.
#[derive(Debug, Clone)]
struct Placed<L> {
    /// Rows below the upper border, 0 to 1.
    z: f64,
    /// Its light; none before it is computed.
    light: Option<L>,
    /// True if light jumps between this line and the next.
    jumps: bool,
    /// Estimate for the interval below, where it is known.
    estimate: Option<Estimate>,
}

/// Lines of a beamlet and row, in the order of z.
#[derive(Debug, Clone)]
pub(crate) struct Heights<L> {
    lines: Vec<Placed<L>>,
    limits: Limits,
    rough: bool,
    /// True if light differs from line to line by chance.
    is_random: bool,
    /// True if light is judged alone, without its displacement along x.
    light_alone: bool,
}

impl<L: Judged + Clone> Heights<L> {
    /// Lines of a row without their light; within their number, but for the three that an estimate needs.
    pub(crate) fn new(features: &Features, limits: Limits) -> Self {
        let rough = features.rough;
        if features.height.is_infinite() {
            return Self {
                lines: vec![Placed { z: 0.5, light: None, jumps: false, estimate: None }],
                limits,
                rough,
                is_random: false,
                light_alone: false,
            };
        }
        let room = (limits.lines as f64 - 1.0).clamp(2.0, MOST_PARTS.into());
        let parts: u32 = numbers::whole((1.0 / features.height).ceil().clamp(2.0, room));
        let even = (0..=parts).map(|part| f64::from(part) / f64::from(parts));
        let mut jumps = jumps(&features.ends, limits.least);
        if parts as usize + 1 + 2 * jumps.len() > limits.lines {
            jumps.clear();
        }
        let is_beside = |z: &f64| jumps.iter().all(|[low, high]| z <= low || z >= high);
        let lids = features.lids.iter().copied().take(MOST_PARTS as usize);
        let mut heights: Vec<f64> = even.chain(lids).filter(is_beside).collect();
        heights.extend(jumps.iter().flatten().filter(|z| (0.0..=1.0).contains(*z)));
        heights.sort_unstable_by(f64::total_cmp);
        heights.dedup_by(|a, b| *a - *b < 0.5 * limits.least);
        let place = |z: f64| Placed {
            z,
            light: None,
            jumps: jumps.iter().any(|it| it[0].to_bits() == z.to_bits()),
            estimate: None,
        };
        let lines = heights.into_iter().map(place).collect();
        Self { lines, limits, rough, is_random: false, light_alone: false }
    }

    /// Heights of lines without light, rows below the upper border.
    pub(crate) fn wanted(&self) -> impl Iterator<Item = f64> {
        self.lines.iter().filter(|line| line.light.is_none()).map(|line| line.z)
    }

    /// Adds the light of [`Self::wanted`], in its order, and halves intervals that err too much, within the number of
    /// lines.
    pub(crate) fn add(&mut self, light: impl Iterator<Item = L>) {
        let wanted = self.lines.iter_mut().filter(|line| line.light.is_none());
        for (line, light) in wanted.zip(light) {
            self.is_random |= self.rough && light.draws().is_none_or(|draws| draws.are_any());
            line.light = Some(light);
        }
        for at in 0..self.lines.len() - 1 {
            if self.lines[at].estimate.is_none() {
                self.lines[at].estimate = Some(self.estimate_of(at));
            }
        }
        let mut halved = self.halved();
        let room = self.limits.lines.saturating_sub(self.lines.len());
        if self.is_random && halved.len() > room {
            // A choice by random light would favour lines that are alike.
            return;
        }
        halved.truncate(room);
        halved.sort_unstable();
        for at in halved.into_iter().rev() {
            let z = f64::midpoint(self.lines[at].z, self.lines[at + 1].z);
            self.lines[at].jumps = false;
            let near = at.saturating_sub(1)..(at + 2).min(self.lines.len());
            self.lines[near].iter_mut().for_each(|line| line.estimate = None);
            self.lines.insert(at + 1, Placed { z, light: None, jumps: false, estimate: None });
        }
    }

    /// Limits the number of lines further.
    pub(crate) fn limit(&mut self, lines: usize) {
        self.limits.lines = self.limits.lines.min(lines.max(3));
    }

    /// Judges light alone, without its displacement along x.
    pub(crate) fn judge_light_alone(&mut self) {
        if !self.light_alone {
            self.light_alone = true;
            self.lines.iter_mut().for_each(|line| line.estimate = None);
        }
    }

    /// Intervals to halve, from the largest error down, until the error of the halves and the rest is within the limit.
    fn halved(&self) -> Vec<usize> {
        let limit = self.limits.error * self.limits.error;
        let estimates: Vec<Estimate> = self.estimates().collect();
        let jumps = estimates.iter().filter(|it| it.hidden > 0.0).count();
        let draws = self.squares_of_draws();
        let hides = jumps <= MOST_JUMPS && !self.is_random;
        let error = |(at, it): (usize, &Estimate)| {
            let hidden = if hides { it.hidden } else { 0.0 };
            it.square(draws.get(at).copied()).sqrt().max(hidden).max(it.hidden_crossing)
        };
        let errors: Vec<f64> = estimates.iter().enumerate().map(error).collect();
        let drawn: f64 = draws.iter().sum();
        if drawn > limit && 2.0 * drawn > errors.iter().map(|error| error * error).sum() {
            // A choice by random light would favour lines that are alike.
            return (0..errors.len())
                .filter(|at| self.height(*at) >= 2.0 * self.limits.least)
                .collect();
        }
        let mut order: Vec<usize> = (0..errors.len()).collect();
        order.sort_by(|a, b| errors[*b].total_cmp(&errors[*a]).then(a.cmp(b)));
        let mut whole: f64 = errors.iter().map(|error| error * error).sum();
        let mut after = whole;
        let mut halved = Vec::new();
        for at in order {
            if after <= limit || whole <= WHOLE * limit {
                break;
            }
            let square = errors[at] * errors[at];
            whole -= square;
            if self.height(at) < 2.0 * self.limits.least {
                after -= square;
            } else {
                // A jump stays in one of the halves.
                after -= 0.75 * square;
                halved.push(at);
            }
        }
        halved
    }

    /// Number of lines.
    pub(crate) const fn count(&self) -> usize {
        self.lines.len()
    }

    /// Light of all lines, in the order of z.
    pub(crate) fn light(&self) -> impl Iterator<Item = &L> {
        self.lines.iter().filter_map(|line| line.light.as_ref())
    }

    /// Height of the line in the middle, and its light.
    pub(crate) fn middle(&self) -> (f64, Option<&L>) {
        let line = &self.lines[self.lines.len() / 2];
        (line.z, line.light.as_ref())
    }

    /// Interval that is nearer to a line than to others, rows below the upper border.
    pub(crate) fn nearest(&self, at: usize) -> [f64; 2] {
        let between = |at: usize| f64::midpoint(self.lines[at].z, self.lines[at + 1].z);
        let last = at + 1 == self.lines.len();
        [if at == 0 { 0.0 } else { between(at - 1) }, if last { 1.0 } else { between(at) }]
    }

    /// Lines that give the light at a height, rows below the upper border, with their parts in it.
    pub(crate) fn at(&self, z: f64) -> impl Iterator<Item = (&L, f64)> {
        let below = self.lines.partition_point(|line| line.z <= z);
        let (upper, lower) = (below.saturating_sub(1), below.min(self.lines.len() - 1));
        let height = self.lines[lower].z - self.lines[upper].z;
        let share = if height > 0.0 { (z - self.lines[upper].z) / height } else { 0.0 };
        let share = if self.limits.uneven == Uneven::Never { share } else { share.round() };
        [(upper, 1.0 - share), (lower, share)]
            .into_iter()
            .filter(|(_, share)| *share > 0.0)
            .filter_map(|(at, share)| Some((self.lines[at].light.as_ref()?, share)))
    }

    /// Intervals of z between lines and beyond the outer ones, rows below the upper border, with their estimated errors.
    pub(crate) fn intervals(&self) -> Vec<Interval> {
        let z = |at: usize| self.lines[at].z;
        let last = self.lines.len() - 1;
        let draws = self.squares_of_draws();
        let between = self.estimates().enumerate().map(|(at, it)| Interval {
            z: [z(at), z(at + 1)],
            error: it.square(draws.get(at).copied()).sqrt(),
        });
        let before = Interval { z: [0.0, z(0)], error: 0.0 };
        let after = Interval { z: [z(last), 1.0], error: 0.0 };
        let all = std::iter::once(before).chain(between).chain([after]);
        all.filter(|it| it.z[1] > it.z[0]).collect()
    }

    /// Weights of the lines in what a window receives. `integrate`: integrals over an interval of z of the window
    /// times light that falls from 1 to 0, and rises from 0 to 1. Light beyond the outer lines is theirs.
    pub(crate) fn weights(&self, integrate: impl Fn([f64; 2]) -> [f64; 2]) -> Vec<f64> {
        let mut weights = vec![0.0; self.lines.len()];
        let last = weights.len() - 1;
        let mut add = |ends: [f64; 2], lines: [usize; 2]| {
            if ends[1] > ends[0] {
                let parts = integrate(ends);
                lines.into_iter().zip(parts).for_each(|(line, part)| weights[line] += part);
            }
        };
        add([0.0, self.lines[0].z], [0, 0]);
        for (at, pair) in self.lines.windows(2).enumerate() {
            add([pair[0].z, pair[1].z], [at, at + 1]);
        }
        add([self.lines[last].z, 1.0], [last, last]);
        weights
    }

    /// Estimated error of the sum over lines, in the unit of their light.
    pub(crate) fn error(&self) -> f64 {
        let draws = self.squares_of_draws();
        let square = |(at, it): (usize, Estimate)| it.square(draws.get(at).copied());
        self.estimates().enumerate().map(square).sum::<f64>().sqrt()
    }

    /// Squared errors of the intervals by random samples; none where there are no samples.
    fn squares_of_draws(&self) -> Vec<f64> {
        let of = |line: &Placed<L>| line.light.as_ref().and_then(L::draws).unwrap_or_default();
        let all = self.lines.iter().map(of).fold(Draws::default(), Draws::and);
        if !all.are_any() {
            return Vec::new();
        }
        let variance = all.variance();
        let of_pair = |at: usize| {
            let squares = 0.5 * (of(&self.lines[at]).squares + of(&self.lines[at + 1]).squares);
            self.height(at).powi(2) * squares * variance
        };
        (0..self.lines.len() - 1).map(of_pair).collect()
    }

    fn estimates(&self) -> impl Iterator<Item = Estimate> {
        let known = |at: usize| self.lines[at].estimate.unwrap_or_else(|| self.estimate_of(at));
        (0..self.lines.len() - 1).map(known)
    }

    /// Estimate for the interval below a line: by the worst bend of a value of its light.
    fn estimate_of(&self, at: usize) -> Estimate {
        let Some(own) = self.rise(at) else { return Estimate::default() };
        // Light beyond a jump has nothing to do with light before it.
        let beside = |at: usize| Some(at).filter(|at| !self.lines[*at].jumps);
        let above = at.checked_sub(1).and_then(beside).and_then(|at| self.rise(at));
        let below = beside(at + 1).and_then(|at| self.rise(at));
        let rises = || above.iter().chain([&own]).chain(&below);
        let (mut worst, mut most, mut change, mut is_jump) = (0.0_f64, 0.0_f64, 0.0_f64, false);
        for kind in 0..own.values.len() {
            for place in places(rises().flat_map(|it| it.values[kind])) {
                let value = Value { kind, place };
                let slope = own.slope(value);
                let bend = |beside: &Rise<'_>| (beside.slope(value) - slope).abs();
                worst = worst.max(match (&above, &below) {
                    (Some(a), Some(b)) => {
                        let larger = |it: &Rise<'_>| bend(it) * (it.height / own.height).min(1.0);
                        bend(a).min(bend(b)).max(PER_LARGER * larger(a).max(larger(b)))
                    }
                    (Some(it), None) | (None, Some(it)) => bend(it).max(PER_SLOPE * slope.abs()),
                    (None, None) => slope.abs(),
                });
                change = change.max(slope.abs() * own.height);
                most = own.ends(value).into_iter().fold(most, f64::max);
                let is_level =
                    |it: &Rise<'_>| it.slope(value) * slope < BESIDE_JUMP * slope * slope;
                is_jump |= slope.abs() * own.height > self.limits.error
                    && above.iter().chain(&below).all(is_level);
            }
        }
        let hides = is_jump && own.height > LEAST_OF_RAYS;
        let uneven = self.limits.uneven.error(own.height) * change;
        let bends = (PER_JUMP * own.height * own.height * worst).hypot(uneven);
        let hidden = if hides { PER_JUMP * own.height * HIDDEN * most } else { 0.0 };
        let [crossing, hidden_crossing] = self.crossing(at, &own, [above, below]);
        Estimate { bends: bends.hypot(crossing), hidden, hidden_crossing }
    }

    /// Error of light that displacement takes over the borders of the row: where the displaced light of an interval
    /// near a border jumps, as much may cross it as the interval has light near the border. The second
    /// error, for halving alone, is of light that may cross it where the two lines cross different surfaces.
    fn crossing(&self, at: usize, own: &Rise<'_>, beside: [Option<Rise<'_>>; 2]) -> [f64; 2] {
        let [upper, _] = own.moved;
        // Light may be displaced farther between two lines than at either.
        let reach = self.limits.reach + 2.0 * own.farthest;
        let border = self.lines[at].z.min(1.0 - self.lines[at + 1].z);
        let near = border < reach || self.limits.uneven == Uneven::Apertures;
        // Random samples that are reflected go anywhere: their own variance tells what crosses.
        if upper.is_empty() || !near || self.is_random {
            return [0.0; 2];
        }
        let slope = |it: &Rise<'_>, step: usize| {
            f64::from(it.moved[1][step] - it.moved[0][step]) / it.height
        };
        let jump = |step: usize| {
            let slope_of_own = slope(own, step);
            let bends = beside.iter().flatten().map(|it| (slope(it, step) - slope_of_own).abs());
            own.height * bends.fold(f64::INFINITY, f64::min).min(f64::MAX)
        };
        let alone = beside.iter().all(Option::is_none);
        let most = (0..upper.len())
            .map(|step| if alone { own.height * slope(own, step).abs() } else { jump(step) });
        let error = PER_JUMP * most.fold(0.0, f64::max) * (own.height / reach).min(1.0);
        let moved = own.moved.into_iter().flatten().fold(0.0_f32, |most, it| most.max(it.abs()));
        let hides = own.is_broken && own.height > LEAST_OF_RAYS && own.farthest > 0.0;
        let share = if hides { (own.height / own.farthest).min(1.0) } else { 0.0 };
        [error, PER_JUMP * f64::from(moved) * share]
    }

    /// Light at the ends of the interval below a line.
    fn rise(&self, at: usize) -> Option<Rise<'_>> {
        let light = |at: usize| self.lines.get(at)?.light.as_ref();
        let ends = [light(at)?, light(at + 1)?];
        let farthest = ends[0].farthest().max(ends[1].farthest());
        let is_broken = ends[0].structure() != ends[1].structure();
        let moved = ends.map(L::moved);
        let displaced = ends.map(|it| Values {
            first: 0,
            values: if self.light_alone { &[] } else { it.displaced() },
        });
        let values = [ends.map(L::values), displaced];
        Some(Rise { values, moved, farthest, is_broken, height: self.height(at) })
    }

    /// Light that is linear in z over intervals, and its values at their ends: the part of a line in the light of the
    /// row.
    pub(crate) fn parts(&self, at: usize) -> impl Iterator<Item = ([f64; 2], [f64; 2])> {
        let z = |at: usize| self.lines[at].z;
        let last = self.lines.len() - 1;
        let before =
            if at == 0 { ([0.0, z(0)], [1.0; 2]) } else { ([z(at - 1), z(at)], [0.0, 1.0]) };
        let after =
            if at == last { ([z(last), 1.0], [1.0; 2]) } else { ([z(at), z(at + 1)], [1.0, 0.0]) };
        [before, after].into_iter().filter(|([low, high], _)| high > low)
    }

    /// Height of a line, rows below the upper border.
    pub(crate) fn z(&self, at: usize) -> f64 {
        self.lines[at].z
    }

    /// Height of the interval below a line, rows.
    fn height(&self, at: usize) -> f64 {
        self.lines[at + 1].z - self.lines[at].z
    }
}

/// Interval of z with its estimated error.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Interval {
    /// Ends, rows below the upper border.
    pub z: [f64; 2],
    /// In the unit of light.
    pub error: f64,
}

/// Estimated error of an interval.
#[derive(Debug, Clone, Copy, Default)]
struct Estimate {
    /// Error that the bends of its light show.
    bends: f64,
    /// Error by light that a jump may hide, for halving alone; 0 where light does not jump.
    hidden: f64,
    /// Error by light that may cross a border of the row between two lines whose rays cross other surfaces, for halving
    /// alone.
    hidden_crossing: f64,
}

impl Estimate {
    /// Squared error, of bends beyond those that random samples of this squared error show, and of these.
    fn square(&self, drawn: Option<f64>) -> f64 {
        let drawn = drawn.unwrap_or(0.0);
        (self.bends * self.bends - NOISE * drawn).max(0.0) + drawn
    }
}

/// Light at both ends of an interval.
#[derive(Debug)]
struct Rise<'a> {
    /// Light, and light times displacement along x, each at the upper and lower end.
    values: [[Values<'a>; 2]; 2],
    moved: [&'a [f32]; 2],
    farthest: f64,
    /// Rays of the two lines cross other surfaces.
    is_broken: bool,
    /// Height of the interval, rows.
    height: f64,
}

/// Value that is judged: its kind and place among [`Rise::values`].
#[derive(Debug, Clone, Copy)]
struct Value {
    kind: usize,
    place: i64,
}

impl Rise<'_> {
    /// A value at the upper and lower end.
    fn ends(&self, Value { kind, place }: Value) -> [f64; 2] {
        self.values[kind].map(|it| it.at(place))
    }

    /// Change of a value per row.
    fn slope(&self, value: Value) -> f64 {
        let [upper, lower] = self.ends(value);
        (lower - upper) / self.height
    }
}

/// Heights of the two lines at each jump of light within a row; none if there are too many.
fn jumps(ends: &[[f64; 2]], least: f64) -> Vec<[f64; 2]> {
    let near = |[low, high]: &[f64; 2]| *low < 1.0 + least && *high > -least;
    let ranges = ends.iter().filter(|range| near(range));
    let mut ranges: Vec<[f64; 2]> = ranges.map(|[low, high]| [low - least, high + least]).collect();
    ranges.sort_unstable_by(|a, b| a[0].total_cmp(&b[0]));
    let mut joined: Vec<[f64; 2]> = Vec::new();
    for range in ranges {
        match joined.last_mut().filter(|last| range[0] <= last[1]) {
            Some(last) => last[1] = last[1].max(range[1]),
            None => joined.push(range),
        }
    }
    joined.retain(|[low, high]| high - low <= FLAT + 2.0 * least);
    if joined.len() > MOST_JUMPS { Vec::new() } else { joined }
}

#[cfg(test)]
mod tests;
