//! Neighbouring segments that are as good as one: at rims facets cut a line into hundreds.

use super::{Aim, Point, STEEPEST, Segment};
use crate::gpu::interface::{FLAG_EXACT, Law};
use crate::trace::moments::grazing;

/// Segments are made one up to this share of the period.
const WIDEST: f64 = 1.0 / 20.0;
/// A run of this share of the period may deviate from a straight line by what is blurred away;
/// wider ones by less, in proportion.
const FULL: f64 = 1.0 / 80.0;

/// Numbers of a law that light goes by: optical depth, displacement and slope along x and z.
pub(in crate::trace) type Numbers = [f64; 5];

/// The straight law closest to those of a run of segments.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::trace) struct Fit {
    /// At its low and its high end.
    pub(in crate::trace) ends: [Numbers; 2],
    /// Variance of the displacement along x about it, m2.
    pub(in crate::trace) spread: f32,
}

/// Numbers of a law, in the order of a ray's moments.
pub(in crate::trace) fn numbers(law: &Law) -> Numbers {
    [law.optical_depth, law.displacement_x, law.displacement_z, law.slope_x, law.slope_z]
        .map(f64::from)
}

/// Integrals of a piecewise linear function over a run, x from its low end.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Integrals {
    value: f64,
    times_x: f64,
    square: f64,
}

impl Integrals {
    pub(crate) fn add(&mut self, [a, b]: [f64; 2], [at_a, at_b]: [f64; 2]) {
        let width = b - a;
        self.value += width * 0.5 * (at_a + at_b);
        self.times_x += width / 6.0 * (2.0 * a * at_a + a * at_b + b * at_a + 2.0 * b * at_b);
        self.square += width / 3.0 * (at_a * at_a + at_a * at_b + at_b * at_b);
    }

    /// Ends of the straight line closest over [0, width], and the mean square that it leaves.
    pub(crate) fn line(&self, width: f64) -> ([f64; 2], f64) {
        let mean = self.value / width;
        let rise = 12.0 * (self.times_x - 0.5 * width * self.value) / (width * width);
        let left = self.square / width - mean * mean - rise * rise / 12.0;
        ([mean - 0.5 * rise, mean + 0.5 * rise], left.max(0.0))
    }
}

/// Segments that follow one another, of one signature, from the first of some on.
struct Run<'s> {
    segments: &'s [Segment],
    /// How many of them.
    count: usize,
    /// Of the displacement along x and z.
    sums: [Integrals; 2],
}

impl<'s> Run<'s> {
    fn of(segments: &'s [Segment]) -> Self {
        let sums = Default::default();
        let mut run = Self { segments, count: 1, sums };
        run.sums = run.with(&segments[0]);
        run
    }

    /// Ends of one of the segments, from the low end of the run.
    fn ends(&self, segment: &Segment) -> [f64; 2] {
        let first = f64::from(self.segments[0].low.x);
        [segment.low.x, segment.high.x].map(|x| f64::from(x) - first)
    }

    fn with(&self, segment: &Segment) -> [Integrals; 2] {
        let (low, high) = (&segment.low.law, &segment.high.law);
        let x = self.ends(segment);
        let mut sums = self.sums;
        sums[0].add(x, [low.displacement_x, high.displacement_x].map(f64::from));
        sums[1].add(x, [low.displacement_z, high.displacement_z].map(f64::from));
        sums
    }

    /// Takes the next segment, if it belongs to the run.
    fn grow(&mut self, aim: &Aim) -> bool {
        let Some(next) = self.segments.get(self.count) else { return false };
        let first = &self.segments[0];
        let alike = |p: &Point| {
            p.is_like(&first.low)
                && (p.law.flags & FLAG_EXACT == 0 || grazing(&p.law) >= aim.severe)
                && (p.law.optical_depth - first.low.law.optical_depth).abs() <= STEEPEST
        };
        let [_, width] = self.ends(next);
        let ends = [&next.low, &next.high, &first.low, &first.high];
        if width > WIDEST * f64::from(aim.period) || !ends.into_iter().all(alike) {
            return false;
        }
        let sums = self.with(next);
        let limit = aim.residual * (FULL * f64::from(aim.period) / width).min(1.0);
        let fits = sums.iter().all(|sum| sum.line(width).1 <= limit * limit);
        if fits {
            (self.sums, self.count) = (sums, self.count + 1);
        }
        fits
    }

    /// The run as one segment.
    #[allow(clippy::cast_possible_truncation, reason = "rounding to f32 is meant")]
    fn segment(&self) -> Segment {
        let (first, last) = (&self.segments[0], &self.segments[self.count - 1]);
        if self.count == 1 {
            return first.clone();
        }
        let [_, width] = self.ends(last);
        let mut sums = [Integrals::default(); 5];
        for segment in &self.segments[..self.count] {
            let [low, high] = [numbers(&segment.low.law), numbers(&segment.high.law)];
            for (sum, ends) in sums.iter_mut().zip(low.into_iter().zip(high)) {
                sum.add(self.ends(segment), ends.into());
            }
        }
        let lines = sums.map(|sum| sum.line(width));
        let fit = Fit {
            ends: [0, 1].map(|end| lines.map(|(ends, _)| ends[end])),
            spread: lines[1].1 as f32,
        };
        Segment { low: first.low, high: last.high, fit: Some(Box::new(fit)) }
    }
}

/// Segments with runs of them made one.
pub(super) fn runs(aim: &Aim, segments: &[Segment]) -> Vec<Segment> {
    let mut made = Vec::new();
    let mut rest = segments;
    while !rest.is_empty() {
        let mut run = Run::of(rest);
        while run.grow(aim) {}
        made.push(run.segment());
        rest = &rest[run.count..];
    }
    made
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_run_of_one_line_is_that_line_and_steps_leave_their_variance() {
        let mut sum = Integrals::default();
        for (a, b) in [(0.0, 0.5), (0.5, 0.6), (0.6, 2.0)] {
            sum.add([a, b], [2.0 * a + 1.0, 2.0 * b + 1.0]);
        }
        let ([low, high], left) = sum.line(2.0);
        assert!((low - 1.0).abs() < 1e-12 && (high - 5.0).abs() < 1e-12, "{low} {high}");
        assert!(left < 1e-12, "{left}");

        // A step of height 1 in the middle: the closest line rises by 1.5 and leaves 1/16.
        let mut sum = Integrals::default();
        sum.add([0.0, 1.0], [0.0, 0.0]);
        sum.add([1.0, 2.0], [1.0, 1.0]);
        let ([low, high], left) = sum.line(2.0);
        assert!((high - low - 1.5).abs() < 1e-12, "{low} {high}");
        assert!((left - 1.0 / 16.0).abs() < 1e-12, "{left}");
    }
}
