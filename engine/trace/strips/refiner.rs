//! Lines of a view traced together; whether a span needs cutting; the cells of a span.

#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    clippy::cast_possible_wrap,
    reason = "counts and indices are bounded by the scene's validation; rounding to f32 is meant"
)]

use super::moments::{CellMoments, ExactCell};
use super::{Key, Span, View, empty_strip, units};
use crate::Result;
use crate::gpu::interface::{
    Cell, FLAG_EXACT, FLAG_NOT_FINITE, Law, MOMENTS_HEAD, MOMENTS_PER_MATERIAL, Ray, Strip,
};
use crate::trace::line::{Aim, DEPTH_TOLERANCE, Edge, Line, Narrow, first_places};
use crate::trace::tracer::Tracer;
use rayon::prelude::*;
use std::collections::HashMap;
use std::ops::Range;
use std::sync::Arc;

/// Silhouettes of neighbouring lines may differ by this share of a period.
const EDGE_SHARE: f32 = 1.0 / 20.0;

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
    view: &'a View<'a>,
    pub(super) aim: Aim,
    units: i64,
    /// Distance from analyser to detector, m, and analyser over detector distance.
    gap: f32,
    ratio: f32,
    row_pitch: f32,
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
            },
            units: units(view),
            gap: (scene.detector.distance - analyser) as f32,
            ratio: (analyser / scene.detector.distance) as f32,
            row_pitch: scene.detector.pitch[1] as f32,
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

    fn ray(&self, key: &Key, x: f32) -> Ray {
        self.view.lattice.ray(key.0, f64::from(x), self.row(key.1), self.view.index)
    }

    /// Traces and refines lines together, so that the device gets many rays at a time. Tells
    /// how many cells were cut.
    pub(super) fn trace_lines(
        &self,
        tracer: &mut Tracer,
        keys: &[Key],
        lines: &mut HashMap<Key, Arc<Line>>,
    ) -> Result<u64> {
        let places = first_places(self.aim.period, self.aim.cells);
        let n = places.len();
        let rays: Vec<Ray> =
            keys.par_iter().flat_map_iter(|k| places.iter().map(|&x| self.ray(k, x))).collect();
        let laws = tracer.trace(&rays)?;
        let mut work: Vec<(Key, Vec<Narrow>, Line)> = keys
            .par_iter()
            .enumerate()
            .map(|(i, key)| {
                let narrow = self.narrow(key);
                let mut line = Line::default();
                let rays = i * n..(i + 1) * n;
                line.begin(&self.aim, &narrow, &laws[rays]);
                if line.wanted_count() == 0 {
                    line.finish(&self.aim);
                }
                (*key, narrow, line)
            })
            .collect();
        loop {
            let rays: Vec<Ray> = work
                .par_iter()
                .flat_map_iter(|(key, _, line)| line.wanted().map(|x| self.ray(key, x)))
                .collect();
            if rays.is_empty() {
                break;
            }
            let laws = tracer.trace(&rays)?;
            let mut first = 0;
            for (_, narrow, line) in &mut work {
                let n = line.wanted_count();
                if n > 0 {
                    line.give(&self.aim, narrow, &laws[first..first + n]);
                    first += n;
                }
            }
        }
        let splits = work.iter().map(|(_, _, line)| line.splits).sum();
        lines.extend(work.into_iter().map(|(key, _, line)| (key, Arc::new(line))));
        Ok(splits)
    }

    /// Moments at both ends of the segments of spans, `[segment][end][material][moment]` for each
    /// span; nothing where they are not kept. Few rays of a line bound cells: these are traced
    /// once more.
    pub(super) fn end_moments(
        &self,
        tracer: &mut Tracer,
        spans: &[Span],
        lines: &HashMap<Key, Arc<Line>>,
    ) -> Result<Vec<Vec<f32>>> {
        if !self.view.keep_moments {
            return Ok(vec![Vec::new(); spans.len()]);
        }
        let met: Vec<Vec<Ray>> = spans
            .par_iter()
            .map(|span| {
                let key = (span.beamlet, span.middle());
                let ends = lines[&key].ends().into_iter();
                ends.filter(|p| p.law.crossings > 0).map(|p| self.ray(&key, p.x)).collect()
            })
            .collect();
        let words = tracer.materials() * MOMENTS_PER_MATERIAL;
        let stride = MOMENTS_HEAD + words;
        let traced = tracer.trace_moments(&met.concat())?;
        let mut rest = &traced[..];
        let of_spans: Vec<&[u32]> = met
            .iter()
            .map(|rays| {
                let (of_span, after) = rest.split_at(rays.len() * stride);
                rest = after;
                of_span
            })
            .collect();
        let by_segment = |(span, traced): (&Span, &[u32])| {
            let mut traced = traced.chunks_exact(stride);
            let line = &lines[&(span.beamlet, span.middle())];
            let mut moments = Vec::with_capacity(2 * line.segments.len() * words);
            let (mut ray, mut last) = (None, None);
            for end in line.segments.iter().flat_map(|s| [s.low, s.high]) {
                // Neighbours share a ray.
                if ray.replace(end.ray) != Some(end.ray) {
                    last = if end.law.crossings > 0 { traced.next() } else { None };
                }
                match last {
                    Some(ray) => {
                        moments.extend(ray[MOMENTS_HEAD..].iter().map(|&w| f32::from_bits(w)));
                    }
                    None => moments.resize(moments.len() + words, 0.0),
                }
            }
            moments
        };
        Ok(spans.par_iter().zip(of_spans).map(by_segment).collect())
    }

    /// Whether the middle line stands for the whole span.
    pub(super) fn agrees(&self, span: &Span, lines: &HashMap<Key, Arc<Line>>) -> bool {
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
        let edges = middle.edges();
        if !edges_agree(&low.edges(), &edges, limit, half)
            || !edges_agree(&high.edges(), &edges, limit, half)
        {
            return false;
        }
        // No silhouette crosses the lines, yet one may run between them.
        let signature = |line: &Line| line.base[line.base.len() / 2].law.signature;
        if edges.iter().all(|e| e.x.abs() >= half - limit)
            && [low, high].into_iter().any(|line| signature(line) != signature(middle))
        {
            return false;
        }
        let bend = |f: fn(&Law) -> f32| {
            let mut sum = 0.0;
            for ((a, m), b) in low.base.iter().zip(&middle.base).zip(&high.base) {
                let same = a.law.signature == m.law.signature && m.law.signature == b.law.signature;
                if same && (a.law.flags | m.law.flags | b.law.flags) & FLAG_NOT_FINITE == 0 {
                    sum += (f(&m.law) - 0.5 * (f(&a.law) + f(&b.law))).abs();
                }
            }
            sum / middle.base.len() as f32 * height
        };
        bend(|l| l.displacement_x) <= self.aim.tolerance
            && bend(|l| l.optical_depth) <= DEPTH_TOLERANCE
            && bend(|l| l.displacement_z) <= 100.0 * self.aim.tolerance
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
    pub(super) fn cells(&self, span: &Span, line: &Line, moments: &[f32]) -> SpanCells {
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
            moments: CellMoments::default(),
            lands: 0..1,
            landed_off: 0,
            not_finite: 0,
        };
        let middle = (span.beamlet, span.middle());
        let words = moments.len() / line.segments.len().max(1);
        for (index, segment) in line.segments.iter().enumerate() {
            let (low, high) = (&segment.low, &segment.high);
            if (low.law.flags | high.law.flags) & FLAG_NOT_FINITE != 0 {
                made.not_finite += 1;
                continue;
            }
            let mean = |f: fn(&Law) -> f32| 0.5 * (f(&low.law) + f(&high.law));
            let displacement_z = mean(|l| l.displacement_z) + mean(|l| l.slope_z) * self.gap;
            if displacement_z.abs() > self.view.lattice.halo as f32 * self.row_pitch {
                made.landed_off += 1;
            }
            let pixel_shift = mean(|l| l.displacement_x) * (1.0 - self.ratio)
                - mean(|l| l.slope_x) * self.gap * self.ratio;
            let down = -f64::from(displacement_z / self.row_pitch);
            made.lands.start = made.lands.start.min(down.floor() as i64);
            made.lands.end = made.lands.end.max(down.ceil() as i64 + 1);
            let [above, below] = self.view.lattice.row_shares(top, bottom, down);
            made.cells.push(Cell {
                x_low: low.x,
                x_high: high.x,
                depth_low: low.law.optical_depth,
                depth_high: high.law.optical_depth,
                displacement_low: low.law.displacement_x,
                displacement_high: high.law.displacement_x,
                displacement_z,
                above,
                below,
                pixel_shift,
                ..bytemuck::Zeroable::zeroed()
            });
            if !self.view.keep_moments {
                continue;
            }
            made.moments.ends.extend_from_slice(&moments[index * words..][..words]);
            let flags = low.law.flags | high.law.flags;
            if flags & FLAG_EXACT != 0 {
                made.moments.exact.push(ExactCell {
                    cell: made.cells.len() as u32 - 1,
                    ends: [low, high].map(|p| self.ray(&middle, line.places[p.ray as usize])),
                    laws: [low.law, high.law],
                    range: [0.0, 1.0],
                });
            }
        }
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
}
