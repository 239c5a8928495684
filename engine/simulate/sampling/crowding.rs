//! Patches whose facets are too many to be looked at, from the projected bounds of components.

use super::patch_grid::PatchGrid;
use super::projected_bounds::ProjectedBounds;
use super::view_context::ViewContext;

/// Patches with more facets than this have none listed: their facets are finer than any rectangle.
const MOST_FACETS: u32 = 1024;

/// Patches crowded by the projected bounds of components, and the components that lie only in such
/// patches: bundles of fibres, whose facets need not be listed.
pub(super) fn bundles(view: &ViewContext<'_>, grid: &PatchGrid) -> (Vec<bool>, Vec<bool>) {
    let each = |shadow: &ProjectedBounds, visit: &mut dyn FnMut(usize)| {
        let [rows, beamlets] = shadow.patches(view.lattice);
        for row in rows.start.max(grid.rows.start)..rows.end.min(grid.rows.end) {
            grid.in_row(row, beamlets.clone()).for_each(&mut *visit);
        }
    };
    let counts = &view.facets.triangles;
    let mut least = vec![0.0_f32; grid.count()];
    for (shadow, count) in view.projected_bounds.iter().zip(counts) {
        let [rows, beamlets] = shadow.patches(view.lattice);
        let among = (rows.end - rows.start) * (beamlets.end - beamlets.start).max(1);
        let share = *count as f32 / among as f32;
        each(shadow, &mut |patch| least[patch] += share);
    }
    // Twice, since facets spread unevenly.
    let crowded: Vec<bool> = least.iter().map(|n| *n > 2.0 * MOST_FACETS as f32).collect();
    let alone = |shadow: &ProjectedBounds| {
        let mut alone = true;
        each(shadow, &mut |patch| alone &= crowded[patch]);
        alone
    };
    let left_out = view.projected_bounds.iter().map(alone).collect();
    (crowded, left_out)
}
