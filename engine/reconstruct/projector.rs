//! Joseph's projector on the device: sums along rays, and the transpose, slab by slab of the volume.

use super::joseph::Rays;
use super::work::Work;
use crate::gpu::{Buffer, Device, Kernel, Memory, Pace, shaders};
use crate::interface::{ProjectBackPush, ProjectPush, Sheet};
use crate::numbers::{count, single};
use crate::trace::push_bytes;
use crate::{Engine, Error, Result, reserve};
use ndarray::{Array3, ArrayView3};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Values of a slab, and of the rays that are on the device with it: 256 MiB each, or one plane and
/// one view.
pub(super) const AT_ONCE: usize = 64 << 20;

/// How the voxels of a ray count, by their place on it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Arm {
    /// `ARM_`
    pub(super) kind: u32,
    /// One over the lever arm of the axis of rotation, 1/m; 0 where it counts for nothing.
    pub(super) per_lever: f64,
    /// Taken off the factor of the arm: 1 leaves its difference to a voxel at the axis.
    pub(super) less: f64,
}

/// Sums voxels along rays, in voxels and slices: lengths are the caller's.
#[derive(Debug)]
pub(super) struct Projector {
    device: Arc<Device>,
    forward: Kernel,
    back: Kernel,
    /// What differs from dispatch to dispatch is left at 0, and so are addresses.
    push: ProjectPush,
    views: usize,
    /// Planes of a slab, views of a part.
    planes: usize,
    part: usize,
    size: [usize; 3],
    is_even: bool,
    places: Buffer,
    starts: Buffer,
    sheets: Buffer,
    volume: Buffer,
    rays: Buffer,
    /// Held while the buffers are in use.
    busy: Mutex<()>,
}

