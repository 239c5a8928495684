//! Cells in batches, as they go to the illumination: cell rows of cells side by side in x, each of
//! one interval of z of a row.

use super::absorption::mean_passed;
use super::cell_moments::{CellMoments, ExactCell};
use super::lattice::Lattice;
use beamlet_core::numbers::{self, single};
use beamlet_core::parallel;
use beamlet_core::tally::Tally;
use beamlet_interface::{Cell, CellRow};
use bytemuck::Pod;
use std::ops::Range;

/// Cell rows and cells, ready to be illuminated.
#[derive(Debug, Clone, Default)]
pub struct CellBatch {
    /// Cell rows, in the order of their cells.
    pub cell_rows: Vec<CellRow>,
    /// Their cells.
    pub cells: Vec<Cell>,
    /// Moments of the rays that bound the cells, where they are kept.
    pub moments: CellMoments,
    /// Cells whose light lands too far off to follow, or outside the detector.
    pub landed_off: u64,
    /// Patches that they are of: rays and estimated errors.
    pub tally: Tally,
}

impl CellBatch {
    /// Appends a cell row with its cells and their moments. Without moments, cells whose light lands far off get a cell
    /// row of their own.
    pub(crate) fn push(&mut self, cell_row: CellRow, cells: &[Cell], moments: &CellMoments) {
        let differ = |pair: &[Cell]| lands_near(&pair[0]) != lands_near(&pair[1]);
        if moments.ends.is_empty() && cells.windows(2).any(differ) {
            let (near, far): (Vec<Cell>, Vec<Cell>) = cells.iter().partition(|it| lands_near(it));
            self.push_together(cell_row, &near, moments);
            self.push_together(cell_row, &far, moments);
        } else {
            self.push_together(cell_row, cells, moments);
        }
    }

    /// Appends a cell row with its cells, wherever their light lands.
    pub(super) fn push_together(
        &mut self,
        cell_row: CellRow,
        cells: &[Cell],
        moments: &CellMoments,
    ) {
        if cells.is_empty() {
            return;
        }
        let first_cell = numbers::count(self.cells.len());
        let cell_count = numbers::count(cells.len());
        let cell_row = reach_of(cell_row, cells);
        self.cell_rows.push(CellRow { first_cell, cell_count, ..cell_row });
        self.cells.extend_from_slice(cells);
        self.moments.append(moments, first_cell);
    }

    /// Cell rows of several parts in their order, with their counts.
    pub(crate) fn concat(mut parts: Vec<Self>) -> Self {
        let mut all = Self::default();
        let mut first = 0;
        for part in &mut parts {
            part.cell_rows.iter_mut().for_each(|cell_row| cell_row.first_cell += first);
            for exact in &mut part.moments.exact {
                exact.cell += first;
            }
            all.moments.exact.append(&mut part.moments.exact);
            first += numbers::count(part.cells.len());
            all.landed_off += part.landed_off;
            all.tally = all.tally + part.tally;
        }
        all.cell_rows = join(&mut parts, |part| &mut part.cell_rows);
        all.cells = join(&mut parts, |part| &mut part.cells);
        all.moments.ends = join(&mut parts, |part| &mut part.moments.ends);
        all
    }

    /// The cells in parts of whole cell rows, about `most` cells each, without counts. Later stages may
    /// need many times the memory of cells.
    pub(crate) fn parts(&self, most: usize) -> impl Iterator<Item = Self> {
        let mut rest = &self.cell_rows[..];
        std::iter::from_fn(move || {
            let mut cells = 0;
            let fits = |row: &&CellRow| {
                let fits = cells < most;
                cells += row.cell_count as usize;
                fits
            };
            let (some, after) = rest.split_at(rest.iter().take_while(fits).count());
            rest = after;
            Some(self.part(some.first()?.first_cell, some))
        })
    }

    /// Some of the cell rows with their cells, which begin with cell `first`.
    fn part(&self, first: u32, rows: &[CellRow]) -> Self {
        let words = self.moments.ends.len() / self.cells.len().max(1);
        let count = rows.iter().map(|row| row.cell_count).sum::<u32>();
        let exact = self.moments.exact.iter();
        let exact = exact.filter(|it| (first..first + count).contains(&it.cell));
        let [from, to] = [first, first + count].map(|cell| cell as usize);
        let moved = |row: &CellRow| CellRow { first_cell: row.first_cell - first, ..*row };
        Self {
            cell_rows: rows.iter().map(moved).collect(),
            cells: self.cells[from..to].to_vec(),
            moments: CellMoments {
                ends: self.moments.ends[words * from..words * to].to_vec(),
                exact: exact.map(|it| ExactCell { cell: it.cell - first, ..*it }).collect(),
            },
            ..Self::default()
        }
    }
}

