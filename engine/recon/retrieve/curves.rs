//! Results of fits of illumination curves, for any method.

use super::flags;
use beamlet_core::numbers::single;

/// A curve in f64. Slits have no z.
#[derive(Debug, Clone, Copy)]
pub(super) struct Curve {
    /// Light: the integral over places, value times m, of apertures value times m^2.
    pub(super) area: f64,
    /// Height above the background.
    pub(super) amplitude: f64,
    /// Centre x and z, m.
    pub(super) centre: [f64; 2],
    /// Second moments xx, zz and xz about the centre, apertures and pixels included, m^2.
    pub(super) moments: [f64; 3],
    /// Background.
    pub(super) background: f64,
    /// Root mean square of the residuals.
    pub(super) residual: f64,
    /// Standard uncertainty of the area, as a part of it.
    pub(super) area_sigma: f64,
    /// Standard uncertainties of the centre, m.
    pub(super) centre_sigma: [f64; 2],
    /// Standard uncertainties of the second moments, m^2.
    pub(super) moments_sigma: [f64; 3],
    /// Axes whose blur the values do not determine.
    pub(super) unresolved: [bool; 2],
    /// Axes along which the values do not determine the centre.
    pub(super) uncentred: [bool; 2],
    /// Condition number of the fit.
    pub(super) condition: f64,
    /// Bits of [`super::flags`].
    pub(super) flags: u32,
}

impl Curve {
    /// Nothing known but flags.
    pub(super) const fn unknown(flags: u32) -> Self {
        let unknown = f64::NAN;
        let slits = Self::of_slits([unknown; 4], [unknown; 3], flags);
        Self { background: unknown, residual: unknown, ..slits }
    }

    /// A curve of slits without background: area, amplitude, centre and width, and the uncertainties of the area (as a
    /// part of it), the centre and the width.
    pub(super) const fn of_slits(
        [area, amplitude, centre, width]: [f64; 4],
        [area_sigma, centre_sigma, width_sigma]: [f64; 3],
        flags: u32,
    ) -> Self {
        Self {
            area,
            amplitude,
            centre: [centre, f64::NAN],
            moments: [width * width, f64::NAN, f64::NAN],
            background: 0.0,
            residual: 0.0,
            area_sigma,
            centre_sigma: [centre_sigma, f64::NAN],
            moments_sigma: [2.0 * width * width_sigma, f64::NAN, f64::NAN],
            unresolved: [false; 2],
            uncentred: [false; 2],
            condition: f64::NAN,
            flags,
        }
    }

    /// True if there is a result.
    pub(super) const fn has_answer(&self) -> bool {
        self.flags & flags::NO_ANSWER == 0
    }

    /// Centre along an axis, m; NaN where the values do not determine it.
    pub(super) const fn centre_of(&self, axis: usize) -> f64 {
        if self.uncentred[axis] { f64::NAN } else { self.centre[axis] }
    }

    /// Standard deviation along x, m.
    pub(super) fn width(&self) -> f64 {
        self.moments[0].sqrt()
    }

    /// Standard uncertainty of the standard deviation along x, m.
    pub(super) fn width_sigma(&self) -> f64 {
        self.moments_sigma[0] / (2.0 * self.width())
    }

    /// True if the values determine a second moment, by its index.
    pub(super) const fn resolves(&self, moment: usize) -> bool {
        match moment {
            0 | 1 => !self.unresolved[moment],
            _ => !(self.unresolved[0] || self.unresolved[1]),
        }
    }
}

/// Fits of the curves of flat or sample, in the order of the pixels of the images.
#[derive(Debug, Clone)]
pub(super) enum Fits {
    /// Curves of slits, one in every place.
    Slits(Vec<SlitCurve>),
    /// Curves in two directions; `None` where there is no beamlet.
    Planar(Vec<Option<Curve>>),
}

impl Fits {
    /// Number of places.
    pub(super) fn len(&self) -> usize {
        match self {
            Self::Slits(curves) => curves.len(),
            Self::Planar(curves) => curves.len(),
        }
    }

