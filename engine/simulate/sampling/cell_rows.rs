//! Rows of cells from the rectangles of a patch: rectangles side by side at the same heights form a row.

use super::cell_batch::{CellBatch, empty_cell_row};
use super::cell_moments::{CellMoments, ExactCell};
use super::emission::Emitter;
use super::moment_recording::LinearModel;
use super::rectangle::{PatchPlace, Rectangle};
use beamlet_core::numbers::{self, single};
use beamlet_interface::{Cell, CellRow, FLAG_EXACT, FLAG_NOT_FINITE};
use std::ops::Range;

/// Light of both ends of a rectangle that lands farther apart than this, relative to its height, is
/// spread over what lies between.
const STRETCHED: f64 = 0.2;
/// Cells of less height than this share of the blur have no tilt.
const LEAST_TILTED: f32 = 0.5;

/// Position of a row of cells.
struct RowPlace {
    patch: PatchPlace,
    /// Interval within the detector row, 0..1 downwards.
    z: [f32; 2],
}

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
            let place = RowPlace { patch, z: first.z };
            self.push_row(&mut out, &place, &rectangles[run.clone()], moments);
            begin = run.end;
        }
        out
    }

    /// A row of cells.
    fn push_row(
        &self,
        out: &mut CellBatch,
        place: &RowPlace,
        rectangles: &[Rectangle],
        moments: &[f32],
    ) {
        let RowPlace { patch, z, .. } = *place;
        if z[1] <= z[0] {
            return;
        }
        let words = moments.len() / rectangles.len();
        let mut row = RowCells { lands: 0..1, ..RowCells::default() };
        row.cells.reserve(rectangles.len());
        for (index, rectangle) in rectangles.iter().enumerate() {
            let of_cell = &moments[words * index..words * (index + 1)];
            self.push_cell(&mut row, place, rectangle, of_cell);
        }
        out.landed_off += row.landed_off;
        if patch.row + row.lands.end > self.recorded_rows.start
            && patch.row + row.lands.start < self.recorded_rows.end
        {
            let column = patch.beamlet - self.view.lattice.beamlets.start;
            let cell_row = CellRow { top: z[0], bottom: z[1], ..empty_cell_row(column, patch.row) };
            out.push(cell_row, &row.cells, &row.moments);
        }
    }

    /// The cell of a rectangle, if any part of it lies in the period.
    fn push_cell(
        &self,
        row: &mut RowCells,
        place: &RowPlace,
        rectangle: &Rectangle,
        moments: &[f32],
    ) {
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
        let down = -f64::from(displacement_z / self.row_pitch);
        let farthest = down * self.view.delta_ratio();
        row.lands.start = row.lands.start.min(numbers::whole::<i64>(farthest.floor()));
        row.lands.end = row.lands.end.max(numbers::whole::<i64>(farthest.ceil()) + 1);
        let [above, mut below] = self.row_shares(rectangle, place.z, down);
        let mut landing_z = displacement_z;
        if above < 0.0 && lattice.row_spread.is_wide() && self.view.recording.is_none() {
            let height = place.z[1] - place.z[0];
            if height > LEAST_TILTED * single(lattice.row_spread.blur) {
                below = rectangle.tilt;
            } else {
                // In f32 the tilt of a thin cell is lost in rounding: its centroid moves instead.
                landing_z -= rectangle.tilt * height / 12.0 * self.row_pitch;
            }
        }
        let mut above = above;
        if lattice.heights {
            [above, below, landing_z] = self.along_z(rectangle, place.z);
        }
        self.record(row, rectangle, moments);
        row.cells.push(Cell {
            x_low: x[0],
            x_high: x[1],
            depth_low: depth[0],
            depth_high: depth[1],
            displacement_low: displacement[0],
            displacement_high: displacement[1],
            displacement_z: landing_z,
            share_above: above,
            share_below: below,
            pixel_shift,
            displacement_variance: rectangle.displacement_variance,
            ..bytemuck::Zeroable::zeroed()
        });
    }

    /// Light of a rectangle along z, of its part at the heights `z`: growth of the landing over the height
    /// (rows), change of the light relative to its mean, and displacement on the detector (m).
    fn along_z(&self, rectangle: &Rectangle, z: [f32; 2]) -> [f32; 3] {
        let part = (z[1] - z[0]) / (rectangle.z[1] - rectangle.z[0]);
        let aside = 0.5 * (z[0] + z[1]) - 0.5 * (rectangle.z[0] + rectangle.z[1]);
        let [up, low] = rectangle.ends_z;
        let slope = (low - up) / (rectangle.z[1] - rectangle.z[0]);
        let growth = -part * (low - up) / self.row_pitch;
        [growth, part * rectangle.tilt, 0.5 * (up + low) + slope * aside]
    }

    /// Shares of the light of a rectangle that land in the rows above and below, of its part at the
    /// heights `z`; `down`: how far the light lands below its place, rows.
    fn row_shares(&self, rectangle: &Rectangle, z: [f32; 2], down: f64) -> [f32; 2] {
        let lattice = self.view.lattice;
        let [top, bottom] = z.map(f64::from);
        // Its upper end may land otherwise than its lower one.
        let own = rectangle.z.map(f64::from);
        let at = |z: f64| {
            let [up, low] = rectangle.ends_z.map(f64::from);
            -(up + (low - up) * (z - own[0]) / (own[1] - own[0])) / f64::from(self.row_pitch)
        };
        let landing = [top + at(top), bottom + at(bottom)];
        if let Some(shares) = rectangle.shares {
            return shares;
        }
        if landing[1] - landing[0] > STRETCHED * (bottom - top) {
            lattice.row_shares(landing[0], landing[1], 0.0)
        } else {
            lattice.row_shares(top, bottom, down)
        }
    }

    /// Records the moments at both ends of the cell that comes next, and its rays where they were traced exactly.
    fn record(&self, row: &mut RowCells, rectangle: &Rectangle, moments: &[f32]) {
        if rectangle.ends.result.flags & FLAG_EXACT != 0 && self.view.recording.is_some() {
            row.moments.exact.push(ExactCell {
                cell: numbers::count(row.cells.len()),
                ray: rectangle.ray,
                results: rectangle.ends.results(),
            });
        }
        row.moments.ends.extend_from_slice(moments);
    }
}
