//! The filter 1/|k| of slices: it makes steps of refraction angles about the same size at all frequencies.

use super::vectors::{Vector, Vectors};
use beamlet_core::numbers::single;
use beamlet_core::{Cancel, Result, reserve};
use rayon::prelude::*;
use rustfft::num_complex::Complex;
use rustfft::{Fft, FftPlannerScalar};
use std::fmt;
use std::sync::Arc;

/// Filter of planes that are padded with zeros to twice their sides.
pub(super) struct Preconditioner {
    size: [usize; 2],
    padded: [usize; 2],
    /// Forward and inverse transforms along x, and along y.
    transforms: [[Arc<dyn Fft<f32>>; 2]; 2],
}

impl fmt::Debug for Preconditioner {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Preconditioner").field("size", &self.size).finish_non_exhaustive()
    }
}

impl Preconditioner {
    /// A filter of planes of this size, x then y.
    pub(super) fn new(size: [usize; 2]) -> Self {
        let mut planner = FftPlannerScalar::new();
        let padded = size.map(|n| (2 * n).next_power_of_two());
        let transforms = padded.map(|n| [planner.plan_fft_forward(n), planner.plan_fft_inverse(n)]);
        Self { size, padded, transforms }
    }

    /// Filters each plane of `[z][y][x]`.
    pub(super) fn apply(
        &self,
        volume: &Vector,
        to: &mut Vector,
        vectors: &mut Vectors,
        cancel: &Cancel,
    ) -> Result<()> {
        let plane = self.size[0] * self.size[1];
        let mut values = reserve::zeroed(volume.len(), "a volume")?;
        vectors.values(volume, &mut values)?;
        values.par_chunks_mut(plane).try_for_each(|plane| {
            cancel.check()?;
            self.filter(plane);
            Ok(())
        })?;
        vectors.set(to, &values)
    }

    fn filter(&self, plane: &mut [f32]) {
        let ([x, _], [wide, high]) = (self.size, self.padded);
        let mut rows = vec![Complex::new(0.0_f32, 0.0); wide * high];
        for (row, given) in rows.chunks_mut(wide).zip(plane.chunks(x)) {
            row.iter_mut().zip(given).for_each(|(to, from)| to.re = *from);
        }
        let mut columns = vec![Complex::new(0.0_f32, 0.0); wide * high];
        let [[along, along_back], [across, across_back]] = &self.transforms;
        along.process(&mut rows);
        transpose(&rows, &mut columns, wide);
        across.process(&mut columns);
        let frequency = |n: usize, length: usize| n.min(length - n) as f64 / length as f64;
        let least = 0.25 / self.size[0].max(self.size[1]) as f64;
        let per = 1.0 / (wide * high) as f64;
        for (n, column) in columns.chunks_mut(high).enumerate() {
            let fx = frequency(n, wide);
            for (m, value) in column.iter_mut().enumerate() {
                *value *= single(per / fx.hypot(frequency(m, high)).max(least));
            }
        }
        across_back.process(&mut columns);
        transpose(&columns, &mut rows, high);
        along_back.process(&mut rows);
        for (row, to) in rows.chunks(wide).zip(plane.chunks_mut(x)) {
            to.iter_mut().zip(row).for_each(|(to, from)| *to = from.re);
        }
    }
}

/// Rows of `length` values as columns.
fn transpose(from: &[Complex<f32>], to: &mut [Complex<f32>], length: usize) {
    let count = from.len() / length;
    for (n, row) in from.chunks(length).enumerate() {
        row.iter().enumerate().for_each(|(m, value)| to[m * count + n] = *value);
    }
}
