//! Models of curves: values, and slopes by their unknowns.

use super::curves::Curve;
use super::equations::{UNKNOWNS, Unknowns, Valued};
use super::mask_curve::MaskCurve;
use super::method::Method;
use super::profile::Profile;
use super::scan::Points;
use super::shape::CurveGeometry;
use super::strips::{Strips, Tables};
use std::sync::Arc;

/// Least deviation of a blur, as a part of the light without it or of the distance of values.
const LEAST_BLUR: f64 = 0.01;
/// Least half base of a trapezoid, as a part of half the scan.
const LEAST_BASE: f64 = 1e-3;

/// Curve of unit area behind a Gaussian blur, whose variance is an unknown.
#[derive(Debug, Clone)]
pub(super) enum Model {
    /// The slits of two masks over offsets along x.
    Masks(Arc<MaskCurve>),
    /// Two slits over offsets along x behind a point source: even between `-top` and `top`, falling to 0 on either
    /// side. The blur is the variance beyond that of a box of this top.
    Trapezoid {
        /// Half the top, m.
        top: f64,
    },
    /// Apertures over pixels or over offsets along x and z; a Gaussian without apertures.
    Strips(Strips),
}

/// Unknowns that slits do not have.
pub(super) const SLITS: [bool; UNKNOWNS] = [false, false, true, false, true, true, false];

/// Unknowns of slits: light, centre, variance of the blur, and background.
pub(super) const fn of_slits([light, x, xx, background]: [f64; 4]) -> Unknowns {
    [light, x, 0.0, xx, 1.0, 0.0, background]
}

impl Model {
    /// The curve of slits over mask offsets that a method fits, of closed forms the nearest that there is; `None` of
    /// beamlets, and without both masks.
    pub(super) fn of(method: Method, masks: &CurveGeometry) -> Option<Self> {
        match method {
            Method::Gaussian | Method::ThreeStep | Method::Moments => Some(Self::gaussian()),
            Method::Triangle => Some(Self::Trapezoid { top: 0.0 }),
            Method::ExactCurve | Method::TwoStep => masks.model(),
            Method::Beamlet => None,
        }
    }

    /// A Gaussian over offsets along x.
    pub(super) fn gaussian() -> Self {
        Self::Strips(Strips::one([Profile::GAUSSIAN, Profile::ENDLESS], Vec::new()))
    }

    /// Second moments xx and zz without blur, m^2.
    pub(super) fn own_variances(&self) -> [f64; 2] {
        match self {
            Self::Masks(masks) => [masks.variance(), 0.0],
            Self::Trapezoid { top } => [top * top / 3.0, 0.0],
            Self::Strips(strips) => strips.own_variances(),
        }
    }

    /// Unknowns of a curve in two directions.
    pub(super) fn unknowns(&self, curve: &Curve) -> Unknowns {
        let ([x, z], [xx, zz, xz], own) = (curve.centre, curve.moments, self.own_variances());
        [curve.area, x, z, xx - own[0], zz - own[1], xz, curve.background]
    }

    /// True of a list of apertures, whose curve has several peaks.
    pub(super) const fn is_list(&self) -> bool {
        match self {
            Self::Strips(strips) => strips.is_list,
            Self::Masks(_) | Self::Trapezoid { .. } => false,
        }
    }

    /// Columns after which the curves of columns repeat: 1 where all columns have one curve.
    pub(super) fn repeats(&self) -> usize {
        match self {
            Self::Masks(masks) => masks.repeats(),
            Self::Trapezoid { .. } | Self::Strips(_) => 1,
        }
    }

    /// Period of the curve, m; `None` of curves that do not repeat.
    pub(super) fn period(&self) -> Option<f64> {
        match self {
            Self::Masks(masks) => Some(masks.mean().recip()),
            Self::Trapezoid { .. } | Self::Strips(_) => None,
        }
    }

    /// Number of terms of a value.
    pub(super) fn terms(&self) -> usize {
        match self {
            Self::Masks(masks) => masks.orders().len(),
            Self::Trapezoid { .. } => 1,
            Self::Strips(strips) => strips.strips.len() * (1 + strips.neighbours.len()),
        }
    }

