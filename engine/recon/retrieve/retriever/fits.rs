//! The fits of a band of curves, by method.

use super::super::background_term::BackgroundTerm;
use super::super::beamlets::Beamlets;
use super::super::curves::{Curve, Curves};
use super::super::fit::fit_slits;
use super::super::fitter::Weights;
use super::super::method::Method;
use super::super::model::Model;
use super::super::noise_factors::NoiseFactors;
use super::super::scan::Scan;
use super::super::value_noise::ValueNoise;
use super::super::{closed, quadrature};
use super::Retriever;
use super::view_scan::ViewScan;
use beamlet_core::cancel::Cancel;
use beamlet_core::{Error, Result};
use ndarray::Array3;
use rayon::prelude::*;

impl Retriever {
    /// The curves of a band. `known`: of a sample, the flat's curves and the first of this band.
    pub(in crate::retrieve) fn curves(
        &self,
        data: Array3<f32>,
        scan: &ViewScan<'_>,
        known: Option<(&Curves, usize)>,
        cancel: &Cancel,
    ) -> Result<Curves> {
        let (steps, offsets) = (data.dim().0, scan.offsets);
        if steps != offsets.len() {
            return Err(Error::scene(
                "scan.mask_offsets",
                format!("{} offsets for {steps} frames", offsets.len()),
                "one offset for each frame",
            ));
        }
        let data = match &self.beamlets {
            Some(beamlets) => beamlets.gather(data.view()),
            None => data,
        };
        let (steps, rows, columns) = data.dim();
        if let Some(fitter) = &scan.fitter {
            let flat = data.into_shape_with_order((steps, rows * columns)).map_err(|error| {
                Error::argument("frames", error.to_string(), "frames in C order")
            })?;
            return fitter.fit(flat.view(), cancel);
        }
        let scan = match &self.beamlets {
            Some(beamlets) => self.scan(&beamlets.offsets(), scan.noise),
            None => self.scan(offsets, scan.noise),
        };
        let lights = self.beamlets.as_ref().map_or(&[][..], Beamlets::lights);
        let model = self.model();
        let model = || {
            let none = || Error::scene("detector_mask", "nothing", "both masks");
            model.as_ref().ok_or_else(none)
        };
        let entry = |pixel: usize| -> Result<Curve> {
            cancel.check()?;
            let (row, column) = (pixel / columns, pixel % columns);
            let curve = (0..steps).map(|step| data[[step, row, column]]);
            Ok(match self.options.method() {
                Method::Beamlet if !self.has_width() => lights[column].fit_few(&scan, curve),
                Method::Beamlet => {
                    let flat = known.map(|(flat, first)| flat.flags[first + pixel]);
                    lights[column].fit(&scan, curve, flat)
                }
                Method::ThreeStep => closed::three_step(&scan, curve),
                Method::Moments => closed::by_moments(&scan, curve),
                Method::TwoStep => {
                    let reach = self.shape.reach_of_two(2.0 * scan.half());
                    let known =
                        closed::KnownBlur { model: model()?, blur: self.shape.spread(), reach };
                    closed::two_points(&scan, known, curve)
                }
                Method::Gaussian | Method::Triangle | Method::ExactCurve => {
                    fit_slits(model()?, &scan, curve, None)
                }
            })
        };
        let entries: Vec<Curve> =
            (0..rows * columns).into_par_iter().map(entry).collect::<Result<_>>()?;
        Ok(Curves::from_entries(&entries))
    }

    /// The model of curves over mask offsets, of closed forms the nearest that there is; `None` of beamlets.
    pub(in crate::retrieve) fn model(&self) -> Option<Model> {
        match self.options.method() {
            Method::Gaussian | Method::ThreeStep | Method::Moments => Some(Model::gaussian()),
            Method::Triangle => Some(Model::Trapezoid { top: 0.0 }),
            Method::ExactCurve | Method::TwoStep => self.shape.model(),
            Method::Beamlet => None,
        }
    }

    /// Noise of the values; of fits of the masks' curve to counts of a guessed gain the residuals are the noise.
    fn value_noise(&self, noise: NoiseFactors) -> ValueNoise {
        let known = ValueNoise::of(&self.options, noise);
        let is_guess = self.options.gain_assumed && self.options.weights == Weights::None;
        let by_residuals = is_guess && self.options.method() == Method::ExactCurve;
        ValueNoise { gain: known.gain.filter(|_| !by_residuals), ..known }
    }

    /// A scan of values with this noise.
    fn scan(&self, offsets: &[f64], noise: NoiseFactors) -> Scan {
        let shares = match self.options.method() == Method::Moments {
            true => quadrature::weights(offsets),
            false => quadrature::trapezoids(offsets),
        };
        Scan::along_x(offsets, shares, self.value_noise(noise), self.background())
    }

    /// Background of the curves.
    pub(in crate::retrieve) fn background(&self) -> BackgroundTerm {
        match self.options.method().has_background() {
            true => self.shape.background,
            false => BackgroundTerm::Free,
        }
    }
}
