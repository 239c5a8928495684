//! Memory of iterative methods whose vectors are on the device.

use super::geometry::ScanGeometry;
use super::grid::VolumeGrid;
use super::preconditioner::filter_bytes;
use super::problem::spare;
use super::projector::AT_ONCE;
use super::solver::Solver;

/// Bytes of a value.
pub(super) const VALUE: u64 = 4;

/// Bytes of the vectors of a method, with a filter of gradients or not, on the device; with a mask, and with
/// weights. Rays are there part by part.
pub(super) fn resident_bytes(
    geometry: &ScanGeometry,
    grid: &VolumeGrid,
    (solver, filtered): (Solver, bool),
    [mask, weights]: [bool; 2],
) -> u64 {
    let product =
        |sides: [usize; 3]| sides.iter().fold(VALUE, |all, side| all.saturating_mul(*side as u64));
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

/// Volumes and sinograms of a method.
pub(super) fn vectors(solver: Solver, filtered: bool, [mask, weights]: [bool; 2]) -> [u64; 2] {
    let [volumes, sinograms] = spare(solver, filtered).map(|count| count as u64);
    [2 + volumes + u64::from(mask), 2 + sinograms + u64::from(weights)]
}
