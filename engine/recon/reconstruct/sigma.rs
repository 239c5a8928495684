//! Standard deviations of filtered back-projections from the deviations of the sinograms. Noise of
//! neighbouring voxels is correlated, by the filter and by common lines.

use super::back_projector::BackProjector;
use super::fbp::check;
use super::fbp_options::FbpOptions;
use super::filtering::Filtering;
use super::geometry::ScanGeometry;
use super::grid::{Volume, VolumeGrid};
use super::quantity::Quantity;
use super::resampling::Resampling;
use super::work::reporting;
use beamlet_core::numbers::{single, whole};
use beamlet_core::rows_control::RowsControl;
use beamlet_core::{Error, Result, parallel, reserve};
use beamlet_gpu::Compute;
use ndarray::{Array3, ArrayView3};
use rayon::prelude::*;

/// Standard deviation of each voxel of [`super::fbp`], from the deviations of independent values of
/// sinograms, `[view][row][column]`. Corrections of lever arms are small and neglected. Noise that views
/// share has a function of its own: [`super::fbp_shared_sigma`].
///
/// # Errors
/// As [`super::fbp`]; [`Error::Argument`] for columns that are uneven, rows that are extrapolated, and
/// deviations below zero.
pub fn fbp_sigma(
    compute: &Compute,
    (geometry, sigmas, quantity): (&ScanGeometry, ArrayView3<'_, f32>, Quantity),
    grid: &VolumeGrid,
    options: &FbpOptions,
    control: &mut RowsControl<'_>,
) -> Result<Volume> {
    let filtering = prepared(geometry, sigmas, quantity, options)?;
    grid.check(geometry)?;
    let (views, rows, _) = sigmas.dim();
    let columns = filtering.count();
    let kernels = [0, 1].map(|shift| filtering.filter().squared(shift));
    let mut variances: Vec<f32> = reserve::zeroed(2 * views * rows * columns, "variances")?;
    let cancel = &control.cancel;
    variances.par_chunks_mut(2 * columns).enumerate().try_for_each(|(number, out)| {
        cancel.check()?;
        let (view, row) = (number / rows, number % rows);
        let mut given = vec![0.0; columns];
        given[filtering.measured()]
            .iter_mut()
            .zip(deviations(&filtering, geometry, sigmas, [view, row]))
            .for_each(|(to, deviation)| *to = deviation * deviation);
        for (out, kernel) in out.chunks_mut(columns).zip(&kernels) {
            out.iter_mut().zip(kernel.apply(&given)).for_each(|(to, from)| *to = single(from));
        }
        Ok(())
    })?;
    let shape = (views, 2 * rows, columns);
    let variances =
        Array3::from_shape_vec(shape, variances).unwrap_or_else(|_| Array3::zeros(shape));
    let mut projector =
        BackProjector::of_variances(compute, geometry, filtering.columns(), grid, quantity)?;
    if let Some(at_once) = options.at_once {
        projector = projector.with_at_once(at_once);
    }
    let mut values = reporting(control, |work| projector.sum(variances.view(), work))?;
    // Sums of f32 may end below zero where all is nothing.
    values.mapv_inplace(|variance| variance.max(0.0).sqrt());
    Ok(Volume::new(*grid, quantity, values))
}

/// Standard deviation of the mean of [`super::fbp`] over voxels, each as its x, y and z, from the
/// deviations of independent values of sinograms, `[view][row][column]`.
///
/// # Errors
/// As [`fbp_sigma`]; [`Error::Argument`] for no voxel, or one beyond the grid.
pub fn fbp_mean_sigma(
    (geometry, sigmas, quantity): (&ScanGeometry, ArrayView3<'_, f32>, Quantity),
    grid: &VolumeGrid,
    voxels: &[[usize; 3]],
    options: &FbpOptions,
    control: &mut RowsControl<'_>,
) -> Result<f64> {
    let filtering = prepared(geometry, sigmas, quantity, options)?;
    check_voxels(geometry, grid, voxels)?;
    let cancel = &control.cancel;
    let of_view = |view: usize| {
        cancel.check()?;
        let spread = spread(geometry, &filtering, quantity, (grid, voxels), view);
        let mut sum = 0.0;
        for (row, line) in spread.chunks(filtering.count()).enumerate() {
            let amplitudes = amplitudes(&filtering, (geometry, sigmas), line, [view, row]);
            sum += amplitudes.iter().map(|amplitude| amplitude.powi(2)).sum::<f64>();
        }
        Ok(sum)
    };
    let sums: Vec<f64> =
        (0..geometry.angles.len()).into_par_iter().map(of_view).collect::<Result<_>>()?;
    Ok(sums.iter().sum::<f64>().sqrt() / voxels.len() as f64)
}

/// # Errors
/// [`Error::Argument`] for no voxel, and for a voxel beyond the grid.
pub(super) fn check_voxels(
    geometry: &ScanGeometry,
    grid: &VolumeGrid,
    voxels: &[[usize; 3]],
) -> Result<()> {
    grid.check(geometry)?;
    let is_beyond = |voxel: &&[usize; 3]| (0..3).any(|axis| voxel[axis] >= grid.size[axis]);
    if let Some(voxel) = voxels.iter().find(is_beyond) {
        let found = format!("{voxel:?}");
        return Err(Error::argument("voxels", found, format!("below {:?}", grid.size)));
    }
    if voxels.is_empty() {
        return Err(Error::argument("voxels", "none", "one or more"));
    }
    Ok(())
}

/// # Errors
/// [`Error::Argument`] for options without a known deviation.
pub(super) fn prepared<'a>(
    geometry: &'a ScanGeometry,
    sigmas: ArrayView3<'_, f32>,
    quantity: Quantity,
    options: &FbpOptions,
) -> Result<Filtering<'a>> {
    check(geometry, sigmas)?;
    options.check(quantity)?;
    parallel::start_threads()?;
    if let Some(((view, row, column), value)) = sigmas.indexed_iter().find(|(_, v)| **v < 0.0) {
        let found = format!("{value} in view {view}, row {row}, column {column}");
        return Err(Error::argument("sigmas", found, "at least zero"));
    }
    check_sigma(geometry, options)?;
    Filtering::new(geometry, quantity, options)
}

