//! Estimated errors of the intervals between lines, by the bends of light.

use super::{Heights, Judged, LEAST_OF_RAYS, Moved, Uneven};
use crate::lines::line::PER_JUMP;
use crate::lines::window_light::{Values, places};

/// Part of the larger of both bends of an interval that counts, per height of the interval beside where that is lower:
/// a jump in that interval bends light, too, and three lines may be in line by chance.
const PER_LARGER: f64 = 0.25;
/// Least bend of an interval that has one beside it over the slope of its light: three lines may be in line by chance;
/// with 1/4 light that changes evenly takes more lines
/// (`light_that_changes_evenly_takes_few_lines_and_fills_windows_exactly`).
const PER_SLOPE: f64 = 1.0 / 6.0;
/// Square of the bend of independent lines, of the worst of many values, over the square of their error: the second
/// difference has a standard deviation of 0.29·√6 of it, and the largest of some dozens of values is 2.5 deviations off.
const NOISE: f64 = 3.2;

/// Estimated error of an interval.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Estimate {
    /// Error that the bends of its light show.
    bends: f64,
    /// Error by light that may cross a border of the row between two lines whose rays cross other surfaces, for halving
    /// alone.
    pub(super) hidden_crossing: f64,
}

impl Estimate {
    /// Squared error, of bends beyond those that random samples of this squared error show, and of these.
    pub(super) fn square(&self, drawn: Option<f64>) -> f64 {
        let drawn = drawn.unwrap_or(0.0);
        (self.bends * self.bends - NOISE * drawn).max(0.0) + drawn
    }
}

