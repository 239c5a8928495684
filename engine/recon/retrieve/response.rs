//! Response of a method: small contrasts as they are retrieved at the offsets of a scan, by the curve of the masks.

use super::background::Background;
use super::curves::Curves;
use super::images::Images;
use super::method::Method;
use super::model::{Model, of_slits};
use super::noise_factors::NoiseFactors;
use super::options::RetrieveOptions;
use super::record::Record;
use super::retriever::{Retriever, ViewScan};
use beamlet_core::Result;
use beamlet_core::cancel::Cancel;
use beamlet_core::numbers::single;
use ndarray::Array3;
use serde::{Deserialize, Serialize};
use std::fmt;

/// Displacement of the curve by the refraction angle, in standard deviations of the curve.
pub(super) const SHIFT: f64 = 0.1;
/// Dark field as a share of the variance of the curve.
pub(super) const WIDENED: f64 = 0.1;
/// Transmission of the sample.
pub(super) const TRANSMISSION: f64 = 0.9;
/// Relative error from which on a warning states a response.
pub const LARGE_ERROR: f64 = 0.1;
/// Photons at the peak of the curves, for the noise of counts.
pub(super) const PHOTONS: f64 = 1e4;

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

impl Retriever {
    /// The response at the offsets of the scan; `None` where the curve of the masks is not known.
    ///
    /// # Errors
    /// [`beamlet_core::Error::Device`], [`beamlet_core::Error::Memory`].
    pub fn response(&self) -> Result<Option<Response>> {
        let Some(masks) = self.curve_geometry().masks() else { return Ok(None) };
        if self.has_beamlets() {
            return Ok(None);
        }
        let model = Model::Masks(masks.clone());
        let (spread, leak) = (masks.spread(), self.curve_geometry().leak);
        let own = of_slits([1.0, 0.0, spread, leak]);
        let width = model.width(&own);
        let peak = model.values(std::iter::once(0.0), &own)[0][0];
        let scale = self.options().gain.map_or(1.0, |gain| PHOTONS * gain) / peak;
        let (shift, widened) = (SHIFT * width, WIDENED * width * width);
        // Refraction, dark field, transmission: scale, centre and spread.
        let samples = [
            [scale, shift, spread],
            [scale, 0.0, spread + widened],
            [TRANSMISSION * scale, 0.0, spread],
        ];
        let flat = self.fit_curves(&model, &[[scale, 0.0, spread]; 3], None)?;
        let sample = self.fit_curves(&model, &samples, Some(&flat))?;
        let mut images = Images::new(self.names(), 1, samples.len());
        let curves = |at: usize| [flat.curve(at), sample.curve(at)].map(Some);
        images.take(0..samples.len(), curves, self.angle_per_shift());
        let of = |name: &str, pixel: usize| images.get(name).map(|map| f64::from(map[[0, pixel]]));
        let angle = self.angle_per_shift();
        Ok(Some(Response {
            transmission: of("transmission", 2).unwrap_or(f64::NAN) / TRANSMISSION,
            refraction: of("refraction", 0).unwrap_or(f64::NAN) / (angle * shift),
            dark_field: of("dark_field", 1).map(|found| found / (angle * angle * widened)),
        }))
    }

    /// Fits of curves with these scales, centres and spreads.
    fn fit_curves(
        &self,
        model: &Model,
        curves: &[[f64; 3]],
        flat: Option<&Curves>,
    ) -> Result<Curves> {
        let leak = self.curve_geometry().leak;
        let offsets = self.flat_offsets();
        let of_curve = |[scale, centre, spread]: &[f64; 3]| {
            let p = of_slits([*scale, *centre, *spread, leak * scale]);
            model.values(offsets.iter().copied(), &p)
        };
        let values: Vec<_> = curves.iter().map(of_curve).collect();
        let frames = Array3::from_shape_fn((offsets.len(), 1, curves.len()), |(step, _, pixel)| {
            single(values[pixel][step][0])
        });
        let scan = ViewScan::of(offsets, NoiseFactors::ONE, self.fitter(), true)?;
        self.curves(frames, &scan, flat.map(|flat| (flat, 0)), &Cancel::default())
    }
}
