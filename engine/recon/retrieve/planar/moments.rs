//! Area, centroid and second moments of values in two directions, with what the window cuts off.

use super::super::flags;
use super::super::value_noise::ValueNoise;
use super::curve::PlanarCurve;
use super::fit::Correlated;
use super::scan::PlanarValues;
use super::shape::{PlanarShape, Tables};

/// Steps of the correction for the window, at most.
const STEPS: usize = 60;
/// Change of the moments, as a part of the widths, at which the correction has settled.
const SETTLED: f64 = 1e-8;
/// Least variance of the blur, as a part of the second moment of a pixel.
const LEAST: f64 = 0.01;

/// Sum, centroid x and z, and second moments xx, zz and xz about it.
type Raw = [f64; 6];

/// Moments of the values, corrected for the window: a Gaussian of `shape` with these moments, and its neighbours, have
/// the moments of the values within the window. `area`: of a pixel, m^2. No background is subtracted. A saturated value
/// leaves a hole, and no answer.
pub(super) fn by_moments(
    values: &PlanarValues,
    noise: &ValueNoise,
    (shape, area): (&PlanarShape, f64),
) -> PlanarCurve {
    if values.flags & (flags::NO_ANSWER | flags::SATURATED) != 0 {
        return PlanarCurve::unknown(values.flags | flags::FEW);
    }
    let places: Vec<[f64; 2]> = (0..values.values.len()).map(|k| values.points.place(k)).collect();
    let measured = raw(&places, values.values.iter().copied());
    if measured[0].is_nan() || measured[0] <= 0.0 {
        return PlanarCurve::unknown(values.flags | flags::NO_PEAK);
    }
    let corrected = corrected(values, &places, (shape, area), &measured);
    let truncated = if corrected.is_some() { 0 } else { flags::TRUNCATED };
    let [light, x, z, xx, zz, xz] = corrected.unwrap_or(measured);
    let sigma = |of: &dyn Fn([f64; 2]) -> f64| {
        let terms = values.values.iter().zip(&places);
        let squares = terms.map(|(value, place)| of(*place).powi(2) * noise.variance(*value));
        squares.sum::<f64>().sqrt() / light
    };
    let from = |[px, pz]: [f64; 2]| [(px - x).powi(2), (pz - z).powi(2), (px - x) * (pz - z)];
    let moments = [xx, zz, xz];
    PlanarCurve {
        area: light * area,
        amplitude: values.range[1],
        centre: [x, z],
        moments,
        background: 0.0,
        residual: f64::NAN,
        area_sigma: sigma(&|_| 1.0),
        centre_sigma: [0, 1].map(|axis| sigma(&|place| place[axis] - [x, z][axis])),
        moments_sigma: [0, 1, 2].map(|k| sigma(&|place| from(place)[k] - moments[k])),
        flags: values.flags | truncated,
    }
}

/// Moments of values at places.
fn raw(places: &[[f64; 2]], values: impl Iterator<Item = f64> + Clone) -> Raw {
    let sum = |of: &dyn Fn([f64; 2]) -> f64| -> f64 {
        values.clone().zip(places).map(|(value, place)| value * of(*place)).sum()
    };
    let light = sum(&|_| 1.0);
    let [x, z] = [0, 1].map(|axis| sum(&|place| place[axis]) / light);
    let second = |of: &dyn Fn(f64, f64) -> f64| sum(&|[px, pz]| of(px - x, pz - z)) / light;
    [light, x, z, second(&|x, _| x * x), second(&|_, z| z * z), second(&|x, z| x * z)]
}

/// Moments of the Gaussian that has the measured moments in the window; `None` if there is none, as where the light
/// does not fall off within it.
fn corrected(
    values: &PlanarValues,
    places: &[[f64; 2]],
    (shape, area): (&PlanarShape, f64),
    measured: &Raw,
) -> Option<Raw> {
    let own = shape.own_variances();
    let (mut found, mut tables, mut out) = (*measured, Tables::default(), Vec::new());
    for _ in 0..STEPS {
        let [light, x, z, xx, zz, xz] = found;
        let [xx, zz] = [(xx, own[0]), (zz, own[1])].map(|(all, own)| (all - own).max(LEAST * own));
        let p = [light * area, x, z, xx, zz, xz.clamp_to(xx * zz), 0.0];
        shape.evaluate(&values.points, &p, &mut tables, &mut out);
        let model = raw(places, out.iter().map(|value| value[0]));
        let widths = [measured[3].sqrt(), measured[4].sqrt()];
        let units =
            [measured[0], widths[0], widths[1], measured[3], measured[4], widths[0] * widths[1]];
        let mut most: f64 = 0.0;
        for (k, value) in found.iter_mut().enumerate() {
            let step = measured[k] - model[k];
            *value += step;
            most = most.max((step / units[k]).abs());
        }
        let is_one = most.is_finite() && found[0] > 0.0 && found[3] > 0.0 && found[4] > 0.0;
        if !is_one || found[3] > 4.0 * measured[3] || found[4] > 4.0 * measured[4] {
            return None;
        }
        if most < SETTLED {
            return Some(found);
        }
    }
    None
}
