//! The fit of a beamlet: a box behind the blur of the spot, integrated over pixels.

use super::curves::Curve;
use super::flags;
use super::least_squares::{CurveScan, CurveValues, Fit, Fitting};
use super::shape::{CurveShape, LIT};
use super::{closed, least_squares};

/// Least blur, as a part of half the base of a beamlet.
const LEAST_BLUR: f64 = 1e-6;
/// Difference of two residuals of f32 frames that is none, as a part of the peak.
const SAME: f64 = 1e-6;
/// Noise of a value, as a part of the peak, by which fits are judged where it is not known.
const NOISE: f64 = 0.005;
/// Largest relative uncertainty of the blur's variance that pixels determine, of the sample and of the
/// flat.
const WIDTH_LIMITS: [f64; 2] = [0.3, 0.1];
/// Uncertainty of the centre in pixels, at that noise, beyond which pixels do not determine it.
/// Where a border of pixels lies in a beamlet or in its penumbra it is below 0.01.
const CENTRE_LIMIT: f64 = 0.015;

/// The light of one aperture on the detector.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Beamlet {
    /// Width of the aperture as it is projected, m.
    pub(super) aperture: f64,
    /// Variance of the blur of its edges by spot, detector and bars, m^2.
    pub(super) blur: f64,
    /// From beamlet to beamlet, m.
    pub(crate) period: f64,
    /// Width of a pixel, m.
    pub(super) pitch: f64,
}

impl Beamlet {
    /// The shape that is fitted.
    const fn shape(&self) -> CurveShape {
        CurveShape::Blurred {
            base: (self.aperture + self.pitch) / 2.0,
            top: (self.aperture - self.pitch).abs() / 2.0,
            period: self.period,
        }
    }

    /// Fits the values of pixels, whose centres are the offsets of the scan. `flat`: the flags of
    /// the same beamlet of the flat, `None` for itself.
    pub(super) fn fit(
        &self,
        scan: &CurveScan,
        curve: impl Iterator<Item = f32>,
        flat: Option<u32>,
    ) -> Curve {
        let values = scan.values(curve, 5);
        if values.flags & flags::NO_ANSWER != 0 {
            return Curve::unknown(values.flags);
        }
        let least_spread = (LEAST_BLUR * self.base()).powi(2);
        let shape = self.shape();
        let free = Fitting { shape: &shape, scan, values: &values, least_spread, held: false };
        let fit = free.from(self.start(&values));
        let has_width = fit.settled && fit.inverse.is_some() && fit.p[2] > 1.01 * least_spread;
        let resolves = has_width && self.resolves_width(scan, &fit, flat);
        let mut curve = if resolves {
            self.with_centre(free.curve(&fit), &fit)
        } else {
            let held = Fitting { held: true, ..free };
            let of_geometry = self.held(&held, &fit.p);
            // A flat has the blur of the set-up. A sample may have more, which does not change area
            // and centre much; without noise it has where the residual says so.
            let more = match (flat, scan.noise.gain) {
                (Some(_), Some(_)) => self.resolves_centre(&fit),
                (Some(_), None) => {
                    of_geometry.residual > fit.residual + SAME * self.peak(&fit).abs()
                }
                (None, _) => false,
            };
            if has_width && more {
                self.with_centre(free.curve(&fit), &fit)
            } else {
                self.with_centre(held.curve(&of_geometry), &of_geometry)
            }
        };
        if !resolves {
            curve.flags |= flags::UNRESOLVED;
        }
        curve
    }

    /// Fits the values of two to four pixels with the blur of the set-up: of two without background.
    pub(super) fn fit_few(&self, scan: &CurveScan, curve: impl Iterator<Item = f32>) -> Curve {
        let spread = self.blur.max((LEAST_BLUR * self.base()).powi(2));
        if scan.offsets.len() > 2 {
            return least_squares::fit_with(&self.shape(), scan, curve, Some(spread));
        }
        let lit = self.base() + LIT * spread.sqrt() - 0.5 * self.pitch;
        let reach = lit.min(0.5 * (self.period - self.pitch)).max(0.0);
        closed::two_points(scan, (&self.shape(), spread, reach), curve)
    }

