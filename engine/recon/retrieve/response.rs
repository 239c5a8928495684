//! Response of a method: small contrasts as they are retrieved at the offsets of a scan, by the curve of the masks.

use super::background::Background;
use super::background_term::BackgroundTerm;
use super::curve_model::CurveModel;
use super::curves::{Curve, Fits};
use super::equations::Valued;
use super::images::contrasts;
use super::method::Method;
use super::misfit::median;
use super::model::Model;
use super::options::RetrieveOptions;
use super::record::Record;
use super::retriever::{Layout, Retriever};
use super::scan::Points;
use super::strips::Tables;
use super::value_noise::NoiseFactors;
use beamlet_core::Result;
use beamlet_core::cancel::Cancel;
use beamlet_core::numbers::single;
use ndarray::Array3;
use serde::{Deserialize, Serialize};
use std::fmt;

/// Displacement of the curve by the refraction angle, in standard deviations of the curve.
const SHIFT: f64 = 0.1;
/// Dark field as a share of the variance of the curve.
const WIDENED: f64 = 0.1;
/// Transmission of the sample.
const TRANSMISSION: f64 = 0.9;
/// Relative error from which on a warning states a response.
pub const LARGE_ERROR: f64 = 0.1;
/// Photons at the peak of the curves, for the noise of counts.
const PHOTONS: f64 = 1e4;

/// Retrieved contrast over the true one, each for a pixel with this contrast alone and without noise. NaN where the
/// method has no result.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Response {
    /// Transmission of 0.9.
    pub transmission: f64,
    /// Refraction angle that moves the curve by a tenth of its standard deviation.
    pub refraction: f64,
    /// Dark field of a tenth of the variance of the curve; `None` for methods without one.
    pub dark_field: Option<f64>,
}

impl Response {
    /// The warning for a poor response of a method and background, with the response of another one that mends it.
    pub fn warning(&self, found: &str, better: Option<(&str, Self)>) -> Option<String> {
        let remedy = match better {
            Some((name, response)) => format!("; {name} finds {response}"),
            None => "; offsets over a whole period of the sample mask determine more".to_owned(),
        };
        self.is_poor().then(|| {
            format!(
                "{found} finds small contrasts at these offsets as {self} of the true ones (a dark field of a tenth of \
                 the variance of the curve){remedy}"
            )
        })
    }

    /// The largest relative error; NaN without a result.
    #[must_use]
    pub fn largest_error(&self) -> f64 {
        let all = [Some(self.transmission), Some(self.refraction), self.dark_field];
        let errors = all.into_iter().flatten().map(|response| (response - 1.0).abs());
        errors.fold(0.0, |most, error| if error.is_nan() || error > most { error } else { most })
    }

    /// True where an error is large, or there is no result.
    #[must_use]
    pub fn is_poor(&self) -> bool {
        let error = self.largest_error();
        error.is_nan() || error > LARGE_ERROR
    }
}

impl fmt::Display for Response {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { transmission, refraction, dark_field } = self;
        write!(f, "transmission {transmission:.3}, refraction {refraction:.3}")?;
        match dark_field {
            Some(dark_field) => write!(f, ", dark field {dark_field:.3}"),
            None => Ok(()),
        }
    }
}

/// Adds the response of a retriever to a record, with a warning where it is poor. `retriever_of`: the retriever of other
/// options.
///
/// # Errors
/// As [`Retriever::response`].
pub(super) fn enter(
    record: &mut Record,
    options: &RetrieveOptions,
    response: Option<Response>,
    response_of: impl Fn(&RetrieveOptions) -> Result<Option<Response>>,
) -> Result<()> {
    record.response = response;
    let Some(response) = response.filter(Response::is_poor) else { return Ok(()) };
    let others = [(Method::ExactCurve, Background::Leak), (Method::Gaussian, Background::Free)];
    let mut better = None;
    for (method, background) in others {
        let other = options.clone().with_method(method).with_background(background);
        // A method that does not serve the set-up is no remedy.
        let found = response_of(&other).unwrap_or(None).filter(|found| !found.is_poor());
        if let (Some(found), None) = (found, &better) {
            better = Some((format!("--method {method} --background {background}"), found));
        }
    }
    let own = format!("{} with background {}", options.method(), options.background());
    let better = better.as_ref().map(|(name, found)| (name.as_str(), *found));
    if let Some(warning) = response.warning(&own, better) {
        log::warn!("{warning}");
        record.warnings.push(warning);
    }
    Ok(())
}