    /// The curve of a place; `None` where there is no beamlet.
    pub(super) fn curve(&self, at: usize) -> Option<Curve> {
        match self {
            Self::Slits(curves) => Some(curves[at].curve()),
            Self::Planar(curves) => curves[at],
        }
    }

    /// Curves in two directions from a place on; `None` of slits.
    pub(super) fn planar(&self, first: usize) -> Option<&[Option<Curve>]> {
        match self {
            Self::Slits(_) => None,
            Self::Planar(curves) => curves.get(first..),
        }
    }

    /// All curves.
    pub(super) fn iter(&self) -> impl Iterator<Item = Curve> {
        (0..self.len()).filter_map(|at| self.curve(at))
    }

    /// The curves that have a result.
    pub(super) fn known(&self) -> impl Iterator<Item = Curve> {
        self.iter().filter(Curve::has_answer)
    }

    /// Standard deviations of the curves along an axis, m.
    pub(super) fn widths(&self, axis: usize) -> Vec<f64> {
        self.iter().map(|curve| curve.moments[axis].sqrt()).collect()
    }

    /// Puts the curves of a band in their place among all.
    pub(super) fn put(&mut self, start: usize, part: Self) {
        match (self, part) {
            (Self::Slits(all), Self::Slits(part)) => {
                all[start..start + part.len()].copy_from_slice(&part);
            }
            (Self::Planar(all), Self::Planar(part)) => {
                all[start..start + part.len()].copy_from_slice(&part);
            }
            (Self::Slits(_), Self::Planar(_)) | (Self::Planar(_), Self::Slits(_)) => {}
        }
    }
}

/// Fit of a curve of slits. NaN where a method gives no number.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct SlitCurve {
    /// Area under the peak over a constant that flat and sample share; the transmission is their
    /// ratio.
    pub area: f32,
    /// Height A of the peak above the background, intensity or counts.
    pub amplitude: f32,
    /// Centre, in the unit of the offsets.
    pub centre: f32,
    /// Standard deviation of the curve, in the unit of the offsets: sigma of eq. 1, or of the method's
    /// own shape.
    pub width: f32,
    /// Background b, intensity or counts. It may be negative.
    pub background: f32,
    /// Root mean square of the residuals, intensity or counts.
    pub residual: f32,
    /// One-sigma uncertainty of the area, as a part of it.
    pub area_sigma: f32,
    /// One-sigma uncertainty of the centre.
    pub centre_sigma: f32,
    /// One-sigma uncertainty of the width.
    pub width_sigma: f32,
    /// Condition number of the normal equations, scaled to a unit diagonal.
    pub condition: f32,
    /// Bits of [`super::flags`].
    pub flags: u32,
}

impl SlitCurve {
    /// Nothing known.
    pub(super) fn unknown() -> Self {
        Self::of(&Curve::unknown(0))
    }

    /// A curve of slits in f32.
    pub(super) fn of(curve: &Curve) -> Self {
        Self {
            area: single(curve.area),
            amplitude: single(curve.amplitude),
            centre: single(curve.centre[0]),
            width: single(curve.width()),
            background: single(curve.background),
            residual: single(curve.residual),
            area_sigma: single(curve.area_sigma),
            centre_sigma: single(curve.centre_sigma[0]),
            width_sigma: single(curve.width_sigma()),
            condition: single(curve.condition),
            flags: curve.flags,
        }
    }

    /// The curve in f64.
    fn curve(&self) -> Curve {
        let numbers = [self.area, self.amplitude, self.centre, self.width].map(f64::from);
        let sigmas = [self.area_sigma, self.centre_sigma, self.width_sigma].map(f64::from);
        Curve {
            background: self.background.into(),
            residual: self.residual.into(),
            condition: self.condition.into(),
            unresolved: [self.flags & flags::UNRESOLVED != 0, false],
            ..Curve::of_slits(numbers, sigmas, self.flags)
        }
    }
}
