//! Memory and time of a reconstruction, before it is done.

use super::back_projector::BackProjector;
use super::geometry::ScanGeometry;
use super::grid::VolumeGrid;
use super::quantity::Quantity;
use super::resampling::Resampling;
use super::work::Work;
use crate::run::RowsControl;
use crate::{Engine, Result, parallel};
use ndarray::Array3;
use serde::Serialize;
use std::time::Instant;

/// Sums of a voxel over a view that are measured.
const MEASURED: usize = 1 << 23;

/// Memory and time of a reconstruction by filtered back-projection.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[non_exhaustive]
pub struct VolumeEstimate {
    /// Bytes of a volume.
    pub volume_bytes: u64,
    /// Most bytes on the host at a time: sinograms, filtered projections, a volume.
    pub host_bytes: u64,
    /// Bytes on the device: a slab of the volume, and a part of the projections.
    pub device_bytes: u64,
    /// Seconds of the back-projection of one quantity, by a part of it on this device.
    pub seconds: f64,
}

/// Estimates a reconstruction of one quantity.
///
/// # Errors
/// As [`super::fbp`].
pub fn estimate(
    engine: &Engine,
    geometry: &ScanGeometry,
    grid: &VolumeGrid,
    control: &mut RowsControl<'_>,
) -> Result<VolumeEstimate> {
    parallel::start_threads()?;
    let even = Resampling::of(&geometry.columns);
    let [views, rows, _] = geometry.shape();
    let [x, y, z] = grid.size;
    let filtered = bytes([views, rows, even.len()]);
    let volume_bytes = bytes(grid.size);
    let slice = VolumeGrid { size: [x, y, 1], ..*grid };
    let few = (MEASURED / (x * y)).clamp(1, views);
    let part = ScanGeometry { angles: geometry.angles[..few].to_vec(), ..geometry.clone() };
    let projector =
        BackProjector::new(engine, &part, [even.first, even.pitch], &slice, Quantity::Mu)?;
    let projections = Array3::zeros((few, rows, even.len()));
    let mut work = Work { cancel: control.cancel.clone(), report: &mut |_| () };
    // The first makes the kernel and finds the pace.
    projector.sum(projections.view(), &mut work)?;
    let since = Instant::now();
    projector.sum(projections.view(), &mut work)?;
    let seconds = since.elapsed().as_secs_f64() * (z * views) as f64 / few as f64;
    let at_once = 4 * super::back_projector::AT_ONCE as u64;
    let device_bytes = volume_bytes.min(at_once.max(bytes([x, y, 1])))
        + filtered.min(at_once.max(bytes([1, rows, even.len()])));
    Ok(VolumeEstimate {
        volume_bytes,
        host_bytes: host_bytes(geometry, grid),
        device_bytes,
        seconds,
    })
}

/// Bytes of an array of f32.
fn bytes(sides: [usize; 3]) -> u64 {
    sides.iter().fold(4, |all, side| all.saturating_mul(*side as u64))
}

/// Most bytes on the host at a time: sinograms, filtered projections, a volume.
pub(super) fn host_bytes(geometry: &ScanGeometry, grid: &VolumeGrid) -> u64 {
    let [views, rows, columns] = geometry.shape();
    let filtered = bytes([views, rows, Resampling::of(&geometry.columns).len()]);
    bytes([views, rows, columns]).saturating_add(filtered).saturating_add(bytes(grid.size))
}
