//! Memory of the vectors of iterative methods, all of them on the device.

use super::geometry::ScanGeometry;
use super::grid::VolumeGrid;
use super::preconditioner::filter_bytes;
use super::projector::AT_ONCE;
use super::solver::Solver;
use beamlet_core::{Error, Result};
use beamlet_gpu::Compute;

/// Bytes of a value.
pub(super) const VALUE: u64 = 4;

/// Bytes of an array with these sides.
pub(super) fn product(sides: [usize; 3]) -> u64 {
    sides.iter().fold(VALUE, |all, side| all.saturating_mul(*side as u64))
}

/// Bytes of the vectors of a method, with a filter of gradients or not, on the device; with a mask, and with
/// weights. Rays are there part by part.
pub(super) fn resident_bytes(
    geometry: &ScanGeometry,
    grid: &VolumeGrid,
    (solver, filtered): (Solver, bool),
    [mask, weights]: [bool; 2],
) -> u64 {
    let [views, rows, columns] = geometry.shape();
    let [volumes, sinograms] = vectors(solver, filtered, [mask, weights]);
    let view = product([1, rows, columns + 1]);
    let rays = view.saturating_mul(views as u64).min(view.max(VALUE * AT_ONCE as u64));
    // Factors of each column of a row, and tables of each view.
    let tables = 4 * product([1, rows, columns]) + 512 * views as u64;
    let values = product(grid.size).saturating_mul(volumes);
    let of_sinograms = product([views, rows, columns]).saturating_mul(sinograms);
    let filter = if filtered { filter_bytes(grid.size) } else { 0 };
    [of_sinograms, rays, tables, filter].into_iter().fold(values, u64::saturating_add)
}

/// Volumes and sinograms of a method: a volume, the best one, residuals and projections; and what the method,
/// its filter of gradients, a mask and weights add.
fn vectors(solver: Solver, filtered: bool, [mask, weights]: [bool; 2]) -> [u64; 2] {
    let [volumes, sinograms] = match (solver, filtered) {
        (Solver::Cgls, false) => [4, 2],
        (Solver::Cgls, true) | (Solver::Bb, false) => [5, 2],
        (Solver::Sirt, _) => [4, 3],
        (Solver::Bb, true) => [7, 2],
    };
    [volumes + u64::from(mask), sinograms + u64::from(weights)]
}

/// Refuses vectors of `needed` bytes that the device has no room for.
///
/// # Errors
/// [`Error::Memory`].
pub(super) fn require_room(
    compute: &Compute,
    (geometry, grid): (&ScanGeometry, &VolumeGrid),
    needed: u64,
) -> Result<()> {
    let device = compute.device().description();
    // A vector is one buffer, whose places shaders count with 31 bits.
    let longest = product(grid.size).max(product(geometry.shape()));
    let most = device.max_allocation_bytes.min(VALUE << 31);
    let all = device.memory_bytes / 8 * 7;
    let name = &device.name;
    let (purpose, needed, available) = if needed > all {
        (format!("an iterative reconstruction on {name}"), needed, all)
    } else if longest > most {
        (format!("the largest volume or sinogram on {name}"), longest, most)
    } else {
        return Ok(());
    };
    let remedy = "use larger or fewer voxels (--voxel, --size), reconstruct a part of the volume (--origin), \
                  choose a device with more memory, or use fbp, which has a part of the volume on the device";
    Err(Error::Memory { purpose, needed, available: Some(available), remedy: remedy.into() })
}
