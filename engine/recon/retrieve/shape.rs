//! Shapes of illumination curves that follow from the masks: triangle, trapezoid, the curve of slits behind a blur,
//! and the light of an aperture over pixels.

use super::background::{Background, BackgroundTerm};
use super::mask_curve::MaskCurve;
use beamlet_core::Result;
use beamlet_model::optics::{self, Optics};
use beamlet_model::scene::Scene;
use beamlet_model::spectrum;
use beamlet_model::spot::deviation;
use std::f64::consts::{FRAC_1_SQRT_2, PI};
use std::sync::Arc;

/// Standard deviations of a curve from one to the next from which on a background lies between them.
const SEPARATE: f64 = 6.0;

/// Shape of a curve by the masks.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct CurveGeometry {
    /// Curve of both masks; `None` with fewer.
    masks: Option<Arc<MaskCurve>>,
    /// Widths of the narrowest apertures of sample and detector mask on the analyser, m.
    pub(crate) projected: [f64; 2],
    /// Blur of the focal spot on the analyser, standard deviation, m.
    pub(crate) blur: f64,
    /// Analyser over sample mask distance.
    pub(super) magnification: f64,
    /// Period of the sample mask in its plane, m; infinite without.
    pub(crate) period: f64,
    /// Background of the curves.
    pub(super) background: BackgroundTerm,
    /// Light that the masks leak, per area of the curve, 1/m.
    pub(super) leak: f64,
}

impl CurveGeometry {
    /// Geometry of the curves of a scene with both masks; zero widths without.
    ///
    /// # Errors
    /// Errors of the materials of tapered masks and of the beam.
    pub(super) fn of(scene: &Scene) -> Result<Self> {
        let magnification = scene.magnification();
        let optics = match scene.masks().any(|(_, mask)| mask.taper != 0.0) {
            true => {
                let nodes = spectrum::nodes(scene)?;
                Optics::of(&*optics::straightened(scene, (&nodes.energies, &nodes.weights))?)
            }
            false => Optics::of(scene),
        };
        Ok(Self {
            masks: MaskCurve::of(&optics).map(Arc::new),
            projected: optics.overlapping_apertures(),
            blur: (magnification - 1.0) * deviation(scene.source.spot.fwhm()[0]),
            magnification,
            period: optics.curve_period(),
            background: BackgroundTerm::Free,
            leak: 0.0,
        })
    }

    /// The geometry with a background of the curves of a scene.
    ///
    /// # Errors
    /// As [`Background::term`].
    pub(super) fn with_background(mut self, background: Background, scene: &Scene) -> Result<Self> {
        self.background = background.term(scene, self.period)?;
        let leak = match self.background {
            _ if self.masks.is_none() => return Ok(self),
            BackgroundTerm::PerArea(_) => self.background,
            BackgroundTerm::Free | BackgroundTerm::Value(_) => {
                Background::Leak.term(scene, self.period)?
            }
        };
        if let BackgroundTerm::PerArea(leak) = leak {
            self.leak = leak;
        }
        Ok(self)
    }

    /// Curve of both masks; `None` with fewer.
    pub(super) const fn masks(&self) -> Option<&Arc<MaskCurve>> {
        self.masks.as_ref()
    }

    /// Shape of the curve over mask offsets: the slits behind a blur, or a trapezoid without blur; `None` without two
    /// masks.
    pub(super) fn shape(&self) -> Option<CurveShape> {
        let masks = self.masks.clone()?;
        Some(match self.blur > 0.0 {
            true => CurveShape::Masks(masks),
            false => CurveShape::Trapezoid { top: self.half_top() / self.magnification },
        })
    }

    /// Spread of the shape with the focal spot of the geometry.
    pub(super) fn spread(&self) -> f64 {
        match &self.masks {
            Some(masks) if self.blur > 0.0 => masks.spread(),
            _ => self.half_base() / self.magnification,
        }
    }

    /// True if light of neighbouring apertures leaves room for a background between the curves.
    pub(super) fn is_separate(&self) -> bool {
        self.width().is_none_or(|width| self.period >= SEPARATE * width)
    }

