//! Cells of one lattice as cells of another: cut where beamlets and rows end, their moments
//! interpolated in between, and taken to another analyser.

use crate::sampling::{
    CellBatch, CellMoments, ExactCell, Lattice, blank_cell_rows, empty_cell, empty_cell_row,
};
use beamlet_core::numbers::{self, single};
use beamlet_core::{Error, Result};
use beamlet_interface::{Cell, CellRow, MOMENTS_PER_MATERIAL, MOMENTS_PER_PAIR};
use beamlet_model::optics::Optics;
use std::collections::HashMap;
use std::ops::Range;

/// Pieces thinner than this share of a period or row come from rounding.
const SLIVER: f64 = 1e-6;

/// A beamlet and row is covered where cell rows take this share of it: slanting ones leave gaps and
/// overlaps of the same size.
const COVERED: f64 = 0.999;

/// From the lattice of one scene to the lattice of another with the same sample.
#[derive(Debug, Clone)]
pub(super) struct Resampled {
    old: Lattice,
    new: Lattice,
    /// Rows of the detectors.
    rows: [f64; 2],
    /// dz/dy per row.
    row_slopes: [f64; 2],
    /// From the old analyser to the new one, m.
    lever: f64,
    /// Words of a ray's moments that belong to materials, and not to pairs of them.
    of_materials: usize,
    same_columns: bool,
    same_rows: bool,
}

/// Parts of the new lattice that kept cell rows cover: by row and beamlet, intervals of z in the row with
/// intervals of x.
#[derive(Debug, Default)]
pub(super) struct Covered(HashMap<(i64, i64), Vec<[f64; 4]>>);

impl Covered {
    pub(super) fn bytes(&self) -> usize {
        let rows = self.0.capacity() * size_of::<((i64, i64), Vec<[f64; 4]>)>();
        rows + self.0.values().map(|parts| parts.capacity() * size_of::<[f64; 4]>()).sum::<usize>()
    }
}

impl Resampled {
    /// # Errors
    /// [`Error::Scene`] where the new field of view is not inside the old one.
    pub(super) fn new(
        [from, to]: [&Optics; 2],
        [old, new]: [&Lattice; 2],
        materials: usize,
    ) -> Result<Self> {
        let rows = [from, to].map(|optics| f64::from(optics.detector.pixels[1]));
        let row_slopes = [from, to].map(|optics| optics.detector.row_slope());
        let reach = |l: &Lattice, beamlets: &Range<i64>| {
            [l.centre(beamlets.start), l.centre(beamlets.end - 1)].map(|x| x / l.plane)
        };
        let (had, wanted) = (reach(old, &old.beamlets), reach(new, &new.direct));
        let step = old.period / old.plane;
        if wanted[0] < had[0] - step || wanted[1] > had[1] + step {
            return Err(outside("detector.pixels", "columns", wanted[1] / had[1]));
        }
        let height = [0, 1].map(|i| rows[i] * row_slopes[i]);
        if height[1] > height[0] * (1.0 + 1e-9) {
            return Err(outside("detector.pixels", "rows", height[1] / height[0]));
        }
        // The reach of a wider spot or a lattice displaced by less than a period may add empty
        // beamlets at the rim; beamlets of the same lattice keep their cells bit by bit.
        let same_columns = old.plane.to_bits() == new.plane.to_bits()
            && old.period.to_bits() == new.period.to_bits()
            && old.offset.to_bits() == new.offset.to_bits()
            && from.detector.pixels[0] == to.detector.pixels[0];
        let same_rows = rows[0].to_bits() == rows[1].to_bits()
            && row_slopes[0].to_bits() == row_slopes[1].to_bits();
        Ok(Self {
            old: old.clone(),
            new: new.clone(),
            rows,
            row_slopes,
            lever: to.analyser - from.analyser,
            of_materials: materials * MOMENTS_PER_MATERIAL,
            same_columns,
            same_rows,
        })
    }

    /// True if cells are cut at the borders of other beamlets or rows.
    pub(super) const fn cuts(&self) -> bool {
        !(self.same_columns && self.same_rows)
    }

