//! Patches whose facets are too many to be looked at, from the projected bounds of components.

#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_precision_loss,
    reason = "counts are bounded by the scene's validation"
)]

use super::View;
use super::facet_lists::MOST_FACETS;
use super::projected_bounds::Shadow;
use std::ops::Range;

/// Patches that are crowded as the projected bounds of components tell, and the components that
/// stand in such patches alone: bundles of fibres, whose facets need not be looked at one by one.
pub(super) fn bundles(
    view: &View<'_>,
    rows: &Range<i64>,
    patches: usize,
    index: &impl Fn(i64, i64) -> usize,
) -> (Vec<bool>, Vec<bool>) {
    let touched = |shadow: &Shadow| {
        let [top, bottom] = shadow.rows.map(|row| row.floor() as i64);
        (top..bottom + 1, view.lattice.beamlets_of(shadow.x))
    };
    let each = |shadow: &Shadow, visit: &mut dyn FnMut(usize)| {
        let (all, beamlets) = touched(shadow);
        for row in all.start.max(rows.start)..all.end.min(rows.end) {
            beamlets.clone().for_each(|beamlet| visit(index(row, beamlet)));
        }
    };
    let counts = view.facets.map_or(&[][..], |facets| &facets.triangles);
    let mut least = vec![0.0_f32; patches];
    for (shadow, count) in view.shadows.iter().zip(counts) {
        let (all, beamlets) = touched(shadow);
        let among = (all.end - all.start) * (beamlets.end - beamlets.start).max(1);
        let share = *count as f32 / among as f32;
        each(shadow, &mut |patch| least[patch] += share);
    }
    // Twice, since facets spread unevenly.
    let crowded: Vec<bool> = least.iter().map(|n| *n > 2.0 * MOST_FACETS as f32).collect();
    let alone = |shadow: &Shadow| {
        let mut alone = true;
        each(shadow, &mut |patch| alone &= crowded[patch]);
        alone
    };
    let left_out = view.shadows.iter().map(alone).collect();
    (crowded, left_out)
}
