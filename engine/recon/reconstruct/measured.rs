//! What iterative methods are given.

use super::data::Data;
use super::geometry::{ScanGeometry, same_shape};
use super::grid::VolumeGrid;
use beamlet_core::{Error, Result, setters};
use ndarray::{Array3, ArrayView3};

/// Sinograms with weights and kind.
#[derive(Debug, Clone, Copy)]
#[non_exhaustive]
pub struct Measured<'a> {
    /// Kind of the values.
    pub data: Data,
    /// `[view][row][column]`; values of weight 0 may be anything.
    pub sinograms: ArrayView3<'a, f32>,
    /// Weight of the square of each residual, ≥ 0: one over the variance, in any unit. `None`: all
    /// alike.
    pub weights: Option<ArrayView3<'a, f32>>,
    /// Voxels that may differ from zero, `[z][y][x]`. `None`: all.
    pub mask: Option<ArrayView3<'a, bool>>,
    /// Volume to begin with, `[z][y][x]`. `None`: zero.
    pub start: Option<ArrayView3<'a, f32>>,
}

impl<'a> Measured<'a> {
    /// Sinograms without weights, mask and start.
    #[must_use]
    pub const fn new(data: Data, sinograms: ArrayView3<'a, f32>) -> Self {
        Self { data, sinograms, weights: None, mask: None, start: None }
    }

    setters! {
        /// Sets the weights.
        with_weights(weights: impl Into<Option<ArrayView3<'a, f32>>>);
        /// Sets the voxels that may differ from zero.
        with_mask(mask: impl Into<Option<ArrayView3<'a, bool>>>);
        /// Sets the volume to begin with.
        with_start(start: impl Into<Option<ArrayView3<'a, f32>>>);
    }

    /// # Errors
    /// [`Error::Argument`] for arrays of other shapes, and values that cannot be.
    pub(super) fn check(&self, geometry: &ScanGeometry, grid: &VolumeGrid) -> Result<()> {
        let measured = self;
        let [x, y, z] = grid.size;
        same_shape("sinograms", measured.sinograms.dim(), geometry.dim())?;
        if let Some(weights) = &measured.weights {
            same_shape("weights", weights.dim(), geometry.dim())?;
            let bad = weights.indexed_iter().find(|(_, w)| !(w.is_finite() && **w >= 0.0));
            if let Some(((view, row, column), weight)) = bad {
                let found = format!("{weight} in view {view}, row {row}, column {column}");
                return Err(Error::argument("weights", found, "finite, at least zero"));
            }
            if weights.iter().all(|weight| *weight <= 0.0) {
                return Err(Error::argument("weights", "zero everywhere", "some above zero"));
            }
        }
        let counts = |at| measured.weights.as_ref().is_none_or(|weights| weights[at] > 0.0);
        let bad = measured.sinograms.indexed_iter().find(|(at, v)| !v.is_finite() && counts(*at));
        if let Some(((view, row, column), value)) = bad {
            let found = format!("{value} in view {view}, row {row}, column {column}");
            return Err(Error::argument("sinograms", found, "finite values, or weight 0"));
        }
        if let Some(mask) = &measured.mask {
            same_shape("mask", mask.dim(), (z, y, x))?;
            if mask.iter().all(|may| !may) {
                return Err(Error::argument("mask", "no voxel", "one or more"));
            }
        }
        if let Some(start) = &measured.start {
            same_shape("start", start.dim(), (z, y, x))?;
            if let Some(((z, y, x), value)) = start.indexed_iter().find(|(_, v)| !v.is_finite()) {
                let found = format!("{value} in voxel x {x}, y {y}, z {z}");
                return Err(Error::argument("start", found, "finite values"));
            }
        }
        Ok(())
    }
}

/// Weights of values by their standard deviations: one over the squares, 0 where there is none (NaN).
/// Deviations below a tenth of the median count as this.
#[must_use]
pub fn deviation_weights(mut sigmas: Array3<f32>) -> Array3<f32> {
    let mut known: Vec<f32> = sigmas.iter().copied().filter(|sigma| *sigma > 0.0).collect();
    let middle = known.len() / 2;
    let least = match known.is_empty() {
        true => 1.0,
        false => *known.select_nth_unstable_by(middle, f32::total_cmp).1 / 10.0,
    };
    let weight = |sigma: f32| if sigma.is_nan() { 0.0 } else { sigma.max(least).powi(-2) };
    sigmas.mapv_inplace(weight);
    sigmas
}