/// Refuses options without a known deviation, before any work is done.
///
/// # Errors
/// [`Error::Argument`] with the reason.
pub(super) fn check_sigma(geometry: &ScanGeometry, options: &FbpOptions) -> Result<()> {
    if options.extrapolate {
        let allowed = "rows without extrapolation: the noise of extrapolated rows is unknown";
        return Err(Error::argument("extrapolate", "true", allowed));
    }
    if !Resampling::of(&geometry.columns).is_even {
        let allowed = "even columns: the noise of interpolated columns is unknown";
        return Err(Error::argument("columns", "uneven places", allowed));
    }
    Ok(())
}

/// Deviations that the columns of a row of a view add to a sum over its filtered columns with these weights;
/// empty where all weights are zero.
pub(super) fn amplitudes(
    filtering: &Filtering<'_>,
    (geometry, sigmas): (&ScanGeometry, ArrayView3<'_, f32>),
    weights: &[f64],
    at: [usize; 2],
) -> Vec<f64> {
    if weights.iter().all(|weight| weight.abs() <= 0.0) {
        return Vec::new();
    }
    let filtered = &filtering.filter().apply(weights)[filtering.measured()];
    let given = deviations(filtering, geometry, sigmas, at);
    filtered.iter().zip(given).map(|(a, b)| a * b).collect()
}

/// Standard deviations of the weighted values of a row.
fn deviations<'a>(
    filtering: &'a Filtering<'_>,
    geometry: &'a ScanGeometry,
    sigmas: ArrayView3<'a, f32>,
    [view, row]: [usize; 2],
) -> impl Iterator<Item = f64> + 'a {
    geometry.columns.iter().enumerate().map(move |(column, place)| {
        f64::from(sigmas[[view, row, column]]) * filtering.weight(view, row, *place)
    })
}

/// The transpose of the sum of back-projection, for ones in some voxels: weights of the columns of a view,
/// row by row.
pub(super) fn spread(
    geometry: &ScanGeometry,
    filtering: &Filtering<'_>,
    quantity: Quantity,
    (grid, voxels): (&VolumeGrid, &[[usize; 3]]),
    view: usize,
) -> Vec<f64> {
    let columns = filtering.count();
    let mut spread = vec![0.0; geometry.rows.len() * columns];
    for [x, y, z] in voxels {
        let point = grid.centre((*z, *y, *x));
        for (row, column, share) in
            shares(geometry, filtering, quantity, point, view).into_iter().flatten()
        {
            spread[row * columns + column] += share;
        }
    }
    spread
}

/// Rows and columns of a view that back-projection takes at a point, m, each with its weight; `None` where
/// the point is outside of the detector.
pub(super) fn shares(
    geometry: &ScanGeometry,
    filtering: &Filtering<'_>,
    quantity: Quantity,
    [x, y, z]: [f64; 3],
    view: usize,
) -> Option<[(usize, usize, f64); 4]> {
    let (columns, rows) = (filtering.count(), geometry.rows.len());
    let [first, pitch] = filtering.columns();
    let (sine, cosine) = (libm::sin(geometry.angles[view]), libm::cos(geometry.angles[view]));
    let scale = geometry.magnification();
    let last = [(columns - 1) as f64, (rows - 1) as f64];
    let depth = y * cosine - x * sine;
    let near = 1.0 / (1.0 + depth * geometry.per_distance());
    let across = (x * cosine + y * sine + geometry.axis) * near * scale;
    let at =
        [(across - first) / pitch, (geometry.rows[0] - z * near * scale) / geometry.row_pitch()];
    if (0..2).any(|n| at[n] < -0.5 || at[n] > last[n] + 0.5) {
        return None;
    }
    let weight = if quantity == Quantity::Delta { near } else { near * near };
    let [column, row] = [0, 1].map(|n| at[n].clamp(0.0, last[n]));
    let [left, top] = [column, row].map(whole::<usize>);
    let [right, low] = [column - left as f64, row - top as f64];
    let (left_two, top_two) = ([left, (left + 1).min(columns - 1)], [top, (top + 1).min(rows - 1)]);
    let share = |n: usize, m: usize| {
        let of_row = if n == 0 { 1.0 - low } else { low };
        let of_column = if m == 0 { 1.0 - right } else { right };
        (top_two[n], left_two[m], weight * of_row * of_column)
    };
    Some([share(0, 0), share(0, 1), share(1, 0), share(1, 1)])
}