    /// The lattice of the cell rows.
    pub(super) const fn old(&self) -> &Lattice {
        &self.old
    }

    /// True if the cells that `other` makes of cell rows of the same run are the same.
    pub(super) fn maps_like(&self, other: &Self) -> bool {
        let numbers =
            |r: &Self| [r.rows, r.row_slopes, [r.lever, 0.0]].map(|n| n.map(f64::to_bits));
        self.new.places_like(&other.new)
            && numbers(self) == numbers(other)
            && [self.same_columns, self.same_rows] == [other.same_columns, other.same_rows]
    }

    /// Row coordinate on the new detector.
    fn row(&self, old: f64) -> f64 {
        if self.same_rows {
            return old;
        }
        0.5 * self.rows[1] - (0.5 * self.rows[0] - old) * self.row_slopes[0] / self.row_slopes[1]
    }

    /// Rows of the old detector that rows of the new one see.
    pub(super) fn old_rows(&self, rows: &Range<i64>) -> Range<i64> {
        if self.same_rows {
            return rows.clone();
        }
        let old = |new: i64| {
            let from_axis = (0.5 * self.rows[1] - new as f64) * self.row_slopes[1];
            0.5 * self.rows[0] - from_axis / self.row_slopes[0]
        };
        numbers::whole::<i64>(old(rows.start).floor())..numbers::whole::<i64>(old(rows.end).ceil())
    }

    /// The cell rows of `rows` of the new detector.
    pub(super) fn map(
        &self,
        cell_rows: CellBatch,
        rows: &Range<i64>,
        covered: &mut Covered,
    ) -> CellBatch {
        if self.same_columns && self.same_rows && self.lever.to_bits() == 0 {
            return self.keep(cell_rows, rows, covered);
        }
        let mut out = CellBatch::default();
        for cell_row in &cell_rows.cell_rows {
            let at = f64::from(cell_row.row);
            let [top, bottom] =
                [cell_row.top, cell_row.bottom].map(|z| self.row(at + f64::from(z)));
            for row in numbers::whole::<i64>(top.floor())..numbers::whole::<i64>(bottom.ceil()) {
                let z = [top.max(row as f64), bottom.min((row + 1) as f64)].map(|z| z - row as f64);
                if rows.contains(&row) && z[1] - z[0] > SLIVER {
                    self.map_cell_row(&cell_rows, cell_row, row, z, &mut out, covered);
                }
            }
        }
        out
    }

    /// Cell rows of the same lattice: cell rows in `rows` do not change.
    fn keep(
        &self,
        mut cell_rows: CellBatch,
        rows: &Range<i64>,
        covered: &mut Covered,
    ) -> CellBatch {
        let CellBatch { cell_rows: all, cells, .. } = &mut cell_rows;
        all.retain_mut(|cell_row| {
            let beamlet = i64::from(cell_row.column) + self.old.beamlets.start;
            let row = i64::from(cell_row.row);
            if !rows.contains(&row) || !self.new.beamlets.contains(&beamlet) {
                return false;
            }
            cell_row.column = numbers::narrow::<u32>(beamlet - self.new.beamlets.start);
            let of_row = &cells[cell_row.first_cell as usize
                ..(cell_row.first_cell + cell_row.cell_count) as usize];
            if let [first, .., last] | [first @ last] = of_row {
                let [top, bottom] = [cell_row.top, cell_row.bottom].map(f64::from);
                let x = [first.x_low, last.x_high].map(f64::from);
                covered.0.entry((row, beamlet)).or_default().push([top, bottom, x[0], x[1]]);
            }
            true
        });
        cell_rows
    }

