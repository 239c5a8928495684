//! The fits of a band of curves, by method.

use super::super::background::BackgroundTerm;
use super::super::beamlets::Beamlets;
use super::super::curves::{Curve, Curves};
use super::super::fitter::Weights;
use super::super::least_squares::{self, CurveScan};
use super::super::method::Method;
use super::super::noise_factors::NoiseFactors;
use super::super::shape::CurveShape;
use super::super::value_noise::ValueNoise;
use super::super::{closed, flags, quadrature};
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
        let lights = self.beamlets.as_ref().map(Beamlets::lights);
        let shape = self.shape();
        let entry = |pixel: usize| -> Result<Curve> {
            cancel.check()?;
            let (row, column) = (pixel / columns, pixel % columns);
            let curve = (0..steps).map(|step| data[[step, row, column]]);
            if let Some(lights) = lights {
                if !self.has_width() {
                    return Ok(lights[column].fit_few(&scan, curve));
                }
                let flat = known.map(|(flat, first)| flat.flags[first + pixel]);
                return Ok(lights[column].fit(&scan, curve, flat));
            }
            Ok(match self.options.method() {
                Method::ThreeStep => closed::three_step(&scan, curve),
                Method::TwoStep => match &shape {
                    Some(shape) => {
                        let apart = 2.0 * scan.half();
                        let known = (shape, self.shape.spread(), self.shape.reach_of_two(apart));
                        closed::two_points(&scan, known, curve)
                    }
                    None => Curve::unknown(flags::NOT_CONVERGED),
                },
                Method::Moments => closed::by_moments(&scan, curve),
                _ => shape.as_ref().map_or(Curve::unknown(flags::NOT_CONVERGED), |shape| {
                    least_squares::fit(shape, &scan, curve)
                }),
            })
        };
        let entries: Vec<Curve> =
            (0..rows * columns).into_par_iter().map(entry).collect::<Result<_>>()?;
        Ok(Curves::from_entries(&entries))
    }

    /// The shape of methods that fit one, in the unit of offsets.
    pub(in crate::retrieve) fn shape(&self) -> Option<CurveShape> {
        match self.options.method() {
            Method::Triangle => Some(CurveShape::Trapezoid { top: 0.0 }),
            Method::ExactCurve | Method::TwoStep => self.shape.shape(),
            _ => None,
        }
    }

    /// Noise of the values; of fits of the masks' curve to counts of a guessed gain the residuals are the noise.
    fn value_noise(&self, noise: NoiseFactors) -> ValueNoise {
        let known = ValueNoise::of(&self.options, noise);
        let is_guess = self.options.gain_assumed && self.options.weights == Weights::None;
        match self.options.method() {
            Method::ExactCurve if is_guess => ValueNoise { gain: None, ..known },
            _ => known,
        }
    }

    /// A scan of values with this noise.
    fn scan(&self, offsets: &[f64], noise: NoiseFactors) -> CurveScan {
        CurveScan {
            offsets: offsets.to_vec(),
            shares: match self.options.method() {
                Method::Moments => quadrature::weights(offsets),
                _ => quadrature::trapezoids(offsets),
            },
            noise: self.value_noise(noise),
            background: match self.options.method() {
                Method::ExactCurve => self.shape.background,
                _ => BackgroundTerm::Free,
            },
        }
    }
}
