//! Light summed over the window of each pixel: directly, or by Fourier transforms along the rows
//! where windows are wide.

use beamlet_core::Result;
use beamlet_core::cancel::Cancel;
use beamlet_core::fourier::transforms;
use beamlet_core::numbers::single;
use ndarray::{Array2, Array3, ArrayView3};
use rayon::prelude::*;
use rustfft::Fft;
use rustfft::num_complex::Complex;
use std::fmt;
use std::sync::Arc;

/// Least width along x, pixels, of windows that are summed by Fourier transforms.
const WIDE: usize = 24;
/// Least width of windows with at least the pixels of such a square: a row of weights costs as much as
/// four of them.
pub(crate) const NARROW: usize = 4;
/// Bytes that the transforms of the weights may take, where shorter transforms take less.
const WEIGHTS: usize = 256 << 20;
/// Bytes of the transforms of light that are held at a time; more where windows are as high: each group of
/// rows transforms all of their windows.
const LIGHT: usize = 32 << 20;

/// Weights of the light around a pixel.
#[derive(Debug, Clone)]
pub(super) struct Window {
    /// `[sub-row][sub-column]`.
    weights: Array2<f64>,
    /// Parts of a pixel along x and z.
    parts: [usize; 2],
    transformed: Option<Transformed>,
}

impl Window {
    /// Weights `[sub-row][sub-column]` for rows of `columns` pixels.
    pub(super) fn new(weights: Array2<f64>, parts: [usize; 2], columns: usize) -> Self {
        let transformed = is_wide(weights.dim(), parts)
            .then(|| Transformed::of(&weights, Blocks::of(weights.dim(), parts[0], columns)));
        Self { weights, parts, transformed }
    }

    /// Bytes that sums over windows of `[sub-rows, sub-columns]` take at most beside the light.
    pub(super) fn bytes([rows, columns]: [usize; 2], parts: [usize; 2], pixels: usize) -> u64 {
        // The kernel as it was read, about as fine, and its weights.
        let weights = 2 * rows * columns * size_of::<f64>();
        let transforms = if is_wide((rows, columns), parts) {
            let blocks = Blocks::of((rows, columns), parts[0], pixels);
            blocks.weight_bytes() + (blocks.light_rows() + rows) * blocks.row_bytes()
        } else {
            0
        };
        (weights + transforms) as u64
    }

    /// Sums the weights over the window of each pixel, which moves by the parts of a pixel from
    /// pixel to pixel; in f64. The bits of a row depend on the light in its window alone.
    ///
    /// # Errors
    /// [`beamlet_core::Error::Interrupted`].
    pub(super) fn gather(
        &self,
        lit: ArrayView3<'_, f32>,
        [rows, columns]: [usize; 2],
        cancel: &Cancel,
    ) -> Result<Array3<f32>> {
        let sums = match &self.transformed {
            Some(transformed) => transformed.gather(lit, self.parts, [rows, columns], cancel),
            None => direct(lit, &self.weights, self.parts, [rows, columns], cancel),
        };
        cancel.check().map(|()| sums)
    }
}

/// True if transforms take less time than direct sums.
fn is_wide((rows, columns): (usize, usize), parts: [usize; 2]) -> bool {
    let taps = [columns / parts[0], rows / parts[1]];
    let large = taps[0] >= NARROW && taps[0] * taps[1] >= WIDE * WIDE;
    rows > parts[1] && (taps[0] >= WIDE || large)
}

/// Where it is cancelled, sums are left out.
fn direct(
    lit: ArrayView3<'_, f32>,
    weights: &Array2<f64>,
    parts: [usize; 2],
    [rows, columns]: [usize; 2],
    cancel: &Cancel,
) -> Array3<f32> {
    let (steps, lit_rows, lit_columns) = lit.dim();
    let mut out = Array3::zeros((steps, rows, columns));
    let lit = lit.as_standard_layout();
    let light = lit.as_slice().unwrap_or_default();
    let Some(values) = out.as_slice_mut() else { return out };
    values.par_chunks_mut(columns).enumerate().for_each(|(index, line)| {
        if cancel.is_cancelled() {
            return;
        }
        let (step, row) = (index / rows, index % rows);
        let mut sums = vec![0.0_f64; columns];
        for (j, weights) in weights.outer_iter().enumerate() {
            // A row of a large kernel takes seconds.
            if cancel.is_cancelled() {
                return;
            }
            let start = (step * lit_rows + row * parts[1] + j) * lit_columns;
            let light = &light[start..start + lit_columns];
            for (i, weight) in weights.iter().enumerate() {
                for (sum, light) in sums.iter_mut().zip(light[i..].iter().step_by(parts[0])) {
                    *sum += weight * f64::from(*light);
                }
            }
        }
        store(line, &sums);
    });
    out
}

fn store(line: &mut [f32], sums: &[f64]) {
    line.iter_mut().zip(sums).for_each(|(value, sum)| *value = single(*sum));
}

