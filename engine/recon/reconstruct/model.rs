//! Sinograms of a volume: the projector with lengths, arms and differences.

use super::data::Data;
use super::geometry::{ScanGeometry, same_shape};
use super::grid::VolumeGrid;
use super::joseph::Rays;
use super::projector::{AT_ONCE, Arm, Projector};
use super::stream::Stream;
use super::work::{Work, reporting};
use crate::retrieve::borders;
use beamlet_core::numbers::single;
use beamlet_core::rows_control::RowsControl;
use beamlet_core::{Result, parallel, reserve};
use beamlet_gpu::{Compute, Download};
use ndarray::{Array3, ArrayView3};
use rayon::prelude::*;

/// Projections of volumes as sinograms of one kind, and their transpose, by Joseph's method: no bit
/// depends on slabs, parts or threads. Calls from several threads wait for each other. A voxel counts in a refraction angle by its lever arm, in a
/// variance by the square of it, where the geometry has one.
///
/// # Example
///
/// ```no_run
/// use beamlet::reconstruct::{Data, Model, ScanGeometry, VolumeGrid};
/// use beamlet::{Engine, EngineOptions, RowsControl, ndarray::Array3, scene::Scene};
///
/// let geometry = ScanGeometry::of_scene(&Scene::load("scene.toml")?);
/// let grid = VolumeGrid::of(&geometry)?;
/// let engine = Engine::open(&EngineOptions::default())?;
/// let model = Model::new(&engine, &geometry, &grid, Data::Refraction, None)?;
/// let [x, y, z] = grid.size;
/// let angles = model.project(Array3::zeros((z, y, x)).view(), &mut RowsControl::default())?;
/// println!("{:?}", angles.dim());
/// # Ok::<(), beamlet::Error>(())
/// ```
#[derive(Debug)]
pub struct Model {
    rays: Rays,
    data: Data,
    arm: Arm,
    projector: Projector,
}

impl Model {
    /// A model of sinograms of a scan. `at_once` bounds the values of the volume, and of sinograms,
    /// that are on the device at once; `None`: 64 Mi each.
    ///
    /// # Errors
    /// [`beamlet_core::Error::Argument`] for a geometry or grid that cannot be, more than one plane of voxels for one
    /// row, a fan of 90° or more; [`beamlet_core::Error::Device`], [`beamlet_core::Error::Memory`].
    pub fn new(
        compute: &Compute,
        geometry: &ScanGeometry,
        grid: &VolumeGrid,
        data: Data,
        at_once: Option<usize>,
    ) -> Result<Self> {
        let arm = Arm { kind: data.arm(), per_lever: 1.0 / geometry.lever, less: 0.0 };
        Self::with_arm(compute, geometry, grid, (data, arm), at_once.unwrap_or(AT_ONCE))
    }

    /// The same with another arm than the data's.
    pub(super) fn with_arm(
        compute: &Compute,
        geometry: &ScanGeometry,
        grid: &VolumeGrid,
        (data, arm): (Data, Arm),
        at_once: usize,
    ) -> Result<Self> {
        geometry.check()?;
        grid.check(geometry)?;
        parallel::start_threads()?;
        let places = match data {
            Data::Refraction => borders(&geometry.columns),
            _ => geometry.columns.clone(),
        };
        let rays = Rays { geometry: geometry.clone(), grid: *grid, places };
        let projector = Projector::new(compute, &rays, arm, at_once)?;
        Ok(Self { rays, data, arm, projector })
    }

    /// Sinograms, `[view][row][column]`, of a volume, `[z][y][x]`.
    ///
    /// # Errors
    /// [`beamlet_core::Error::Argument`] for a volume of another shape than the grid; [`beamlet_core::Error::Interrupted`],
    /// [`beamlet_core::Error::Device`], [`beamlet_core::Error::Memory`].
    pub fn project(
        &self,
        volume: ArrayView3<'_, f32>,
        control: &mut RowsControl<'_>,
    ) -> Result<Array3<f32>> {
        let [x, y, z] = self.rays.grid.size;
        same_shape("volume", volume.dim(), (z, y, x))?;
        reporting(control, |work| self.forward(volume, work))
    }

