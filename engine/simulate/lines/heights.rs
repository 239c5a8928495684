//! Heights of the lines of a beamlet and row: the closed rule over z.
//!
//! Light along z is linear between two lines, so a row sums to trapezoids, and what a window along z (blurred rows,
//! apertures that end along z) receives is the integral of that linear light in closed form. Lines lie at both
//! borders of the row, where the row beside has the same line, and between; an interval between two lines is halved
//! until the bends of its light are within the tolerance. A height at which light jumps has two lines, just above and
//! just below it.

mod draws;
mod estimate;
mod features;
mod first;
mod moved;

use super::window_light::Values;
pub(crate) use draws::Draws;
use estimate::Estimate;
use features::Crease;
pub(crate) use features::Features;
use first::FirstHeights;
pub(crate) use moved::Moved;

/// Part of the squared limit of errors that intervals which stay whole may have: where a few jumps have most of the
/// error, halving all others is in vain.
const WHOLE: f64 = 0.3;
/// [`Limits::least`] of lines of rays: above the rounding of rays 1,000 rows off the axis (6e-5), and a jump that is missed
/// errs by less than 2e-4 of it (`jumps_at_known_heights_take_two_lines`).
pub(crate) const LEAST_OF_RAYS: f64 = 1.0 / 4096.0;
/// Light of a line, as heights are judged by it.
pub(crate) trait Judged {
    fn judged(&self) -> JudgedLight<'_>;
}

/// Properties of the light of a line by which heights are judged.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct JudgedLight<'a> {
    /// Recorded values.
    pub values: Values<'a>,
    /// Light times its displacement along x, of each mask step, as an error of light; none where that does not count.
    pub displaced: &'a [f32],
    /// Light that is displaced along z, of each mask step; none where light stays in its row.
    pub moved: &'a [Moved],
    /// Largest displacement of the light, rows.
    pub farthest: f64,
    /// Hash of the surfaces that its rays cross, in their order.
    pub structure: u32,
    /// Its rays that are random samples; nothing where that is unknown.
    pub draws: Option<Draws>,
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
    /// Height whose light may be lost, rows.
    pub thin: f64,
    /// Distance of a line from a critical height, rows: rays of f32 at the height itself meet the surface by chance.
    pub beside: f64,
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
    /// Places at which light bends, in the order of z.
    creases: Vec<Crease>,
    /// Heights that light may change at without a first line, in the order of z.
    left: Vec<f64>,
}

impl<L> Placed<L> {
    /// A line without its light.
    const fn new(z: f64) -> Self {
        Self { z, light: None, jumps: false, estimate: None }
    }
}

impl<L: Judged + Clone> Heights<L> {
    /// Lines of a row without their light; within their number, but for the three that an estimate needs.
    pub(crate) fn new(features: &Features, limits: Limits) -> Self {
        let first = FirstHeights::new(features, limits);
        let place = |z: &f64| Placed { jumps: first.jumps_at(*z), ..Placed::new(*z) };
        let lines = first.heights.iter().map(place).collect();
        let (rough, creases, left) = (features.rough, features.creases.clone(), first.left);
        Self { lines, limits, rough, is_random: false, light_alone: false, creases, left }
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
            self.is_random |=
                self.rough && light.judged().draws.is_none_or(|draws| draws.are_any());
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
            self.lines.insert(at + 1, Placed::new(z));
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
        let draws = self.squares_of_draws();
        let error = |(at, it): (usize, &Estimate)| {
            it.square(draws.get(at).copied()).sqrt().max(it.hidden_crossing)
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

    /// Light of a line.
    pub(crate) fn line(&self, at: usize) -> Option<&L> {
        self.lines.get(at)?.light.as_ref()
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
    pub(crate) fn at(&self, z: f64) -> impl Iterator<Item = (usize, f64)> {
        let below = self.lines.partition_point(|line| line.z <= z);
        let (upper, lower) = (below.saturating_sub(1), below.min(self.lines.len() - 1));
        let height = self.lines[lower].z - self.lines[upper].z;
        let share = if height > 0.0 { (z - self.lines[upper].z) / height } else { 0.0 };
        let share = if self.limits.uneven == Uneven::Never { share } else { share.round() };
        [(upper, 1.0 - share), (lower, share)].into_iter().filter(|(_, share)| *share > 0.0)
    }

    /// Intervals of z between lines and beyond the outer ones, rows below the upper border, with their estimated errors.
    pub(crate) fn intervals(&self) -> Vec<Interval> {
        let z = |at: usize| self.lines[at].z;
        let last = self.lines.len() - 1;
        let squares = self.squares().enumerate();
        let between =
            squares.map(|(at, square)| Interval { z: [z(at), z(at + 1)], error: square.sqrt() });
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
        self.squares().sum::<f64>().sqrt()
    }

    /// Squared errors of the intervals between lines.
    fn squares(&self) -> impl Iterator<Item = f64> {
        let draws = self.squares_of_draws();
        let square = move |(at, it): (usize, Estimate)| it.square(draws.get(at).copied());
        self.estimates().enumerate().map(square)
    }

    /// Squared errors of the intervals by random samples; none where there are no samples.
    fn squares_of_draws(&self) -> Vec<f64> {
        let of = |line: &Placed<L>| {
            line.light.as_ref().and_then(|light| light.judged().draws).unwrap_or_default()
        };
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

#[cfg(test)]
mod tests;
