//! Heights of the lines of a beamlet and row: intervals of z are cut in three until their light is that between
//! their neighbours.

use super::grazing::GrazingPart;
use super::line::Line;

/// Share of the tolerance that the heights of the lines of a patch take: the rest is the spacing's.
const SHARE: f64 = 0.4;
/// Error of an interval over its deviation from its neighbours: a twelfth for smooth light, a third at the end of a
/// body.
const PER_DEVIATION: f64 = 1.0 / 3.0;
/// Height of the intervals at the borders of a row, where a body may end unseen.
const BORDER: f64 = 1.0 / 27.0;
/// Least height of an interval.
const LEAST: f64 = 1.0 / 729.0;

/// Interval of z within a row, with a line in its middle.
#[derive(Debug, Clone)]
pub(super) struct Interval {
    /// Ends within the row, 0..1 downwards.
    pub ends: [f64; 2],
    /// Light of its line, `[step][pixel]`; none before it is traced.
    pub light: Vec<f32>,
    /// Parts of the line near grazing.
    pub grazing: Vec<GrazingPart>,
}

impl Interval {
    const fn new(ends: [f64; 2]) -> Self {
        Self { ends, light: Vec::new(), grazing: Vec::new() }
    }

    /// Height, rows.
    pub(super) const fn height(&self) -> f64 {
        self.ends[1] - self.ends[0]
    }

    /// Height of its line, within the row.
    pub(super) const fn middle(&self) -> f64 {
        f64::midpoint(self.ends[0], self.ends[1])
    }
}

/// Lines of a beamlet and row.
#[derive(Debug, Clone)]
pub(super) struct Patch {
    /// Beamlet of the lattice.
    pub beamlet: i64,
    /// Row of the detector.
    pub row: i64,
    /// Intervals, which cover the row.
    pub intervals: Vec<Interval>,
}

/// Errors and lines that a patch may have.
#[derive(Debug, Clone, Copy)]
pub(super) struct Limits {
    /// Error of light, share of open beam.
    pub tolerance: f64,
    /// Most lines.
    pub lines: usize,
}

impl Patch {
    /// A patch before its first line, with `parts` intervals between the two at its borders; one in all for 0,
    /// where bodies are the same at all heights.
    pub(super) fn new(beamlet: i64, row: i64, parts: u32) -> Self {
        if parts == 0 {
            return Self { beamlet, row, intervals: vec![Interval::new([0.0, 1.0])] };
        }
        let height = (1.0 - 2.0 * BORDER) / f64::from(parts);
        let end = |part: u32| BORDER + f64::from(part) * height;
        let inner = (0..parts).map(|part| [end(part), end(part + 1)]);
        let all = [[0.0, BORDER]].into_iter().chain(inner).chain([[1.0 - BORDER, 1.0]]);
        Self { beamlet, row, intervals: all.map(Interval::new).collect() }
    }

    /// The interval nearest to the middle of the row.
    pub(super) fn middle(&self) -> &Interval {
        &self.intervals[self.intervals.len() / 2]
    }

    /// Lines that are to be traced; none if it is done.
    pub(super) fn next_lines(&self) -> Vec<Line> {
        let wanted = self.intervals.iter().filter(|it| it.light.is_empty());
        let line =
            |it: &Interval| Line { beamlet: self.beamlet, row: self.row as f64 + it.middle() };
        wanted.map(line).collect()
    }

    /// Takes the parts near grazing of these lines, before their other light.
    pub(super) fn take_grazing(&mut self, of_lines: &mut [Vec<GrazingPart>]) {
        let wanted = self.intervals.iter_mut().filter(|it| it.light.is_empty());
        wanted.zip(of_lines).for_each(|(it, parts)| it.grazing = std::mem::take(parts));
    }

    /// Takes the light of these lines, and cuts intervals that err too much.
    pub(super) fn take(&mut self, light: &[f32], values: usize, limits: Limits) {
        let wanted = self.intervals.iter_mut().filter(|it| it.light.is_empty());
        for (interval, light) in wanted.zip(light.chunks_exact(values)) {
            interval.light = light.to_vec();
        }
        let errs = |at: &usize| {
            let height = self.intervals[*at].height();
            height > LEAST && self.error_of(*at) > SHARE * limits.tolerance * height.sqrt()
        };
        let cut: Vec<usize> = (0..self.intervals.len()).filter(errs).collect();
        if self.intervals.len() + 2 * cut.len() > limits.lines {
            return;
        }
        for at in cut.into_iter().rev() {
            let [top, middle, bottom] = thirds(self.intervals[at].ends);
            self.intervals[at].ends = middle;
            self.intervals.insert(at + 1, Interval::new(bottom));
            self.intervals.insert(at, Interval::new(top));
        }
    }

