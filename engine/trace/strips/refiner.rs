//! Lines of a view traced together; whether a span needs cutting; the cells of a span.

#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    clippy::cast_possible_wrap,
    reason = "counts and indices are bounded by the scene's validation; rounding to f32 is meant"
)]

use super::moments::{CellMoments, ExactCell};
use super::neighbours::Wanted;
use super::{Key, Span, View, empty_strip, units};
use crate::Result;
use crate::gpu::interface::{Cell, FLAG_EXACT, FLAG_NOT_FINITE, Law, Ray, Strip};
use crate::trace::line::{
    Aim, Asks, DEPTH_TOLERANCE, Edge, Line, Narrow, Seen, first_places, without_narrow,
};
use crate::trace::tracer::Tracer;
use rayon::prelude::*;
use std::collections::HashMap;
use std::ops::Range;
use std::sync::Arc;

/// Silhouettes of neighbouring lines may differ by this share of a period.
const EDGE_SHARE: f32 = 1.0 / 20.0;

/// Displacements in a cell may differ from a straight line by this share of the blur, standard
/// deviation. It is added to the blur; what an edge of an aperture cuts out of a cell may lean by
/// as much.
const RESIDUAL_SHARE: f64 = 0.1;

/// Light between the rays of smooth lines lands at most so many times as far off as theirs.
const BETWEEN: f32 = 2.0;

/// The cells of one span.
pub(super) struct SpanCells {
    pub(super) strip: Strip,
    pub(super) cells: Vec<Cell>,
    pub(super) moments: CellMoments,
    /// Rows, relative to its own, where it lands.
    pub(super) lands: Range<i64>,
    pub(super) landed_off: u64,
    pub(super) not_finite: u64,
}

/// Traces lines of a view, and judges and cuts spans by them.
pub(super) struct Refiner<'a> {
    pub(super) view: &'a View<'a>,
    pub(super) aim: Aim,
    units: i64,
    /// Distance from analyser to detector, m, and analyser over detector distance.
    gap: f32,
    ratio: f32,
    row_pitch: f32,
    /// How much farther than its law says light may land, at another energy.
    stronger: f64,
}

impl<'a> Refiner<'a> {
    pub(super) fn new(view: &'a View<'a>) -> Self {
        let scene = view.scene;
        let analyser = scene.analyser_distance();
        Self {
            view,
            aim: Aim {
                period: view.lattice.period as f32,
                cells: view.lattice.cells,
                tolerance: scene.sampling.tolerance as f32,
                residual: (RESIDUAL_SHARE * view.lattice.edge_blur).max(scene.sampling.tolerance),
                severe: view.keep.map_or(0.0, |keep| keep.severe),
            },
            units: units(view),
            gap: (scene.detector.distance - analyser) as f32,
            ratio: (analyser / scene.detector.distance) as f32,
            row_pitch: scene.detector.pitch[1] as f32,
            stronger: view.keep.map_or(1.0, |keep| keep.stronger),
        }
    }

    fn row(&self, at: i64) -> f64 {
        at as f64 / self.units as f64
    }

    /// Components that may hide between the rays of a line.
    fn narrow(&self, key: &Key) -> Vec<Narrow> {
        let cell = self.view.lattice.period / f64::from(2 * self.aim.cells);
        let centre = self.view.lattice.centre(key.0);
        let row = self.row(key.1);
        let half = self.view.lattice.period / 2.0;
        self.view
            .shadows
            .iter()
            .filter(|s| {
                s.width < 2.0 * cell
                    && s.rows[0] <= row
                    && s.rows[1] >= row
                    && s.x[0] < centre + half
                    && s.x[1] > centre - half
            })
            .map(|s| Narrow {
                x: [(s.x[0] - centre) as f32, (s.x[1] - centre) as f32],
                width: s.width as f32,
            })
            .collect()
    }

    pub(super) fn ray(&self, key: &Key, x: f32) -> Ray {
        self.view.lattice.ray(key.0, f64::from(x), self.row(key.1), self.view.index)
    }

