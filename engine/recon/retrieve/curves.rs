//! Results of fits of illumination curves, for any method.

use super::flags;
use beamlet_core::numbers::single;

/// One curve in f64, fields as of [`Curves`].
#[derive(Debug, Clone, Copy)]
pub(super) struct Curve {
    /// Area, relative to open beam.
    pub area: f64,
    /// Amplitude.
    pub amplitude: f64,
    /// Centre, m.
    pub centre: f64,
    /// Standard deviation, m.
    pub width: f64,
    /// Background.
    pub background: f64,
    /// Root mean square of the residuals.
    pub residual: f64,
    /// Standard uncertainty of the area.
    pub area_sigma: f64,
    /// Standard uncertainty of the centre, m.
    pub centre_sigma: f64,
    /// Standard uncertainty of the width, m.
    pub width_sigma: f64,
    /// Condition number of the fit.
    pub condition: f64,
    /// Bits of [`super::flags`].
    pub flags: u32,
}

impl Curve {
    /// Nothing known but flags.
    pub(super) const fn unknown(flags: u32) -> Self {
        Self {
            area: f64::NAN,
            amplitude: f64::NAN,
            centre: f64::NAN,
            width: f64::NAN,
            background: f64::NAN,
            residual: f64::NAN,
            area_sigma: f64::NAN,
            centre_sigma: f64::NAN,
            width_sigma: f64::NAN,
            condition: f64::NAN,
            flags,
        }
    }
}

/// Results of many curves, one entry per curve. `NaN` where a method gives none.
#[derive(Debug, Clone, Default)]
#[non_exhaustive]
pub struct Curves {
    /// Area under the peak over a constant that flat and sample share; the transmission is their
    /// ratio.
    pub area: Vec<f32>,
    /// Height A of the peak above the background, intensity or counts.
    pub amplitude: Vec<f32>,
    /// Centre, in the unit of the offsets.
    pub centre: Vec<f32>,
    /// Standard deviation of the curve, in the unit of the offsets: sigma of eq. 1, or of the method's
    /// own shape.
    pub width: Vec<f32>,
    /// Background b, intensity or counts. It may be negative.
    pub background: Vec<f32>,
    /// Root mean square of the residuals, intensity or counts.
    pub residual: Vec<f32>,
    /// One-sigma uncertainty of the area, as a part of it.
    pub area_sigma: Vec<f32>,
    /// One-sigma uncertainty of the centre.
    pub centre_sigma: Vec<f32>,
    /// One-sigma uncertainty of the width.
    pub width_sigma: Vec<f32>,
    /// Condition number of the normal equations, scaled to a unit diagonal.
    pub condition: Vec<f32>,
    /// Bits of [`super::flags`].
    pub flags: Vec<u32>,
}

impl Curves {
    /// Numbers of four bytes that a curve has.
    pub(super) const NUMBERS: usize = 11;

    /// Results of `count` curves, all unknown.
    #[must_use]
    pub fn new(count: usize) -> Self {
        let unknown = || vec![f32::NAN; count];
        Self {
            area: unknown(),
            amplitude: unknown(),
            centre: unknown(),
            width: unknown(),
            background: unknown(),
            residual: unknown(),
            area_sigma: unknown(),
            centre_sigma: unknown(),
            width_sigma: unknown(),
            condition: unknown(),
            flags: vec![0; count],
        }
    }

    /// From one entry per curve.
    pub(super) fn from_entries(entries: &[Curve]) -> Self {
        let of = |get: fn(&Curve) -> f64| entries.iter().map(|e| single(get(e))).collect();
        Self {
            area: of(|e| e.area),
            amplitude: of(|e| e.amplitude),
            centre: of(|e| e.centre),
            width: of(|e| e.width),
            background: of(|e| e.background),
            residual: of(|e| e.residual),
            area_sigma: of(|e| e.area_sigma),
            centre_sigma: of(|e| e.centre_sigma),
            width_sigma: of(|e| e.width_sigma),
            condition: of(|e| e.condition),
            flags: entries.iter().map(|e| e.flags).collect(),
        }
    }

    /// Puts curves in their place among all.
    pub(super) fn put(&mut self, start: usize, part: &Self) {
        let to = start..start + part.len();
        for (all, part) in [
            (&mut self.area, &part.area),
            (&mut self.amplitude, &part.amplitude),
            (&mut self.centre, &part.centre),
            (&mut self.width, &part.width),
            (&mut self.background, &part.background),
            (&mut self.residual, &part.residual),
            (&mut self.area_sigma, &part.area_sigma),
            (&mut self.centre_sigma, &part.centre_sigma),
            (&mut self.width_sigma, &part.width_sigma),
            (&mut self.condition, &part.condition),
        ] {
            all[to.clone()].copy_from_slice(part);
        }
        self.flags[to].copy_from_slice(&part.flags);
    }

    /// True if the curve has an answer.
    #[must_use]
    pub fn has_answer(&self, at: usize) -> bool {
        self.flags[at] & flags::NO_ANSWER == 0
    }

    /// Number of curves.
    #[must_use]
    pub fn len(&self) -> usize {
        self.flags.len()
    }

    /// True if there are none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.flags.is_empty()
    }
}