    fn map_cell_row(
        &self,
        cell_rows: &CellBatch,
        cell_row: &CellRow,
        row: i64,
        z: [f64; 2],
        out: &mut CellBatch,
        covered: &mut Covered,
    ) {
        let words = cell_rows.moments.ends.len() / cell_rows.cells.len().max(1) / 2;
        let old_beamlet = i64::from(cell_row.column) + self.old.beamlets.start;
        let scale = self.new.plane / self.old.plane;
        let first = cell_row.first_cell as usize;
        let mut from = cell_rows.moments.exact.partition_point(|e| (e.cell as usize) < first);
        let mut piece = NewBeamlet::default();
        for index in first..first + cell_row.cell_count as usize {
            let cell = &cell_rows.cells[index];
            let ends = &cell_rows.moments.ends[2 * words * index..2 * words * (index + 1)];
            let exact = cell_rows.moments.exact.get(from).filter(|e| e.cell as usize == index);
            from += usize::from(exact.is_some());
            let [low, high] = [cell.x_low, cell.x_high]
                .map(|x| (self.old.centre(old_beamlet) + f64::from(x)) * scale);
            let beamlets = if self.same_columns {
                old_beamlet..old_beamlet + 1
            } else {
                self.new.beamlet_at(low)..self.new.beamlet_at(high) + 1
            };
            for beamlet in beamlets {
                let centre = self.new.centre(beamlet);
                let half = 0.5 * self.new.period;
                let cut = if self.same_columns {
                    [low, high]
                } else {
                    [low.max(centre - half), high.min(centre + half)]
                };
                let whole = cut[0].to_bits() == low.to_bits() && cut[1].to_bits() == high.to_bits();
                if cut[1] <= cut[0] || (!whole && cut[1] - cut[0] < SLIVER * 1e-3 * self.new.period)
                {
                    continue;
                }
                if piece.beamlet != Some(beamlet) {
                    self.flush(&mut piece, row, z, out, covered);
                    piece.beamlet = Some(beamlet);
                }
                let x = if self.same_columns {
                    [cell.x_low, cell.x_high]
                } else {
                    cut.map(|x| single(x - centre))
                };
                if x[1] <= x[0] {
                    continue;
                }
                let share =
                    if whole { [0.0, 1.0] } else { cut.map(|x| single((x - low) / (high - low))) };
                piece.push(
                    Cell { x_low: x[0], x_high: x[1], ..*cell },
                    ends,
                    share,
                    exact,
                    (self.lever, self.of_materials),
                );
            }
        }
        self.flush(&mut piece, row, z, out, covered);
    }

    /// Appends the cell row of a beamlet.
    fn flush(
        &self,
        piece: &mut NewBeamlet,
        row: i64,
        z: [f64; 2],
        out: &mut CellBatch,
        covered: &mut Covered,
    ) {
        let done = std::mem::take(piece);
        let (Some(beamlet), Some(first), Some(last)) =
            (done.beamlet, done.cells.first(), done.cells.last())
        else {
            return;
        };
        if !self.new.beamlets.contains(&beamlet) {
            return;
        }
        let x = [first.x_low.into(), last.x_high.into()];
        covered.0.entry((row, beamlet)).or_default().push([z[0], z[1], x[0], x[1]]);
        let cell_row = CellRow {
            top: single(z[0]),
            bottom: single(z[1]),
            ..empty_cell_row(beamlet - self.new.beamlets.start, row)
        };
        out.push(cell_row, &done.cells, &done.moments);
    }

