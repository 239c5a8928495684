//! Back-projection on the device: slab by slab of the volume, part by part of the views.

use super::geometry::ScanGeometry;
use super::grid::VolumeGrid;
use super::quantity::Quantity;
use super::work::Work;
use beamlet_core::numbers::{count, single};
use beamlet_core::{Result, reserve};
use beamlet_gpu::{Compute, Device, Kernel, Memory, Pace, push_bytes};
use beamlet_interface::{BackProjectPush, ViewTurn};
use ndarray::{Array3, ArrayView3};
use std::sync::Arc;

/// Values of a slab, and of the projections that are on the device with it: 256 MiB each, or one
/// slice and one view.
pub(super) const AT_ONCE: usize = 64 << 20;

/// Sums filtered projections over views.
#[derive(Debug)]
pub(super) struct BackProjector<'a> {
    device: Arc<Device>,
    kernel: Kernel,
    /// Constants of all dispatches; fields that differ between them are 0.
    push: BackProjectPush,
    grid: &'a VolumeGrid,
    turns: Vec<ViewTurn>,
    at_once: usize,
}

impl<'a> BackProjector<'a> {
    /// For projections at even columns, the first at `first` and of this `pitch` on the detector, m.
    pub(super) fn new(
        compute: &Compute,
        geometry: &ScanGeometry,
        [first, pitch]: [f64; 2],
        grid: &'a VolumeGrid,
        quantity: Quantity,
    ) -> Result<Self> {
        let scale = geometry.magnification();
        let row_pitch = geometry.row_pitch();
        let push = BackProjectPush {
            size_x: count(grid.size[0]),
            size_y: count(grid.size[1]),
            rows: count(geometry.rows.len()),
            is_squared: (quantity != Quantity::Delta).into(),
            origin: grid.origin.map(single),
            voxel: grid.voxel.map(single),
            axis: single(geometry.axis),
            per_distance: single(geometry.per_distance()),
            column_scale: single(scale / pitch),
            column_zero: single(-first / pitch),
            row_scale: single(-scale / row_pitch),
            row_zero: single(geometry.rows[0] / row_pitch),
            ..bytemuck::Zeroable::zeroed()
        };
        let turn = |angle: &f64| ViewTurn {
            cosine: single(libm::cos(*angle)),
            sine: single(libm::sin(*angle)),
        };
        let device = compute.device().clone();
        Ok(Self {
            kernel: device.kernel("back_project", push_bytes::<BackProjectPush>())?,
            device,
            push,
            grid,
            turns: geometry.angles.iter().map(turn).collect(),
            at_once: AT_ONCE,
        })
    }

    /// Changes how many values are on the device at once; no bit of a volume depends on it.
    pub(super) const fn with_at_once(mut self, at_once: usize) -> Self {
        self.at_once = at_once;
        self
    }

    /// The sum over all views, `[z][y][x]`, of projections `[view][row][column]`.
    pub(super) fn sum(
        &self,
        projections: ArrayView3<'_, f32>,
        work: &mut Work<'_>,
    ) -> Result<Array3<f32>> {
        let [x, y, z] = self.grid.size;
        let (views, rows, columns) = projections.dim();
        let slices = (self.at_once / (x * y)).clamp(1, z);
        let at_once = (self.at_once / (rows * columns)).clamp(1, views);
        let mut values: Vec<f32> = reserve::zeroed(x * y * z, "a volume")?;
        let volume = self.device.buffer("a slab", (slices * x * y * 4) as u64, Memory::Device)?;
        let room = (at_once * rows * columns * 4) as u64;
        let images = self.device.buffer("filtered projections", room, Memory::Device)?;
        let mut pace = Pace::new(1 << 12, 256, 1 << 20);
        let total = (x * y * z * views) as f64;
        let mut done = 0;
        for (number, slab) in values.chunks_mut(slices * x * y).enumerate() {
            volume.write(0, slab)?;
            for start in (0..views).step_by(at_once) {
                let n = at_once.min(views - start);
                let part = projections.slice(ndarray::s![start..start + n, .., ..]);
                images.write(0, part.as_standard_layout().as_slice().unwrap_or_default())?;
                let turns = self.device.upload("views", &self.turns[start..start + n])?;
                let push = BackProjectPush {
                    views: turns.address(),
                    projections: images.address(),
                    volume: volume.address(),
                    view_count: count(n),
                    columns: count(columns),
                    first_slice: count(number * slices),
                    ..self.push
                };
                let mut report = |voxels: u32| {
                    (work.report)((done + voxels as usize * n) as f64 / total);
                };
                let push = |first, end| BackProjectPush { first, end, ..push };
                let (pace, none) = ((&mut pace, &work.cancel), (&[][..], &mut [][..]));
                let voxels = count(slab.len());
                self.device.run_paced(&self.kernel, voxels, pace, none, push, &mut report)?;
                done += slab.len() * n;
            }
            volume.read_into(0, slab)?;
        }
        let shape = (z, y, x);
        Ok(Array3::from_shape_vec(shape, values).unwrap_or_else(|_| Array3::zeros(shape)))
    }
}
