//! Phase: refraction angles integrated along the rows.

use super::geometry::{ScanGeometry, borders, same_shape};
use crate::numbers::single;
use crate::{Error, Result, parallel};
use ndarray::{Array3, ArrayView3};
use rayon::prelude::*;

/// Refraction angles (rad), `[view][row][column]`, integrated along the rows: the integral of δ over the
/// depth t, m, where δ counts by the lever arm and by 1/(1 + t/D), D the distance from source to axis. Angles that are not finite, or not `usable`, are interpolated linearly between those
/// beside them. The sum over a row is a drift, where air is on both sides of the sample: it is taken off
/// as a ramp, so that rows begin and end at 0. Truncated rows have no phase.
///
/// # Errors
/// [`Error::Argument`] for a geometry that cannot be, arrays of another shape, rows without an angle.
pub fn phase_along_rows(
    geometry: &ScanGeometry,
    angles: ArrayView3<'_, f32>,
    usable: Option<ArrayView3<'_, bool>>,
) -> Result<Array3<f32>> {
    geometry.check()?;
    same_shape("angles", angles.dim(), geometry.dim())?;
    if let Some(usable) = &usable {
        same_shape("usable", usable.dim(), geometry.dim())?;
    }
    parallel::start_threads()?;
    let (views, rows, columns) = geometry.dim();
    let made: Vec<Vec<f32>> = (0..views * rows)
        .into_par_iter()
        .map(|number| {
            let (view, row) = (number / rows, number % rows);
            let known: Vec<(usize, f64)> = (0..columns)
                .filter(|column| usable.as_ref().is_none_or(|usable| usable[[view, row, *column]]))
                .map(|column| (column, f64::from(angles[[view, row, column]])))
                .filter(|(_, angle)| angle.is_finite())
                .collect();
            if known.is_empty() {
                let found = format!("none in view {view}, row {row}");
                return Err(Error::argument("angles", found, "one or more in each row"));
            }
            Ok(of_row(geometry, row, &known))
        })
        .collect::<Result<_>>()?;
    let shape = geometry.dim();
    Ok(Array3::from_shape_vec(shape, made.concat()).unwrap_or_else(|_| Array3::zeros(shape)))
}

/// Phase of a row, at its columns, by the angles that are known.
fn of_row(geometry: &ScanGeometry, row: usize, known: &[(usize, f64)]) -> Vec<f32> {
    let places = &geometry.columns;
    let angle = |column: usize| {
        let next = known.partition_point(|(at, _)| *at < column);
        match (next.checked_sub(1).map(|before| known[before]), known.get(next).copied()) {
            (_, Some((at, angle))) if at == column => angle,
            (Some((a, from)), Some((b, to))) => {
                let share = (places[column] - places[a]) / (places[b] - places[a]);
                from + share * (to - from)
            }
            (Some((_, angle)), None) | (None, Some((_, angle))) => angle,
            (None, None) => 0.0,
        }
    };
    let borders = borders(places);
    let scale = geometry.magnification();
    let mut sums = vec![0.0];
    for (column, place) in places.iter().enumerate() {
        let [change, _] = geometry.tangents(*place, row);
        let width = (borders[column + 1] - borders[column]) / scale;
        sums.push(sums[column] - angle(column) * width / change);
    }
    let last = places.len();
    let ramp = sums[last] / (borders[last] - borders[0]);
    let levelled = |n: usize| sums[n] - ramp * (borders[n] - borders[0]);
    (0..last).map(|column| single(f64::midpoint(levelled(column), levelled(column + 1)))).collect()
}
