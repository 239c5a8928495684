//! Bands of the rows of a detector.

use std::ops::Range;

/// Some rows of a detector in bands of at most `band` rows that end at multiples of `block` rows.
pub(super) fn bands_of_blocks(
    rows: Range<u32>,
    block: u32,
    band: u32,
) -> impl Iterator<Item = Range<u32>> {
    let mut next = rows.start;
    std::iter::from_fn(move || {
        let first = next;
        let border = (first / block).saturating_add(1).saturating_mul(block);
        next = first.saturating_add(band).min(border).min(rows.end);
        (first < rows.end).then_some(first..next)
    })
}

/// The rows of a detector in bands of at most `band` rows.
pub(super) fn bands(rows: u32, band: u32) -> impl Iterator<Item = Range<u32>> {
    (0..rows).step_by(band as usize).map(move |first| first..rows.min(first + band))
}