    /// The transpose of [`Model::project`]: a volume, `[z][y][x]`, of sinograms.
    ///
    /// # Errors
    /// [`beamlet_core::Error::Argument`] for sinograms of another shape than the scan; [`beamlet_core::Error::Interrupted`],
    /// [`beamlet_core::Error::Device`], [`beamlet_core::Error::Memory`].
    pub fn transpose(
        &self,
        sinograms: ArrayView3<'_, f32>,
        control: &mut RowsControl<'_>,
    ) -> Result<Array3<f32>> {
        same_shape("sinograms", sinograms.dim(), self.rays.geometry.dim())?;
        reporting(control, |work| self.back(sinograms, work))
    }

    pub(super) fn forward(
        &self,
        volume: ArrayView3<'_, f32>,
        work: &mut Work<'_>,
    ) -> Result<Array3<f32>> {
        let mut rays = self.sums(volume, work)?;
        if self.data != Data::Refraction {
            self.each_row(&mut rays, |[view, row], values| {
                let steps = self.steps(view, row);
                values.iter_mut().zip(steps).for_each(|(value, step)| {
                    *value = single(f64::from(*value) * step);
                });
            });
            return Ok(rays);
        }
        let shape = self.rays.geometry.dim();
        let mut angles: Vec<f32> = reserve::zeroed(shape.0 * shape.1 * shape.2, "sinograms")?;
        angles.par_chunks_mut(shape.2).enumerate().for_each(|(number, out)| {
            let (view, row) = (number / shape.1, number % shape.1);
            let line = rays.slice(ndarray::s![view, row, ..]);
            let lengths: Vec<f64> =
                line.iter().zip(self.steps(view, row)).map(|(q, s)| f64::from(*q) * s).collect();
            for (column, angle) in out.iter_mut().enumerate() {
                let [left, right] = self.slopes(row, column);
                *angle = single(left * lengths[column] + right * lengths[column + 1]);
            }
        });
        Ok(Array3::from_shape_vec(shape, angles).unwrap_or_else(|_| Array3::zeros(shape)))
    }

    pub(super) fn back(
        &self,
        sinograms: ArrayView3<'_, f32>,
        work: &mut Work<'_>,
    ) -> Result<Array3<f32>> {
        let (views, rows, _) = self.rays.geometry.dim();
        let places = self.rays.places.len();
        let lines: Vec<f32> = reserve::zeroed(views * rows * places, "projections")?;
        let shape = (views, rows, places);
        let mut lines =
            Array3::from_shape_vec(shape, lines).unwrap_or_else(|_| Array3::zeros(shape));
        self.each_row(&mut lines, |[view, row], out| {
            let given = sinograms.slice(ndarray::s![view, row, ..]);
            let mut sums = vec![0.0; places];
            for (column, value) in given.iter().enumerate() {
                let value = f64::from(*value);
                if self.data == Data::Refraction {
                    let [left, right] = self.slopes(row, column);
                    sums[column] += value * left;
                    sums[column + 1] += value * right;
                } else {
                    sums[column] = value;
                }
            }
            let steps = self.steps(view, row);
            for ((to, sum), step) in out.iter_mut().zip(sums).zip(steps) {
                *to = single(sum * step);
            }
        });
        self.gathered(lines.view(), work)
    }

    /// Sums along rays, `[view][row][place]`, of a volume.
    fn sums(&self, volume: ArrayView3<'_, f32>, work: &mut Work<'_>) -> Result<Array3<f32>> {
        let projector = &self.projector;
        let (_alone, mut stream) = (projector.alone(), Stream::new(projector.device()));
        let (views, rows, _) = self.rays.geometry.dim();
        let per_view = rows * self.rays.places.len();
        let mut rays: Vec<f32> = reserve::zeroed(views * per_view, "projections")?;
        let slab = projector.slab()?;
        for [first, n] in projector.parts() {
            stream.fill(projector.rays(), 4 * (n * per_view) as u64, 0.0);
            for planes in projector.slabs() {
                stream.submit(&mut [])?;
                let values = volume.slice(ndarray::s![planes[0]..planes[1], .., ..]);
                slab.write(0, values.as_standard_layout().as_slice().unwrap_or_default())?;
                let shares = planes.map(|plane| {
                    (first as f64 + n as f64 * plane as f64 / self.size()[2] as f64) / views as f64
                });
                work.stage(shares, |work| {
                    projector.forward((slab, planes), [first, n], &mut stream, work)
                })?;
            }
            let part = &mut rays[first * per_view..(first + n) * per_view];
            stream.submit(&mut [Download::new(projector.rays(), 0, part)])?;
        }
        let shape = (views, rows, self.rays.places.len());
        Ok(Array3::from_shape_vec(shape, rays).unwrap_or_else(|_| Array3::zeros(shape)))
    }