    /// The fit with the blur of the set-up. Where an end of the light is just beyond a border of
    /// pixels the nearest optimum may hide it: the best of several then.
    fn held(&self, held: &Fitting<'_>, start: &[f64; 4]) -> Fit {
        let [scale, centre, _, background] = *start;
        let blur = self.blur.max(held.least_spread);
        let from = |centre: f64| held.from([scale, centre, blur, background]);
        let mut best = from(centre);
        for part in [-0.25, 0.25] {
            if !self.resolves_centre(&best) {
                let other = from(centre + part * self.pitch);
                if other.residual < best.residual {
                    best = other;
                }
            }
        }
        best
    }

    /// Half the base of the shape without blur.
    fn base(&self) -> f64 {
        (self.aperture + self.pitch) / 2.0
    }

    /// Light and centroid about the highest pixel, with the blur of the set-up or one by which
    /// edges within pixels are felt, too.
    fn start(&self, values: &CurveValues) -> [f64; 4] {
        let highest = values.points.iter().max_by(|a, b| a[1].total_cmp(&b[1]));
        let peak = highest.map_or(0.0, |point| point[0]);
        let reach = self.base() + 3.0 * self.blur.sqrt() + self.pitch;
        let near = values.points.iter().filter(|[x, ..]| (x - peak).abs() < reach);
        let [light, moment] = near.fold([0.0; 2], |[light, moment], [x, y, _]| {
            let above = y - values.least;
            [light + above, moment + above * x]
        });
        let blur = self.blur.max((0.3 * self.base()).powi(2));
        [light * self.pitch, moment / light, blur, values.least]
    }

    /// Decides whether the noise leaves the width of the blur determined.
    fn resolves_width(&self, scan: &CurveScan, fit: &Fit, flat: Option<u32>) -> bool {
        let variance = match (&fit.covariance, &fit.inverse, scan.noise.gain) {
            (Some(covariance), _, Some(_)) => covariance[2][2],
            (_, Some(inverse), _) => inverse[2][2] * self.noise(fit).powi(2),
            _ => f64::NAN,
        };
        // Noise that widens a beamlet adds pixels that determine its width: a flat is judged by its
        // known blur.
        let limit = match flat {
            None => WIDTH_LIMITS[0] * fit.p[2].min(self.blur),
            Some(of_flat) if of_flat & flags::UNRESOLVED != 0 => WIDTH_LIMITS[1] * fit.p[2],
            Some(_) => WIDTH_LIMITS[0] * fit.p[2],
        };
        variance.sqrt() < limit
    }

    /// Height of a fit above its background.
    fn peak(&self, fit: &Fit) -> f64 {
        self.shape().at(&fit.p, fit.p[1]).0 - fit.p[3]
    }

    /// Noise by which a fit is judged: a part of its peak.
    fn noise(&self, fit: &Fit) -> f64 {
        NOISE * self.peak(fit)
    }

    /// Decides whether the pixels determine the centre.
    fn resolves_centre(&self, fit: &Fit) -> bool {
        let variance = fit.inverse.as_ref().map_or(f64::NAN, |inverse| inverse[1][1]);
        variance.sqrt() * self.noise(fit) < CENTRE_LIMIT * self.pitch
    }

    /// Drops a centre that the pixels do not determine: all light is in one of them.
    fn with_centre(&self, mut curve: Curve, fit: &Fit) -> Curve {
        if !self.resolves_centre(fit) {
            (curve.centre, curve.centre_sigma) = (f64::NAN, f64::NAN);
            curve.flags |= flags::UNRESOLVED;
        }
        curve
    }
}
