//! Strips: the cells of each beamlet in intervals of z that are cut until neighbouring lines
//! agree. Each row of a beamlet is refined on its own, from lines at its borders and inside,
//! so that the outcome does not depend on how rows are grouped into bands.

#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    clippy::cast_possible_wrap,
    reason = "counts and indices are bounded by the scene's validation; rounding to f32 is meant"
)]

use super::lattice::Lattice;
use super::line::{Aim, DEPTH_TOLERANCE, Edge, Line, Narrow};
use super::occupancy::Shadow;
use super::tracer::Tracer;
use crate::Result;
use crate::gpu::interface::{Cell, FLAG_NOT_FINITE, Law, Ray, Strip};
use crate::scene::Scene;
use rayon::prelude::*;
use std::collections::HashMap;
use std::ops::Range;
use std::sync::Arc;

/// A row is cut at most to 1/256.
const FINEST: i64 = 256;
/// Silhouettes of neighbouring lines may differ by this share of a period.
const EDGE_SHARE: f32 = 1.0 / 20.0;

/// Spans whose cells are made side by side.
const SPANS_AT_ONCE: usize = 1 << 12;

/// Strips and cells, ready to be illuminated.
#[derive(Debug, Clone, Default)]
pub struct Strips {
    /// Strips.
    pub strips: Vec<Strip>,
    /// Their cells.
    pub cells: Vec<Cell>,
    /// Cells that refinement cut.
    pub splits: u64,
    /// Cells whose light lands too far off to follow, or outside the detector.
    pub landed_off: u64,
    /// Cells left out because a law is not finite.
    pub not_finite: u64,
}

/// A line by beamlet and row coordinate in units of 1 / (2 FINEST rows).
type Key = (i64, i64);

/// An interval of z of one beamlet, in the same units.
#[derive(Debug, Clone, Copy)]
struct Span {
    beamlet: i64,
    low: i64,
    high: i64,
}

impl Span {
    const fn middle(&self) -> i64 {
        (self.low + self.high) / 2
    }

    const fn keys(&self) -> [Key; 3] {
        [(self.beamlet, self.low), (self.beamlet, self.middle()), (self.beamlet, self.high)]
    }
}

/// What the strips of a view are made from.
#[derive(Debug)]
pub struct View<'a> {
    /// The scene.
    pub scene: &'a Scene,
    /// Its lattice.
    pub lattice: &'a Lattice,
    /// Index of the view.
    pub index: u32,
    /// Shadows of the components.
    pub shadows: &'a [Shadow],
}

/// Units per row of the row coordinates in keys. Twice, so that every span has a middle.
fn units(view: &View<'_>) -> i64 {
    2 * FINEST * i64::from(view.scene.sampling.rows)
}

impl Strips {
    /// Appends a strip with its cells.
    fn push(&mut self, strip: Strip, cells: &[Cell]) {
        if cells.is_empty() {
            return;
        }
        let (first, count) = (self.cells.len() as u32, cells.len() as u32);
        self.strips.push(Strip { first, count, ..strip });
        self.cells.extend_from_slice(cells);
    }

    /// Appends other strips and their counts.
    pub(crate) fn append(&mut self, other: &Self) {
        let first = self.cells.len() as u32;
        self.strips.extend(
            other.strips.iter().map(|strip| Strip { first: strip.first + first, ..*strip }),
        );
        self.cells.extend_from_slice(&other.cells);
        self.splits += other.splits;
        self.landed_off += other.landed_off;
        self.not_finite += other.not_finite;
    }

    /// Empties strips, cells and counts; keeps their memory.
    fn clear(&mut self) {
        self.strips.clear();
        self.cells.clear();
        (self.splits, self.landed_off, self.not_finite) = (0, 0, 0);
    }

    /// Strips of about equal size side by side: invocations of a subgroup wait for one another.
    fn balance(&mut self) {
        self.strips.sort_by_key(|s| std::cmp::Reverse(s.count));
    }
}

/// Strips of all beamlets without a sample: one cell each.
#[must_use]
pub fn empty_strips(lattice: &Lattice, rows: Range<i64>) -> Strips {
    let mut out = Strips::default();
    let cell = empty_cell(lattice);
    for row in rows {
        for beamlet in lattice.direct.clone() {
            out.push(empty_strip(beamlet - lattice.beamlets.start, row), &[cell]);
        }
    }
    out
}

