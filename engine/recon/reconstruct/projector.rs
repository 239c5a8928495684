//! Joseph's projector on the device: sums along rays, and the transpose, slab by slab of the volume.

use super::joseph::Rays;
use super::work::Work;
use beamlet_core::numbers::{count, single};
use beamlet_core::{Cancel, Error, Result, reserve};
use beamlet_gpu::{Buffer, Compute, Device, Kernel, Memory, Pace, push_bytes};
use beamlet_interface::{
    MovedSheet, MovedView, ProjectBackMovedPush, ProjectBackPush, ProjectMovedPush, ProjectPush,
    Sheet,
};
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
    tables: Tables,
    rows: usize,
    columns: usize,
    views: usize,
    /// Planes of a slab, views of a part.
    planes: usize,
    part: usize,
    size: [usize; 3],
    is_even: bool,
    places: Buffer,
    starts: Buffer,
    volume: Buffer,
    rays: Buffer,
    /// Held while the buffers are in use.
    busy: Mutex<()>,
}

/// Tables of the views, and push constants: what differs from dispatch to dispatch is left at 0, and so
/// are addresses.
#[derive(Debug)]
enum Tables {
    /// Views on a circle.
    Circle { sheets: Buffer, push: ProjectPush },
    /// Views with motions of their own.
    Moved { sheets: Buffer, views: Buffer, push: ProjectMovedPush },
}

