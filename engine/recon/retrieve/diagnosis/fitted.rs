//! The curve that was fitted to a pixel: its value and slopes at any offset.

use crate::retrieve::curve_model::CurveModel;
use crate::retrieve::curves::{Curve, Fits};
use crate::retrieve::equations::{Equations, Unknowns, Valued};
use crate::retrieve::flags;
use crate::retrieve::images::Images;
use crate::retrieve::scan::Points;
use crate::retrieve::strips::Tables;

/// Flags of a curve that keep a pixel out of a diagnosis.
const ODD: u32 = flags::NO_ANSWER | flags::SATURATED | flags::OUTSIDE | flags::TRUNCATED;

/// A curve with its unknowns.
#[derive(Debug, Clone)]
pub(crate) struct FittedCurve {
    of: CurveModel,
    p: Unknowns,
    /// Height over the background.
    pub(in crate::retrieve) amplitude: f64,
    /// Standard deviations along x and z, m; z of slits is NaN.
    pub(in crate::retrieve) widths: [f64; 2],
}

/// True if a pixel with these flags in an image counts in a diagnosis.
pub(in crate::retrieve) const fn is_usable(bits: u32) -> bool {
    let odd = flags::of_pixel(ODD, ODD) | flags::MISFIT | flags::UNRESOLVED | flags::BAD_PIXEL;
    bits & odd == 0
}

impl FittedCurve {
    /// The curve of a model with this height, centre, width and background; `None` where one of them is unknown.
    pub(in crate::retrieve) fn new(of: &CurveModel, curve: &Curve) -> Option<Self> {
        let (mut p, own) = (of.model.unknowns(curve), of.model.own_variances());
        (p[0], p[6]) = (1.0, 0.0);
        for axis in [0, 1] {
            p[1 + axis] = curve.centre_of(axis);
            p[3 + axis] = p[3 + axis].max(1e-6 * own[axis]);
        }
        if !of.is_planar {
            (p[2], p[4], p[5]) = (0.0, 1.0, 0.0);
        }
        let is_known = p.iter().all(|number| number.is_finite())
            && curve.background.is_finite()
            && curve.amplitude > 0.0
            && of.axes().iter().all(|axis| curve.moments[*axis] > 0.0);
        if !is_known {
            return None;
        }
        p[0] = curve.amplitude / of.model.peak(&Points::default(), &p);
        p[6] = curve.background;
        let widths = [0, 1].map(|axis| curve.moments[axis].sqrt());
        Some(Self { of: of.clone(), p, amplitude: curve.amplitude, widths })
    }

    /// The curve of a pixel of the flat; `None` where it has no answer or an odd one.
    pub(super) fn of_flat(of: &CurveModel, flat: &Fits, at: usize) -> Option<Self> {
        Self::new(of, &flat.curve(at).filter(|curve| curve.flags & ODD == 0)?)
    }

    /// The curve of a pixel of a view, counted over rows; `None` where flat or sample has no answer or
    /// an odd one, or the pixel is a misfit.
    pub(super) fn of_sample(of: &CurveModel, images: &Images, at: usize) -> Option<Self> {
        let get = |name: &str| Some(f64::from(*images.get(name)?.as_slice()?.get(at)?));
        if !is_usable(beamlet_core::numbers::whole::<u32>(get("flags")?)) {
            return None;
        }
        let [x, z, xx, zz, xz] = [
            "sample_centre",
            "sample_centre_z",
            "sample_width",
            "sample_width_z",
            "sample_covariance_xz",
        ]
        .map(|name| get(name).unwrap_or(f64::NAN));
        let curve = Curve {
            amplitude: get("sample_amplitude")?,
            centre: [x, z],
            moments: [xx * xx, zz * zz, xz],
            background: get("sample_background")?,
            ..Curve::unknown(0)
        };
        Self::new(of, &curve)
    }

    /// Standard deviations along the axes of the steps, m.
    pub(super) fn widths_of_steps(&self) -> &[f64] {
        &self.widths[..self.of.axes().len()]
    }

    /// Its unknowns.
    pub(in crate::retrieve) const fn unknowns(&self) -> Unknowns {
        self.p
    }

    /// Centre x and z, m.
    pub(in crate::retrieve) const fn centre(&self) -> [f64; 2] {
        [self.p[1], self.p[2]]
    }

    /// Values at offsets (m) with slopes by the unknowns; a background that follows from the light is part of its slope.
    pub(in crate::retrieve) fn at(&self, offsets: &[[f64; 2]]) -> Vec<Valued> {
        let mut tables = Tables::default();
        let points = Points::of(offsets).of_columns(self.of.model.repeats());
        let values = self.of.model.evaluate(&points, &self.p, &mut tables);
        values.iter().map(|valued| self.of.background.tied(*valued)).collect()
    }

    /// Equations of the unknowns of the fit.
    pub(in crate::retrieve) fn equations(&self) -> Equations {
        self.of.equations()
    }
}