    /// Traces lines together, as far as it takes to tell whether they agree.
    pub(super) fn see_lines(
        &self,
        tracer: &mut Tracer,
        keys: &[Key],
        lines: &mut HashMap<Key, Arc<Seen>>,
    ) -> Result<()> {
        let places = first_places(self.aim.period, self.aim.cells);
        let wanted: Vec<Wanted> = keys.iter().map(|key| (*key, places.clone())).collect();
        let laws = self.trace_places(tracer, &wanted)?;
        let begin =
            |(key, laws): (&Key, &[Law])| (*key, Seen::begin(&self.aim, self.narrow(key), laws));
        let mut work: Vec<(Key, Seen)> =
            keys.par_iter().zip(laws.par_chunks(places.len())).map(begin).collect();
        self.answer(tracer, &mut work)?;
        lines.extend(work.into_iter().map(|(key, line)| (key, Arc::new(line))));
        Ok(())
    }

    /// Refines the middle lines of spans, which leave the lines seen.
    pub(super) fn refine_lines(
        &self,
        tracer: &mut Tracer,
        spans: &[Span],
        lines: &mut HashMap<Key, Arc<Seen>>,
    ) -> Result<Vec<Line>> {
        // A middle is no other span's line.
        let mut seen =
            |span: &Span| Some((span.key(), Arc::unwrap_or_clone(lines.remove(&span.key())?)));
        let seen: Vec<(Key, Seen)> = spans.iter().filter_map(&mut seen).collect();
        assert_eq!(seen.len(), spans.len(), "every middle line was seen, and stands once");
        let refine = |(key, seen)| (key, Line::refine(&self.aim, seen));
        let mut work: Vec<(Key, Line)> = seen.into_par_iter().map(refine).collect();
        self.answer(tracer, &mut work)?;
        Ok(work.into_iter().map(|(_, line)| line).collect())
    }

    /// Traces what lines ask for until they ask no more, all together, so that the device gets
    /// many rays at a time.
    fn answer<L: Asks + Send + Sync>(
        &self,
        tracer: &mut Tracer,
        work: &mut [(Key, L)],
    ) -> Result<()> {
        loop {
            let asking = work.par_iter().filter(|(_, line)| !line.rays().open.is_empty());
            let wanted: Vec<Wanted> =
                asking.map(|(key, line)| (*key, line.rays().wanted().collect())).collect();
            if wanted.is_empty() {
                return Ok(());
            }
            let laws = self.trace_places(tracer, &wanted)?;
            let mut rest = &laws[..];
            let mut asking = Vec::new();
            for (_, line) in work.iter_mut().filter(|(_, line)| !line.rays().open.is_empty()) {
                let (given, after) = rest.split_at(line.rays().open.len());
                rest = after;
                asking.push((line, given));
            }
            asking.into_par_iter().for_each(|(line, laws)| line.give(&self.aim, laws));
        }
    }

