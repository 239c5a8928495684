//! Filtered back-projection.

use super::back_projector::BackProjector;
use super::filter::{Filter, RowFilter};
use super::geometry::ScanGeometry;
use super::grid::{Volume, VolumeGrid};
use super::quantity::Quantity;
use super::redundancy::Redundancy;
use super::resampling::Resampling;
use crate::numbers::single;
use crate::run::RowsControl;
use crate::{Engine, Error, Result, parallel, reserve};
use ndarray::{Array3, ArrayView3};
use rayon::prelude::*;
use std::f64::consts::TAU;

/// How a filtered back-projection is done; what differs from the default is set in a chain.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct FbpOptions {
    /// Window of the filter.
    pub filter: Filter,
    /// Frequency from which on nothing counts, as a share of Nyquist's. Above 0, at most 1.
    pub cut_off: f64,
    /// Values of volume and of projections that are on the device at once; no bit of the volume
    /// depends on it. `None`: 64 Mi each.
    pub at_once: Option<usize>,
}

impl Default for FbpOptions {
    fn default() -> Self {
        Self { filter: Filter::RamLak, cut_off: 1.0, at_once: None }
    }
}

impl FbpOptions {
    setters! {
        /// Sets the window of the filter.
        with_filter(filter: Filter);
        /// Sets the frequency from which on nothing counts, as a share of Nyquist's.
        with_cut_off(cut_off: f64);
        /// Bounds the values on the device.
        with_at_once(at_once: impl Into<Option<usize>>);
    }
}

/// Filtered back-projection of sinograms, `[view][row][column]`: −ln T, refraction angles (rad) or
/// variances (rad²), as `quantity` says. One row is a fan, or a parallel beam; more are a cone, by
/// Feldkamp, Davis and Kress. Views over a whole turn count alike, those over less by Parker's
/// weights. Where a voxel is outside of the detector in a view, that view adds nothing. Each
/// refraction angle counts as if the sample were at the axis of rotation.
///
/// # Errors
/// [`Error::Argument`] for a geometry, grid or options that cannot be, sinograms of another shape or
/// with values that are not finite; [`Error::Interrupted`], [`Error::Device`], [`Error::Memory`].
///
/// # Example
///
/// ```no_run
/// use beamlet::reconstruct::{FbpOptions, Quantity, ScanGeometry, VolumeGrid, fbp};
/// use beamlet::{Engine, EngineOptions, RowsControl, ndarray::Array3, scene::Scene};
///
/// let geometry = ScanGeometry::of_scene(&Scene::load("scene.toml")?)?;
/// // `[view][row][column]`: −ln of the transmission.
/// let sinograms = Array3::<f32>::zeros((360, 4, 256));
/// let volume = fbp(
///     &Engine::open(&EngineOptions::default())?,
///     &geometry,
///     sinograms.view(),
///     Quantity::Mu,
///     &VolumeGrid::of(&geometry)?,
///     &FbpOptions::default(),
///     &mut RowsControl::default(),
/// )?;
/// println!("{:?} {}", volume.values.dim(), volume.quantity.unit());
/// # Ok::<(), beamlet::Error>(())
/// ```
pub fn fbp(
    engine: &Engine,
    geometry: &ScanGeometry,
    sinograms: ArrayView3<'_, f32>,
    quantity: Quantity,
    grid: &VolumeGrid,
    options: &FbpOptions,
    control: &mut RowsControl<'_>,
) -> Result<Volume> {
    check(geometry, sinograms, options)?;
    grid.check(geometry)?;
    let weights = Redundancy::of(geometry)?;
    parallel::start_threads()?;
    let even = Resampling::of(&geometry.columns);
    let filtered =
        Filtering { geometry, quantity, options, weights, even: &even }.all(sinograms, control)?;
    let is_squared = quantity != Quantity::Delta;
    let mut projector =
        BackProjector::new(engine, geometry, [even.first, even.pitch], grid, is_squared)?;
    if let Some(at_once) = options.at_once {
        projector = projector.with_at_once(at_once);
    }
    Ok(Volume::new(*grid, quantity, projector.sum(filtered.view(), control)?))
}

