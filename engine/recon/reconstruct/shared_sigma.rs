//! Standard deviations of filtered back-projections by noise that all views share, as the noise of one flat:
//! rings about the axis of rotation.

use super::fbp_options::FbpOptions;
use super::filtering::Filtering;
use super::geometry::ScanGeometry;
use super::grid::{Volume, VolumeGrid};
use super::quantity::Quantity;
use super::sigma::{amplitudes, check_voxels, prepared, shares, spread};
use beamlet_core::numbers::single;
use beamlet_core::rows_control::RowsControl;
use beamlet_core::{Cancel, Error, Result, reserve};
use ndarray::{Array3, ArrayView3};
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::f64::consts::TAU;

/// Places on a ring whose variances are averaged: with few views they differ along it.
const PLACES: u32 = 8;
/// Most planes whose rings are computed; planes between them are interpolated.
const PLANES: usize = 3;

/// Standard deviation of each voxel of [`super::fbp`] by noise that is the same in all views, as its root
/// mean square over the ring of the voxel, from the deviations of values of sinograms,
/// `[view][row][column]`. Noise of different rows and columns is independent.
///
/// # Errors
/// As [`super::fbp_sigma`].
pub fn fbp_shared_sigma(
    (geometry, sigmas, quantity): (&ScanGeometry, ArrayView3<'_, f32>, Quantity),
    grid: &VolumeGrid,
    options: &FbpOptions,
    control: &mut RowsControl<'_>,
) -> Result<Volume> {
    let filtering = prepared(geometry, sigmas, quantity, options)?;
    grid.check(geometry)?;
    let rings = Rings::of(grid);
    let cancel = &control.cancel;
    let cells: Vec<[usize; 2]> = (0..rings.planes.len())
        .flat_map(|plane| (0..rings.radii.len()).map(move |radius| [plane, radius]))
        .collect();
    let of_cell = |[plane, radius]: &[usize; 2]| {
        let radius = rings.radii[*radius];
        let places = if radius > 0.0 { PLACES } else { 1 };
        let z = grid.origin[2] + grid.voxel[2] * rings.planes[*plane] as f64;
        let mut sum = 0.0;
        for place in 0..places {
            // Between the axes x and y, along which rays of a few views lie.
            let angle = TAU * (f64::from(place) + 0.3) / f64::from(places);
            let point = [radius * libm::cos(angle), radius * libm::sin(angle), z];
            sum += of_point((geometry, sigmas, quantity), &filtering, point, cancel)?;
        }
        Ok(sum / f64::from(places))
    };
    let variances: Vec<f64> = cells.par_iter().map(of_cell).collect::<Result<_>>()?;
    let [x, y, z] = grid.size;
    let values = reserve::zeroed(x * y * z, "deviations of voxels")?;
    let mut values = Array3::from_shape_vec((z, y, x), values)
        .map_err(|error| Error::argument("grid", error.to_string(), "its number of voxels"))?;
    if let Some(all) = values.as_slice_mut() {
        all.par_chunks_mut(x).enumerate().try_for_each(|(row, line)| {
            cancel.check()?;
            let (plane, row) = (row / y, row % y);
            for (column, value) in line.iter_mut().enumerate() {
                let [a, b, _] = grid.centre((plane, row, column));
                *value = single(rings.at(&variances, plane, a.hypot(b)).sqrt());
            }
            Ok(())
        })?;
    }
    Ok(Volume::new(*grid, quantity, values))
}

/// Standard deviation of the mean of [`super::fbp`] over voxels, each as its x, y and z, by noise that is
/// the same in all views, from the deviations of values of sinograms, `[view][row][column]`. Noise of
/// different rows and columns is independent.
///
/// # Errors
/// As [`super::fbp_mean_sigma`].
pub fn fbp_mean_shared_sigma(
    (geometry, sigmas, quantity): (&ScanGeometry, ArrayView3<'_, f32>, Quantity),
    grid: &VolumeGrid,
    voxels: &[[usize; 3]],
    options: &FbpOptions,
    control: &mut RowsControl<'_>,
) -> Result<f64> {
    let filtering = prepared(geometry, sigmas, quantity, options)?;
    check_voxels(geometry, grid, voxels)?;
    let (views, rows, columns) = sigmas.dim();
    let mut sums = vec![0.0; rows * columns];
    let all: Vec<usize> = (0..views).collect();
    let cancel = &control.cancel;
    for some in all.chunks(rayon::current_num_threads()) {
        let of_view = |view: &usize| {
            cancel.check()?;
            let spread = spread(geometry, &filtering, quantity, (grid, voxels), *view);
            let mut found = vec![0.0; rows * columns];
            for (row, line) in spread.chunks(filtering.count()).enumerate() {
                let to = &mut found[row * columns..(row + 1) * columns];
                add(to, amplitudes(&filtering, (geometry, sigmas), line, [*view, row]));
            }
            Ok(found)
        };
        let found: Vec<Vec<f64>> = some.par_iter().map(of_view).collect::<Result<_>>()?;
        found.into_iter().for_each(|found| add(&mut sums, found));
    }
    Ok(sums.iter().map(|sum| sum * sum).sum::<f64>().sqrt() / voxels.len() as f64)
}

/// Variance of the value at a point, m.
fn of_point(
    (geometry, sigmas, quantity): (&ScanGeometry, ArrayView3<'_, f32>, Quantity),
    filtering: &Filtering<'_>,
    point: [f64; 3],
    cancel: &Cancel,
) -> Result<f64> {
    let mut sums: BTreeMap<usize, Vec<f64>> = BTreeMap::new();
    for view in 0..geometry.angles.len() {
        cancel.check()?;
        let Some(shares) = shares(geometry, filtering, quantity, point, view) else { continue };
        let mut lines: BTreeMap<usize, Vec<f64>> = BTreeMap::new();
        for (row, column, share) in shares {
            let line = lines.entry(row).or_insert_with(|| vec![0.0; filtering.count()]);
            line[column] += share;
        }
        for (row, line) in lines {
            let to = sums.entry(row).or_insert_with(|| vec![0.0; geometry.columns.len()]);
            add(to, amplitudes(filtering, (geometry, sigmas), &line, [view, row]));
        }
    }
    Ok(sums.values().flatten().map(|sum| sum * sum).sum())
}

/// Adds amplitudes to the sums of their columns.
fn add(to: &mut [f64], amplitudes: Vec<f64>) {
    to.iter_mut().zip(amplitudes).for_each(|(sum, amplitude)| *sum += amplitude);
}

/// Rings whose variances are computed.
struct Rings {
    /// Ascending, m.
    radii: Vec<f64>,
    /// Planes of voxels, ascending.
    planes: Vec<usize>,
    /// Side of a voxel, m.
    side: f64,
}

impl Rings {
    /// Rings of a grid: close ones near the axis, where variances change within a voxel.
    fn of(grid: &VolumeGrid) -> Self {
        let side = grid.voxel[0].min(grid.voxel[1]);
        let [x, y, _] = grid.ends().map(|[low, high]| low.abs().max(high.abs()));
        let most = x.hypot(y) / side;
        let mut radii = vec![0.0];
        let mut radius = 0.5;
        while radius < most {
            radii.push(radius);
            radius = (1.3 * radius).max(radius + 0.5);
        }
        radii.push(most.max(0.5));
        let last = grid.size[2] - 1;
        let mut planes: Vec<usize> = (0..PLANES).map(|n| n * last / (PLANES - 1)).collect();
        planes.dedup();
        Self { radii: radii.into_iter().map(|radius| radius * side).collect(), planes, side }
    }

    /// Variance in a plane at a distance from the axis: times the distance it changes slowly.
    fn at(&self, variances: &[f64], plane: usize, distance: f64) -> f64 {
        let scaled = |plane: usize, ring: usize| {
            variances[plane * self.radii.len() + ring] * (self.radii[ring] + self.side)
        };
        let next = self.radii.partition_point(|radius| *radius <= distance);
        let right = next.clamp(1, self.radii.len() - 1);
        let gap = self.radii[right] - self.radii[right - 1];
        let along = ((distance - self.radii[right - 1]) / gap).clamp(0.0, 1.0);
        let in_plane = |plane: usize| {
            let [a, b] = [right - 1, right].map(|ring| scaled(plane, ring));
            (a + along * (b - a)) / (distance + self.side)
        };
        let above = self.planes.partition_point(|other| *other <= plane).min(self.planes.len() - 1);
        let below = above.saturating_sub(1);
        let [low, high] = [below, above].map(|at| self.planes[at] as f64);
        let share = if high > low { ((plane as f64 - low) / (high - low)).min(1.0) } else { 0.0 };
        let [a, b] = [below, above].map(in_plane);
        a + share * (b - a)
    }
}
