//! Bands of the rows of a detector.

use std::ops::Range;

/// The rows of a detector in bands of at most `band` rows.
pub(super) fn bands(rows: u32, band: u32) -> impl Iterator<Item = Range<u32>> {
    (0..rows).step_by(band as usize).map(move |first| first..rows.min(first + band))
}