    /// Cell rows of what no kept cell row covers: there is no sample there.
    pub(super) fn blank(
        &self,
        rows: &Range<i64>,
        lit: &Range<i64>,
        covered: &Covered,
    ) -> CellBatch {
        let mut out = CellBatch::default();
        let whole = empty_cell(&self.new);
        let half = 0.5 * self.new.period;
        let mut blank = Vec::new();
        for row in rows.start.max(lit.start)..rows.end.min(lit.end) {
            for beamlet in self.new.direct.clone() {
                let cell_row = empty_cell_row(beamlet - self.new.beamlets.start, row);
                let Some(parts) = covered.0.get(&(row, beamlet)) else {
                    blank.push((i64::from(cell_row.column), row));
                    continue;
                };
                let ends = half - SLIVER * self.new.period;
                let whole_beamlet = |p: &[f64; 4]| {
                    p[0] <= SLIVER && p[1] >= 1.0 - SLIVER && p[2] <= -ends && p[3] >= ends
                };
                // Most patches are covered whole, by one cell or by many.
                let area: f64 = parts.iter().map(|p| (p[1] - p[0]) * (p[3] - p[2])).sum();
                if parts.iter().any(whole_beamlet) || area >= COVERED * self.new.period {
                    continue;
                }
                let mut edges: Vec<f64> = parts.iter().flat_map(|p| [p[0], p[1]]).collect();
                edges.extend([0.0, 1.0]);
                edges.sort_by(f64::total_cmp);
                for z in edges.windows(2).filter(|z| z[1] - z[0] > SLIVER) {
                    let middle = 0.5 * (z[0] + z[1]);
                    let mut taken: Vec<[f64; 2]> = parts
                        .iter()
                        .filter(|p| p[0] < middle && p[1] > middle)
                        .map(|p| [p[2], p[3]])
                        .collect();
                    taken.sort_by(|a, b| a[0].total_cmp(&b[0]));
                    taken.push([half, half]);
                    let mut cells = Vec::new();
                    let mut x = -half;
                    for [low, high] in taken {
                        if low - x > SLIVER * self.new.period {
                            cells.push(Cell { x_low: single(x), x_high: single(low), ..whole });
                        }
                        x = x.max(high);
                    }
                    let [above, below] = self.new.row_shares(z[0], z[1], 0.0);
                    for cell in &mut cells {
                        (cell.share_above, cell.share_below) = (above, below);
                    }
                    let cell_row = CellRow { top: single(z[0]), bottom: single(z[1]), ..cell_row };
                    out.push(cell_row, &cells, &CellMoments::default());
                }
            }
        }
        for cell_row in blank_cell_rows(&self.new, blank) {
            out.push(cell_row, &[whole], &CellMoments::default());
        }
        out
    }
}

/// Cells of one new beamlet in the making.
#[derive(Default)]
struct NewBeamlet {
    beamlet: Option<i64>,
    cells: Vec<Cell>,
    moments: CellMoments,
}

impl NewBeamlet {
    /// Takes the part `share` of a cell, to an analyser farther by `lever`.
    fn push(
        &mut self,
        cell: Cell,
        ends: &[f32],
        share: [f32; 2],
        exact: Option<&ExactCell>,
        (lever, of_materials): (f64, usize),
    ) {
        let (low, high) = ends.split_at(ends.len() / 2);
        for at in share {
            let first = self.moments.ends.len();
            let mix = |(a, b): (&f32, &f32)| {
                if at <= 0.0 {
                    *a
                } else if at >= 1.0 {
                    *b
                } else {
                    a + (b - a) * at
                }
            };
            self.moments.ends.extend(low.iter().zip(high).map(mix));
            let (materials, pairs) = self.moments.ends[first..].split_at_mut(of_materials);
            for m in materials.chunks_exact_mut(MOMENTS_PER_MATERIAL) {
                m[1] += single(f64::from(m[3]) * lever);
                m[2] += single(f64::from(m[4]) * lever);
            }
            for m in pairs.chunks_exact_mut(MOMENTS_PER_PAIR) {
                let [plain, levered] = [m[0], m[1]].map(f64::from);
                m[1] += single(plain * lever);
                m[2] += single((2.0 * levered + plain * lever) * lever);
            }
        }
        if let Some(exact) = exact {
            let range = exact.range[1] - exact.range[0];
            self.moments.exact.push(ExactCell {
                cell: numbers::count(self.cells.len()),
                range: share.map(|t| exact.range[0] + range * t),
                results: exact.results.map(|mut result| {
                    result.displacement_x += single(f64::from(result.slope_x) * lever);
                    result.displacement_z += single(f64::from(result.slope_z) * lever);
                    result
                }),
                ..*exact
            });
        }
        self.cells.push(cell);
    }
}

fn outside(key: &str, what: &str, times: f64) -> Error {
    Error::scene(
        key,
        format!("a field of view {times:.3} times as wide as the stored moments in {what}"),
        "a field of view inside the stored one",
    )
}
