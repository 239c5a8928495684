//! The patches of some rows, numbered by row, then beamlet.

use beamlet_core::numbers;
use std::ops::Range;

/// Numbers the patches of some rows and beamlets.
#[derive(Debug, Clone)]
pub(crate) struct PatchGrid {
    pub(crate) rows: Range<i64>,
    pub(crate) beamlets: Range<i64>,
}

impl PatchGrid {
    /// Number of the patches.
    pub(crate) fn count(&self) -> usize {
        self.width() * numbers::narrow::<usize>((self.rows.end - self.rows.start).max(0))
    }

    fn width(&self) -> usize {
        numbers::narrow::<usize>((self.beamlets.end - self.beamlets.start).max(0))
    }

    /// Number of a patch; nothing beyond the grid.
    pub(crate) fn index(&self, beamlet: i64, row: i64) -> Option<usize> {
        let inside = self.rows.contains(&row) && self.beamlets.contains(&beamlet);
        inside.then(|| {
            numbers::narrow::<usize>(row - self.rows.start) * self.width()
                + numbers::narrow::<usize>(beamlet - self.beamlets.start)
        })
    }

    /// Numbers of the patches of a row, for beamlets inside the grid.
    pub(crate) fn in_row(&self, row: i64, beamlets: Range<i64>) -> Range<usize> {
        let first = numbers::narrow::<usize>(row - self.rows.start) * self.width();
        let at = |beamlet: i64| first + numbers::narrow::<usize>(beamlet - self.beamlets.start);
        if beamlets.is_empty() { 0..0 } else { at(beamlets.start)..at(beamlets.end) }
    }
}
