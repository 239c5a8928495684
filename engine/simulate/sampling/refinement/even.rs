//! Patches whose rays are spread evenly, in place of rectangles that are split.

use super::super::patch::{Even, PARTS, Patch};
use super::super::patch_error::KnownErrors;
use super::super::response::Opening;
use super::super::unresolved::columns;
use super::held::Held;
use super::{PatchWork, Refiner};
use beamlet_core::numbers::{self, single};

impl Refiner<'_> {
    /// Replaces the rectangles of a patch by about `count` evenly spread rays, limited by `max_rays`; the
    /// patch is done if that is no gain. False if memory is short.
    pub(super) fn begin_even(
        &self,
        work: &mut PatchWork,
        (count, even): (u32, Even),
        openings: &[Opening],
        held: &Held,
    ) -> bool {
        let left = self.view.budget.max_rays.saturating_sub(work.rays);
        let half = 0.5 * single(self.view.lattice.period);
        let most = numbers::whole::<u32>(f64::from(2.0 * half / self.estimator.least[0]));
        let possible = count.min(left).min(most);
        let leak = self.view.response.lit(0.0);
        let lines = Patch::even_lines(possible);
        let borders = columns(openings, half, leak, possible.div_ceil(lines).max(1));
        let now = numbers::count(work.patch.leaves().count());
        let is_no_gain = possible < count && possible <= now;
        let count = lines * (numbers::count(borders.len()) - 1);
        if is_no_gain || count > left {
            work.done = true;
            return true;
        }
        if !held.takes(count.div_ceil(PARTS) as usize) {
            return false;
        }
        let Patch { beamlet, row, .. } = work.patch;
        work.patch = Patch::even([beamlet, row], borders, (lines, even));
        work.known_errors = KnownErrors::default();
        work.changed.clear();
        // Along each line in turn: neighbours cross the same surfaces.
        work.pending = (0..count).collect();
        true
    }
}