    /// Whether the middle line stands for the whole span.
    pub(super) fn agrees(&self, span: &Span, lines: &HashMap<Key, Arc<Seen>>) -> bool {
        let [low, middle, high] = span.keys().map(|k| &lines[&k]);
        let height = (self.row(span.high) - self.row(span.low)) as f32;
        if self.may_hide(span, height) {
            return false;
        }
        if low.is_empty() && middle.is_empty() && high.is_empty() {
            return true;
        }
        let limit = self.aim.period * EDGE_SHARE;
        let half = self.aim.period / 2.0;
        let edges = &middle.edges;
        let wide = |edges: &[Edge]| without_narrow(edges, self.aim.period);
        let differs = |line: &Seen| {
            !edges_agree(&line.edges, edges, limit, half)
                && !edges_agree(&wide(&line.edges), &wide(edges), limit, half)
        };
        if differs(low) || differs(high) {
            return false;
        }
        // No silhouette crosses the lines, yet one may run between them.
        let centre = (self.aim.cells as usize).div_ceil(2);
        let signature = |line: &Seen| line.base(&self.aim).nth(centre).map(|law| law.signature);
        if edges.iter().all(|e| e.x.abs() >= half - limit)
            && [low, high].into_iter().any(|line| signature(line) != signature(middle))
        {
            return false;
        }
        let bend = |f: fn(&Law) -> f32| {
            let mut sum = 0.0;
            let [low, middle, high] = [low, middle, high].map(|line| line.base(&self.aim));
            let count = middle.len();
            for ((a, m), b) in low.zip(middle).zip(high) {
                let same = a.signature == m.signature && m.signature == b.signature;
                if same && (a.flags | m.flags | b.flags) & FLAG_NOT_FINITE == 0 {
                    sum += (f(m) - 0.5 * (f(a) + f(b))).abs();
                }
            }
            sum / count as f32 * height
        };
        bend(|l| l.displacement_x) <= self.aim.tolerance
            && bend(|l| l.optical_depth) <= DEPTH_TOLERANCE
            && bend(|l| l.displacement_z) <= 100.0 * self.aim.tolerance
    }

    /// Whether a span outside the lit rows is seen to throw no light into them.
    pub(super) fn misses(
        &self,
        span: &Span,
        lines: &HashMap<Key, Arc<Seen>>,
        lit: &Range<i64>,
    ) -> bool {
        let row = span.low.div_euclid(self.units);
        let height = (self.row(span.high) - self.row(span.low)) as f32;
        if lit.contains(&row) || self.may_hide(span, height) {
            return false;
        }
        let lines = span.keys().map(|key| &lines[&key]);
        let signature = |line: &Seen| line.base(&self.aim).next().map(|law| law.signature);
        if lines.iter().any(|line| signature(line) != signature(lines[1])) {
            return false;
        }
        let reaches = lines.map(|line| line.smooth_reach(self.gap));
        let reach = reaches.into_iter().try_fold(0.0, |most: f32, reach| Some(most.max(reach?)));
        reach.is_some_and(|reach| {
            let rows = f64::from(BETWEEN * reach / self.row_pitch) * self.stronger;
            let rows = rows.ceil() as i64;
            row + rows < lit.start || row - rows >= lit.end
        })
    }

    /// Whether a component lower than the span could pass between its lines.
    fn may_hide(&self, span: &Span, height: f32) -> bool {
        let (low, high) = (self.row(span.low), self.row(span.high));
        let centre = self.view.lattice.centre(span.beamlet);
        let half = self.view.lattice.period / 2.0;
        self.view.shadows.iter().any(|s| {
            f64::from(height) > 2.0 * s.height
                && s.rows[0] < high
                && s.rows[1] > low
                && s.x[0] < centre + half
                && s.x[1] > centre - half
        })
    }

