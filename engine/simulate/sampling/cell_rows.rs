//! Rows of cells from the rectangles of a patch: rectangles side by side at the same heights form a row.

use super::cell_batch::{CellBatch, empty_cell_row};
use super::cell_moments::{CellMoments, ExactCell};
use super::emission::Emitter;
use super::moment_recording::LinearModel;
use super::rectangle::{PatchPlace, Rectangle};
use beamlet_core::numbers;
use beamlet_interface::{Cell, CellRow, FLAG_EXACT, FLAG_NOT_FINITE};
use std::ops::Range;

/// A row of cells in the making.
#[derive(Default)]
struct RowCells {
    cells: Vec<Cell>,
    moments: CellMoments,
    /// Rows where the light lands, relative to the row of the patch.
    lands: Range<i64>,
    /// Cells whose light lands too far off to follow.
    landed_off: u64,
}

impl Emitter<'_> {
    /// The rows of cells of a patch; `moments`: `[rectangle][end][material][moment]`, where they
    /// are recorded.
    pub(super) fn cell_rows(
        &self,
        patch: PatchPlace,
        rectangles: &[Rectangle],
        moments: &[f32],
        words: usize,
    ) -> CellBatch {
        let mut out = CellBatch::default();
        let words = if moments.is_empty() { 0 } else { 2 * words };
        let mut begin = 0;
        while begin < rectangles.len() {
            let first = &rectangles[begin];
            let runs_on = |pair: &[Rectangle]| {
                pair[0].x[1].to_bits() == pair[1].x[0].to_bits()
                    && pair[1].z.map(f32::to_bits) == first.z.map(f32::to_bits)
            };
            let more = rectangles[begin..].windows(2).take_while(|pair| runs_on(pair)).count();
            let run = begin..begin + more + 1;
            let moments = &moments[words * run.start..words * run.end];
            self.push_row(&mut out, patch, &rectangles[run.clone()], moments);
            begin = run.end;
        }
        out
    }

    /// A row of cells, of rectangles at the same heights.
    fn push_row(
        &self,
        out: &mut CellBatch,
        patch: PatchPlace,
        rectangles: &[Rectangle],
        moments: &[f32],
    ) {
        let z = rectangles[0].z;
        if z[1] <= z[0] {
            return;
        }
        let words = moments.len() / rectangles.len();
        let mut row = RowCells { lands: 0..1, ..RowCells::default() };
        row.cells.reserve(rectangles.len());
        for (index, rectangle) in rectangles.iter().enumerate() {
            let of_cell = &moments[words * index..words * (index + 1)];
            self.push_cell(&mut row, rectangle, of_cell);
        }
        out.landed_off += row.landed_off;
        if patch.row + row.lands.end > self.recorded_rows.start
            && patch.row + row.lands.start < self.recorded_rows.end
        {
            let column = patch.beamlet - self.view.lattice.beamlets.start;
            let cell_row = CellRow { top: z[0], bottom: z[1], ..empty_cell_row(column, patch.row) };
            if self.view.lattice.heights {
                out.push_together(cell_row, &row.cells, &row.moments);
            } else {
                out.push(cell_row, &row.cells, &row.moments);
            }
        }
    }

    /// The cell of a rectangle, if any part of it lies in the period.
    fn push_cell(&self, row: &mut RowCells, rectangle: &Rectangle, moments: &[f32]) {
        let lattice = self.view.lattice;
        let LinearModel { result, depth, displacement } = &rectangle.ends;
        let x = rectangle.x;
        // The tally has the ray of one that is not finite.
        if x[1] <= x[0] || result.flags & FLAG_NOT_FINITE != 0 {
            return;
        }
        let displacement_z = result.landing_z(self.gap);
        if displacement_z.abs() > lattice.halo as f32 * self.row_pitch {
            row.landed_off += 1;
        }
        let pixel_shift = result.pixel_shift(self.gap, self.ratio);
        let farthest = f64::from(self.view.down(result)) * self.view.delta_ratio();
        row.lands.start = row.lands.start.min(numbers::whole::<i64>(farthest.floor()));
        row.lands.end = row.lands.end.max(numbers::whole::<i64>(farthest.ceil()) + 1);
        let [share_above, share_below, landing_z] = if lattice.heights {
            // Growth of the landing over the height (rows), and change of the light relative to its mean.
            let [up, low] = rectangle.ends_z;
            [-(low - up) / self.row_pitch, rectangle.tilt, 0.5 * (up + low)]
        } else {
            let [above, below] = self.row_shares(rectangle, displacement_z);
            [above, below, displacement_z]
        };
        if result.flags & FLAG_EXACT != 0 && self.view.recording.is_some() {
            row.moments.exact.push(ExactCell {
                cell: numbers::count(row.cells.len()),
                ray: rectangle.ray,
                results: rectangle.ends.results(),
            });
        }
        row.moments.ends.extend_from_slice(moments);
        row.cells.push(Cell {
            x_low: x[0],
            x_high: x[1],
            depth_low: depth[0],
            depth_high: depth[1],
            displacement_low: displacement[0],
            displacement_high: displacement[1],
            displacement_z: landing_z,
            share_above,
            share_below,
            pixel_shift,
            displacement_variance: rectangle.displacement_variance,
            ..bytemuck::Zeroable::zeroed()
        });
    }

    /// Shares of the light of a rectangle that land in the rows above and below; `landing_z`: its displacement on the
    /// detector, m.
    fn row_shares(&self, rectangle: &Rectangle, landing_z: f32) -> [f32; 2] {
        rectangle.shares.unwrap_or_else(|| {
            let [top, bottom] = rectangle.z.map(f64::from);
            let down = -f64::from(landing_z) / f64::from(self.row_pitch);
            self.view.lattice.row_shares(top, bottom, down)
        })
    }
}
