//! Moments of the refraction angles of views: the area of δ in their slices.

use super::geometry::ScanGeometry;
use beamlet_core::{Error, Result, parallel};
use ndarray::{Array2, ArrayView1, ArrayView3, Axis, s};
use rayon::prelude::*;

/// Mean −ln T at an end of a row, over the largest mean as wide, beyond which a body reaches the end.
const REACHES: f64 = 0.2;
/// Columns whose mean is an end of a row, as a share of the row.
const END: usize = 16;

/// Integral of α·x over each row, `[view][row]`, m²: ∬ δ (1 − t/z) (D/(D + t))² dA over the slice, t the depth
/// behind the axis, D the distance from the source to the axis, and z the lever arm; x and dx are taken at the
/// axis. In thin samples it is the area of δ, equal in all views. In rows
/// inclined by κ gradients of δ along z add x τ κ ∂δ/∂z, τ the slope of a line in the plane of the row.
///
/// # Errors
/// [`Error::Argument`] where threads cannot begin.
pub(super) fn moments(
    geometry: &ScanGeometry,
    sinograms: ArrayView3<'_, f32>,
) -> Result<Array2<f64>> {
    parallel::start_threads()?;
    let (views, rows, _) = geometry.dim();
    let weights: Vec<Vec<f64>> = (0..rows).map(|row| weights(geometry, row)).collect();
    let of_view = |view: usize| {
        let row = |(values, weights): (ArrayView1<'_, f32>, &Vec<f64>)| {
            values.iter().zip(weights).map(|(value, weight)| f64::from(*value) * weight).sum()
        };
        let image = sinograms.index_axis(Axis(0), view);
        image.outer_iter().zip(&weights).map(row).collect::<Vec<f64>>()
    };
    let all: Vec<f64> = (0..views).into_par_iter().flat_map_iter(of_view).collect();
    Array2::from_shape_vec((views, rows), all)
        .map_err(|error| Error::argument("sinograms", error.to_string(), "their shape"))
}

/// x dx of each column of a row at the axis, per slope of a refraction angle, m².
fn weights(geometry: &ScanGeometry, row: usize) -> Vec<f64> {
    let (columns, scale) = (&geometry.columns, geometry.magnification());
    let last = columns.len() - 1;
    let weight = |column: usize| {
        // Half the distance of the columns on both sides; at an end twice the half on one side.
        let [before, behind] = [column.saturating_sub(1), (column + 1).min(last)];
        let width = (columns[behind] - columns[before]) / (behind - before) as f64 / scale;
        let [per_slope, _] = geometry.tangents(columns[column], row);
        (columns[column] / scale - geometry.axis) * width / per_slope
    };
    (0..=last).map(weight).collect()
}

/// Views and rows in which a body reaches an end of the row, `[view][row]`, from −ln T, `[view][row][column]`:
/// their moments lack its other part.
#[must_use]
pub fn reaching_ends(attenuation: ArrayView3<'_, f32>) -> Array2<bool> {
    let (views, rows, columns) = attenuation.dim();
    let width = columns.div_ceil(END).max(1);
    let reaches = |values: ArrayView1<'_, f32>| {
        let means: Vec<f64> = values
            .windows(width.min(columns))
            .into_iter()
            .map(|part| part.iter().map(|value| f64::from(*value)).sum::<f64>())
            .collect();
        let most = means.iter().copied().fold(0.0, f64::max);
        match means[..] {
            [first, .., last] => first.max(last) > REACHES * most,
            _ => true,
        }
    };
    Array2::from_shape_fn((views, rows), |(view, row)| {
        reaches(attenuation.slice(s![view, row, ..]))
    })
}
