//! From the light on the grid behind the detector mask to the detector's pixels.

use super::grid::LightGrid;
use super::kernel::{Measured, Spread};
use crate::Result;
use crate::scene::{Blur, Scene};
use ndarray::{Array2, Array3, ArrayView3};
use rayon::prelude::*;

/// Weights of the grid around a pixel, `[sub-row][sub-column]`; they sum to 1.
#[derive(Debug, Clone)]
pub(super) struct BlurStage {
    weights: Array2<f64>,
    parts: [usize; 2],
}

impl BlurStage {
    /// The stage of a scene; `None` where every part of the grid is a pixel.
    pub(super) fn of(scene: &Scene, grid: &LightGrid) -> Result<Option<Self>> {
        let weights = match &scene.detector.blur {
            None => return Ok(None),
            Some(Blur::Gaussian { .. }) if grid.margin == [0; 2] => return Ok(None),
            Some(Blur::Gaussian { sigma }) => {
                let spread = Spread::Gaussian(sigma[0] / scene.detector.pitch[0]);
                let [margin, parts] = [grid.margin[0], grid.parts[0]].map(f64::from);
                let count = ((2 * grid.margin[0] + 1) * grid.parts[0]) as usize;
                let weight = |i: usize| {
                    let low = i as f64 / parts - margin;
                    spread.landing(low, low + 1.0 / parts) / parts
                };
                Array2::from_shape_fn((1, count), |(_, i)| weight(i))
            }
            Some(Blur::Kernel(kernel)) => {
                let measured = Measured::read(scene, kernel, "detector.blur")?;
                measured.weights(grid.margin, grid.parts)
            }
        };
        Ok(Some(Self { weights, parts: grid.parts.map(|n| n as usize) }))
    }

    /// Intensities `[step][row][column]` of `rows` of pixels, from the grid's rows that they need.
    pub(super) fn pixels(&self, lit: ArrayView3<'_, f32>, rows: usize) -> Array3<f32> {
        let [_, window] = [self.weights.nrows(), self.weights.ncols()];
        let columns = (lit.dim().2 + self.parts[0] - window) / self.parts[0];
        gather(lit, &self.weights, self.parts, [rows, columns])
    }
}

/// Sums `weights` over the window of each pixel, which moves by `parts` from pixel to pixel; in a
/// fixed order, in f64.
pub(super) fn gather(
    lit: ArrayView3<'_, f32>,
    weights: &Array2<f64>,
    parts: [usize; 2],
    [rows, columns]: [usize; 2],
) -> Array3<f32> {
    let (steps, lit_rows, lit_columns) = lit.dim();
    let mut out = Array3::zeros((steps, rows, columns));
    let lit = lit.as_standard_layout();
    let light = lit.as_slice().unwrap_or_default();
    let Some(values) = out.as_slice_mut() else { return out };
    values.par_chunks_mut(columns).enumerate().for_each(|(index, line)| {
        let (step, row) = (index / rows, index % rows);
        let mut sums = vec![0.0_f64; columns];
        for (j, weights) in weights.outer_iter().enumerate() {
            let start = (step * lit_rows + row * parts[1] + j) * lit_columns;
            let light = &light[start..start + lit_columns];
            for (i, weight) in weights.iter().enumerate() {
                for (sum, light) in sums.iter_mut().zip(light[i..].iter().step_by(parts[0])) {
                    *sum += weight * f64::from(*light);
                }
            }
        }
        for (value, sum) in line.iter_mut().zip(sums) {
            #[allow(clippy::cast_possible_truncation, reason = "rounding to f32 is meant")]
            {
                *value = sum as f32;
            }
        }
    });
    out
}