    /// The transpose of [`Self::sums`].
    fn gathered(&self, rays: ArrayView3<'_, f32>, work: &mut Work<'_>) -> Result<Array3<f32>> {
        let projector = &self.projector;
        let (_alone, mut stream) = (projector.alone(), Stream::new(projector.device()));
        let [x, y, z] = self.size();
        let mut values: Vec<f32> = reserve::zeroed(x * y * z, "a volume")?;
        let slab = projector.slab()?;
        for planes in projector.slabs() {
            let own = planes[0] * x * y..planes[1] * x * y;
            stream.fill(slab, 4 * own.len() as u64, 0.0);
            for part in projector.parts() {
                let given = rays.slice(ndarray::s![part[0]..part[0] + part[1], .., ..]);
                stream.submit(&mut [])?;
                let given = given.as_standard_layout();
                projector.rays().write(0, given.as_slice().unwrap_or_default())?;
                work.stage(self.share(planes, part), |work| {
                    projector.back((slab, planes), part, &mut stream, work)
                })?;
            }
            stream.submit(&mut [Download::new(slab, 0, &mut values[own])])?;
        }
        let shape = (z, y, x);
        Ok(Array3::from_shape_vec(shape, values).unwrap_or_else(|_| Array3::zeros(shape)))
    }

    /// Share of a back-projection that is done before and after a part of the views in some planes.
    pub(super) fn share(&self, [plane, end]: [usize; 2], [view, views]: [usize; 2]) -> [f64; 2] {
        let all_views = self.rays.geometry.angles.len() as f64;
        let at = |view: usize| {
            let planes = plane as f64 + (end - plane) as f64 * view as f64 / all_views;
            planes / self.size()[2] as f64
        };
        [at(view), at(view + views)]
    }

    pub(super) const fn projector(&self) -> &Projector {
        &self.projector
    }

    pub(super) const fn rays(&self) -> &Rays {
        &self.rays
    }

    pub(super) const fn data(&self) -> Data {
        self.data
    }

    /// Factors of the integrals along lines, per path from slice to slice, in a value of a sinogram: of
    /// the one at the place of a column (at its left border), and of the next.
    pub(super) fn factors(&self, row: usize, column: usize) -> [f64; 2] {
        match self.data {
            Data::Refraction => self.slopes(row, column),
            Data::Phase => [1.0, 0.0],
            Data::Attenuation | Data::DarkField => {
                [self.rays.geometry.length(self.rays.places[column], row), 0.0]
            }
        }
    }

    fn each_row(&self, rays: &mut Array3<f32>, work: impl Fn([usize; 2], &mut [f32]) + Sync) {
        let (_, rows, columns) = rays.dim();
        if let Some(values) = rays.as_slice_mut() {
            let rows_of = values.par_chunks_mut(columns).enumerate();
            rows_of.for_each(|(number, values)| work([number / rows, number % rows], values));
        }
    }

    /// Way through a slice on each line of a row, m: along the line, or along the optical axis where the
    /// data are derivatives.
    fn steps(&self, view: usize, row: usize) -> impl Iterator<Item = f64> + '_ {
        let is_length = matches!(self.data, Data::Attenuation | Data::DarkField);
        let steps = self.rays.steps_of(view, row);
        self.rays.places.iter().zip(steps).map(move |(place, step)| {
            let length = if is_length { self.rays.geometry.length(*place, row) } else { 1.0 };
            step * length
        })
    }

    /// What integrals at the borders of a column do to the tangent of its angle: by their change over
    /// its width at the axis, and by the arm, which changes along an oblique line.
    fn slopes(&self, row: usize, column: usize) -> [f64; 2] {
        let geometry = &self.rays.geometry;
        let width = self.rays.places[column + 1] - self.rays.places[column];
        let [change, mean] = geometry.tangents(geometry.columns[column], row);
        let (change, mean) = (change * geometry.magnification() / width, mean * self.arm.per_lever);
        [change + mean / 2.0, mean / 2.0 - change]
    }

    /// Voxels along x, y, z.
    pub(super) const fn size(&self) -> [usize; 3] {
        self.rays.grid.size
    }
}
