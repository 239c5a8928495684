//! Results of fits in two directions.

use super::super::flags;

/// Values along x and z.
pub(super) type Pair = [f64; 2];
/// Values of xx, zz and xz.
pub(super) type Moments = [f64; 3];

/// Light of a beamlet, or the curve of a pixel over offsets in two directions.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PlanarCurve {
    /// Light: the integral over places, value times m^2.
    pub(super) area: f64,
    /// Height above the background.
    pub(super) amplitude: f64,
    /// Centre, m.
    pub(super) centre: Pair,
    /// Second moments about the centre, apertures and pixels included, m^2.
    pub(crate) moments: Moments,
    /// Background.
    pub(super) background: f64,
    /// Root mean square of the residuals.
    pub(super) residual: f64,
    /// Standard uncertainty of the area, as a part of it.
    pub(super) area_sigma: f64,
    /// Standard uncertainties of the centre, m.
    pub(super) centre_sigma: Pair,
    /// Standard uncertainties of the second moments, m^2.
    pub(super) moments_sigma: Moments,
    /// Bits of [`super::super::flags`].
    pub(super) flags: u32,
}

impl PlanarCurve {
    /// Nothing known but flags.
    pub(super) const fn unknown(flags: u32) -> Self {
        Self {
            area: f64::NAN,
            amplitude: f64::NAN,
            centre: [f64::NAN; 2],
            moments: [f64::NAN; 3],
            background: f64::NAN,
            residual: f64::NAN,
            area_sigma: f64::NAN,
            centre_sigma: [f64::NAN; 2],
            moments_sigma: [f64::NAN; 3],
            flags,
        }
    }

    /// True if there is a result.
    pub(crate) const fn has_answer(&self) -> bool {
        self.flags & flags::NO_ANSWER == 0
    }
}
