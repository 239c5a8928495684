//! Area, centroid and second moments of values in two directions, with what the window cuts off.

use super::super::curves::Curve;
use super::super::fit::clamp_covariance;
use super::super::flags;
use super::super::model::Model;
use super::super::scan::{Scan, Values};
use super::super::strips::Tables;
use super::fit::NEEDED;

/// Steps of the correction for the window, at most.
const STEPS: usize = 60;
/// Change of the moments, as a part of the widths, at which the correction has settled.
const SETTLED: f64 = 1e-8;
/// Least variance of the blur, as a part of the second moment of a pixel.
const LEAST: f64 = 0.01;

/// Moments of the values, corrected for the window: a Gaussian of `model` with these moments, and its neighbours, have
/// the moments of the values within the window. `area`: of a pixel, m^2. No background is subtracted. A saturated value
/// leaves a hole, and no answer.
pub(super) fn by_moments(
    scan: &Scan,
    curve: impl Iterator<Item = f32>,
    model: &Model,
    area: f64,
) -> Curve {
    let values = scan.values(curve, NEEDED);
    if values.flags & (flags::NO_ANSWER | flags::SATURATED) != 0 {
        return Curve::unknown(values.flags | flags::FEW);
    }
    let measured = values.moments(0.0);
    if measured[0].is_nan() || measured[0] <= 0.0 {
        return Curve::unknown(values.flags | flags::NO_PEAK);
    }
    let corrected = corrected(&values, model, area, &measured);
    let truncated = if corrected.is_some() { 0 } else { flags::TRUNCATED };
    let [light, x, z, xx, zz, xz] = corrected.unwrap_or(measured);
    let sigma = |of: &dyn Fn([f64; 2]) -> f64| {
        let terms = values.values.iter().enumerate();
        let squares = terms.map(|(point, value)| {
            of(values.points.place(point)).powi(2) * scan.noise.variance(*value)
        });
        squares.sum::<f64>().sqrt() / light
    };
    let from = |[px, pz]: [f64; 2]| [(px - x).powi(2), (pz - z).powi(2), (px - x) * (pz - z)];
    let moments = [xx, zz, xz];
    Curve {
        area: light * area,
        amplitude: values.range[1],
        centre: [x, z],
        moments,
        background: 0.0,
        residual: f64::NAN,
        area_sigma: sigma(&|_| 1.0),
        centre_sigma: [0, 1].map(|axis| sigma(&|place| place[axis] - [x, z][axis])),
        moments_sigma: [0, 1, 2].map(|k| sigma(&|place| from(place)[k] - moments[k])),
        unresolved: [false; 2],
        uncentred: [false; 2],
        condition: f64::NAN,
        flags: values.flags | truncated,
    }
}

/// Moments of the Gaussian that has the measured moments in the window; `None` if there is none, as where the light
/// does not fall off within it.
fn corrected(values: &Values, model: &Model, area: f64, measured: &[f64; 6]) -> Option<[f64; 6]> {
    let own = model.own_variances();
    let (mut found, mut tables) = (*measured, Tables::default());
    let mut fitted = values.clone();
    for _ in 0..STEPS {
        let [light, x, z, xx, zz, xz] = found;
        let [xx, zz] = [(xx, own[0]), (zz, own[1])].map(|(all, own)| (all - own).max(LEAST * own));
        let p = [light * area, x, z, xx, zz, clamp_covariance(xz, xx * zz), 0.0];
        let out = model.evaluate(&values.points, &p, &mut tables);
        fitted.values.iter_mut().zip(out).for_each(|(to, value)| *to = value[0]);
        let by_model = fitted.moments(0.0);
        let widths = [measured[3].sqrt(), measured[4].sqrt()];
        let units =
            [measured[0], widths[0], widths[1], measured[3], measured[4], widths[0] * widths[1]];
        let mut most: f64 = 0.0;
        for (k, value) in found.iter_mut().enumerate() {
            let step = measured[k] - by_model[k];
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
