//! The curve that was fitted to a pixel: its value and slopes at any offset.

use crate::retrieve::background::BackgroundTerm;
use crate::retrieve::curves::Curves;
use crate::retrieve::images::Images;
use crate::retrieve::shape::CurveShape;
use crate::retrieve::{Method, Retriever, flags};
use std::f64::consts::TAU;

/// Flags of a curve that keep a pixel out of a diagnosis.
const ODD: u32 = flags::NO_ANSWER | flags::SATURATED | flags::OUTSIDE | flags::TRUNCATED;

/// Kinds of curves that methods fit.
#[derive(Debug, Clone)]
pub(in crate::retrieve) enum Model {
    /// Eq. 1 of docs/retrieval.md; of closed forms the nearest that there is.
    Gaussian,
    /// A curve of the masks.
    Shape(CurveShape),
}

/// A curve with its numbers: scale, centre, spread (width of a Gaussian), background.
#[derive(Debug, Clone)]
pub(crate) struct FittedCurve {
    model: Model,
    background: BackgroundTerm,
    p: [f64; 4],
    /// Height over the background.
    pub(in crate::retrieve) amplitude: f64,
    /// Standard deviation, m.
    pub(in crate::retrieve) width: f64,
}

impl Model {
    /// The curve of a retriever's method; `None` where it fits none over mask offsets.
    pub(super) fn of(retriever: &Retriever, method: Method) -> Option<Self> {
        match method {
            Method::Beamlet => None,
            Method::Triangle | Method::ExactCurve | Method::TwoStep => {
                retriever.shape().map(Self::Shape)
            }
            _ => Some(Self::Gaussian),
        }
    }

    /// The curve of these numbers: area, amplitude, centre, width, background. `term`: the background of the fit.
    pub(in crate::retrieve) fn fitted(
        &self,
        numbers: [f64; 5],
        term: BackgroundTerm,
    ) -> Option<FittedCurve> {
        let [area, amplitude, centre, width, background] = numbers;
        if !numbers.iter().all(|number| number.is_finite()) || amplitude <= 0.0 || width <= 0.0 {
            return None;
        }
        let p = match self {
            Self::Gaussian => [amplitude, centre, width, background],
            Self::Shape(shape) => {
                let [scale, spread] = shape.of_area(area, width);
                [scale, centre, spread, background]
            }
        };
        Some(FittedCurve { model: self.clone(), background: term, p, amplitude, width })
    }

    /// The curve of a pixel of the flat; `None` where it has no answer or an odd one.
    pub(super) fn of_flat(
        &self,
        flat: &Curves,
        at: usize,
        term: BackgroundTerm,
    ) -> Option<FittedCurve> {
        if flat.flags[at] & ODD != 0 {
            return None;
        }
        let numbers = [&flat.area, &flat.amplitude, &flat.centre, &flat.width, &flat.background];
        self.fitted(numbers.map(|of| f64::from(of[at])), term)
    }

    /// The curve of a pixel of a view, counted over rows; `None` where flat or sample has no answer or
    /// an odd one, or the pixel is a misfit.
    pub(super) fn of_sample(
        &self,
        flat: &Curves,
        images: &Images,
        at: usize,
        term: BackgroundTerm,
    ) -> Option<FittedCurve> {
        let get = |name: &str| Some(f64::from(*images.get(name)?.as_slice()?.get(at)?));
        if !is_usable(beamlet_core::numbers::whole::<u32>(get("flags")?)) {
            return None;
        }
        let numbers = [
            get("transmission")? * f64::from(flat.area[at]),
            get("sample_amplitude")?,
            get("sample_centre")?,
            get("sample_width")?,
            get("sample_background")?,
        ];
        self.fitted(numbers, term)
    }
}

/// True if a pixel with these flags in an image counts in a diagnosis.
pub(in crate::retrieve) const fn is_usable(bits: u32) -> bool {
    let odd = flags::of_pixel(ODD, ODD) | flags::MISFIT | flags::UNRESOLVED | flags::BAD_PIXEL;
    bits & odd == 0
}

impl FittedCurve {
    /// Centre, m.
    pub(in crate::retrieve) const fn centre(&self) -> f64 {
        self.p[1]
    }

    /// Value at an offset (m) and slopes by its four numbers; 0 by a background that is no unknown of the fit.
    pub(in crate::retrieve) fn at(&self, x: f64) -> (f64, [f64; 4]) {
        let (value, mut slopes) = self.untied(x);
        if let BackgroundTerm::PerArea(share) = self.background {
            let [by_scale, by_spread] = match &self.model {
                Model::Shape(shape) => {
                    let [[_, by_scale, by_spread], _] = shape.area_and_width(&self.p);
                    [by_scale, by_spread]
                }
                Model::Gaussian => [self.p[2], self.p[0]].map(|of| of * TAU.sqrt()),
            };
            slopes[0] += share * by_scale;
            slopes[2] += share * by_spread;
        }
        if self.background != BackgroundTerm::Free {
            slopes[3] = 0.0;
        }
        (value, slopes)
    }

    /// Value and slopes of a curve whose background is an unknown.
    fn untied(&self, x: f64) -> (f64, [f64; 4]) {
        match &self.model {
            Model::Shape(shape) => shape.at(&self.p, x),
            Model::Gaussian => {
                let [a, centre, width, background] = self.p;
                let t = (x - centre) / width;
                let e = (-0.5 * t * t).exp();
                let slopes = [e, a * e * t / width, a * e * t * t / width, 1.0];
                (libm::fma(a, e, background), slopes)
            }
        }
    }
}
