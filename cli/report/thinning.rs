//! Frames and images as 16-bit numbers, binned where there are too many.

use crate::numbers;
use ndarray::{Array2, ArrayView2};

/// Code of a pixel without a number.
pub(super) const NOTHING: u16 = u16::MAX;
/// Views are left out before pixels are binned, down to this many.
const VIEWS: usize = 24;

/// Part of a run that is kept, so that the page stays small.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Thinning {
    /// Pixels of a side that become one.
    pub(super) bin: usize,
    /// Every how many views one is kept.
    pub(super) every: usize,
}

impl Thinning {
    /// The least thinning with which `images` frames per view (and `more` frames beside) take no
    /// more than `most` bytes.
    pub(super) fn of(
        [views, _, rows, columns]: [usize; 4],
        images: usize,
        more: usize,
        most: u64,
    ) -> Self {
        let mut thinning = Self { bin: 1, every: 1 };
        loop {
            let Self { bin, every } = thinning;
            let frames = views.div_ceil(every) * images + more;
            let bytes = 2 * frames as u64 * (rows.div_ceil(bin) * columns.div_ceil(bin)) as u64;
            if bytes <= most || (bin >= rows.max(columns) && every >= views) {
                return thinning;
            }
            if views.div_ceil(every) > VIEWS || bin >= rows.max(columns) {
                thinning.every += 1;
            } else {
                thinning.bin += 1;
            }
        }
    }

    /// Means over blocks; blocks at the right and lower edge may be smaller.
    pub(super) fn binned(&self, frame: ArrayView2<'_, f32>) -> Array2<f64> {
        let (rows, columns) = frame.dim();
        let bin = self.bin;
        Array2::from_shape_fn((rows.div_ceil(bin), columns.div_ceil(bin)), |(row, column)| {
            let of = |at: usize, end: usize| at * bin..((at + 1) * bin).min(end);
            let block = frame.slice(ndarray::s![of(row, rows), of(column, columns)]);
            block.iter().map(|value| f64::from(*value)).sum::<f64>() / block.len() as f64
        })
    }

    /// Bits of any pixel of a block.
    pub(super) fn joined(&self, frame: ArrayView2<'_, f32>) -> Array2<u32> {
        let (rows, columns) = frame.dim();
        let bin = self.bin;
        let mut joined = Array2::zeros((rows.div_ceil(bin), columns.div_ceil(bin)));
        for ((row, column), flags) in frame.indexed_iter() {
            joined[[row / bin, column / bin]] |= numbers::whole::<u32>(f64::from(*flags));
        }
        joined
    }
}

/// Numbers on their way to 16 bits.
pub(super) struct Quantised {
    pub(super) low: f64,
    pub(super) high: f64,
    pub(super) words: Vec<u16>,
}

impl Quantised {
    pub(super) fn of(values: &[f64]) -> Self {
        let finite = values.iter().copied().filter(|value| value.is_finite());
        let (low, high) =
            finite.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
        let (low, high) = if low > high { (0.0, 0.0) } else { (low, high) };
        let span = if high > low { high - low } else { 1.0 };
        let word = |value: &f64| match value.is_finite() {
            true => numbers::whole::<u16>(((value - low) / span * f64::from(NOTHING - 1)).round()),
            false => NOTHING,
        };
        Self { low, high: low + span, words: values.iter().map(word).collect() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thinning_keeps_within_the_limit_and_does_no_more_than_it_must() {
        let small = [3, 11, 128, 128];
        assert_eq!(Thinning::of(small, 14, 11, 24 << 20), Thinning { bin: 1, every: 1 });
        let large = [1, 11, 2048, 2048];
        let thinning = Thinning::of(large, 18, 15, 24 << 20);
        let side = 2048_u64.div_ceil(thinning.bin as u64);
        assert_eq!(thinning.every, 1);
        assert!(2 * 33 * side * side <= 24 << 20, "{thinning:?}");
        let coarser = 2048_u64.div_ceil(thinning.bin as u64 - 1);
        assert!(2 * 33 * coarser * coarser > 24 << 20, "{thinning:?}");
        let many = Thinning::of([3600, 7, 1, 256], 14, 11, 1 << 20);
        assert!(many.every > 1 && many.bin == 1, "{many:?}");
        // An impossible limit ends, too.
        let _ = Thinning::of(large, 18, 15, 1);
    }

    #[test]
    fn bins_are_means_and_words_hold_the_values() {
        let frame = Array2::from_shape_fn((3, 5), |(r, c)| (10 * r + c) as f32);
        let binned = Thinning { bin: 2, every: 1 }.binned(frame.view());
        assert_eq!(binned.dim(), (2, 3));
        assert_eq!(binned.iter().copied().collect::<Vec<_>>(), [5.5, 7.5, 9.0, 20.5, 22.5, 24.0]);
        let values = [-1.0, f64::NAN, 0.25, 3.0];
        let Quantised { low, high, words } = Quantised::of(&values);
        assert_eq!(words[1], NOTHING);
        for (value, word) in values.iter().zip(&words).filter(|(value, _)| value.is_finite()) {
            let back = low + (high - low) * f64::from(*word) / f64::from(NOTHING - 1);
            // Half a step of the 65,534 between the ends.
            assert!((back - value).abs() <= 4.0 / 65_534.0 / 2.0 + 1e-12, "{value} {back}");
        }
    }
}