/// A small change of the curves of a flat.
#[derive(Debug, Clone, Copy)]
pub(super) struct Probe {
    /// Centre of the curve of the flat, m.
    pub(super) centre: [f64; 2],
    /// Displacement of the curve, in its standard deviations.
    pub(super) shift: f64,
    /// Dark field as a share of the variance of the curve.
    pub(super) widened: f64,
}

impl CurveModel {
    /// The curve of the masks behind the blur of the set-up; `None` where it is not known, and of beamlets and lists of
    /// apertures.
    pub(super) fn of_masks(layout: &Layout) -> Option<Self> {
        match layout {
            Layout::Pixels(slits) => {
                let masks = slits.shape.masks()?;
                let leak = BackgroundTerm::PerArea(slits.shape.leak);
                Some(Self::of_slits(Model::Masks(masks.clone()), leak, masks.spread()))
            }
            Layout::Steps(curves) => curves.truth.clone(),
            Layout::Beamlets(_) | Layout::Lattice(..) => None,
        }
    }

    /// Variances xx and zz of the blur by the geometry, m^2.
    fn spread(&self) -> [f64; 2] {
        let (own, blur) = (self.model.own_variances(), self.blur.unwrap_or_default());
        [0, 1].map(|axis| blur[axis].max(1e-4 * own[axis]))
    }

    /// Height of a curve of unit light over nothing.
    fn peak(&self) -> f64 {
        self.values(&Points::of(&[[0.0; 2]]), 1.0, [0.0; 2], (0, 0.0))[0][0]
    }

    /// Values at points of a curve with this light and centre, changed in one of its unknowns.
    fn values(
        &self,
        points: &Points,
        light: f64,
        [x, z]: [f64; 2],
        (unknown, by): (usize, f64),
    ) -> Vec<Valued> {
        let [xx, zz] = self.spread();
        let mut p = [light, x, z, xx, zz, 0.0, 0.0];
        p[unknown] += by;
        p[6] = self.background.of_area(p[0]).unwrap_or(0.0);
        let mut tables = Tables::default();
        self.model.evaluate(points, &p, &mut tables).to_vec()
    }
}

impl Retriever {
    /// The response at the offsets of the scan, in two directions the worse one; `None` where the curve of the masks is
    /// not known, and of beamlets and lists of apertures.
    ///
    /// # Errors
    /// [`beamlet_core::Error::Device`], [`beamlet_core::Error::Memory`].
    pub fn response(&self) -> Result<Option<Response>> {
        let probe = Probe { centre: [0.0; 2], shift: SHIFT, widened: WIDENED };
        let truth = CurveModel::of_masks(self.layout());
        truth.map(|truth| self.response_to(&truth, probe, None)).transpose()
    }

