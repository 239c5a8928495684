//! Response of a method: small contrasts as they are retrieved at the offsets of a scan, by the curve of the masks.

use super::background::Background;
use super::background_term::BackgroundTerm;
use super::curves::{Curve, Fits};
use super::equations::Valued;
use super::images::contrasts;
use super::method::Method;
use super::misfit::median;
use super::model::Model;
use super::noise_factors::NoiseFactors;
use super::options::RetrieveOptions;
use super::record::Record;
use super::retriever::{Layout, Retriever, ViewScan};
use super::scan::Points;
use super::strips::Tables;
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

/// The curve of the masks behind the blur of the set-up.
struct TrueCurve {
    model: Model,
    /// Variances xx and zz of the blur, m^2.
    blur: [f64; 2],
    background: BackgroundTerm,
    /// Number of axes along which the mask is stepped.
    axes: usize,
}

impl TrueCurve {
    /// The curve of a retriever; `None` where it is not known, and of beamlets and lists of apertures.
    fn of(layout: &Layout) -> Option<Self> {
        match layout {
            Layout::Pixels(slits) => {
                let masks = slits.shape.masks()?;
                let background = BackgroundTerm::PerArea(slits.shape.leak);
                let blur = [masks.spread(), 1.0];
                Some(Self { model: Model::Masks(masks.clone()), blur, background, axes: 1 })
            }
            Layout::Steps(curves) => {
                let (model, blur, background) = curves.truth()?;
                let own = model.own_variances();
                let blur = [0, 1].map(|axis| blur[axis].max(1e-4 * own[axis]));
                Some(Self { model, blur, background, axes: 2 })
            }
            Layout::Beamlets(_) | Layout::Lattice(..) => None,
        }
    }

    /// Height of a curve of unit light over nothing.
    fn peak(&self) -> f64 {
        self.values(&Points::of(&[[0.0; 2]]), 1.0, (0, 0.0))[0][0]
    }

    /// Values at points of a curve with this light, changed in one of its unknowns.
    fn values(&self, points: &Points, light: f64, (unknown, by): (usize, f64)) -> Vec<Valued> {
        let mut p = [light, 0.0, 0.0, self.blur[0], self.blur[1], 0.0, 0.0];
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
        let Some(truth) = TrueCurve::of(self.layout()) else { return Ok(None) };
        let scale = self.options().gain.map_or(1.0, |gain| PHOTONS * gain) / truth.peak();
        let own = truth.model.own_variances();
        let variances = [0, 1].map(|axis| own[axis] + truth.blur[axis]);
        let shifts = variances.map(|variance| SHIFT * variance.sqrt());
        let mut changes = vec![(0, (TRANSMISSION - 1.0) * scale)];
        for axis in 0..truth.axes {
            changes.extend([(1 + axis, shifts[axis]), (3 + axis, WIDENED * variances[axis])]);
        }
        let points = Points::of(self.flat_offsets());
        let curves = |changes: &[(usize, f64)]| -> Vec<Vec<Valued>> {
            changes.iter().map(|change| truth.values(&points, scale, *change)).collect()
        };
        let flat = self.fits_of(&curves(&vec![(0, 0.0); changes.len()]), None)?;
        let sample = self.fits_of(&curves(&changes), Some(&flat))?;
        let angle = self.angle_per_shift();
        let found = |pixel: usize, contrast: usize| {
            let [flat, sample] =
                [&flat, &sample].map(|fits| fits.curve(pixel).filter(Curve::has_answer));
            let pair = flat.zip(sample);
            pair.map_or(f64::NAN, |(flat, sample)| contrasts(&flat, &sample, angle)[contrast])
        };
        let of_axis = |axis: usize| {
            let at = 1 + 2 * axis;
            [
                found(at, 1 + axis) / (angle * shifts[axis]),
                found(at + 1, 3 + axis) / (angle * angle * WIDENED * variances[axis]),
            ]
        };
        let worse = |a: f64, b: f64| match (b - 1.0).abs() > (a - 1.0).abs() || b.is_nan() {
            true => b,
            false => a,
        };
        let all = (0..truth.axes).map(of_axis);
        let [refraction, dark_field] =
            all.reduce(|a, b| [0, 1].map(|k| worse(a[k], b[k]))).unwrap_or([f64::NAN; 2]);
        Ok(Some(Response {
            transmission: found(0, 0) / TRANSMISSION,
            refraction,
            dark_field: self.has_width().then_some(dark_field),
        }))
    }

    /// Residual of the method's fit to the curve of the masks at the flat's offsets, rms over the height; 0 where this
    /// curve is not known.
    ///
    /// # Errors
    /// [`beamlet_core::Error::Device`], [`beamlet_core::Error::Memory`].
    pub(super) fn misfit_of_masks(&self) -> Result<f64> {
        let (Some(truth), Some(flat)) = (TrueCurve::of(self.layout()), self.flat_curves()) else {
            return Ok(0.0);
        };
        let middle =
            |of: &dyn Fn(&Curve) -> f64| median(flat.iter().map(|curve| of(&curve)).collect());
        let centre = [0, 1].map(|axis| middle(&|curve| curve.centre_of(axis)).unwrap_or(0.0));
        let height = middle(&|curve| curve.amplitude).unwrap_or(1.0);
        let from_centre = |offset: &[f64; 2]| [0, 1].map(|axis| offset[axis] - centre[axis]);
        let places: Vec<[f64; 2]> = self.flat_offsets().iter().map(from_centre).collect();
        let values = truth.values(&Points::of(&places), height / truth.peak(), (0, 0.0));
        let fit = self.fits_of(&[values], None)?.curve(0);
        Ok(fit.map_or(0.0, |fit| fit.residual / fit.amplitude))
    }

    /// Fits of curves with these values at the flat's offsets. `flat`: of a sample, the curves of its flat.
    fn fits_of(&self, curves: &[Vec<Valued>], flat: Option<&Fits>) -> Result<Fits> {
        let offsets = self.flat_offsets();
        let shape = (offsets.len(), 1, curves.len());
        let frames =
            Array3::from_shape_fn(shape, |(step, _, pixel)| single(curves[pixel][step][0]));
        let scan = ViewScan::of(offsets, NoiseFactors::ONE, self.layout().fitter(), true)?;
        self.curves((frames, 0), &scan, flat.map(|flat| (flat, 0)), &Cancel::default())
    }
}
