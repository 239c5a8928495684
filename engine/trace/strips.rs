//! Strips: the cells of each beamlet in intervals of z that are cut until neighbouring lines
//! agree. Each row of a beamlet is refined on its own, from lines at its borders and inside,
//! so that the outcome does not depend on how rows are grouped into bands.

#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    clippy::cast_possible_wrap,
    reason = "counts and indices are bounded by the scene's validation; rounding to f32 is meant"
)]

mod ends;
mod moments;
mod neighbours;
mod refiner;

use super::lattice::Lattice;
use super::line::{Seen, first_places};
use super::occupancy::Shadow;
use super::tracer::Tracer;
use crate::Result;
use crate::gpu::interface::{Cell, MOMENTS_PER_MATERIAL, Strip};
use crate::parallel;
use crate::scene::Scene;
use bytemuck::Pod;
pub use ends::Keep;
pub use moments::{CellMoments, ExactCell};
use rayon::prelude::*;
use refiner::Refiner;
use std::collections::HashMap;
use std::ops::Range;
use std::sync::Arc;

/// A row is cut at most to 1/256.
const FINEST: i64 = 256;

/// Spans whose cells are made side by side.
const SPANS_AT_ONCE: usize = 1 << 12;
/// Of these, one after the other by a thread.
const SPANS_OF_A_THREAD: usize = 1 << 5;

/// Cells narrower than this may bend light by any amount, m.
const NARROW: f32 = 2.5e-7;

/// Strips and cells, ready to be illuminated.
#[derive(Debug, Clone, Default)]
pub struct Strips {
    /// Strips.
    pub strips: Vec<Strip>,
    /// Their cells.
    pub cells: Vec<Cell>,
    /// Moments of the rays that bound the cells, where they are kept.
    pub moments: CellMoments,
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

    /// Of the line in the middle, which stands for the span.
    const fn key(&self) -> Key {
        (self.beamlet, self.middle())
    }

    const fn keys(&self) -> [Key; 3] {
        [(self.beamlet, self.low), self.key(), (self.beamlet, self.high)]
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
    /// Keep the moments of the rays that bound cells, for other energies or masks.
    pub keep: Option<&'a Keep>,
}

/// Units per row of the row coordinates in keys. Twice, so that every span has a middle.
fn units(view: &View<'_>) -> i64 {
    2 * FINEST * i64::from(view.scene.sampling.rows)
}

impl Strips {
    /// Appends a strip with its cells and their moments.
    pub(crate) fn push(&mut self, strip: Strip, cells: &[Cell], moments: &CellMoments) {
        if cells.is_empty() {
            return;
        }
        let (first, count) = (self.cells.len() as u32, cells.len() as u32);
        self.strips.push(Strip { first, count, ..reach_of(strip, cells) });
        self.cells.extend_from_slice(cells);
        self.moments.append(moments, first);
    }

    /// Gives cells without a sample their moments, which are zero.
    pub(crate) fn keep_nothing(&mut self, materials: usize) {
        self.moments.ends = vec![0.0; 2 * self.cells.len() * materials * MOMENTS_PER_MATERIAL];
    }

    /// Strips of several parts in their order, with their counts.
    pub(crate) fn concat(mut parts: Vec<Self>) -> Self {
        let mut all = Self::default();
        let mut first = 0;
        for part in &mut parts {
            part.strips.iter_mut().for_each(|strip| strip.first += first);
            for exact in &mut part.moments.exact {
                exact.cell += first;
            }
            all.moments.exact.append(&mut part.moments.exact);
            first += part.cells.len() as u32;
            all.splits += part.splits;
            all.landed_off += part.landed_off;
            all.not_finite += part.not_finite;
        }
        all.strips = join(&mut parts, |part| &mut part.strips);
        all.cells = join(&mut parts, |part| &mut part.cells);
        all.moments.ends = join(&mut parts, |part| &mut part.moments.ends);
        all
    }