/// Real and imaginary parts of half a spectrum; the other half mirrors it.
type Half = [Vec<f64>; 2];

/// Blocks that a row is cut into (overlap-save).
#[derive(Debug, Clone, Copy)]
struct Blocks {
    /// Points of a transform.
    length: usize,
    /// Pixels that one transform gives.
    block: usize,
    /// Parts of a pixel along x.
    parts: usize,
    /// Rows of the window.
    window: usize,
}

impl Blocks {
    /// For windows of `rows` and `columns` of the grid: the length that takes the fewest points for
    /// a whole row, of those whose transforms of all weights are no larger than [`WEIGHTS`]; or the shortest.
    fn of((rows, columns): (usize, usize), parts: usize, pixels: usize) -> Self {
        let taps = columns / parts;
        let of_length =
            |length: usize| Self { length, block: length + 1 - taps, parts, window: rows };
        let longest = (pixels + taps).next_power_of_two();
        let shortest = (2 * taps).next_power_of_two().min(longest);
        let mut best = of_length(shortest);
        let points = |it: &Self| pixels.div_ceil(it.block) * it.length;
        let mut length = 2 * shortest;
        while length <= longest && of_length(length).weight_bytes() <= WEIGHTS {
            let next = of_length(length);
            if points(&next) < points(&best) {
                best = next;
            }
            length *= 2;
        }
        best
    }

    /// Bytes of half a spectrum of a row of the grid.
    const fn row_bytes(self) -> usize {
        self.parts * (self.length / 2 + 1) * size_of::<Complex<f64>>()
    }

    const fn weight_bytes(self) -> usize {
        self.window * self.row_bytes()
    }

    /// Rows of the grid beside the rows of one window whose transforms are held together.
    fn light_rows(self) -> usize {
        (LIGHT / self.row_bytes()).saturating_sub(self.window).max(self.window)
    }
}

/// Rows of weights as spectra. Every row of light is transformed separately and rows are summed in their
/// order, so that no bit depends on the band; along x by overlap-save, in blocks from column 0 on.
#[derive(Clone)]
struct Transformed {
    blocks: Blocks,
    /// `[sub-row][sub-column of a pixel]`.
    weights: Vec<Half>,
    forward: Arc<dyn Fft<f64>>,
    inverse: Arc<dyn Fft<f64>>,
}

impl fmt::Debug for Transformed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Transformed").field("blocks", &self.blocks).finish_non_exhaustive()
    }
}

impl Transformed {
    fn of(weights: &Array2<f64>, blocks: Blocks) -> Self {
        let Blocks { length, parts, .. } = blocks;
        let [forward, inverse] = transforms(length);
        let scale = (length as f64).recip();
        let spectra = weights
            .outer_iter()
            .flat_map(|row| {
                let row = row.to_vec();
                (0..parts).map(move |part| {
                    row[part..].iter().step_by(parts).map(|it| it * scale).collect::<Vec<f64>>()
                })
            })
            .map(|row| half(&*forward, row.into_iter()))
            .collect();
        Self { blocks, weights: spectra, forward, inverse }
    }

    /// Where it is cancelled, sums are left out.
    fn gather(
        &self,
        lit: ArrayView3<'_, f32>,
        [across, down]: [usize; 2],
        [rows, columns]: [usize; 2],
        cancel: &Cancel,
    ) -> Array3<f32> {
        let (steps, lit_rows, lit_columns) = lit.dim();
        let mut out = Array3::zeros((steps, rows, columns));
        let lit = lit.as_standard_layout();
        let light = lit.as_slice().unwrap_or_default();
        let Some(values) = out.as_slice_mut() else { return out };
        let Blocks { block, window, .. } = self.blocks;
        let group = (self.blocks.light_rows() / down).max(1);
        for (step, frame) in values.chunks_mut((rows * columns).max(1)).enumerate() {
            for first in (0..columns).step_by(block) {
                for (start, lines) in
                    (0..rows).step_by(group).zip(frame.chunks_mut(group * columns))
                {
                    if cancel.is_cancelled() {
                        return out;
                    }
                    let count = (lines.len() / columns - 1) * down + window;
                    let spectra: Vec<Half> = (0..count * across)
                        .into_par_iter()
                        .map(|index| {
                            let row = step * lit_rows + start * down + index / across;
                            let part = first * across + index % across;
                            let row = &light[row * lit_columns..][..lit_columns];
                            let light = row[part.min(row.len())..].iter().step_by(across);
                            half(&*self.forward, light.map(|it| f64::from(*it)))
                        })
                        .collect();
                    lines.par_chunks_mut(columns).enumerate().for_each(|(row, line)| {
                        if cancel.is_cancelled() {
                            return;
                        }
                        let light = &spectra[row * down * across..];
                        let last = columns.min(first + block);
                        store(&mut line[first..last], &self.sums(light));
                    });
                }
            }
        }
        out
    }