impl Projector {
    /// # Errors
    /// [`Error::Argument`] for more than one plane under one row, and for fans of 90° or more;
    /// [`Error::Device`], [`Error::Memory`].
    pub(super) fn new(engine: &Engine, rays: &Rays, arm: Arm, at_once: usize) -> Result<Self> {
        let [x, y, z] = rays.grid.size;
        let (rows, columns) = (rays.geometry.rows.len(), rays.places.len());
        let views = rays.geometry.angles.len();
        if rows == 1 && z > 1 {
            let found = format!("{z} planes under one row of a detector");
            return Err(Error::argument("grid", found, "one plane for one row"));
        }
        let steps = rays.steps();
        let half = (columns - 1) as f64 / 2.0;
        let is_even = steps.iter().enumerate().all(|(n, at)| (at + half - n as f64).abs() < 1e-4);
        let even = |n: usize| n as f64 - half;
        let places: Vec<f32> =
            (0..columns).map(|n| single(if is_even { even(n) } else { steps[n] })).collect();
        let starts: Vec<u32> = (0..columns)
            .map(|bin| count(steps.partition_point(|at| at + half < bin as f64)))
            .collect();
        let [row_zero, row_step, plane_zero] = rays.heights().map(single);
        let push = ProjectPush {
            columns: count(columns),
            rows: count(rows),
            size_x: count(x),
            size_y: count(y),
            arm: arm.kind,
            per_lever: single(arm.per_lever),
            arm_less: single(arm.less),
            row_zero,
            row_step,
            plane_zero,
            ..bytemuck::Zeroable::zeroed()
        };
        let (planes, part) =
            ((at_once / (x * y)).clamp(1, z), (at_once / (rows * columns)).clamp(1, views));
        let device = engine.device().clone();
        let kernel = |[flat, cone]: [(&str, &'static [u32]); 2], bytes| {
            let (name, code) = if rows == 1 { flat } else { cone };
            device.kernel(name, code, bytes)
        };
        let buffer = |name, values: usize| device.buffer(name, values as u64 * 4, Memory::Device);
        Ok(Self {
            forward: kernel(
                [("project", shaders::PROJECT), ("project_cone", shaders::PROJECT_CONE)],
                push_bytes::<ProjectPush>(),
            )?,
            back: kernel(
                [
                    ("project_back", shaders::PROJECT_BACK),
                    ("project_back_cone", shaders::PROJECT_BACK_CONE),
                ],
                push_bytes::<ProjectBackPush>(),
            )?,
            push,
            views,
            planes,
            part,
            size: rays.grid.size,
            is_even,
            places: device.upload("places of columns", &places)?,
            starts: device.upload("columns by their places", &starts)?,
            sheets: device.upload("sheets of rays", &rays.sheets()?)?,
            volume: buffer("a slab", planes * x * y)?,
            rays: buffer("rays", part * rows * columns)?,
            device,
            busy: Mutex::new(()),
        })
    }

    /// Waits until no other thread uses the buffers.
    fn alone(&self) -> MutexGuard<'_, ()> {
        self.busy.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn rays_of_a_view(&self) -> usize {
        (self.push.rows * self.push.columns) as usize
    }

    fn sheets_from(&self, view: usize) -> u64 {
        self.sheets.address() + (2 * view * size_of::<Sheet>()) as u64
    }

    /// Sums along rays, `[view][row][place]`, of a volume, `[z][y][x]`.
    pub(super) fn forward(
        &self,
        volume: ArrayView3<'_, f32>,
        work: &mut Work<'_>,
    ) -> Result<Array3<f32>> {
        let _alone = self.alone();
        let per_view = self.rays_of_a_view();
        let mut rays: Vec<f32> = reserve::zeroed(self.views * per_view, "projections")?;
        let mut pace = Pace::new(1 << 12, 256, 1 << 20);
        let slabs = self.slabs();
        let total = (rays.len() * slabs.len()) as f64;
        let mut before = 0;
        for (number, part) in rays.chunks_mut(self.part * per_view).enumerate() {
            self.rays.write(0, part)?;
            for [first, end] in &slabs {
                let slab = volume.slice(ndarray::s![*first..*end, .., ..]);
                self.volume.write(0, slab.as_standard_layout().as_slice().unwrap_or_default())?;
                let push = ProjectPush {
                    sheets: self.sheets_from(number * self.part),
                    places: self.places.address(),
                    volume: self.volume.address(),
                    rays: self.rays.address(),
                    first_plane: count(*first),
                    plane_end: count(*end),
                    ..self.push
                };
                let push = |first, end| ProjectPush { first, end, ..push };
                let mut done = |n: u32| (work.report)((before + n as usize) as f64 / total);
                let (items, pace) = (count(part.len()), (&mut pace, &work.cancel));
                self.device.run_paced(&self.forward, items, pace, push, &mut done)?;
                before += part.len();
            }
            self.rays.read_into(0, part)?;
        }
        let shape = (self.views, self.push.rows as usize, self.push.columns as usize);
        Ok(Array3::from_shape_vec(shape, rays).unwrap_or_else(|_| Array3::zeros(shape)))
    }

    /// The transpose: a volume, `[z][y][x]`, of values of rays, `[view][row][place]`.
    pub(super) fn back(
        &self,
        rays: ArrayView3<'_, f32>,
        work: &mut Work<'_>,
    ) -> Result<Array3<f32>> {
        let _alone = self.alone();
        let [x, y, z] = self.size;
        let mut values: Vec<f32> = reserve::zeroed(x * y * z, "a volume")?;
        let mut pace = Pace::new(1 << 12, 256, 1 << 20);
        let total = (values.len() * self.views) as f64;
        let mut before = 0;
        for ([first_plane, _], slab) in
            self.slabs().iter().zip(values.chunks_mut(self.planes * x * y))
        {
            self.volume.write(0, slab)?;
            for start in (0..self.views).step_by(self.part) {
                let n = self.part.min(self.views - start);
                let part = rays.slice(ndarray::s![start..start + n, .., ..]);
                self.rays.write(0, part.as_standard_layout().as_slice().unwrap_or_default())?;
                let push = ProjectBackPush {
                    sheets: self.sheets_from(start),
                    places: self.places.address(),
                    starts: self.starts.address(),
                    volume: self.volume.address(),
                    rays: self.rays.address(),
                    view_count: count(n),
                    columns: self.push.columns,
                    rows: self.push.rows,
                    is_even: self.is_even.into(),
                    size_x: self.push.size_x,
                    size_y: self.push.size_y,
                    first_plane: count(*first_plane),
                    first: 0,
                    end: 0,
                    arm: self.push.arm,
                    per_lever: self.push.per_lever,
                    arm_less: self.push.arm_less,
                    row_zero: self.push.row_zero,
                    row_step: self.push.row_step,
                    plane_zero: self.push.plane_zero,
                };
                let push = |first, end| ProjectBackPush { first, end, ..push };
                let mut done = |voxels: u32| {
                    (work.report)((before + voxels as usize * n) as f64 / total);
                };
                let (items, pace) = (count(slab.len()), (&mut pace, &work.cancel));
                self.device.run_paced(&self.back, items, pace, push, &mut done)?;
                before += slab.len() * n;
            }
            self.volume.read_into(0, slab)?;
        }
        let shape = (z, y, x);
        Ok(Array3::from_shape_vec(shape, values).unwrap_or_else(|_| Array3::zeros(shape)))
    }

    /// First plane and the end of each slab.
    fn slabs(&self) -> Vec<[usize; 2]> {
        let planes = self.size[2];
        (0..planes)
            .step_by(self.planes)
            .map(|first| [first, (first + self.planes).min(planes)])
            .collect()
    }
}
