//! Whether moments can belong to their run: a file may have a good hash and come from a broken program or
//! hand. Later stages index and loop by these numbers.

use crate::sampling::{CellBatch, ExactCell, Lattice};
use beamlet_core::numbers::single;
use beamlet_interface::{Cell, CellRow, FLAG_NOT_FINITE, Ray, RayResult};
use std::ops::Range;

/// Rounding of places in a row or period.
const SLACK: f32 = 1e-3;
/// Largest moment, sum of a path (m) or of tangents of incidence: up to 1e9 for each crossing of a ray that
/// grazes (`LEAST_ALONG` of the shaders). Squares of this limit are finite.
const MOMENT: f32 = 1e18;
/// Largest displacement (m), slope (rad) or optical depth of a traced ray.
const WALKED: f32 = 1e4;

/// Requirements on the moments of a view.
#[derive(Debug, Clone, Copy)]
pub(super) struct Bounds {
    /// Beamlets of the run's lattice.
    columns: u32,
    /// Half a period, m.
    half: f32,
    view: u32,
}

impl Bounds {
    pub(super) fn of(lattice: &Lattice, view: u32) -> Self {
        let columns = lattice.beamlets.end - lattice.beamlets.start;
        Self {
            columns: u32::try_from(columns).unwrap_or(0),
            half: single(0.5 * lattice.period) * (1.0 + SLACK),
            view,
        }
    }

    /// The defect of the cell rows of a block of these rows.
    pub(super) fn check(
        self,
        cell_rows: &CellBatch,
        rows: &Range<i64>,
    ) -> Result<(), &'static str> {
        let mut next = 0_u32;
        for cell_row in &cell_rows.cell_rows {
            if cell_row.first_cell != next || cell_row.cell_count == 0 {
                return Err("cell rows that do not follow one another");
            }
            next = next.checked_add(cell_row.cell_count).ok_or("more cells than can be counted")?;
            self.cell_row(cell_row, rows)?;
        }
        if next as usize != cell_rows.cells.len() {
            return Err("cells of no cell row");
        }
        let good = |cell: &Cell| {
            let floats: &[f32] = bytemuck::cast_slice(std::slice::from_ref(cell));
            floats.iter().all(|value| value.is_finite())
                && -self.half <= cell.x_low
                && cell.x_low <= cell.x_high
                && cell.x_high <= self.half
        };
        if !cell_rows.cells.iter().all(good) {
            return Err("cells outside their beamlet, or values that are not finite");
        }
        // Also false for NaN.
        if !cell_rows.moments.ends.iter().all(|value| value.abs() <= MOMENT) {
            return Err("moments of no ray");
        }
        let exact = &cell_rows.moments.exact;
        let ascend = exact.windows(2).all(|pair| pair[0].cell < pair[1].cell);
        if !ascend || exact.last().is_some_and(|last| last.cell >= next) {
            return Err("exact cells that do not exist");
        }
        match exact.iter().all(|cell| self.is_exact(cell)) {
            true => Ok(()),
            false => Err("exact rays that no tracing has"),
        }
    }

    fn cell_row(self, cell_row: &CellRow, rows: &Range<i64>) -> Result<(), &'static str> {
        let last = i64::from(cell_row.row) + i64::from(cell_row.rows) - 1;
        let inside = rows.contains(&i64::from(cell_row.row)) && rows.contains(&last);
        if !inside || cell_row.column >= self.columns {
            return Err("cell rows outside their rows or columns");
        }
        let floats = [
            cell_row.light,
            cell_row.low_landing,
            cell_row.high_landing,
            cell_row.displacement_variance,
            cell_row.displacement_slope,
        ];
        let in_row = -SLACK <= cell_row.top
            && cell_row.top < cell_row.bottom
            && cell_row.bottom <= 1.0 + SLACK;
        match in_row && floats.iter().all(|value| value.is_finite()) {
            true => Ok(()),
            false => Err("cell rows outside their row, or values that are not finite"),
        }
    }

    fn is_exact(self, cell: &ExactCell) -> bool {
        let ray = |ray: &Ray| {
            let floats = [ray.x, ray.z, ray.slope_x, ray.slope_z];
            ray.pose == self.view && floats.iter().all(|value| value.abs() <= WALKED)
        };
        let result = |result: &RayResult| {
            let RayResult {
                optical_depth, displacement_x, displacement_z, slope_x, slope_z, ..
            } = *result;
            let floats = [optical_depth, displacement_x, displacement_z, slope_x, slope_z];
            result.flags & FLAG_NOT_FINITE != 0 || floats.iter().all(|value| value.abs() <= WALKED)
        };
        cell.ends.iter().all(ray) && cell.results.iter().all(result)
    }
}
