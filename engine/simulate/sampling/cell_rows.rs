//! Rows of cells from the rectangles of a patch: rectangles side by side at the same heights form a row.

use super::cell_batch::{CellBatch, empty_cell_row};
use super::cell_moments::{CellMoments, ExactCell};
use super::emission::Emitter;
use super::moment_recording::LinearModel;
use super::rectangle::{PatchPlace, Rectangle};
use beamlet_core::numbers;
use beamlet_interface::{Cell, CellRow, FLAG_EXACT};

/// A row of cells in the making.
#[derive(Default)]
struct RowCells {
    cells: Vec<Cell>,
    moments: CellMoments,
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
        let mut rest = moments;
        for row in rectangles.chunk_by(Rectangle::is_before) {
            let (own, after) = rest.split_at(words * row.len());
            rest = after;
            self.push_row(&mut out, patch, row, own);
        }
        out
    }

    /// Rectangles of a patch, without the rows whose light misses all recorded rows, and the number of those whose light
    /// lands too far off to follow.
    pub(super) fn landing(&self, row: i64, rectangles: Vec<Rectangle>) -> (Vec<Rectangle>, u64) {
        let farthest = self.view.lattice.halo as f32 * self.row_pitch;
        let is_off =
            |it: &&Rectangle| it.is_lit() && it.ends.result.landing_z(self.gap).abs() > farthest;
        let off = rectangles.iter().filter(is_off).count() as u64;
        if self.recorded_rows.contains(&row) {
            return (rectangles, off);
        }
        let lands = |it: &Rectangle| {
            let down = f64::from(self.view.down(&it.ends.result)) * self.view.delta_ratio();
            let [first, last] =
                [down.min(0.0).floor(), down.max(0.0).ceil()].map(numbers::whole::<i64>);
            row + first < self.recorded_rows.end && row + last + 1 > self.recorded_rows.start
        };
        let rows = rectangles.chunk_by(Rectangle::is_before);
        let kept = rows.filter(|row| row.iter().any(|it| it.is_lit() && lands(it)));
        (kept.flatten().copied().collect(), off)
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
        let mut row = RowCells::default();
        row.cells.reserve(rectangles.len());
        for (index, rectangle) in rectangles.iter().enumerate() {
            let of_cell = &moments[words * index..words * (index + 1)];
            self.push_cell(&mut row, rectangle, of_cell);
        }
        let column = patch.beamlet - self.view.lattice.beamlets.start;
        let cell_row = CellRow { top: z[0], bottom: z[1], ..empty_cell_row(column, patch.row) };
        if self.view.lattice.heights {
            out.push_together(cell_row, &row.cells, &row.moments);
        } else {
            out.push(cell_row, &row.cells, &row.moments);
        }
    }

    /// The cell of a rectangle, if any part of it lies in the period.
    fn push_cell(&self, row: &mut RowCells, rectangle: &Rectangle, moments: &[f32]) {
        let lattice = self.view.lattice;
        let LinearModel { result, depth, displacement } = &rectangle.ends;
        let x = rectangle.x;
        if !rectangle.is_lit() {
            return;
        }
        let displacement_z = result.landing_z(self.gap);
        let pixel_shift = result.pixel_shift(self.gap, self.ratio);
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
