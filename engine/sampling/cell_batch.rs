//! Cells in batches, as they go to the illumination: strips of cells side by side in x, each of
//! one interval of z of a row.

use super::cell_moments::CellMoments;
use super::lattice::Lattice;
use crate::interface::{Cell, CellRow, MOMENTS_PER_MATERIAL};
use crate::numbers::{self, single};
use crate::parallel;
use crate::trace::Tally;
use bytemuck::Pod;
use std::ops::Range;

/// Cells narrower than this may bend light by any amount, m.
const NARROW: f32 = 2.5e-7;

/// Strips and cells, ready to be illuminated.
#[derive(Debug, Clone, Default)]
pub struct CellBatch {
    /// Strips.
    pub strips: Vec<CellRow>,
    /// Their cells.
    pub cells: Vec<Cell>,
    /// Moments of the rays that bound the cells, where they are kept.
    pub moments: CellMoments,
    /// Cells that refinement cut.
    pub splits: u64,
    /// Cells whose light lands too far off to follow, or outside the detector.
    pub landed_off: u64,
    /// Patches that they are of: rays and estimated errors.
    pub tally: Tally,
}

impl CellBatch {
    /// Appends a strip with its cells and their moments.
    pub(crate) fn push(&mut self, strip: CellRow, cells: &[Cell], moments: &CellMoments) {
        if cells.is_empty() {
            return;
        }
        let (first, count) = (numbers::count(self.cells.len()), numbers::count(cells.len()));
        self.strips.push(CellRow { first, count, ..reach_of(strip, cells) });
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
            first += numbers::count(part.cells.len());
            all.splits += part.splits;
            all.landed_off += part.landed_off;
            all.tally = all.tally + part.tally;
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
fn join<T: Pod + Send + Sync>(
    parts: &mut [CellBatch],
    of: fn(&mut CellBatch) -> &mut Vec<T>,
) -> Vec<T> {
    let own: Vec<Vec<T>> = parts.iter_mut().map(|part| std::mem::take(of(part))).collect();
    match <[Vec<T>; 1]>::try_from(own) {
        Ok([only]) => only,
        Err(own) => parallel::concat(&own),
    }
}

/// A strip with what its cells let through and how far their light lands.
fn reach_of(strip: CellRow, cells: &[Cell]) -> CellRow {
    let mut strip = CellRow {
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
pub(crate) fn empty_strips(lattice: &Lattice, rows: Range<i64>) -> CellBatch {
    let mut out = CellBatch::default();
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
pub(crate) fn blank_strips(lattice: &Lattice, mut places: Vec<(i64, i64)>) -> Vec<CellRow> {
    places.sort_unstable();
    let block = |row: i64| row.div_euclid(i64::from(lattice.alike_rows));
    let alike =
        |a: &(i64, i64), b: &(i64, i64)| a.0 == b.0 && a.1 + 1 == b.1 && block(a.1) == block(b.1);
    let strip = |run: &[(i64, i64)]| CellRow {
        rows: numbers::count(run.len()),
        ..empty_strip(run[0].0, run[0].1)
    };
    places.chunk_by(alike).map(strip).collect()
}

pub(crate) fn empty_strip(column: i64, row: i64) -> CellRow {
    CellRow {
        first: 0,
        count: 0,
        column: numbers::narrow::<u32>(column),
        row: numbers::narrow::<i32>(row),
        top: 0.0,
        bottom: 1.0,
        rows: 1,
        ..bytemuck::Zeroable::zeroed()
    }
}

pub(crate) fn empty_cell(lattice: &Lattice) -> Cell {
    let half = single(lattice.period / 2.0);
    let [above, below] = lattice.row_shares(0.0, 1.0, 0.0);
    Cell { x_low: -half, x_high: half, above, below, ..bytemuck::Zeroable::zeroed() }
}
