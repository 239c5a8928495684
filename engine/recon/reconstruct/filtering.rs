//! Weights and filters of all rows, in f64 on the host.

use super::extrapolation::extended;
use super::fbp_options::FbpOptions;
use super::filter::RowFilter;
use super::geometry::ScanGeometry;
use super::quantity::Quantity;
use super::redundancy::Redundancy;
use super::resampling::Resampling;
use beamlet_core::numbers::single;
use beamlet_core::{Cancel, Result, reserve};
use ndarray::{Array3, ArrayView3};
use rayon::prelude::*;
use std::f64::consts::TAU;

/// Weights and filters of the rows of a scan.
#[derive(Debug)]
pub(super) struct Filtering<'a> {
    geometry: &'a ScanGeometry,
    quantity: Quantity,
    weights: Redundancy,
    even: Resampling,
    filter: RowFilter,
    /// Columns that a row is continued by on either side before it is filtered.
    beyond: usize,
    /// Columns of zeros before and behind a row, which filtered rows have, too.
    added: [usize; 2],
}

impl<'a> Filtering<'a> {
    /// # Errors
    /// [`beamlet_core::Error::Argument`] for views that do not serve.
    pub(super) fn new(
        geometry: &'a ScanGeometry,
        quantity: Quantity,
        options: &FbpOptions,
    ) -> Result<Self> {
        let weights = Redundancy::of(geometry)?;
        let even = Resampling::of(&geometry.columns);
        let beyond = if options.extrapolate { even.len() } else { 0 };
        let added = weights.missing(geometry, [even.first, even.pitch], even.len());
        let most = |side: usize| beyond.max(added[side]);
        let filter = RowFilter::new(
            even.len() + most(0) + most(1),
            even.pitch / geometry.magnification(),
            quantity == Quantity::Delta,
            (options.filter, options.cut_off),
        );
        Ok(Self { geometry, quantity, weights, even, filter, beyond, added })
    }

    /// Place of the first filtered column on the detector, and their distance, m.
    pub(super) fn columns(&self) -> [f64; 2] {
        [self.even.first - self.added[0] as f64 * self.even.pitch, self.even.pitch]
    }

    /// Number of filtered columns.
    pub(super) fn count(&self) -> usize {
        self.even.len() + self.added[0] + self.added[1]
    }

    pub(super) const fn is_turn(&self) -> bool {
        self.weights.is_turn()
    }

    /// Filtered rows at even columns, `[view][row][column]`.
    ///
    /// # Errors
    /// [`beamlet_core::Error::Interrupted`], [`beamlet_core::Error::Memory`].
    pub(super) fn all(
        &self,
        sinograms: ArrayView3<'_, f32>,
        cancel: &Cancel,
    ) -> Result<Array3<f32>> {
        let (views, rows, columns) = sinograms.dim();
        let count = self.count();
        let mut all: Vec<f32> = reserve::zeroed(views * rows * count, "filtered projections")?;
        let [before, behind] = self.added.map(|added| added.max(self.beyond));
        all.par_chunks_mut(count).enumerate().try_for_each(|(number, out)| {
            cancel.check()?;
            let (view, row) = (number / rows, number % rows);
            let value = |column| f64::from(sinograms[[view, row, column]]);
            let mut even = vec![0.0; before + self.even.len() + behind];
            if self.beyond > 0 {
                let values: Vec<f64> = (0..columns).map(value).collect();
                let first = self.even.first - self.beyond as f64 * self.even.pitch;
                let place = |n: usize| first + n as f64 * self.even.pitch;
                // Squares of chords of an ellipse are a parabola in u after this.
                let length = |place: f64| self.geometry.length(place, row);
                let values: Vec<f64> = (self.beyond..)
                    .zip(self.even.values(&values))
                    .map(|(n, value)| value * length(place(n)))
                    .collect();
                let weight = |place: f64| self.weight(view, row, place) / length(place);
                let extended = extended(&values, self.beyond).into_iter().enumerate();
                let to = &mut even[before - self.beyond..];
                to.iter_mut().zip(extended).for_each(|(to, (n, value))| {
                    *to = value * weight(place(n));
                });
            } else {
                let weight = |column: usize| self.weight(view, row, self.geometry.columns[column]);
                let weighted: Vec<f64> = (0..columns).map(|n| value(n) * weight(n)).collect();
                let to = &mut even[before..];
                to.iter_mut().zip(self.even.values(&weighted)).for_each(|(to, value)| *to = value);
            }
            let filtered = self.filter.apply(&even);
            let from = &filtered[before - self.added[0]..];
            out.iter_mut().zip(from).for_each(|(to, from)| *to = single(*from));
            Ok(())
        })?;
        let shape = (views, rows, count);
        Ok(Array3::from_shape_vec(shape, all).unwrap_or_else(|_| Array3::zeros(shape)))
    }

    /// Angle that a value stands for, with the cosines of its line and the sign of its filter.
    fn weight(&self, view: usize, row: usize, place: f64) -> f64 {
        let (scale, per) = (self.geometry.magnification(), self.geometry.per_distance());
        let place = place / scale;
        let (u, v) = (place * per, self.geometry.rows[row] / scale * per);
        let length = 1.0 + u * u + v * v;
        let cosines = match self.quantity {
            // A slope is the tangent of an angle in the plane of the row.
            Quantity::Delta => (1.0 + v * v) / (length * length) * (-1.0 / TAU),
            Quantity::Mu | Quantity::DarkField => 1.0 / length.sqrt(),
        };
        // Lines lie closer or wider where the axis is beside the optical axis.
        let beside = 1.0 + self.geometry.axis * per * u;
        self.weights.angle(view, place) * cosines * beside
    }
}