    /// Standard deviation of the curve, m of mask offset; `None` without two masks.
    pub(super) fn width(&self) -> Option<f64> {
        let [_, [width, ..]] = self.shape()?.area_and_width(&[1.0, 0.0, self.spread(), 0.0]);
        Some(width)
    }

    /// Half the base of the curve without blur, m on the analyser.
    pub(super) fn half_base(&self) -> f64 {
        (self.projected[0] + self.projected[1]) / 2.0
    }

    /// Distance of the centre of a curve from the middle of two offsets `apart` from one another, m of mask offset,
    /// within which both have light of this curve alone.
    pub(super) fn reach_of_two(&self, apart: f64) -> f64 {
        let lit = (self.half_base() + LIT * self.blur) / self.magnification;
        (lit - 0.5 * apart).min(0.5 * (self.period - apart)).max(0.0)
    }

    /// Half its top, m on the analyser.
    pub(super) fn half_top(&self) -> f64 {
        (self.projected[0] - self.projected[1]).abs() / 2.0
    }
}

/// Deviations of the blur beyond the base of a curve where it still has light.
pub(super) const LIT: f64 = 3.0;

/// A shape with four unknowns: scale, centre, spread, background. Lengths are in the unit of offsets. The
/// curve is nearly linear in the spread: half the base of a trapezoid, the variance of a blur.
#[derive(Debug, Clone)]
pub(super) enum CurveShape {
    /// Height 1 between `-top` and `top`, falling to 0 at the spread.
    Trapezoid {
        /// Half the top.
        top: f64,
    },
    /// Curve of the slits of two masks, of unit area in a period, blurred by the spread.
    Masks(Arc<MaskCurve>),
    /// Light of an aperture over pixels: the overlap of two boxes, of unit area, blurred by the spread. The curves of
    /// the periods on either side add to it.
    Blurred {
        /// Half the sum of the boxes' widths.
        base: f64,
        /// Half their difference.
        top: f64,
        /// From curve to curve.
        period: f64,
    },
}

/// Standard deviations beyond which a Gaussian is nothing in f64.
const NOTHING: f64 = 8.5;

impl CurveShape {
    /// Value and slopes at `x` by scale, centre, spread and background.
    pub(super) fn at(&self, p: &[f64; 4], x: f64) -> (f64, [f64; 4]) {
        self.evaluate(p, std::iter::once(x))[0]
    }

    /// Values and slopes at places by scale, centre, spread and background.
    pub(super) fn evaluate(
        &self,
        p: &[f64; 4],
        places: impl Iterator<Item = f64>,
    ) -> Vec<(f64, [f64; 4])> {
        let [scale, centre, spread, background] = *p;
        let places = places.map(|x| x - centre);
        let scaled = |[value, by_x, by_spread]: [f64; 3]| {
            (scale * value + background, [value, -scale * by_x, scale * by_spread, 1.0])
        };
        match self {
            Self::Masks(masks) => masks.evaluate(places, spread).into_iter().map(scaled).collect(),
            _ => places.map(|x| scaled(self.unit(x, spread).into())).collect(),
        }
    }

    /// Value, slope by place and slope by spread, for a scale of one about zero.
    fn unit(&self, x: f64, spread: f64) -> (f64, f64, f64) {
        match *self {
            Self::Masks(ref masks) => {
                let [value, by_x, by_spread] = masks.evaluate(std::iter::once(x), spread)[0];
                (value, by_x, by_spread)
            }
            Self::Trapezoid { top } => {
                let fall = (spread - top).max(1e-12 * spread);
                let left = spread - x.abs();
                if left <= 0.0 {
                    (0.0, 0.0, 0.0)
                } else if left >= fall {
                    (1.0, 0.0, 0.0)
                } else {
                    (left / fall, -x.signum() / fall, (fall - left) / (fall * fall))
                }
            }
            Self::Blurred { base, top, period } => {
                let blur = spread.sqrt();
                let reach = base + NOTHING * blur;
                let curves = [x, x + period, x - period];
                let near = curves.into_iter().filter(|x| x.abs() < reach);
                let [value, by_x, by_spread] = near.fold([0.0; 3], |sum, x| {
                    let [value, by_x, by_spread] = blurred(x, base, top, blur);
                    [sum[0] + value, sum[1] + by_x, sum[2] + by_spread]
                });
                (value, by_x, by_spread)
            }
        }
    }