fn empty_strip(column: i64, row: i64) -> Strip {
    Strip { first: 0, count: 0, column: column as u32, row: row as i32, top: 0.0, bottom: 1.0 }
}

fn empty_cell(lattice: &Lattice) -> Cell {
    let half = (lattice.period / 2.0) as f32;
    let [above, below] = lattice.row_spread.shares(0.0, 1.0, 0.0).unwrap_or([-1.0, 0.0]);
    Cell { x_low: -half, x_high: half, above, below, ..bytemuck::Zeroable::zeroed() }
}

/// Beamlets of a row that a shadow touches.
fn occupied(view: &View<'_>, row: i64) -> Vec<bool> {
    let beamlets = &view.lattice.beamlets;
    let mut marks = vec![false; (beamlets.end - beamlets.start) as usize];
    for shadow in view.shadows {
        if shadow.rows[1] < row as f64 || shadow.rows[0] > (row + 1) as f64 {
            continue;
        }
        for k in view.lattice.beamlets_of(shadow.x) {
            marks[(k - beamlets.start) as usize] = true;
        }
    }
    marks
}

/// Traces and refines the beamlets of some rows and hands strips to `take`, in parts, as they
/// are ready. `lit`: the rows from which undeflected light matters; what neither stands nor
/// lands there is left out. About `rays_at_once` rays and as many cells are in memory at a time; the strips, but not their order, are the same whatever it is.
///
/// # Errors
/// As [`Tracer::trace`]; those of `take`.
pub fn trace_strips(
    view: &View<'_>,
    tracer: &mut Tracer,
    rows: Range<i64>,
    lit: &Range<i64>,
    rays_at_once: usize,
    take: &mut dyn FnMut(&Strips) -> Result<()>,
) -> Result<()> {
    let units = units(view);
    let parts = i64::from(view.scene.sampling.rows);
    let mut open = Vec::new();
    let mut blank = Vec::new();
    for row in rows.clone() {
        for (column, occupied) in occupied(view, row).into_iter().enumerate() {
            let beamlet = view.lattice.beamlets.start + column as i64;
            if occupied {
                for part in 0..parts {
                    let step = units / parts;
                    let low = row * units + part * step;
                    open.push(Span { beamlet, low, high: low + step });
                }
            } else if lit.contains(&row) && view.lattice.direct.contains(&beamlet) {
                blank.push((column as i64, row));
            }
        }
    }
    let mut out = Parts { strips: Strips::default(), most: rays_at_once, take };
    let cell = empty_cell(view.lattice);
    for (column, row) in blank {
        out.push(empty_strip(column, row), &[cell])?;
    }
    let work = Work::new(view);
    // A span takes about two lines: its middle, and one of its ends, shared with a neighbour.
    let places = Line::first_places(&work.aim).len();
    let at_once = (rays_at_once / (2 * places)).max(1);
    let mut waiting: Vec<Lines> = chunks(&open, at_once, &HashMap::new());
    while let Some(Lines { open, mut lines }) = waiting.pop() {
        let mut keys: Vec<Key> = open.iter().flat_map(Span::keys).collect();
        keys.sort_unstable();
        keys.dedup();
        keys.retain(|k| !lines.contains_key(k));
        out.strips.splits += work.trace_lines(tracer, &keys, &mut lines)?;
        let verdicts: Vec<bool> = open.par_iter().map(|s| work.agrees(s, &lines)).collect();
        let (mut next, mut done) = (Vec::new(), Vec::new());
        for (span, agrees) in open.iter().zip(verdicts) {
            if agrees || (span.high - span.low) * FINEST <= units {
                done.push(*span);
            } else {
                let middle = span.middle();
                next.push(Span { high: middle, ..*span });
                next.push(Span { low: middle, ..*span });
            }
        }
        for some in done.chunks(SPANS_AT_ONCE) {
            let cells = |s: &Span| work.cells(s, &lines[&(s.beamlet, s.middle())]);
            let strips: Vec<SpanCells> = some.par_iter().map(cells).collect();
            for made in strips {
                let row = i64::from(made.strip.row);
                out.strips.landed_off += made.landed_off;
                out.strips.not_finite += made.not_finite;
                if row + made.lands.end > lit.start && row + made.lands.start < lit.end {
                    out.push(made.strip, &made.cells)?;
                }
            }
        }
        waiting.extend(chunks(&next, at_once, &lines));
    }
    out.hand_over()
}