    /// The response to curves of this truth. `offsets`: of the sample, m; `None`: of the flat.
    ///
    /// # Errors
    /// As [`Retriever::response`].
    pub(super) fn response_to(
        &self,
        truth: &CurveModel,
        Probe { centre, shift, widened }: Probe,
        offsets: Option<&[[f64; 2]]>,
    ) -> Result<Response> {
        let scale = self.options().gain.map_or(1.0, |gain| PHOTONS * gain) / truth.peak();
        let (own, spread) = (truth.model.own_variances(), truth.spread());
        let variances = [0, 1].map(|axis| own[axis] + spread[axis]);
        let shifts = variances.map(|variance| shift * variance.sqrt());
        let mut changes = vec![(0, (TRANSMISSION - 1.0) * scale)];
        for axis in truth.axes() {
            changes.extend([(1 + axis, shifts[*axis]), (3 + axis, widened * variances[*axis])]);
        }
        let curves = |offsets: &[[f64; 2]], changes: &[(usize, f64)]| -> Vec<Vec<Valued>> {
            let points = Points::of(offsets).of_columns(truth.model.repeats());
            changes.iter().map(|change| truth.values(&points, scale, centre, *change)).collect()
        };
        let unchanged = vec![(0, 0.0); changes.len()];
        let flat = self.fits_of(&curves(self.flat_offsets(), &unchanged), None, None)?;
        let sample = curves(offsets.unwrap_or(self.flat_offsets()), &changes);
        let sample = self.fits_of(&sample, offsets, Some(&flat))?;
        let angle = self.angle_per_shift();
        let found = |pixel: usize, contrast: usize| {
            let [flat, sample] =
                [&flat, &sample].map(|fits| fits.curve(pixel).filter(Curve::has_answer));
            let pair = flat.zip(sample);
            pair.map_or(f64::NAN, |(flat, sample)| contrasts(&flat, &sample, angle)[contrast])
        };
        let of_axis = |axis: &usize| {
            let at = 1 + 2 * axis;
            [
                found(at, 1 + axis) / (angle * shifts[*axis]),
                found(at + 1, 3 + axis) / (angle * angle * widened * variances[*axis]),
            ]
        };
        let worse = |a: f64, b: f64| match (b - 1.0).abs() > (a - 1.0).abs() || b.is_nan() {
            true => b,
            false => a,
        };
        let all = truth.axes().iter().map(of_axis);
        let [refraction, dark_field] =
            all.reduce(|a, b| [0, 1].map(|k| worse(a[k], b[k]))).unwrap_or([f64::NAN; 2]);
        Ok(Response {
            transmission: found(0, 0) / TRANSMISSION,
            refraction,
            dark_field: self.has_width().then_some(dark_field),
        })
    }

    /// Residual of the method's fit to the curve of the masks at the flat's offsets, rms over the height; 0 where this
    /// curve is not known.
    ///
    /// # Errors
    /// [`beamlet_core::Error::Device`], [`beamlet_core::Error::Memory`].
    pub(super) fn misfit_of_masks(&self) -> Result<f64> {
        let truth = CurveModel::of_masks(self.layout());
        let (Some(truth), Some(flat)) = (truth, self.flat_curves()) else {
            return Ok(0.0);
        };
        let middle =
            |of: &dyn Fn(&Curve) -> f64| median(flat.iter().map(|curve| of(&curve)).collect());
        let centre = [0, 1].map(|axis| middle(&|curve| curve.centre_of(axis)).unwrap_or(0.0));
        let height = middle(&|curve| curve.amplitude).unwrap_or(1.0);
        let from_centre = |offset: &[f64; 2]| [0, 1].map(|axis| offset[axis] - centre[axis]);
        let places: Vec<[f64; 2]> = self.flat_offsets().iter().map(from_centre).collect();
        let light = height / truth.peak();
        let points = Points::of(&places).of_columns(truth.model.repeats());
        let values = truth.values(&points, light, [0.0; 2], (0, 0.0));
        let fit = self.fits_of(&[values], None, None)?.curve(0);
        Ok(fit.map_or(0.0, |fit| fit.residual / fit.amplitude))
    }

    /// Fits of curves with these values. `offsets`: `None`: the flat's; `flat`: of a sample, the curves of its flat.
    fn fits_of(
        &self,
        curves: &[Vec<Valued>],
        offsets: Option<&[[f64; 2]]>,
        flat: Option<&Fits>,
    ) -> Result<Fits> {
        let scan = self.scan_at(offsets, NoiseFactors::ONE)?;
        let shape = (scan.offsets.len(), 1, curves.len());
        let frames =
            Array3::from_shape_fn(shape, |(step, _, pixel)| single(curves[pixel][step][0]));
        self.curves((frames, 0), &scan, flat.map(|flat| (flat, 0)), &Cancel::default())
    }
}