    /// The cells of a span; `moments`: those of its segments ([`Self::end_moments`]).
    pub(super) fn cells(&self, span: &Span, line: &Line, moments: Vec<f32>) -> SpanCells {
        let row = span.low.div_euclid(self.units);
        let top = self.row(span.low) - row as f64;
        let bottom = self.row(span.high) - row as f64;
        let column = (span.beamlet - self.view.lattice.beamlets.start) as u32;
        let mut made = SpanCells {
            strip: Strip {
                top: top as f32,
                bottom: bottom as f32,
                ..empty_strip(i64::from(column), row)
            },
            cells: Vec::with_capacity(line.segments.len()),
            moments: CellMoments { ends: moments, exact: Vec::new() },
            lands: 0..1,
            landed_off: 0,
            not_finite: 0,
        };
        let middle = span.key();
        let words = made.moments.ends.len() / line.segments.len().max(1);
        for segment in &line.segments {
            let (low, high) = (&segment.low, &segment.high);
            if (low.law.flags | high.law.flags) & FLAG_NOT_FINITE != 0 {
                made.not_finite += 1;
                let first = made.cells.len() * words;
                made.moments.ends.drain(first..first + words);
                continue;
            }
            let ends = segment.ends().map(|numbers| numbers.map(|number| number as f32));
            let mean = |i: usize| 0.5 * (ends[0][i] + ends[1][i]);
            let displacement_z = mean(2) + mean(4) * self.gap;
            if displacement_z.abs() > self.view.lattice.halo as f32 * self.row_pitch {
                made.landed_off += 1;
            }
            let pixel_shift = mean(1) * (1.0 - self.ratio) - mean(3) * self.gap * self.ratio;
            let down = -f64::from(displacement_z / self.row_pitch);
            let farthest = down * self.stronger;
            made.lands.start = made.lands.start.min(farthest.floor() as i64);
            made.lands.end = made.lands.end.max(farthest.ceil() as i64 + 1);
            let [above, below] = self.view.lattice.row_shares(top, bottom, down);
            made.cells.push(Cell {
                x_low: low.x,
                x_high: high.x,
                depth_low: ends[0][0],
                depth_high: ends[1][0],
                displacement_low: ends[0][1],
                displacement_high: ends[1][1],
                displacement_z,
                above,
                below,
                pixel_shift,
                spread: segment.fit.as_ref().map_or(0.0, |fit| fit.spread),
                ..bytemuck::Zeroable::zeroed()
            });
            if self.view.keep.is_none() {
                continue;
            }
            let flags = low.law.flags | high.law.flags;
            if flags & FLAG_EXACT != 0 {
                made.moments.exact.push(ExactCell {
                    cell: made.cells.len() as u32 - 1,
                    ends: [low, high].map(|p| self.ray(&middle, line.rays.places[p.ray as usize])),
                    laws: segment.laws(),
                    range: [0.0, 1.0],
                });
            }
        }
        debug_assert_eq!(made.moments.ends.len(), made.cells.len() * words, "moments by cell");
        made
    }
}

/// Whether two lines have the same silhouettes within `limit`. One that stands that close to an
/// end of the period may be missing on the other line: it is in the neighbouring beamlet there.
fn edges_agree(a: &[Edge], b: &[Edge], limit: f32, half: f32) -> bool {
    let inner = |edges: &[Edge]| -> Vec<Edge> {
        edges.iter().filter(|e| e.x.abs() < half - limit).copied().collect()
    };
    let matched = |a: &[Edge], b: &[Edge]| {
        a.len() == b.len()
            && a.iter()
                .zip(b)
                .all(|(p, q)| p.signatures == q.signatures && (p.x - q.x).abs() <= limit)
    };
    matched(a, b) || matched(&inner(a), &inner(b))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn edges_that_move_too_far_do_not_agree() {
        let edge = |x: f32| Edge { x, signatures: [0, 7] };
        assert!(edges_agree(&[edge(1.0)], &[edge(1.5)], 1.0, 50.0));
        assert!(!edges_agree(&[edge(1.0)], &[edge(2.5)], 1.0, 50.0));
        assert!(!edges_agree(&[edge(1.0)], &[], 1.0, 50.0));
        assert!(edges_agree(&[edge(49.5)], &[], 1.0, 50.0));
    }

    #[test]
    fn a_strip_that_only_some_lines_see_is_no_difference() {
        let edge = |x: f32, signatures| Edge { x, signatures };
        let period = 160.0;
        let seen = [edge(1.0, [0, 7]), edge(2.0, [7, 9]), edge(40.0, [9, 0])];
        let wide = without_narrow(&seen, period);
        assert_eq!(wide, [edge(1.0, [0, 9]), edge(40.0, [9, 0])]);
        assert!(edges_agree(&wide, &[edge(1.5, [0, 9]), edge(40.0, [9, 0])], 1.0, 80.0));
        // A body that is all that narrow is not there.
        assert_eq!(without_narrow(&[edge(1.0, [0, 7]), edge(2.0, [7, 0])], period), []);
    }
}
