//! Spots from images.

use super::fit::{self, Blob};
use super::{Spot, SpotFit};
use beamlet_core::{Error, Result, image};
use ndarray::Array2;
use std::path::Path;

/// Larger images are summed to at most this many pixels a side.
const SIDE: usize = 128;

impl Spot {
    /// Reads an image of the spot (NPY, TIFF, PNG), as [`Spot::of_image`]; `background` is subtracted,
    /// and negative values count as 0.
    ///
    /// # Errors
    /// As [`image::read`] and [`Spot::of_image`].
    pub fn read_image(path: &Path, pixel: [f64; 2], background: Option<f64>) -> Result<Self> {
        let mut values = image::read(path)?;
        if let Some(background) = background {
            values.mapv_inplace(|v| if v.is_nan() { v } else { (v - background).max(0.0) });
        }
        let mut spot = Self::of_image(&values, pixel)?;
        if let Some(fit) = &mut spot.fit {
            fit.file = path.display().to_string();
        }
        Ok(spot)
    }

    /// The spot of an image `[row][column]`: columns run along +x, row 0 is on top (largest z),
    /// values are weights, each spread evenly over its pixel of `pixel` (x, z) metres.
    ///
    /// # Errors
    /// [`Error::Scene`] for values below 0 or not finite, or without any light; for a pixel that
    /// is not above 0.
    pub fn of_image(values: &Array2<f64>, pixel: [f64; 2]) -> Result<Self> {
        if !pixel.iter().all(|size| size.is_finite() && *size > 0.0) {
            return Err(Error::scene("source.spot.pixel", format!("{pixel:?} m"), "sizes > 0"));
        }
        for ((row, column), value) in values.indexed_iter() {
            if !(value.is_finite() && *value >= 0.0) {
                let found = format!("{value} in row {row}, column {column}");
                let allowed = "finite values >= 0 (key background: the value to subtract)";
                return Err(Error::scene("source.spot.image", found, allowed));
            }
        }
        let sum = values.sum();
        if !(sum > 0.0 && sum.is_finite()) {
            let found = format!("values that sum to {sum}");
            return Err(Error::scene("source.spot.image", found, "a finite sum > 0"));
        }
        let block = [values.ncols(), values.nrows()].map(|side| side.div_ceil(SIDE));
        let blobs = blobs(values, pixel, block, sum);
        let fitted = fit::fit(&blobs);
        let samples = values.iter().filter(|value| **value > 0.0).count();
        Ok(Self {
            parts: fitted.parts,
            fit: Some(SpotFit {
                file: String::new(),
                samples,
                block,
                error: fitted.error,
                relative_error: fitted.relative_error,
            }),
        })
    }
}

/// Pixels, or blocks of pixels with their centroid and variance.
fn blobs(values: &Array2<f64>, pixel: [f64; 2], block: [usize; 2], sum: f64) -> Vec<Blob> {
    let [rows, columns] = [values.nrows(), values.ncols()];
    let middle = [0.5 * (columns as f64 - 1.0), 0.5 * (rows as f64 - 1.0)];
    let mut blobs = Vec::new();
    for part in blocks(values, block) {
        let weight: f64 = part.iter().map(|(_, _, w)| w).sum();
        if weight <= 0.0 {
            continue;
        }
        let at = |row: usize, column: usize| {
            [(column as f64 - middle[0]) * pixel[0], (middle[1] - row as f64) * pixel[1]]
        };
        let mean = |f: &dyn Fn([f64; 2]) -> f64| {
            part.iter().map(|(row, column, w)| w * f(at(*row, *column))).sum::<f64>() / weight
        };
        let centre = [0, 1].map(|axis| mean(&|p| p[axis]));
        let variance = [0, 1].map(|axis| {
            mean(&|p| (p[axis] - centre[axis]).powi(2)) + pixel[axis] * pixel[axis] / 12.0
        });
        blobs.push(Blob { weight: weight / sum, at: centre, variance });
    }
    blobs
}

/// Blocks of an image as lists of row, column and value.
fn blocks(values: &Array2<f64>, [across, down]: [usize; 2]) -> Vec<Vec<(usize, usize, f64)>> {
    let (rows, columns) = values.dim();
    let mut blocks = Vec::new();
    for top in (0..rows).step_by(down) {
        for left in (0..columns).step_by(across) {
            let inside = (top..rows.min(top + down)).flat_map(|row| {
                (left..columns.min(left + across)).map(move |column| (row, column))
            });
            blocks.push(inside.map(|(r, c)| (r, c, values[[r, c]])).collect());
        }
    }
    blocks
}