    /// Sums of one row, from the spectra of the light in its window.
    fn sums(&self, light: &[Half]) -> Vec<f64> {
        let length = self.blocks.length;
        let half = length / 2 + 1;
        let mut sum = [vec![0.0; half], vec![0.0; half]];
        for ([weight, weight_i], [light, light_i]) in self.weights.iter().zip(light) {
            let [sum, sum_i] = &mut sum;
            for k in 0..half {
                // The weight conjugated: a correlation.
                sum[k] += weight[k] * light[k] + weight_i[k] * light_i[k];
                sum_i[k] += weight[k] * light_i[k] - weight_i[k] * light[k];
            }
        }
        let [real, imaginary] = sum;
        let at = |k: usize| Complex::new(real[k], imaginary[k]);
        let mut values: Vec<Complex<f64>> =
            (0..length).map(|k| if k < half { at(k) } else { at(length - k).conj() }).collect();
        self.inverse.process(&mut values);
        // No light is less than none; rounding may say so.
        values.iter().map(|value| value.re.max(0.0)).collect()
    }
}

/// Half the spectrum of real numbers, padded with zeros or cut to the length.
fn half(forward: &dyn Fft<f64>, numbers: impl Iterator<Item = f64>) -> Half {
    let mut values: Vec<Complex<f64>> =
        numbers.take(forward.len()).map(|it| Complex::new(it, 0.0)).collect();
    values.resize(forward.len(), Complex::new(0.0, 0.0));
    forward.process(&mut values);
    let half = &values[..forward.len() / 2 + 1];
    [half.iter().map(|it| it.re).collect(), half.iter().map(|it| it.im).collect()]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Numbers without pattern in 0..1.
    fn mixed(index: usize) -> f64 {
        let bits = (index as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        (bits ^ bits >> 29).wrapping_mul(0xbf58_476d_1ce4_e5b9) as f64 / u64::MAX as f64
    }

    fn case(parts: [usize; 2], taps: [usize; 2], size: [usize; 2]) -> (Array2<f64>, Array3<f32>) {
        let [columns, rows] = [0, 1].map(|axis| taps[axis] * parts[axis]);
        let mut weights = Array2::from_shape_fn((rows, columns), |(j, i)| mixed(j * columns + i));
        weights /= weights.sum();
        let [width, height] = [0, 1].map(|axis| (size[axis] + taps[axis] - 1) * parts[axis]);
        let lit = Array3::from_shape_fn((2, height, width), |(step, row, column)| {
            let light = mixed((step * height + row) * width + column + 77);
            // Sharp edges, and darkness.
            if light < 0.3 { 0.0 } else { single(light) }
        });
        (weights, lit)
    }

    #[test]
    fn wide_windows_give_the_direct_sums() {
        for (parts, taps, size) in [
            ([1, 1], [24, 2], [300, 5]),
            ([1, 1], [61, 61], [50, 40]),
            ([3, 2], [25, 7], [90, 11]),
            ([2, 1], [301, 3], [700, 4]),
            ([1, 2], [5, 130], [90, 3]),
        ] {
            let (weights, lit) = case(parts, taps, size);
            let window = Window::new(weights.clone(), parts, size[0]);
            assert!(window.transformed.is_some());
            let got = window.gather(lit.view(), [size[1], size[0]], &Cancel::default()).unwrap();
            for ((step, row, column), got) in got.indexed_iter() {
                let want: f64 = weights
                    .indexed_iter()
                    .map(|((j, i), weight)| {
                        let place = [step, row * parts[1] + j, column * parts[0] + i];
                        weight * f64::from(lit[place])
                    })
                    .sum();
                // Rounding to f32 alone: half a bit.
                assert!((f64::from(*got) - want).abs() < 6.1e-8 * want + 1e-14, "{got} {want}");
            }
        }
    }

    #[test]
    fn rows_have_the_same_bits_alone_and_in_bands() {
        let (parts, taps, size) = ([2, 3], [30, 5], [100, 13]);
        let (weights, lit) = case(parts, taps, size);
        let window = Window::new(weights, parts, size[0]);
        let all = window.gather(lit.view(), [size[1], size[0]], &Cancel::default()).unwrap();
        for (start, count) in [(0, 1), (3, 4), (7, 6), (12, 1)] {
            let rows = start * parts[1]..(start + count + taps[1] - 1) * parts[1];
            let band = lit.slice(ndarray::s![1.., rows, ..]);
            let some = window.gather(band, [count, size[0]], &Cancel::default()).unwrap();
            assert_eq!(some, all.slice(ndarray::s![1.., start..start + count, ..]));
        }
    }

    #[test]
    fn narrow_windows_are_summed_directly() {
        let narrow = |taps| Window::new(case([2, 1], taps, [50, 5]).0, [2, 1], 50);
        for taps in [[23, 23], [40, 1], [3, 900], [4, 143]] {
            assert!(narrow(taps).transformed.is_none(), "{taps:?}");
        }
        for taps in [[24, 23], [4, 144]] {
            assert!(narrow(taps).transformed.is_some(), "{taps:?}");
        }
    }
}
