//! The fit of a beamlet: a box behind the blur of the spot, integrated over pixels.

use super::curves::Curve;
use super::equations::Unknowns;
use super::fit::{Fit, Fitting, fit_slits};
use super::model::{Model, SLITS, of_slits};
use super::profile::Profile;
use super::scan::{Scan, Values};
use super::shape::LIT;
use super::strips::Strips;
use super::{closed, flags};

/// Least blur, as a part of half the base of a beamlet.
const LEAST_BLUR: f64 = 1e-6;
/// Difference of two residuals of f32 frames that is none, as a part of the peak.
const SAME: f64 = 1e-6;
/// The light of one aperture on the detector.
#[derive(Debug, Clone)]
pub(crate) struct Beamlet {
    /// An aperture over pixels, and the same a period to either side.
    model: Model,
    /// Variance of the blur of its edges by spot, detector and bars, m^2.
    blur: f64,
    /// From beamlet to beamlet, m.
    period: f64,
    /// Width of a pixel, m.
    pitch: f64,
    /// Half the base of the light without blur, m.
    base: f64,
}

impl Beamlet {
    /// The light of an aperture of this width as it is projected. `blur`: variance, m^2.
    pub(super) fn new(aperture: f64, blur: f64, [period, pitch]: [f64; 2]) -> Self {
        let along = [Profile { boxes: [aperture, pitch], shift: 0.0 }, Profile::ENDLESS];
        let model = Model::Strips(Strips::one(along, vec![[period, 0.0], [-period, 0.0]]));
        Self { model, blur, period, pitch, base: (aperture + pitch) / 2.0 }
    }

    /// Fits the values of pixels, whose centres are the offsets of the scan. `flat`: the flags of
    /// the same beamlet of the flat, `None` for itself.
    pub(super) fn fit(
        &self,
        scan: &Scan,
        curve: impl Iterator<Item = f32>,
        flat: Option<u32>,
    ) -> Curve {
        let values = scan.values(curve, 5);
        if values.flags & flags::NO_ANSWER != 0 {
            return Curve::unknown(values.flags);
        }
        let least_blur = (LEAST_BLUR * self.base).powi(2);
        let (model, least) = (&self.model, [least_blur, 0.0]);
        let free = Fitting { model, scan, values: &values, least, held: SLITS };
        let fit = free.from(self.start(&values));
        let has_width = fit.settled && fit.even.is_some() && fit.p[3] > 1.01 * least_blur;
        let flat_resolves = flat.map(|flat| flat & flags::UNRESOLVED == 0);
        let resolves = has_width && free.resolves_blur(&fit, 0, Some(self.blur), flat_resolves);
        let mut curve = if resolves {
            self.with_centre(&free, &fit)
        } else {
            let mut held = free;
            held.held[3] = true;
            let of_geometry = self.held(&held, &fit.p);
            // A flat has the blur of the set-up. A sample may have more, which does not change area
            // and centre much; without noise it has where the residual says so.
            let more = match (flat, scan.noise.gain) {
                (Some(_), Some(_)) => free.resolves_centre(&fit, 0, self.pitch),
                (Some(_), None) => {
                    of_geometry.residual > fit.residual + SAME * free.peak(&fit.p).abs()
                }
                (None, _) => false,
            };
            if has_width && more {
                self.with_centre(&free, &fit)
            } else {
                self.with_centre(&held, &of_geometry)
            }
        };
        if !resolves {
            curve.flags |= flags::UNRESOLVED;
        }
        curve
    }

    /// Fits the values of two to four pixels with the blur of the set-up: of two without background.
    pub(super) fn fit_few(&self, scan: &Scan, curve: impl Iterator<Item = f32>) -> Curve {
        let blur = self.blur.max((LEAST_BLUR * self.base).powi(2));
        if scan.places.len() > 2 {
            return fit_slits(&self.model, scan, curve, Some(blur));
        }
        let lit = self.base + LIT * blur.sqrt() - 0.5 * self.pitch;
        let reach = lit.min(0.5 * (self.period - self.pitch)).max(0.0);
        closed::two_points(scan, closed::KnownBlur { model: &self.model, blur, reach }, curve)
    }

    /// The fit with the blur of the set-up. Where an end of the light is just beyond a border of
    /// pixels the nearest optimum may hide it: the best of several then.
    fn held(&self, held: &Fitting<'_>, start: &Unknowns) -> Fit {
        let [light, centre, .., background] = *start;
        let blur = self.blur.max(held.least[0]);
        let from = |centre: f64| held.from(of_slits([light, centre, blur, background]));
        let mut best = from(centre);
        for part in [-0.25, 0.25] {
            if !held.resolves_centre(&best, 0, self.pitch) {
                let other = from(centre + part * self.pitch);
                if other.residual < best.residual {
                    best = other;
                }
            }
        }
        best
    }

    /// Light and centroid about the highest pixel, with the blur of the set-up or one by which
    /// edges within pixels are felt, too.
    fn start(&self, values: &Values) -> Unknowns {
        let least = values.range[0];
        let highest = values.along_x().max_by(|a, b| a[1].total_cmp(&b[1]));
        let peak = highest.map_or(0.0, |point| point[0]);
        let reach = self.base + 3.0 * self.blur.sqrt() + self.pitch;
        let near = values.along_x().filter(|[x, ..]| (x - peak).abs() < reach);
        let [light, moment] = near.fold([0.0; 2], |[light, moment], [x, y, _]| {
            let above = y - least;
            [light + above, moment + above * x]
        });
        let blur = self.blur.max((0.3 * self.base).powi(2));
        of_slits([light * self.pitch, moment / light, blur, least])
    }

    /// The curve of a fit without a centre that the pixels do not determine: all light is in one of them.
    fn with_centre(&self, of: &Fitting<'_>, fit: &Fit) -> Curve {
        let mut curve = of.curve_of_slits(fit);
        if !of.resolves_centre(fit, 0, self.pitch) {
            (curve.centre[0], curve.centre_sigma[0]) = (f64::NAN, f64::NAN);
            curve.flags |= flags::UNRESOLVED;
        }
        curve
    }
}
