//! The fits of a band of curves, by method.

use super::super::background_term::BackgroundTerm;
use super::super::beamlets::Beamlets;
use super::super::closed;
use super::super::curves::{Curve, Fits, SlitCurve};
use super::super::fit::{fit_masks, fit_slits};
use super::super::method::{Estimator, Method};
use super::super::moments::by_moments;
use super::super::quadrature;
use super::super::scan::{Scan, along};
use super::super::starts::Known;
use super::super::value_noise::{NoiseFactors, ValueNoise, Weights};
use super::Retriever;
use super::layout::{Layout, SlitCurves};
use super::view_scan::ViewScan;
use beamlet_core::cancel::Cancel;
use beamlet_core::{Error, Result};
use ndarray::Array3;
use rayon::prelude::*;

impl Retriever {
    /// The curves of a band of frames, `[step][row][column]` from the row with this number on. `known`: of a sample, the
    /// flat's curves and the first of this band.
    pub(in crate::retrieve) fn curves(
        &self,
        (data, row): (Array3<f32>, u32),
        scan: &ViewScan<'_>,
        known: Option<(&Fits, usize)>,
        cancel: &Cancel,
    ) -> Result<Fits> {
        let (steps, offsets) = (data.dim().0, scan.offsets);
        if steps != offsets.len() {
            return Err(Error::scene(
                "scan.mask_offsets",
                format!("{} offsets for {steps} frames", offsets.len()),
                "one offset for each frame",
            ));
        }
        let flat = known.and_then(|(flat, first)| flat.planar(first));
        match &self.layout {
            Layout::Pixels(slits) => {
                self.slits(slits, data, scan, (known, cancel)).map(Fits::Slits)
            }
            Layout::Beamlets(beamlets) => {
                self.beamlets(beamlets, &data, scan, (known, cancel)).map(Fits::Slits)
            }
            Layout::Steps(curves) => curves
                .fits((data.view(), row as usize), (offsets, scan.noise), flat, cancel)
                .map(Fits::Planar),
            Layout::Lattice(_, Some(beamlets)) => {
                beamlets.fits(data.view(), scan.noise, flat, cancel).map(Fits::Planar)
            }
            Layout::Lattice(_, None) => {
                Err(Error::argument("flat", "no flat was taken", "the flat, then the views"))
            }
        }
    }

    /// Curves of slits in each pixel.
    fn slits(
        &self,
        slits: &SlitCurves,
        data: Array3<f32>,
        view: &ViewScan<'_>,
        (known, cancel): (Option<(&Fits, usize)>, &Cancel),
    ) -> Result<Vec<SlitCurve>> {
        let (steps, rows, columns) = data.dim();
        if let Some(fitter) = &view.fitter {
            let flat = data.into_shape_with_order((steps, rows * columns)).map_err(|error| {
                Error::argument("frames", error.to_string(), "frames in C order")
            })?;
            return fitter.fit(flat.view(), cancel);
        }
        let (model, shape) = (&slits.curve.model, &slits.shape);
        let scan = self.scan(&along(view.offsets, 0), view.noise, slits.curve.background);
        let scan = scan.of_columns(model.repeats());
        let knows_masks = self.options.method() == Method::ExactCurve;
        entries(&data, cancel, |at, curve| match self.options.method().estimator() {
            Estimator::ThreePoints => closed::three_step(&scan, curve),
            Estimator::Moments => by_moments(&scan, curve, None),
            Estimator::TwoPoints => {
                let reach = shape.reach_of_two(2.0 * scan.half());
                let known = closed::KnownBlur { model, blur: shape.spread(), reach };
                closed::two_points(&scan, known, curve)
            }
            Estimator::Device | Estimator::LeastSquares if knows_masks => {
                let flat = known.and_then(|(flat, first)| flat.curve(first + at));
                let misfit = self.flat.as_ref().map_or(0.0, |flat| flat.misfit);
                let known = Known { blur: shape.spread(), flat: flat.as_ref(), misfit };
                fit_masks(model, &scan, curve, known)
            }
            Estimator::Device | Estimator::LeastSquares => fit_slits(model, &scan, curve, None),
        })
    }

    /// Curves of beamlets of slits.
    fn beamlets(
        &self,
        beamlets: &Beamlets,
        data: &Array3<f32>,
        view: &ViewScan<'_>,
        (known, cancel): (Option<(&Fits, usize)>, &Cancel),
    ) -> Result<Vec<SlitCurve>> {
        let scan = self.scan(&beamlets.offsets(), view.noise, BackgroundTerm::Free);
        let (lights, determine_width) = (beamlets.lights(), beamlets.determine_width());
        entries(&beamlets.gather(data.view()), cancel, |at, curve| {
            let light = &lights[at % beamlets.count()];
            if !determine_width {
                return light.fit_few(&scan, curve);
            }
            let flat = known.and_then(|(flat, first)| Some(flat.curve(first + at)?.flags));
            light.fit(&scan, curve, flat)
        })
    }

    /// Noise of the values; of fits of the masks' curve to counts of a guessed gain the residuals are the noise.
    pub(super) fn value_noise(&self, noise: NoiseFactors) -> ValueNoise {
        let known = ValueNoise::of(&self.options, noise);
        let is_guess = self.options.gain_assumed && self.options.weights == Weights::None;
        let is_curve = self.options.method() == Method::ExactCurve && !self.layout.is_planar();
        ValueNoise { gain: known.gain.filter(|_| !(is_guess && is_curve)), ..known }
    }

    /// A scan of values along x with this noise.
    fn scan(&self, offsets: &[f64], noise: ValueNoise, background: BackgroundTerm) -> Scan {
        let shares = match self.options.method().estimator() == Estimator::Moments {
            true => quadrature::weights(offsets),
            false => quadrature::trapezoids(offsets),
        };
        Scan::along_x(offsets, shares, noise, background)
    }
}

/// Fits the curve of each place of frames `[step][row][column]`.
fn entries(
    data: &Array3<f32>,
    cancel: &Cancel,
    fit: impl Fn(usize, &mut dyn Iterator<Item = f32>) -> Curve + Sync,
) -> Result<Vec<SlitCurve>> {
    let (steps, rows, columns) = data.dim();
    let entry = |at: usize| {
        cancel.check()?;
        let mut curve = (0..steps).map(|step| data[[step, at / columns, at % columns]]);
        Ok(SlitCurve::of(&fit(at, &mut curve)))
    };
    (0..rows * columns).into_par_iter().map(entry).collect()
}
