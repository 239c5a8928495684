//! Phase: refraction angles integrated along the rows.

use super::geometry::{ScanGeometry, same_shape};
use crate::retrieve::{Drift, DriftSum, borders, integrated_row};
use beamlet_core::{Cancel, Error, Result, parallel, reserve};
use ndarray::{Array3, ArrayView3};
use rayon::prelude::*;

/// Refraction angles (rad), `[view][row][column]`, integrated along the rows: the integral of δ over the
/// depth t, m, where δ counts by the lever arm and by 1/(1 + t/D), D the distance from source to axis.
/// Angles that are not finite, or not `usable`, are interpolated linearly between those beside them. The
/// sum over a row is a drift, where air is on both sides of the sample: it is taken off as a ramp, so that
/// rows begin and end at 0. Truncated rows have no phase.
///
/// # Errors
/// [`Error::Argument`] for a geometry that cannot be, arrays of another shape, rows without an angle.
pub fn phase_along_rows(
    geometry: &ScanGeometry,
    angles: ArrayView3<'_, f32>,
    usable: Option<ArrayView3<'_, bool>>,
) -> Result<Array3<f32>> {
    integrated(geometry, angles, usable, &Cancel::default()).map(|(phase, _)| phase)
}

/// As [`phase_along_rows`], with the drift that was taken off.
pub(super) fn integrated(
    geometry: &ScanGeometry,
    angles: ArrayView3<'_, f32>,
    usable: Option<ArrayView3<'_, bool>>,
    cancel: &Cancel,
) -> Result<(Array3<f32>, Drift)> {
    geometry.check()?;
    same_shape("angles", angles.dim(), geometry.dim())?;
    if let Some(usable) = &usable {
        same_shape("usable", usable.dim(), geometry.dim())?;
    }
    parallel::start_threads()?;
    let (views, rows, columns) = geometry.dim();
    let made: Vec<(Vec<f32>, f64, u64)> = (0..views * rows)
        .into_par_iter()
        .map(|number| {
            cancel.check()?;
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
            let tangent = |place: f64| geometry.tangents(place, row)[0];
            let scale = geometry.magnification();
            let (phase, mean) = integrated_row(&known, &geometry.columns, scale, tangent);
            Ok((phase, mean, (columns - known.len()) as u64))
        })
        .collect::<Result<_>>()?;
    let shape = geometry.dim();
    let mut phase: Vec<f32> = reserve::room(shape.0 * shape.1 * shape.2, "integrated angles")?;
    let mut sum = DriftSum::default();
    for (row, mean, filled) in &made {
        phase.extend(row);
        sum.take(*mean, row, *filled);
    }
    let borders = borders(&geometry.columns);
    let drift = sum.drift((borders[columns] - borders[0]) / geometry.magnification());
    let phase = Array3::from_shape_vec(shape, phase).unwrap_or_else(|_| Array3::zeros(shape));
    Ok((phase, drift))
}