    /// Values and slopes by the unknowns at points.
    pub(super) fn evaluate<'t>(
        &self,
        points: &Points,
        p: &Unknowns,
        tables: &'t mut Tables,
    ) -> &'t [Valued] {
        let [light, x, _, xx, .., background] = *p;
        let places = points.along[0].iter().map(|place| place - x);
        let has_columns = !points.columns.is_empty();
        let of_slits: Vec<[f64; 3]> = match self {
            Self::Masks(masks) if has_columns => {
                let own = points.at.iter().zip(&points.columns);
                let place = |([at, _], column): (&[usize; 2], &usize)| {
                    points.along[0][*at] - x + masks.to_slit(*column)
                };
                masks.evaluate(own.map(place), xx)
            }
            Self::Masks(masks) => masks.evaluate(places, xx),
            Self::Trapezoid { top } => places.map(|x| trapezoid(x, *top, xx)).collect(),
            Self::Strips(strips) => {
                strips.evaluate(points, p, tables);
                return &tables.values;
            }
        };
        tables.values.clear();
        tables.values.extend(points.at.iter().enumerate().map(|(index, [at, _])| {
            let [value, by_x, by_xx] = of_slits[if has_columns { index } else { *at }];
            [
                libm::fma(light, value, background),
                value,
                -light * by_x,
                0.0,
                light * by_xx,
                0.0,
                0.0,
                1.0,
            ]
        }));
        &tables.values
    }

    /// Height above the background: at the centre, or of a list at these points.
    pub(super) fn peak(&self, points: &Points, p: &Unknowns) -> f64 {
        let centre = Points::of(&[[p[1], p[2]]]);
        let points = if self.is_list() { points } else { &centre };
        let mut tables = Tables::default();
        let values = self.evaluate(points, p, &mut tables).iter();
        values.map(|value| value[0] - p[6]).fold(f64::NAN, f64::max)
    }

    /// Least variances xx and zz of the blur that values at points determine.
    pub(super) fn least_blur(&self, points: &Points) -> [f64; 2] {
        match self {
            Self::Masks(masks) => [masks.least(), 0.0],
            Self::Trapezoid { top } => {
                let base = top.max(LEAST_BASE * points.half()[0]);
                [(base * base - top * top) / 6.0, 0.0]
            }
            Self::Strips(strips) => {
                let own = strips.own_variances();
                [0, 1].map(|axis| {
                    let count = points.along[axis].len().max(2) - 1;
                    let between = 2.0 * points.half()[axis] / count as f64;
                    (LEAST_BLUR * LEAST_BLUR) * own[axis].max(between * between)
                })
            }
        }
    }

    /// Standard deviation along x of the curve of these unknowns.
    pub(super) fn width(&self, p: &Unknowns) -> f64 {
        (p[3] + self.own_variances()[0]).sqrt()
    }
}

/// Trapezoid of unit area about 0: value, slope by place and slope by variance. Its half base b and half top t have the
/// variance (b^2 + t^2)/6.
fn trapezoid(x: f64, top: f64, variance: f64) -> [f64; 3] {
    let base = libm::fma(6.0, variance, top * top).sqrt();
    let area = base + top;
    let fall = (base - top).max(1e-12 * base);
    let left = base - x.abs();
    // Height, slope by place, slope by base.
    let [height, by_x, by_base] = if left <= 0.0 {
        [0.0; 3]
    } else if left >= fall {
        [1.0, 0.0, 0.0]
    } else {
        [left / fall, -x.signum() / fall, (fall - left) / (fall * fall)]
    };
    [height / area, by_x / area, (by_base - height / area) / area * 3.0 / base]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Unit area, the variance of blur and own moments, and slopes by central differences: 1e-6.
    #[test]
    fn trapezoids_have_unit_area_their_variance_and_their_slopes() {
        for top in [0.0, 0.8] {
            let model = Model::Trapezoid { top };
            let p = of_slits([1.0, 0.1, 0.4, 0.0]);
            let at = |x: f64, p: &Unknowns| {
                let points = Points::along_x(std::iter::once(x));
                model.evaluate(&points, p, &mut Tables::default())[0]
            };
            let [mut area, mut second] = [0.0; 2];
            for k in -30_000..30_000 {
                let x = (f64::from(k) + 0.5) * 1e-4;
                let value = at(x, &p)[0] * 1e-4;
                (area, second) = (area + value, second + value * (x - 0.1).powi(2));
            }
            let variance = model.width(&p).powi(2);
            assert!((area - 1.0).abs() < 1e-6 && (second - variance).abs() < 1e-6, "{area}");
            for x in [-1.4, -0.9, 0.2, 1.3] {
                for unknown in [0, 1, 3, 6] {
                    let moved = |by: f64| {
                        let mut p = p;
                        p[unknown] += by;
                        at(x, &p)[0]
                    };
                    let slope = (moved(1e-6) - moved(-1e-6)) / 2e-6;
                    assert!((slope - at(x, &p)[1 + unknown]).abs() < 1e-6, "{x} {unknown}");
                }
            }
        }
    }
}
