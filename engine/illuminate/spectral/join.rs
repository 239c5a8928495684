//! Neighbouring cells of faint light joined to fewer.

#![allow(clippy::cast_possible_truncation, reason = "rounding to f32 is meant")]

use crate::gpu::interface::Cell;

/// Joins neighbouring cells up to a width, with their light, their mean displacement and its
/// spread. Cells of one interval that stand for several bands of energies are joined too.
pub(super) fn join(cells: &[Cell], width: f64) -> Vec<Cell> {
    let mut out: Vec<Cell> = Vec::new();
    let mut first = 0;
    while first < cells.len() {
        let low = cells[first].x_low;
        let fits = |c: &Cell| f64::from(c.x_high - low) <= width;
        let more = cells[first..].iter().take_while(|c| fits(c)).count().max(1);
        // Never between bands of one interval.
        let end = cells[first + more - 1].x_high;
        let more = cells[first..].iter().take_while(|c| c.x_high <= end).count();
        out.push(joined(&cells[first..first + more]));
        first += more;
    }
    out
}

fn joined(cells: &[Cell]) -> Cell {
    let (first, last) = (cells[0], cells[cells.len() - 1]);
    if cells.len() == 1 {
        return first;
    }
    let amount = |c: &Cell| {
        f64::from(c.x_high - c.x_low) * f64::from((-0.5 * (c.depth_low + c.depth_high)).exp())
    };
    let light: f64 = cells.iter().map(amount).sum();
    let mean =
        |of: &dyn Fn(&Cell) -> f64| cells.iter().map(|c| amount(c) * of(c)).sum::<f64>() / light;
    let x = |c: &Cell| 0.5 * f64::from(c.displacement_low + c.displacement_high);
    let middle = mean(&x);
    let spread = mean(&|c| f64::from(c.spread) + (x(c) - middle).powi(2));
    let depth = -(light / f64::from(last.x_high - first.x_low)).ln() as f32;
    Cell {
        x_low: first.x_low,
        x_high: last.x_high,
        depth_low: depth,
        depth_high: depth,
        displacement_low: middle as f32,
        displacement_high: middle as f32,
        spread: spread as f32,
        sample_shade: mean(&|c| c.sample_shade.into()) as f32,
        detector_shade: mean(&|c| c.detector_shade.into()) as f32,
        pixel_shift: mean(&|c| c.pixel_shift.into()) as f32,
        ..cells[cells.len() / 2]
    }
}