fn check(
    geometry: &ScanGeometry,
    sinograms: ArrayView3<'_, f32>,
    options: &FbpOptions,
) -> Result<()> {
    geometry.check()?;
    let needed = (geometry.angles.len(), geometry.rows.len(), geometry.columns.len());
    if sinograms.dim() != needed {
        let found = format!("{:?} views, rows and columns", sinograms.dim());
        return Err(Error::argument(
            "sinograms",
            found,
            format!("{needed:?}, as the geometry has"),
        ));
    }
    if let Some((place, value)) = sinograms.indexed_iter().find(|(_, value)| !value.is_finite()) {
        let (view, row, column) = place;
        let found = format!("{value} in view {view}, row {row}, column {column}");
        return Err(Error::argument("sinograms", found, "finite values"));
    }
    if !(options.cut_off > 0.0 && options.cut_off <= 1.0) {
        let found = options.cut_off.to_string();
        return Err(Error::argument("cut_off", found, "above 0, at most 1"));
    }
    Ok(())
}

/// Weights and filters of all rows.
struct Filtering<'a> {
    geometry: &'a ScanGeometry,
    quantity: Quantity,
    options: &'a FbpOptions,
    weights: Redundancy,
    even: &'a Resampling,
}

impl Filtering<'_> {
    /// Filtered rows at even columns, `[view][row][column]`.
    fn all(
        &self,
        sinograms: ArrayView3<'_, f32>,
        control: &RowsControl<'_>,
    ) -> Result<Array3<f32>> {
        let (views, rows, columns) = sinograms.dim();
        let is_hilbert = self.quantity == Quantity::Delta;
        let pitch = self.even.pitch / self.geometry.magnification();
        let window = (self.options.filter, self.options.cut_off);
        let filter = RowFilter::new(self.even.len(), pitch, is_hilbert, window);
        let mut all: Vec<f32> =
            reserve::zeroed(views * rows * self.even.len(), "filtered projections")?;
        let cancel = &control.cancel;
        let factor = if is_hilbert { -1.0 / TAU } else { 1.0 };
        all.par_chunks_mut(self.even.len()).enumerate().try_for_each(|(number, out)| {
            cancel.check()?;
            let (view, row) = (number / rows, number % rows);
            let weighted: Vec<f64> = (0..columns)
                .map(|column| {
                    let value = f64::from(sinograms[[view, row, column]]);
                    value * self.weight(view, row, column) * factor
                })
                .collect();
            let even: Vec<f64> = self.even.values(&weighted).collect();
            out.iter_mut().zip(filter.apply(&even)).for_each(|(to, from)| *to = single(from));
            Ok(())
        })?;
        let shape = (views, rows, self.even.len());
        Ok(Array3::from_shape_vec(shape, all).unwrap_or_else(|_| Array3::zeros(shape)))
    }

    /// Angle that a value stands for, with the cosines of its line.
    fn weight(&self, view: usize, row: usize, column: usize) -> f64 {
        let (scale, per) = (self.geometry.magnification(), self.geometry.per_distance());
        let place = self.geometry.columns[column] / scale;
        let (u, v) = (place * per, self.geometry.rows[row] / scale * per);
        let length = 1.0 + u * u + v * v;
        let cosines = match self.quantity {
            // A slope is the tangent of an angle in the plane of the row.
            Quantity::Delta => (1.0 + v * v) / (length * length),
            Quantity::Mu | Quantity::DarkField => 1.0 / length.sqrt(),
        };
        // Lines lie closer or wider where the axis is beside the optical axis.
        let beside = 1.0 + self.geometry.axis * per * u;
        self.weights.angle(view, place) * cosines * beside
    }
}