    /// Area and standard deviation of a fitted curve, and the slopes of both by scale and
    /// spread: `[[value, by scale, by spread]; 2]`.
    pub(super) fn area_and_width(&self, p: &[f64; 4]) -> [[f64; 3]; 2] {
        let [scale, _, spread, _] = *p;
        match *self {
            Self::Trapezoid { top } => {
                let width = ((spread * spread + top * top) / 6.0).sqrt();
                [
                    [scale * (spread + top), spread + top, scale],
                    [width, 0.0, spread / (6.0 * width)],
                ]
            }
            Self::Masks(_) | Self::Blurred { .. } => {
                let width = (spread + self.variance()).sqrt();
                [[scale, 1.0, 0.0], [width, 0.0, 1.0 / (2.0 * width)]]
            }
        }
    }

    /// Variance without a blur.
    fn variance(&self) -> f64 {
        match *self {
            Self::Masks(ref masks) => masks.variance(),
            Self::Blurred { base, top, .. } => (base * base + top * top) / 6.0,
            Self::Trapezoid { top } => top * top / 3.0,
        }
    }

    /// Least spread that counts as one, and the unit in which a step of it is judged, for a scan
    /// of this half width.
    pub(super) fn limits(&self, half: f64) -> [f64; 2] {
        match *self {
            Self::Masks(ref masks) => [masks.least(), half * masks.variance().sqrt()],
            Self::Trapezoid { top } => [top.max(1e-3 * half), half],
            Self::Blurred { base, .. } => [(0.02 * base).powi(2), half * base],
        }
    }

    /// Scale of a curve with values in this range, roughly.
    pub(super) fn scale_of(&self, range: f64) -> f64 {
        match *self {
            Self::Masks(ref masks) => range * masks.variance().sqrt(),
            Self::Trapezoid { .. } => range,
            Self::Blurred { base, .. } => range * base,
        }
    }

    /// Scale and spread of a curve of this area and standard deviation.
    pub(super) fn of_area(&self, area: f64, width: f64) -> [f64; 2] {
        match *self {
            Self::Trapezoid { top } => {
                let spread = libm::fma(6.0 * width, width, -top * top).max(top * top).sqrt();
                [area / (spread + top), spread]
            }
            Self::Masks(_) | Self::Blurred { .. } => {
                let own = self.variance();
                [area, (width * width - own).max(1e-6 * own)]
            }
        }
    }

    /// Scale and spread of a curve of this area and standard deviation, roughly.
    pub(super) fn guess(&self, area: f64, deviation: f64) -> [f64; 2] {
        let variance = deviation * deviation;
        match *self {
            Self::Trapezoid { top } => {
                let spread = (6.0 * variance - top * top).max(1.1 * top * top).sqrt();
                [area / (spread + top), spread]
            }
            Self::Masks(_) | Self::Blurred { .. } => {
                let own = self.variance();
                [area, (variance - own).max(0.05 * own)]
            }
        }
    }
}

/// Two boxes of unit overlap behind a blur of standard deviation `blur`: value, slope by `x` and
/// by the variance of the blur.
fn blurred(x: f64, base: f64, top: f64, blur: f64) -> [f64; 3] {
    // Second differences of the ramp's blurred form Q; the area is base^2 - top^2.
    let area = base * base - top * top;
    let corners = [(x + base, 1.0), (x - base, 1.0), (x + top, -1.0), (x - top, -1.0)];
    // Boxes of one width: the inner corners are one.
    let middle = [(x + base, 1.0), (x - base, 1.0), (x, -2.0)];
    let corners = if top > 1e-9 * base { &corners[..] } else { &middle[..] };
    let sum = corners.iter().fold([0.0; 3], |sum, (v, sign)| {
        let t = v / blur;
        let density = (-0.5 * t * t).exp() / (2.0 * PI).sqrt();
        let below = 0.5 * libm::erfc(-t * FRAC_1_SQRT_2);
        let q = v * below + blur * density;
        [sum[0] + sign * q, sum[1] + sign * below, sum[2] + sign * density]
    });
    [sum[0] / area, sum[1] / area, sum[2] / (2.0 * blur * area)]
}
