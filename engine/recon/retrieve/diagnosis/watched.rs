//! Values of a few thousand pixels, kept while rows are read.

use ndarray::{Array2, Array3};
use std::ops::Range;

/// Greatest number of pixels that are kept.
const MOST: usize = 4096;

/// Values of chosen pixels at all steps.
#[derive(Debug, Clone)]
pub(super) struct Watched {
    /// Pixels counted over rows, ascending.
    pixels: Vec<usize>,
    /// `[pixel][step]`; NaN where no row was read.
    values: Array2<f32>,
    /// Columns of a frame.
    columns: usize,
    /// Values from here on are left out: NaN.
    saturation: f32,
    /// For each step the values below zero, and all finite ones, among all that were read.
    negatives: Vec<[u64; 2]>,
}

impl Watched {
    /// Pixels evenly over rows and columns of a frame, so many of them at most that equations of `steps`
    /// unknowns for each cost little.
    pub(super) fn over(
        [rows, within]: &[Range<usize>; 2],
        columns: usize,
        steps: usize,
        saturation: Option<f32>,
    ) -> Self {
        let most = MOST.min(100_000_000 / steps.pow(3).max(1)).max(64);
        let (width, count) = (within.len(), rows.len() * within.len());
        // Steps that share no factor with the columns pass through all of them.
        let mut stride = count.div_ceil(most).max(1);
        while stride > 1 && !is_coprime(stride, width) {
            stride += 1;
        }
        let place = |at: usize| (rows.start + at / width) * columns + within.start + at % width;
        let pixels: Vec<usize> = (0..count).step_by(stride).map(place).collect();
        let values = Array2::from_elem((pixels.len(), steps), f32::NAN);
        let saturation = saturation.unwrap_or(f32::INFINITY);
        Self { pixels, values, columns, saturation, negatives: vec![[0; 2]; steps] }
    }

    /// The same pixels and steps, without values.
    pub(super) fn again(&self) -> Self {
        let values = Array2::from_elem(self.values.raw_dim(), f32::NAN);
        let negatives = vec![[0; 2]; self.negatives.len()];
        Self { pixels: self.pixels.clone(), values, negatives, ..*self }
    }

    /// Keeps the values of its pixels among rows, `[step][row][column]`.
    pub(super) fn take(&mut self, data: &Array3<f32>, rows: &Range<u32>) {
        for ([negative, all], frame) in self.negatives.iter_mut().zip(data.outer_iter()) {
            *negative += frame.iter().filter(|value| **value < 0.0).count() as u64;
            *all += frame.iter().filter(|value| value.is_finite()).count() as u64;
        }
        let [from, to] = [rows.start, rows.end].map(|row| row as usize * self.columns);
        let first = self.pixels.partition_point(|pixel| *pixel < from);
        let last = self.pixels.partition_point(|pixel| *pixel < to);
        for at in first..last {
            let pixel = self.pixels[at] - from;
            let (row, column) = (pixel / self.columns, pixel % self.columns);
            for (step, value) in self.values.row_mut(at).iter_mut().enumerate() {
                let found = data[[step, row, column]];
                *value = if found < self.saturation { found } else { f32::NAN };
            }
        }
    }

    /// Each pixel with its values.
    pub(super) fn iter(&self) -> impl Iterator<Item = (usize, Vec<f64>)> {
        self.pixels
            .iter()
            .zip(self.values.outer_iter())
            .map(|(pixel, values)| (*pixel, values.iter().copied().map(f64::from).collect()))
    }

    /// Sum of its finite values.
    pub(super) fn sum(&self) -> f64 {
        let finite = self.values.iter().filter(|value| value.is_finite());
        finite.map(|value| f64::from(*value)).sum()
    }

    /// Values below zero among all that were read.
    pub(super) fn negative(&self) -> u64 {
        self.negatives.iter().map(|[negative, _]| negative).sum()
    }

    /// For each step the values below zero, and all finite ones, among all that were read.
    pub(super) fn negatives(&self) -> &[[u64; 2]] {
        &self.negatives
    }
}

const fn is_coprime(mut a: usize, mut b: usize) -> bool {
    while b > 0 {
        (a, b) = (b, a % b);
    }
    a == 1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pixels_are_spread_over_all_columns_and_hold_their_values() {
        let (rows, columns) = (256, 1024);
        let mut watched = Watched::over(&[0..rows, 0..columns], columns, 3, None);
        let data = Array3::from_shape_fn((3, 256, 1024), |(step, row, column)| {
            (step * 1_000_000 + row * columns + column) as f32
        });
        for band in [0..100_u32, 100..256] {
            let part = data.slice(ndarray::s![.., band.start as usize..band.end as usize, ..]);
            watched.take(&part.to_owned(), &band);
        }
        let mut seen = vec![false; columns];
        let mut count = 0;
        for (pixel, values) in watched.iter() {
            seen[pixel % columns] = true;
            count += 1;
            let expected = [0, 1_000_000, 2_000_000].map(|step| (step + pixel) as f64);
            // f32 holds them to a tenth.
            assert!(values.iter().zip(expected).all(|(a, b)| (a - b).abs() < 0.13));
        }
        assert!(count > MOST / 2 && count <= MOST, "{count}");
        assert!(seen.iter().all(|seen| *seen));
        assert_eq!(watched.negative(), 0);
    }
}