/// Sorts cell rows so that those whose sizes are within a factor of two are side by side, and those of neighbouring lines
/// next to one another: invocations of a subgroup wait for one another, and neighbours pass the same apertures.
pub(crate) fn balance(cell_rows: &mut [CellRow]) {
    cell_rows.sort_by_key(|row| std::cmp::Reverse(row.cell_count.ilog2()));
}

/// Joins a vector of all parts, which it takes out of them.
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

/// True if all light of a cell lands in its row and the two beside it.
pub(crate) fn lands_near(cell: &Cell) -> bool {
    cell.share_above > -1.0
}

/// A cell row with the transmission of its cells and the reach of their light.
fn reach_of(cell_row: CellRow, cells: &[Cell]) -> CellRow {
    let mut cell_row = CellRow {
        light: 0.0,
        low_landing: f32::INFINITY,
        high_landing: f32::NEG_INFINITY,
        displacement_variance: 0.0,
        displacement_slope: 0.0,
        ..cell_row
    };
    for cell in cells {
        let depth_change = cell.depth_high - cell.depth_low;
        let middle = 0.5 * (cell.depth_low + cell.depth_high);
        let width = cell.x_high - cell.x_low;
        cell_row.light += width * mean_passed(middle, depth_change);
        let (low, high) = (cell.displacement_low, cell.displacement_high);
        cell_row.low_landing = cell_row.low_landing.min(low.min(high) - cell.pixel_shift);
        cell_row.high_landing = cell_row.high_landing.max(low.max(high) - cell.pixel_shift);
        // The largest of its cells: they bound how far light may land. The shader limits the slope.
        cell_row.displacement_slope = cell_row.displacement_slope.max((high - low).abs() / width);
        cell_row.displacement_variance =
            cell_row.displacement_variance.max(cell.displacement_variance);
    }
    cell_row
}

/// Cells of all beamlets without a sample: one in each.
#[must_use]
pub(crate) fn empty_cell_rows(lattice: &Lattice, rows: Range<i64>) -> CellBatch {
    let first = lattice.beamlets.start;
    let places = rows.flat_map(|row| lattice.direct.clone().map(move |k| (k - first, row)));
    blank_cells(lattice, &blank_cell_rows(lattice, places.collect()))
}

/// Cell rows without a sample, of one cell each.
pub(crate) fn blank_cells(lattice: &Lattice, cell_rows: &[CellRow]) -> CellBatch {
    let mut out = CellBatch::default();
    let half = single(lattice.period / 2.0);
    let [share_above, share_below] =
        if lattice.heights { [0.0; 2] } else { lattice.row_shares(0.0, 1.0, 0.0) };
    let cell = Cell {
        x_low: -half,
        x_high: half,
        share_above,
        share_below,
        ..bytemuck::Zeroable::zeroed()
    };
    cell_rows.iter().for_each(|row| out.push(*row, &[cell], &CellMoments::default()));
    out
}

/// Cell rows of whole rows without a sample at places (column, row), one for rows that follow one
/// another in a block.
pub(super) fn blank_cell_rows(lattice: &Lattice, mut places: Vec<(i64, i64)>) -> Vec<CellRow> {
    places.sort_unstable();
    let block = |row: i64| row.div_euclid(i64::from(lattice.alike_rows));
    let alike =
        |a: &(i64, i64), b: &(i64, i64)| a.0 == b.0 && a.1 + 1 == b.1 && block(a.1) == block(b.1);
    let cell_row = |run: &[(i64, i64)]| CellRow {
        rows: numbers::count(run.len()),
        ..empty_cell_row(run[0].0, run[0].1)
    };
    places.chunk_by(alike).map(cell_row).collect()
}

pub(crate) fn empty_cell_row(column: i64, row: i64) -> CellRow {
    CellRow {
        first_cell: 0,
        cell_count: 0,
        column: numbers::narrow::<u32>(column),
        row: numbers::narrow::<i32>(row),
        top: 0.0,
        bottom: 1.0,
        rows: 1,
        ..bytemuck::Zeroable::zeroed()
    }
}