type Names = [&'static str; 2];

/// Kernels, forward and back, of circles under one row and under several, and of other motions.
const FLAT: Names = ["project", "project_back"];
const CONE: Names = ["project_cone", "project_back_cone"];
const MOVED: Names = ["project_moved", "project_back_moved"];

impl Projector {
    /// # Errors
    /// [`Error::Argument`] for more than one plane under one row, and for fans of 90° or more;
    /// [`Error::Device`], [`Error::Memory`].
    pub(super) fn new(compute: &Compute, rays: &Rays, arm: Arm, at_once: usize) -> Result<Self> {
        let [x, y, z] = rays.grid.size;
        let (rows, columns) = (rays.geometry.rows.len(), rays.places.len());
        let views = rays.geometry.angles.len();
        let is_circle = rays.geometry.motions.is_none();
        if is_circle && rows == 1 && z > 1 {
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
        let (planes, part) =
            ((at_once / (x * y)).clamp(1, z), (at_once / (rows * columns)).clamp(1, views));
        let device = compute.device().clone();
        let buffer = |name, values: usize| device.buffer(name, values as u64 * 4, Memory::Device);
        let ([forward, back], bytes) = match (is_circle, rows) {
            (true, 1) => (FLAT, [push_bytes::<ProjectPush>(), push_bytes::<ProjectBackPush>()]),
            (true, _) => (CONE, [push_bytes::<ProjectPush>(), push_bytes::<ProjectBackPush>()]),
            (false, _) => {
                let bytes =
                    [push_bytes::<ProjectMovedPush>(), push_bytes::<ProjectBackMovedPush>()];
                (MOVED, bytes)
            }
        };
        Ok(Self {
            forward: device.kernel(forward, bytes[0])?,
            back: device.kernel(back, bytes[1])?,
            tables: Tables::of(&device, rays, arm)?,
            rows,
            columns,
            views,
            planes,
            part,
            size: rays.grid.size,
            is_even,
            places: device.upload("places of columns", &places)?,
            starts: device.upload("columns by their places", &starts)?,
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

    const fn rays_of_a_view(&self) -> usize {
        self.rows * self.columns
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
                let mut done = |n: u32| (work.report)((before + n as usize) as f64 / total);
                let (items, pace) = (count(part.len()), (&mut pace, &work.cancel));
                let (view, planes) = (number * self.part, [*first, *end].map(count));
                self.run_forward(items, pace, (view, planes), &mut done)?;
                before += part.len();
            }
            self.rays.read_into(0, part)?;
        }
        let shape = (self.views, self.rows, self.columns);
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
                let mut done = |voxels: u32| {
                    (work.report)((before + voxels as usize * n) as f64 / total);
                };
                let (items, pace) = (count(slab.len()), (&mut pace, &work.cancel));
                let views = [start, n];
                self.run_back(items, pace, (views, count(*first_plane)), &mut done)?;
                before += slab.len() * n;
            }
            self.volume.read_into(0, slab)?;
        }
        let shape = (z, y, x);
        Ok(Array3::from_shape_vec(shape, values).unwrap_or_else(|_| Array3::zeros(shape)))
    }

    fn run_forward(
        &self,
        items: u32,
        pace: (&mut Pace, &Cancel),
        (view, [first_plane, plane_end]): (usize, [u32; 2]),
        done: &mut dyn FnMut(u32),
    ) -> Result<()> {
        let (places, volume) = (self.places.address(), self.volume.address());
        let rays = self.rays.address();
        match &self.tables {
            Tables::Circle { sheets, push } => {
                let sheets = of_view::<Sheet>(sheets, 2 * view);
                let push =
                    ProjectPush { sheets, places, volume, rays, first_plane, plane_end, ..*push };
                let push = |first, end| ProjectPush { first, end, ..push };
                self.device.run_paced(&self.forward, items, pace, push, done)
            }
            Tables::Moved { sheets, push, .. } => {
                let sheets = of_view::<MovedSheet>(sheets, 3 * view);
                let push = ProjectMovedPush {
                    sheets,
                    places,
                    volume,
                    rays,
                    first_plane,
                    plane_end,
                    ..*push
                };
                let push = |first, end| ProjectMovedPush { first, end, ..push };
                self.device.run_paced(&self.forward, items, pace, push, done)
            }
        }
    }

    fn run_back(
        &self,
        items: u32,
        pace: (&mut Pace, &Cancel),
        ([view, views], first_plane): ([usize; 2], u32),
        done: &mut dyn FnMut(u32),
    ) -> Result<()> {
        match &self.tables {
            Tables::Circle { sheets, push } => {
                let push = ProjectBackPush {
                    sheets: of_view::<Sheet>(sheets, 2 * view),
                    places: self.places.address(),
                    starts: self.starts.address(),
                    volume: self.volume.address(),
                    rays: self.rays.address(),
                    view_count: count(views),
                    columns: push.columns,
                    rows: push.rows,
                    is_even: self.is_even.into(),
                    size_x: push.size_x,
                    size_y: push.size_y,
                    first_plane,
                    first: 0,
                    end: 0,
                    arm: push.arm,
                    per_lever: push.per_lever,
                    arm_less: push.arm_less,
                    row_zero: push.row_zero,
                    row_step: push.row_step,
                    plane_zero: push.plane_zero,
                };
                let push = |first, end| ProjectBackPush { first, end, ..push };
                self.device.run_paced(&self.back, items, pace, push, done)
            }
            Tables::Moved { sheets, views: seen, push } => {
                let push = ProjectBackMovedPush {
                    sheets: of_view::<MovedSheet>(sheets, 3 * view),
                    views: of_view::<MovedView>(seen, view),
                    places: self.places.address(),
                    starts: self.starts.address(),
                    volume: self.volume.address(),
                    rays: self.rays.address(),
                    view_count: count(views),
                    columns: push.columns,
                    rows: push.rows,
                    size_x: push.size_x,
                    size_y: push.size_y,
                    size_z: push.size_z,
                    first_plane,
                    first: 0,
                    end: 0,
                    arm: push.arm,
                    per_lever: push.per_lever,
                    arm_less: push.arm_less,
                    per_distance: push.per_distance,
                };
                let push = |first, end| ProjectBackMovedPush { first, end, ..push };
                self.device.run_paced(&self.back, items, pace, push, done)
            }
        }
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

/// Address of an element of a table.
fn of_view<T>(table: &Buffer, element: usize) -> u64 {
    table.address() + (element * size_of::<T>()) as u64
}

impl Tables {
    fn of(device: &Arc<Device>, rays: &Rays, arm: Arm) -> Result<Self> {
        let [size_x, size_y, size_z] = rays.grid.size.map(count);
        let (rows, columns) = (count(rays.geometry.rows.len()), count(rays.places.len()));
        let (per_lever, arm_less) = (single(arm.per_lever), single(arm.less));
        if rays.geometry.motions.is_some() {
            return Ok(Self::Moved {
                sheets: device.upload("sheets of rays", &rays.moved_sheets())?,
                views: device.upload("views of voxels", &rays.moved_views())?,
                push: ProjectMovedPush {
                    columns,
                    rows,
                    size_x,
                    size_y,
                    size_z,
                    arm: arm.kind,
                    per_lever,
                    arm_less,
                    per_distance: single(rays.geometry.per_distance()),
                    ..bytemuck::Zeroable::zeroed()
                },
            });
        }
        let [row_zero, row_step, plane_zero] = rays.heights().map(single);
        Ok(Self::Circle {
            sheets: device.upload("sheets of rays", &rays.sheets()?)?,
            push: ProjectPush {
                columns,
                rows,
                size_x,
                size_y,
                arm: arm.kind,
                per_lever,
                arm_less,
                row_zero,
                row_step,
                plane_zero,
                ..bytemuck::Zeroable::zeroed()
            },
        })
    }
}