    /// Estimated error of an interval, share of open beam: by the light on the line through its neighbours.
    fn error_of(&self, at: usize) -> f64 {
        let last = self.intervals.len() - 1;
        if last == 0 {
            return 0.0;
        }
        // At a border of the row the neighbours are on one side.
        let [a, b] = match at {
            0 => [1, 2.min(last)],
            _ if at == last => [last - 1, last.saturating_sub(2)],
            _ => [at - 1, at + 1],
        }
        .map(|at| &self.intervals[at]);
        let own = &self.intervals[at];
        let share = (own.middle() - a.middle()) / (b.middle() - a.middle());
        let deviation = |((own, a), b): ((&f32, &f32), &f32)| {
            let [own, a, b] = [own, a, b].map(|value| f64::from(*value));
            (own - a - share * (b - a)).abs()
        };
        let light = own.light.iter().zip(&a.light).zip(&b.light);
        // Extrapolation exaggerates.
        let reach = share.abs().max((1.0 - share).abs()).max(1.0);
        light.map(deviation).fold(0.0, f64::max) * own.height() * PER_DEVIATION / reach
    }

    /// Estimated error by the heights of its lines, share of open beam.
    pub(super) fn error(&self) -> f64 {
        let errors = (0..self.intervals.len()).map(|at| self.error_of(at));
        errors.map(|error| error * error).sum::<f64>().sqrt()
    }
}

fn thirds([top, bottom]: [f64; 2]) -> [[f64; 2]; 3] {
    let third = (bottom - top) / 3.0;
    [[top, top + third], [top + third, bottom - third], [bottom - third, bottom]]
}

#[cfg(test)]
mod tests {
    use super::*;
    use beamlet_core::numbers::single;

    /// Mean light over a patch whose light is a function of the height.
    fn integrate(of: impl Fn(f64) -> f64, limits: Limits) -> (Patch, f64) {
        let mut patch = Patch::new(0, 7, 1);
        loop {
            let lines = patch.next_lines();
            if lines.is_empty() {
                break;
            }
            let light: Vec<f32> = lines.iter().map(|it| single(of(it.row - 7.0))).collect();
            patch.take(&light, 1, limits);
        }
        let mean = patch.intervals.iter().map(|it| it.height() * f64::from(it.light[0])).sum();
        (patch, mean)
    }

    const LIMITS: Limits = Limits { tolerance: 1e-4, lines: 1000 };

    #[test]
    fn light_that_changes_evenly_takes_three_lines() {
        let (patch, mean) = integrate(|z| 0.25 + 0.1 * z, LIMITS);
        assert_eq!(patch.intervals.len(), 3);
        assert!((mean - 0.3).abs() < 1e-7 && patch.error() < 1e-7);
    }

    #[test]
    fn lines_follow_edges_that_cross_a_row_within_the_tolerance() {
        for slope in [1.0, 9.0, 30.0] {
            let (patch, mean) = integrate(|z| 0.1 * (slope * z).sin(), LIMITS);
            let error = (mean - 0.1 * (1.0 - f64::cos(slope)) / slope).abs();
            let lines = patch.intervals.len();
            assert!(error < 3e-5, "{slope}: {error:e}, {lines} lines");
            assert!(error < patch.error(), "{slope}: {error:e} {:e}", patch.error());
        }
    }

    #[test]
    fn lines_find_ends_of_bodies_within_the_tolerance() {
        for end in [0.03, 0.13, 0.34, 0.377, 0.5, 0.66, 0.95] {
            let (patch, mean) = integrate(|z| if z < end { 0.02 } else { 0.0 }, LIMITS);
            let (error, lines) = ((mean - 0.02 * end).abs(), patch.intervals.len());
            assert!(error < 1e-4 && lines < 40, "{end}: {error:e}, {lines} lines");
            assert!(error < 3.0 * patch.error(), "{end}: {error:e} {:e}", patch.error());
        }
    }

    #[test]
    fn lines_do_not_exceed_their_number_and_the_estimate_exceeds_the_tolerance() {
        let limits = Limits { lines: 9, ..LIMITS };
        let (patch, _) = integrate(|z| (20.0 * z).sin(), limits);
        let estimate = patch.error();
        assert!(patch.intervals.len() <= 9 && estimate > 1000.0 * limits.tolerance);
    }
}