    /// Strips of about equal size side by side: invocations of a subgroup wait for one another.
    pub(crate) fn balance(&mut self) {
        self.strips.sort_by_key(|s| std::cmp::Reverse(s.count));
    }
}

/// What all parts have of something, which is gone from them.
fn join<T: Pod + Send + Sync>(parts: &mut [Strips], of: fn(&mut Strips) -> &mut Vec<T>) -> Vec<T> {
    let own: Vec<Vec<T>> = parts.iter_mut().map(|part| std::mem::take(of(part))).collect();
    match <[Vec<T>; 1]>::try_from(own) {
        Ok([only]) => only,
        Err(own) => parallel::concat(&own),
    }
}

/// A strip with what its cells let through and how far their light lands.
fn reach_of(strip: Strip, cells: &[Cell]) -> Strip {
    let mut strip = Strip {
        light: 0.0,
        low_landing: f32::INFINITY,
        high_landing: f32::NEG_INFINITY,
        spread: 0.0,
        bend: 0.0,
        ..strip
    };
    for cell in cells {
        let lean = cell.depth_high - cell.depth_low;
        let middle = 0.5 * (cell.depth_low + cell.depth_high);
        let width = cell.x_high - cell.x_low;
        strip.light += width * (-middle).exp() * (1.0 + lean * lean / 24.0);
        let (low, high) = (cell.displacement_low, cell.displacement_high);
        strip.low_landing = strip.low_landing.min(low.min(high) - cell.pixel_shift);
        strip.high_landing = strip.high_landing.max(low.max(high) - cell.pixel_shift);
        // The shadow of a thick bar blurs a cell by the bend times its width, and by no more than
        // the light of the cell is wide (piece_of in illuminate.comp).
        let lands = 0.5 * (high - low).abs() + 4.0 * width; // magnified eightfold at most
        if width > NARROW {
            strip.bend = strip.bend.max((high - low).abs() / width);
            strip.spread = strip.spread.max(cell.spread);
        } else {
            strip.spread = strip.spread.max(cell.spread + lands * lands / 3.0);
        }
    }
    strip
}

/// Strips of all beamlets without a sample: one cell each.
#[must_use]
pub fn empty_strips(lattice: &Lattice, rows: Range<i64>) -> Strips {
    let mut out = Strips::default();
    let cell = empty_cell(lattice);
    let first = lattice.beamlets.start;
    let places = rows.flat_map(|row| lattice.direct.clone().map(move |k| (k - first, row)));
    for strip in blank_strips(lattice, places.collect()) {
        out.push(strip, &[cell], &CellMoments::default());
    }
    out
}

/// Strips of whole rows without a sample at places (column, row), one for rows that follow one
/// another in a block.
pub(crate) fn blank_strips(lattice: &Lattice, mut places: Vec<(i64, i64)>) -> Vec<Strip> {
    places.sort_unstable();
    let block = |row: i64| row.div_euclid(i64::from(lattice.alike_rows));
    let alike =
        |a: &(i64, i64), b: &(i64, i64)| a.0 == b.0 && a.1 + 1 == b.1 && block(a.1) == block(b.1);
    let strip =
        |run: &[(i64, i64)]| Strip { rows: run.len() as u32, ..empty_strip(run[0].0, run[0].1) };
    places.chunk_by(alike).map(strip).collect()
}

pub(crate) fn empty_strip(column: i64, row: i64) -> Strip {
    Strip {
        first: 0,
        count: 0,
        column: column as u32,
        row: row as i32,
        top: 0.0,
        bottom: 1.0,
        rows: 1,
        ..bytemuck::Zeroable::zeroed()
    }
}

pub(crate) fn empty_cell(lattice: &Lattice) -> Cell {
    let half = (lattice.period / 2.0) as f32;
    let [above, below] = lattice.row_shares(0.0, 1.0, 0.0);
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

/// Takes strips as they are ready; may trace with the tracer that it is lent.
pub type Take<'a> = &'a mut dyn FnMut(&mut Tracer, &Strips) -> Result<()>;

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
    take: Take<'_>,
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
    let mut out = Parts { parts: Vec::new(), ends: Vec::new(), cells: 0, most: rays_at_once, take };
    let cell = empty_cell(view.lattice);
    let words = if view.keep.is_some() { tracer.materials() * MOMENTS_PER_MATERIAL } else { 0 };
    let none = CellMoments { ends: vec![0.0; 2 * words], ..CellMoments::default() };
    for strips in blank_strips(view.lattice, blank).chunks(SPANS_AT_ONCE) {
        let mut part = Strips::default();
        strips.iter().for_each(|strip| part.push(*strip, &[cell], &none));
        let ends = std::mem::take(&mut part.moments.ends);
        out.append(tracer, part, vec![ends])?;
    }
    let work = Refiner::new(view);
    // A span takes about two lines: its middle, and one of its ends, shared with a neighbour.
    let places = first_places(work.aim.period, work.aim.cells).len();
    let at_once = (rays_at_once / (2 * places)).max(1);
    let mut waiting: Vec<Lines> = chunks(&open, at_once, &HashMap::new());
    while let Some(Lines { open, mut lines }) = waiting.pop() {
        let mut keys: Vec<Key> = open.iter().flat_map(Span::keys).collect();
        keys.sort_unstable();
        keys.dedup();
        keys.retain(|k| !lines.contains_key(k));
        work.see_lines(tracer, &keys, &mut lines)?;
        // Whether a span is done, and then wanted: which spans are cut depends on no band.
        let verdict = |span: &Span| {
            let done = work.agrees(span, &lines) || (span.high - span.low) * FINEST <= units;
            done.then(|| !work.misses(span, &lines, lit))
        };
        let verdicts: Vec<Option<bool>> = open.par_iter().map(verdict).collect();
        let (mut next, mut done) = (Vec::new(), Vec::new());
        for (span, verdict) in open.iter().zip(verdicts) {
            match verdict {
                Some(wanted) => done.extend(wanted.then_some(*span)),
                None => {
                    let middle = span.middle();
                    next.push(Span { high: middle, ..*span });
                    next.push(Span { low: middle, ..*span });
                }
            }
        }
        // Neighbouring lines are refined alike.
        done.sort_unstable_by_key(|span| (span.beamlet, span.low));
        for some in done.chunks(SPANS_AT_ONCE) {
            let refined = work.refine_lines(tracer, some, &mut lines)?;
            let mut moments = work.end_moments(tracer, some, &refined)?;
            let spans = some.par_chunks(SPANS_OF_A_THREAD);
            let lines = refined.par_chunks(SPANS_OF_A_THREAD);
            let moments = moments.par_chunks_mut(SPANS_OF_A_THREAD);
            let cells = spans.zip(lines).zip(moments).map(|((spans, lines), moments)| {
                let mut part = Strips::default();
                part.cells.reserve_exact(lines.iter().map(|line| line.segments.len()).sum());
                let mut ends = Vec::with_capacity(spans.len());
                for ((span, line), moments) in spans.iter().zip(lines).zip(moments) {
                    part.splits += line.splits;
                    let made = work.cells(span, line, std::mem::take(moments));
                    let row = i64::from(made.strip.row);
                    part.landed_off += made.landed_off;
                    part.not_finite += made.not_finite;
                    if row + made.lands.end > lit.start && row + made.lands.start < lit.end {
                        let CellMoments { ends: of_span, exact } = made.moments;
                        let moments = CellMoments { exact, ..CellMoments::default() };
                        part.push(made.strip, &made.cells, &moments);
                        ends.push(of_span);
                    }
                }
                (part, ends)
            });
            let parts: Vec<(Strips, Vec<Vec<f32>>)> = cells.collect();
            for (part, ends) in parts {
                out.append(tracer, part, ends)?;
            }
            refined.into_par_iter().for_each(drop);
        }
        waiting.extend(chunks(&next, at_once, &lines));
        lines.into_par_iter().for_each(drop);
    }
    out.hand_over(tracer)
}

/// Spans to look at, and the lines known of them.
struct Lines {
    open: Vec<Span>,
    lines: HashMap<Key, Arc<Seen>>,
}

/// Spans in chunks of at most `at_once`, each with those of the lines that it needs.
fn chunks(spans: &[Span], at_once: usize, lines: &HashMap<Key, Arc<Seen>>) -> Vec<Lines> {
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
    /// Without the moments of their cells,
    parts: Vec<Strips>,
    /// which are copied but once.
    ends: Vec<Vec<f32>>,
    /// In the parts.
    cells: usize,
    /// Cells that are handed over at once.
    most: usize,
    take: Take<'a>,
}

impl Parts<'_> {
    fn append(&mut self, tracer: &mut Tracer, strips: Strips, ends: Vec<Vec<f32>>) -> Result<()> {
        if self.cells + strips.cells.len() > self.most {
            self.hand_over(tracer)?;
        }
        self.cells += strips.cells.len();
        self.parts.push(strips);
        self.ends.extend(ends);
        Ok(())
    }

    fn hand_over(&mut self, tracer: &mut Tracer) -> Result<()> {
        let mut strips = Strips::concat(std::mem::take(&mut self.parts));
        strips.moments.ends = parallel::concat(&std::mem::take(&mut self.ends));
        self.cells = 0;
        strips.balance();
        (self.take)(tracer, &strips)
    }
}
