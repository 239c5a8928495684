//! The patches of some rows, numbered by row, then beamlet.

#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "counts are bounded by the scene's validation"
)]

use std::ops::Range;

/// Numbers the patches of some rows and beamlets.
#[derive(Debug, Clone)]
pub(super) struct PatchGrid {
    pub(super) rows: Range<i64>,
    pub(super) beamlets: Range<i64>,
}

impl PatchGrid {
    /// Number of the patches.
    pub(super) fn count(&self) -> usize {
        self.width() * (self.rows.end - self.rows.start).max(0) as usize
    }

    fn width(&self) -> usize {
        (self.beamlets.end - self.beamlets.start).max(0) as usize
    }

    /// Number of a patch; nothing beyond the grid.
    pub(super) fn index(&self, beamlet: i64, row: i64) -> Option<usize> {
        let inside = self.rows.contains(&row) && self.beamlets.contains(&beamlet);
        inside.then(|| {
            (row - self.rows.start) as usize * self.width()
                + (beamlet - self.beamlets.start) as usize
        })
    }

    /// Numbers of the patches of a row, for beamlets inside the grid.
    pub(super) fn in_row(&self, row: i64, beamlets: Range<i64>) -> Range<usize> {
        let first = (row - self.rows.start) as usize * self.width();
        let at = |beamlet: i64| first + (beamlet - self.beamlets.start) as usize;
        if beamlets.is_empty() { 0..0 } else { at(beamlets.start)..at(beamlets.end) }
    }
}