/// Spans to look at, and the lines known of them.
struct Lines {
    open: Vec<Span>,
    lines: HashMap<Key, Arc<Line>>,
}

/// Spans in chunks of at most `at_once`, each with those of the lines that it needs.
fn chunks(spans: &[Span], at_once: usize, lines: &HashMap<Key, Arc<Line>>) -> Vec<Lines> {
    let chunk = |spans: &[Span]| Lines {
        open: spans.to_vec(),
        lines: spans
            .iter()
            .flat_map(Span::keys)
            .filter_map(|key| Some((key, lines.get(&key)?.clone())))
            .collect(),
    };
    spans.chunks(at_once).map(chunk).collect()
}

/// Strips handed over in parts of limited size.
struct Parts<'a> {
    strips: Strips,
    /// Cells of a part.
    most: usize,
    take: &'a mut dyn FnMut(&Strips) -> Result<()>,
}

impl Parts<'_> {
    fn push(&mut self, strip: Strip, cells: &[Cell]) -> Result<()> {
        if self.strips.cells.len() + cells.len() > self.most {
            self.hand_over()?;
        }
        self.strips.push(strip, cells);
        Ok(())
    }

    fn hand_over(&mut self) -> Result<()> {
        self.strips.balance();
        (self.take)(&self.strips)?;
        self.strips.clear();
        Ok(())
    }
}

/// The cells of one span.
struct SpanCells {
    strip: Strip,
    cells: Vec<Cell>,
    /// Rows, relative to its own, where it lands.
    lands: Range<i64>,
    landed_off: u64,
    not_finite: u64,
}

struct Work<'a> {
    view: &'a View<'a>,
    aim: Aim,
    units: i64,
    /// Distance from analyser to detector, m, and analyser over detector distance.
    gap: f32,
    ratio: f32,
    row_pitch: f32,
}

impl<'a> Work<'a> {
    fn new(view: &'a View<'a>) -> Self {
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
    fn trace_lines(
        &self,
        tracer: &mut Tracer,
        keys: &[Key],
        lines: &mut HashMap<Key, Arc<Line>>,
    ) -> Result<u64> {
        let places = Line::first_places(&self.aim);
        let rays: Vec<Ray> =
            keys.par_iter().flat_map_iter(|k| places.iter().map(|&x| self.ray(k, x))).collect();
        let laws = tracer.trace(&rays)?;
        let mut work: Vec<(Key, Vec<Narrow>, Line)> = keys
            .par_iter()
            .zip(laws.par_chunks_exact(places.len()))
            .map(|(key, laws)| {
                let narrow = self.narrow(key);
                let mut line = Line::default();
                line.begin(&self.aim, &narrow, laws);
                if line.wanted_count() == 0 {
                    line.finish();
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
            let mut rest = laws.as_slice();
            for (_, narrow, line) in &mut work {
                let n = line.wanted_count();
                if n > 0 {
                    let (mine, others) = rest.split_at(n);
                    line.give(&self.aim, narrow, mine);
                    rest = others;
                }
            }
        }
        let splits = work.iter().map(|(_, _, line)| line.splits).sum();
        lines.extend(work.into_iter().map(|(key, _, line)| (key, Arc::new(line))));
        Ok(splits)
    }

    /// Whether the middle line stands for the whole span.
    fn agrees(&self, span: &Span, lines: &HashMap<Key, Arc<Line>>) -> bool {
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

    fn cells(&self, span: &Span, line: &Line) -> SpanCells {
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
            lands: 0..1,
            landed_off: 0,
            not_finite: 0,
        };
        for segment in &line.segments {
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
            let [above, below] =
                self.view.lattice.row_spread.shares(top, bottom, down).unwrap_or([-1.0, 0.0]);
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
            });
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
