//! Memory and time of a reconstruction, before it is done.

use super::back_projector::BackProjector;
use super::geometry::ScanGeometry;
use super::grid::VolumeGrid;
use super::memory::{Memory, passes};
use super::method::Method;
use super::model::Model;
use super::plan::VolumePlan;
use super::quantity::Quantity;
use super::resampling::Resampling;
use super::work::Work;
use beamlet_core::rows_control::RowsControl;
use beamlet_core::{Result, parallel};
use beamlet_gpu::Compute;
use ndarray::Array3;
use serde::Serialize;
use std::time::Instant;

/// Sums of a voxel over a view that are measured.
const MEASURED: usize = 1 << 23;
/// Rows and planes of projections that are measured.
const THICK: usize = 4;

/// Memory and time of a reconstruction.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[non_exhaustive]
pub struct VolumeEstimate {
    /// Bytes of a volume.
    pub volume_bytes: u64,
    /// Most bytes on the host at a time, without the program: sinograms and volumes.
    pub host_bytes: u64,
    /// Bytes on the device: slabs of a volume and parts of the projections, or all volumes and sinograms of
    /// an iterative method.
    pub device_bytes: u64,
    /// Seconds of the projections and back-projections of all quantities, by a part of them on this
    /// device. Iterative methods may end before.
    pub seconds: f64,
}

/// Estimates the reconstruction of a plan, within the memory limit of the engine; `truth`: with volumes of
/// the scene.
///
/// # Errors
/// As [`super::fbp`] and [`super::iterate`]; [`beamlet_core::Error::Memory`] where the limit is too
/// low, or the device has no room for the vectors of an iterative method.
pub fn estimate(
    compute: &Compute,
    geometry: &ScanGeometry,
    plan: &VolumePlan,
    truth: bool,
    control: &mut RowsControl<'_>,
) -> Result<VolumeEstimate> {
    geometry.check()?;
    plan.grid.check(geometry)?;
    let memory = Memory::on(compute, geometry, plan, truth)?;
    parallel::start_threads()?;
    let mut work = Work { cancel: control.cancel.clone(), report: &mut |_| () };
    let pairs = passes(geometry, plan);
    let mut seconds = 0.0;
    if plan.method.filtered().is_some() {
        let all = plan.ordered().count() as f64 + pairs as f64;
        seconds += all * back_projection(compute, geometry, &plan.grid, &mut work)?;
    }
    if pairs > 0 {
        seconds += pairs as f64 * projections(compute, geometry, &plan.grid, &mut work)?[0];
    }
    if let Method::Iterative { options, .. } = &plan.method {
        let [forward, back] = projections(compute, geometry, &plan.grid, &mut work)?;
        let all = options.iterations.saturating_mul(plan.ordered().count()) as f64;
        seconds += all * (forward + back);
    }
    Ok(VolumeEstimate {
        volume_bytes: plan.grid.size.iter().fold(4, |all, side| all.saturating_mul(*side as u64)),
        host_bytes: memory.host,
        device_bytes: memory.device,
        seconds,
    })
}

/// Seconds of work the second time that it is done: the first makes kernels and finds the pace.
fn second_time(mut work: impl FnMut() -> Result<()>) -> Result<f64> {
    work()?;
    let since = Instant::now();
    work()?;
    Ok(since.elapsed().as_secs_f64())
}

/// Seconds of the back-projection of filtered rows.
fn back_projection(
    compute: &Compute,
    geometry: &ScanGeometry,
    grid: &VolumeGrid,
    work: &mut Work<'_>,
) -> Result<f64> {
    geometry.require_circle("fbp")?;
    let even = Resampling::of(&geometry.columns);
    let [views, rows, _] = geometry.shape();
    let [x, y, z] = grid.size;
    let slice = VolumeGrid { size: [x, y, 1], ..*grid };
    let few = (MEASURED / (x * y)).clamp(1, views);
    let part = ScanGeometry { angles: geometry.angles[..few].to_vec(), ..geometry.clone() };
    let columns = [even.first, even.pitch];
    let projector = BackProjector::new(compute, &part, columns, &slice, Quantity::Mu)?;
    let given = Array3::zeros((few, rows, even.len()));
    let seconds = second_time(|| projector.sum(given.view(), work).map(drop))?;
    Ok(seconds * (z * views) as f64 / few as f64)
}

/// Seconds of a projection of the volume and of its transpose.
fn projections(
    compute: &Compute,
    geometry: &ScanGeometry,
    grid: &VolumeGrid,
    work: &mut Work<'_>,
) -> Result<[f64; 2]> {
    let [views, rows, columns] = geometry.shape();
    let [x, y, z] = grid.size;
    let (few_rows, planes) = (rows.min(THICK), z.min(THICK));
    let of_view = (x * y * planes).max(few_rows * columns * x.max(y));
    let few = (MEASURED / of_view).clamp(3, views);
    let first = (rows - few_rows) / 2;
    // Views of the whole scan: how rays cross voxels depends on their direction.
    let chosen = || (0..few).map(|n| n * views / few);
    let motions = geometry.motions.as_ref();
    let part = ScanGeometry {
        angles: chosen().map(|view| geometry.angles[view]).collect(),
        motions: motions.map(|motions| chosen().map(|view| motions[view]).collect()),
        rows: geometry.rows[first..first + few_rows].to_vec(),
        ..geometry.clone()
    };
    let plane = (z - planes) / 2;
    let mut origin = grid.origin;
    origin[2] += grid.voxel[2] * plane as f64;
    let slab = VolumeGrid { size: [x, y, planes], origin, ..*grid };
    let model = Model::new(compute, &part, &slab, super::data::Data::Attenuation, None)?;
    let volume = Array3::zeros((planes, y, x));
    let rays = Array3::zeros((few, few_rows, columns));
    let forward = second_time(|| model.forward(volume.view(), work).map(drop))?;
    let back = second_time(|| model.back(rays.view(), work).map(drop))?;
    let per_view = views as f64 / few as f64;
    Ok([
        forward * per_view * rows as f64 / few_rows as f64,
        back * per_view * z as f64 / planes as f64,
    ])
}
