//! The curve that was fitted to a pixel: its value and slopes at any offset.

use crate::retrieve::background_term::BackgroundTerm;
use crate::retrieve::curves::Curves;
use crate::retrieve::equations::{Equations, Unknowns, Valued};
use crate::retrieve::flags;
use crate::retrieve::images::Images;
use crate::retrieve::model::{Model, SLITS, of_slits};

/// Flags of a curve that keep a pixel out of a diagnosis.
const ODD: u32 = flags::NO_ANSWER | flags::SATURATED | flags::OUTSIDE | flags::TRUNCATED;

/// A curve with its unknowns.
#[derive(Debug, Clone)]
pub(crate) struct FittedCurve {
    model: Model,
    background: BackgroundTerm,
    p: Unknowns,
    /// Height over the background.
    pub(in crate::retrieve) amplitude: f64,
    /// Standard deviation, m.
    pub(in crate::retrieve) width: f64,
}

/// True if a pixel with these flags in an image counts in a diagnosis.
pub(in crate::retrieve) const fn is_usable(bits: u32) -> bool {
    let odd = flags::of_pixel(ODD, ODD) | flags::MISFIT | flags::UNRESOLVED | flags::BAD_PIXEL;
    bits & odd == 0
}

impl FittedCurve {
    /// The curve of a model with these numbers: amplitude, centre, width, background. `term`: the background of the fit.
    pub(in crate::retrieve) fn new(
        model: &Model,
        numbers: [f64; 4],
        term: BackgroundTerm,
    ) -> Option<Self> {
        let [amplitude, centre, width, background] = numbers;
        if !numbers.iter().all(|number| number.is_finite()) || amplitude <= 0.0 || width <= 0.0 {
            return None;
        }
        let mut p = of_slits([1.0, centre, model.blur_of(width), 0.0]);
        p[0] = amplitude / model.values(std::iter::once(centre), &p)[0][0];
        p[6] = background;
        Some(Self { model: model.clone(), background: term, p, amplitude, width })
    }

    /// The curve of a pixel of the flat; `None` where it has no answer or an odd one.
    pub(super) fn of_flat(
        model: &Model,
        flat: &Curves,
        at: usize,
        term: BackgroundTerm,
    ) -> Option<Self> {
        if flat.flags[at] & ODD != 0 {
            return None;
        }
        let numbers = [&flat.amplitude, &flat.centre, &flat.width, &flat.background];
        Self::new(model, numbers.map(|of| f64::from(of[at])), term)
    }

    /// The curve of a pixel of a view, counted over rows; `None` where flat or sample has no answer or
    /// an odd one, or the pixel is a misfit.
    pub(super) fn of_sample(
        model: &Model,
        images: &Images,
        at: usize,
        term: BackgroundTerm,
    ) -> Option<Self> {
        let get = |name: &str| Some(f64::from(*images.get(name)?.as_slice()?.get(at)?));
        if !is_usable(beamlet_core::numbers::whole::<u32>(get("flags")?)) {
            return None;
        }
        let numbers = [
            get("sample_amplitude")?,
            get("sample_centre")?,
            get("sample_width")?,
            get("sample_background")?,
        ];
        Self::new(model, numbers, term)
    }

    /// Centre, m.
    pub(in crate::retrieve) const fn centre(&self) -> f64 {
        self.p[1]
    }

    /// Values at offsets (m) with slopes by the unknowns; a background that follows from the light is part of its slope.
    pub(in crate::retrieve) fn at(&self, offsets: impl Iterator<Item = f64>) -> Vec<Valued> {
        let values = self.model.values(offsets, &self.p);
        values.into_iter().map(|valued| self.background.tied(valued)).collect()
    }

    /// Equations of the unknowns of the fit.
    pub(in crate::retrieve) fn equations(&self) -> Equations {
        Equations::new(&self.background.held(SLITS))
    }
}
