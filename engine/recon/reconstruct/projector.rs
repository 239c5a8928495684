//! Joseph's projector on the device: sums along rays, and the transpose, slab by slab of the volume.

use super::joseph::Rays;
use super::stream::{Direction, Stream};
use super::work::Work;
use beamlet_core::numbers::{count, single};
use beamlet_core::{Error, Result};
use beamlet_gpu::{Buffer, Compute, Device, Kernel, Memory, push_bytes};
use beamlet_interface::{
    MovedSheet, MovedView, ProjectBackMovedPush, ProjectBackPush, ProjectMovedPush, ProjectPush,
    Sheet,
};
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};

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
    forward: Arc<Kernel>,
    back: Arc<Kernel>,
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
    /// A slab of a volume on the host, once there is one.
    slab: OnceLock<Arc<Buffer>>,
    rays: Arc<Buffer>,
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
            forward: Arc::new(device.kernel(forward, bytes[0])?),
            back: Arc::new(device.kernel(back, bytes[1])?),
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
            slab: OnceLock::new(),
            rays: Arc::new(device.buffer(
                "rays",
                (4 * part * rows * columns) as u64,
                Memory::Device,
            )?),
            device,
            busy: Mutex::new(()),
        })
    }

    /// Waits until no other thread uses the buffers.
    pub(super) fn alone(&self) -> MutexGuard<'_, ()> {
        self.busy.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(super) const fn device(&self) -> &Arc<Device> {
        &self.device
    }

    /// Rays of a part of the views, `[view][row][place]`.
    pub(super) const fn rays(&self) -> &Arc<Buffer> {
        &self.rays
    }

    const fn rays_of_a_view(&self) -> usize {
        self.rows * self.columns
    }

    /// First view and number of views of each part.
    pub(super) fn parts(&self) -> impl Iterator<Item = [usize; 2]> + use<> {
        let (views, part) = (self.views, self.part);
        (0..views).step_by(part).map(move |first| [first, part.min(views - first)])
    }

    /// First plane and the end of each slab of a volume on the host.
    pub(super) fn slabs(&self) -> impl Iterator<Item = [usize; 2]> + use<> {
        let (all, planes) = (self.size[2], self.planes);
        (0..all).step_by(planes).map(move |first| [first, (first + planes).min(all)])
    }

    /// Memory for a slab of a volume on the host.
    ///
    /// # Errors
    /// [`Error::Memory`].
    pub(super) fn slab(&self) -> Result<&Arc<Buffer>> {
        if let Some(slab) = self.slab.get() {
            return Ok(slab);
        }
        let bytes = (4 * self.planes * self.size[0] * self.size[1]) as u64;
        let made = Arc::new(self.device.buffer("a slab", bytes, Memory::Device)?);
        Ok(self.slab.get_or_init(|| made))
    }

    /// Adds sums through some planes of a volume to the rays of a part of the views.
    ///
    /// # Errors
    /// As [`Stream::paced`].
    pub(super) fn forward(
        &self,
        (slab, planes): (&Arc<Buffer>, [usize; 2]),
        [view, views]: [usize; 2],
        stream: &mut Stream,
        work: &mut Work<'_>,
    ) -> Result<()> {
        let items = count(views * self.rays_of_a_view());
        stream.keep(slab);
        let done = &mut |n: u32| (work.report)(f64::from(n) / f64::from(items));
        let ([first_plane, plane_end], cancel) = (planes.map(count), &work.cancel);
        let (volume, places, rays) = (slab.address(), self.places.address(), self.rays.address());
        // Slices that a ray may cross; fewer in a last slab, which is thin.
        let cost = self.size[0].max(self.size[1]);
        let is_usual = planes[1] - planes[0] >= self.planes.min(self.size[2]);
        let (kernel, work) = ((&self.forward, Direction::Forward), (items, cost, is_usual));
        match &self.tables {
            Tables::Circle { sheets, push } => {
                let sheets = of_view::<Sheet>(sheets, 2 * view);
                let push =
                    ProjectPush { sheets, places, volume, rays, first_plane, plane_end, ..*push };
                let push = |first, end| ProjectPush { first, end, ..push };
                stream.paced(kernel, work, cancel, push, done)
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
                stream.paced(kernel, work, cancel, push, done)
            }
        }
    }

    /// The transpose: adds the values of the rays of a part of the views to a slab, of which the planes are
    /// given.
    ///
    /// # Errors
    /// As [`Stream::paced`].
    pub(super) fn back(
        &self,
        (slab, [first, end]): (&Arc<Buffer>, [usize; 2]),
        [view, views]: [usize; 2],
        stream: &mut Stream,
        work: &mut Work<'_>,
    ) -> Result<()> {
        let items = count((end - first) * self.size[0] * self.size[1]);
        stream.keep(slab);
        let done = &mut |n: u32| (work.report)(f64::from(n) / f64::from(items));
        let (first_plane, cancel) = (count(first), &work.cancel);
        let (volume, places, rays) = (slab.address(), self.places.address(), self.rays.address());
        let (kernel, work) = ((&self.back, Direction::Back), (items, views, true));
        match &self.tables {
            Tables::Circle { sheets, push } => {
                let push = ProjectBackPush {
                    sheets: of_view::<Sheet>(sheets, 2 * view),
                    places,
                    starts: self.starts.address(),
                    volume,
                    rays,
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
                stream.paced(kernel, work, cancel, push, done)
            }
            Tables::Moved { sheets, views: seen, push } => {
                let push = ProjectBackMovedPush {
                    sheets: of_view::<MovedSheet>(sheets, 3 * view),
                    views: of_view::<MovedView>(seen, view),
                    places,
                    starts: self.starts.address(),
                    volume,
                    rays,
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
                stream.paced(kernel, work, cancel, push, done)
            }
        }
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
