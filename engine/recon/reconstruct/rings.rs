//! Stripes of single columns in sinograms, which are rings in slices.

use super::geometry::{ScanGeometry, same_shape};
use beamlet_core::numbers::single;
use beamlet_core::printed::counted;
use beamlet_core::{Cancel, Error, Result, parallel};
use ndarray::{ArrayView3, ArrayViewMut3};
use rayon::prelude::*;

/// Least number of views: fewer cannot part a column from the sample.
const LEAST_VIEWS: usize = 16;
/// Factors of a fourth difference.
const FOURTH: [f64; 5] = [1.0, -4.0, 6.0, -4.0, 1.0];
/// Square of the fourth difference of a stripe below which it is left in place, over the square of the
/// stripe: a wave over 35 columns.
const LEAST: f64 = 0.001;

/// Removes stripes from the columns of sinograms: gains and offsets of single columns. Fourth differences
/// along a row nearly equal those of the stripes, except at a border of the sample; their medians over
/// all views equal the stripes', if the sample does not keep its place. The stripes are the smallest
/// values with these differences. Rings of the sample about the axis of rotation that are only a few
/// columns wide are removed, too.
///
/// # Errors
/// [`Error::Argument`] for a geometry that cannot be, sinograms of another shape, fewer than 16 views or
/// 5 columns; [`Error::Interrupted`].
pub fn suppress_rings(
    geometry: &ScanGeometry,
    mut sinograms: ArrayViewMut3<'_, f32>,
    cancel: &Cancel,
) -> Result<()> {
    geometry.check()?;
    same_shape("sinograms", sinograms.dim(), geometry.dim())?;
    let (views, rows, columns) = geometry.dim();
    if views < LEAST_VIEWS || columns < FOURTH.len() {
        let found = format!("{} of {}", counted(views, "view"), counted(columns, "column"));
        let allowed = format!("{LEAST_VIEWS} views or more, of {} columns", FOURTH.len());
        return Err(Error::argument("sinograms", found, allowed));
    }
    parallel::start_threads()?;
    for row in 0..rows {
        let stripes = stripes(&medians(sinograms.view(), row, cancel)?);
        for mut view in sinograms.outer_iter_mut() {
            view.row_mut(row).iter_mut().zip(&stripes).for_each(|(value, stripe)| {
                *value = single(f64::from(*value) - stripe);
            });
        }
    }
    Ok(())
}

/// Medians over views of the fourth differences along a row.
fn medians(sinograms: ArrayView3<'_, f32>, row: usize, cancel: &Cancel) -> Result<Vec<f64>> {
    let (views, _, columns) = sinograms.dim();
    (0..=columns - FOURTH.len())
        .into_par_iter()
        .map(|first| {
            cancel.check()?;
            let difference = |view: usize| {
                let term = |(n, factor): (usize, &f64)| {
                    factor * f64::from(sinograms[[view, row, first + n]])
                };
                FOURTH.iter().enumerate().map(term).sum::<f64>()
            };
            let mut found: Vec<f64> = (0..views).map(difference).collect();
            let (_, median, _) = found.select_nth_unstable_by(views / 2, f64::total_cmp);
            Ok(*median)
        })
        .collect()
}

/// Small values that have these fourth differences: `(DᵀD + λ) x = Dᵀ d`, by Cholesky's method in bands.
fn stripes(differences: &[f64]) -> Vec<f64> {
    const BAND: usize = FOURTH.len();
    let columns = differences.len() + BAND - 1;
    let mut values = vec![0.0; columns];
    // Row n: columns n, n − 1, … of the matrix, then of its root.
    let mut bands = vec![[0.0; BAND]; columns];
    for (first, difference) in differences.iter().enumerate() {
        for (n, factor) in FOURTH.iter().enumerate() {
            values[first + n] += factor * difference;
            for (below, other) in FOURTH[..=n].iter().rev().enumerate() {
                bands[first + n][below] += factor * other;
            }
        }
    }
    for n in 0..columns {
        bands[n][0] += LEAST;
        for below in (0..BAND.min(n + 1)).rev() {
            let other = n - below;
            let shared: f64 = (1..BAND - below)
                .map(|m| if m <= other { bands[n][below + m] * bands[other][m] } else { 0.0 })
                .sum();
            let rest = bands[n][below] - shared;
            bands[n][below] = if below == 0 { rest.sqrt() } else { rest / bands[other][0] };
        }
    }
    for n in 0..columns {
        let known: f64 = (1..BAND.min(n + 1)).map(|m| bands[n][m] * values[n - m]).sum();
        values[n] = (values[n] - known) / bands[n][0];
    }
    for n in (0..columns).rev() {
        let known: f64 = (1..BAND.min(columns - n)).map(|m| bands[n + m][m] * values[n + m]).sum();
        values[n] = (values[n] - known) / bands[n][0];
    }
    values
}