/// Light at both ends of an interval.
#[derive(Debug)]
struct Rise<'a> {
    /// Light, and light times displacement along x, each at the upper and lower end.
    values: [[Values<'a>; 2]; 2],
    moved: [&'a [Moved]; 2],
    farthest: f64,
    /// Rays of the two lines cross other surfaces.
    is_broken: bool,
    /// Upper end, rows below the upper border.
    top: f64,
    /// Height of the interval, rows.
    height: f64,
}

/// Errors of light that crosses a border of the row.
#[derive(Debug, Clone, Copy, Default)]
struct Crossing {
    /// Error that lines show.
    error: f64,
    /// Error by light between two lines whose rays cross different surfaces, for halving alone.
    hidden: f64,
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

    /// True if one of some heights, in their order, lies in it.
    fn within(&self, heights: &[f64]) -> bool {
        let first = heights.partition_point(|z| *z <= self.top);
        heights.get(first).is_some_and(|z| *z < self.top + self.height)
    }

    /// Most light of a window at either end.
    fn most_light(&self) -> f32 {
        self.values[0].into_iter().flat_map(|it| it.values).fold(0.0, |most, it| most.max(*it))
    }

    /// Change of a value per row.
    fn slope(&self, value: Value) -> f64 {
        let [upper, lower] = self.ends(value);
        (lower - upper) / self.height
    }
}

impl<L: Judged + Clone> Heights<L> {
    /// Estimate for the interval below a line: by the worst bend of a value of its light.
    pub(super) fn estimate_of(&self, at: usize) -> Estimate {
        let Some(own) = self.rise(at) else { return Estimate::default() };
        // Light beyond a jump has nothing to do with light before it.
        let beside = |at: usize| Some(at).filter(|at| !self.lines[*at].jumps);
        let above = at.checked_sub(1).and_then(beside).and_then(|at| self.rise(at));
        let below = beside(at + 1).and_then(|at| self.rise(at));
        let rises = || above.iter().chain([&own]).chain(&below);
        // Light changes at heights that no line has: as much as it changes from line to line.
        let is_scattered = own.within(&self.left);
        let (mut worst, mut most, mut change) = (0.0_f64, 0.0_f64, 0.0_f64);
        for kind in 0..own.values.len() {
            for place in places(rises().flat_map(|it| it.values[kind])) {
                let value = Value { kind, place };
                let slope = own.slope(value);
                if is_scattered {
                    let scatter = |it: &Rise<'_>| it.slope(value).abs() * it.height / own.height;
                    worst = rises().map(scatter).fold(worst, f64::max);
                }
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
            }
        }
        let uneven = self.limits.uneven.error(own.height) * change;
        let bends = (PER_JUMP * own.height * own.height * worst).hypot(uneven);
        let bends = bends.max(most * self.error_of_creases(at));
        let crossing = self.crossing(at, &own, [above, below]);
        Estimate { bends: bends.hypot(crossing.error), hidden_crossing: crossing.hidden }
    }

    /// Error of the interval below a line by the creases within, over its light: each bends light at one place, and they
    /// count as independent.
    fn error_of_creases(&self, at: usize) -> f64 {
        let [low, high] = [self.lines[at].z, self.lines[at + 1].z];
        let first = self.creases.partition_point(|it| it.z <= low);
        let within = self.creases[first..].iter().take_while(|it| it.z < high);
        within
            .map(|it| (0.5 * it.weight * (it.z - low) * (high - it.z)).powi(2))
            .sum::<f64>()
            .sqrt()
    }

    /// Errors of light that displacement takes over the borders of the row: where the displaced light of an interval
    /// near a border jumps, as much may cross it as the interval has light near the border.
    fn crossing(&self, at: usize, own: &Rise<'_>, beside: [Option<Rise<'_>>; 2]) -> Crossing {
        // Random samples that are reflected go anywhere: their own variance tells what crosses.
        if own.moved[0].is_empty() || self.is_random {
            return Crossing::default();
        }
        let cut = self.limits.uneven == Uneven::Apertures;
        // Apertures that end along z end anywhere in the row.
        let border = if cut { 0.0 } else { self.lines[at].z.min(1.0 - self.lines[at + 1].z) };
        let moved = || own.moved.into_iter().flatten();
        // Light of all windows; errors are those of one.
        let in_one =
            f64::from(own.most_light() / moved().fold(f32::MIN_POSITIVE, |m, it| m.max(it.light)));
        let in_one = in_one.min(1.0);
        let hides = own.is_broken && own.height > LEAST_OF_RAYS;
        let hidden = |it: &Moved| self.crossing_light(own.height, it, border);
        let hidden = if hides { in_one * moved().map(hidden).fold(0.0, f64::max) } else { 0.0 };
        // Light may be displaced farther between two lines than at either.
        let farthest = self.limits.reach + 2.0 * own.farthest;
        if border >= farthest && !cut {
            return Crossing { error: 0.0, hidden };
        }
        let slope = |it: &Rise<'_>, step: usize| {
            f64::from(it.moved[1][step].displaced - it.moved[0][step].displaced) / it.height
        };
        let jump = |step: usize| {
            let slope_of_own = slope(own, step);
            let bends = beside.iter().flatten().map(|it| (slope(it, step) - slope_of_own).abs());
            own.height * bends.fold(f64::INFINITY, f64::min).min(f64::MAX)
        };
        let alone = beside.iter().all(Option::is_none);
        let most = (0..own.moved[0].len())
            .map(|step| if alone { own.height * slope(own, step).abs() } else { jump(step) });
        let mean = |it: &Moved| f64::from(it.distance / it.light.max(f32::MIN_POSITIVE));
        let mean = moved().map(mean).fold(0.0, f64::max);
        // Most of the light stays nearer than the farthest, and little crosses a border that is far from most of it.
        let reach = (self.limits.reach + mean).max(border).max(f64::MIN_POSITIVE);
        let near = (own.height / reach).min(1.0);
        Crossing { error: PER_JUMP * in_one * most.fold(0.0, f64::max) * near, hidden }
    }

    /// Light that may cross a border at a distance, from an interval of which one end has this light: its surface may end
    /// anywhere in the interval, and displacement grows with the inverse root of the distance to that end. In rows.
    fn crossing_light(&self, height: f64, moved: &Moved, border: f64) -> f64 {
        let [light, distance, square] = [moved.light, moved.distance, moved.square].map(f64::from);
        let blur = self.limits.reach.max(f64::MIN_POSITIVE);
        let beyond = (border - blur).max(f64::MIN_POSITIVE);
        // Light that is displaced by more than z: d² h / z² of it.
        let farther =
            libm::cbrt(light * light * square * height).min(square * height / (beyond * beyond));
        // Light that is displaced by a part of the blur.
        let blurred = 2.0 * distance * (height / blur).min((height / blur).sqrt());
        farther.min(blurred).min(light * height)
    }

    /// Light at the ends of the interval below a line.
    fn rise(&self, at: usize) -> Option<Rise<'_>> {
        let light = |at: usize| self.lines.get(at)?.light.as_ref();
        let ends = [light(at)?, light(at + 1)?].map(L::judged);
        let farthest = ends[0].farthest.max(ends[1].farthest);
        let is_broken = ends[0].structure != ends[1].structure;
        let moved = ends.map(|it| it.moved);
        let displaced = ends.map(|it| Values {
            first: 0,
            values: if self.light_alone { &[] } else { it.displaced },
        });
        let values = [ends.map(|it| it.values), displaced];
        let top = self.lines[at].z;
        Some(Rise { values, moved, farthest, is_broken, top, height: self.height(at) })
    }
}
