//! Area, centroid and second moments of values, in two directions with what the window cuts off.

use super::curve_model::NEEDED;
use super::curves::Curve;
use super::fit::clamp_covariance;
use super::model::Model;
use super::scan::{Scan, Values};
use super::strips::Tables;
use super::{flags, quadrature};

/// Part of the greatest value that the ends of a scan may have for moments to count: the paper's
/// curve, cut there, loses 0.2 % of its shift and 2.5 % of what it widens.
const EDGE: f64 = 1e-3;
/// Steps of the correction for the window, at most.
const STEPS: usize = 60;
/// Change of the moments, as a part of the widths, at which the correction has settled.
const SETTLED: f64 = 1e-8;
/// Least variance of the blur, as a part of the second moment of a pixel.
const LEAST: f64 = 0.01;

/// Pixels of a beamlet.
#[derive(Debug, Clone, Copy)]
pub(super) struct Window<'a> {
    /// A Gaussian of unit area over pixels, and its neighbours.
    pub(super) model: &'a Model,
    /// Area of a pixel, m^2.
    pub(super) area: f64,
}

/// Moments of the values of slits, whose shares are [`quadrature::weights`]; in a window corrected for it: a Gaussian
/// with these moments, and its neighbours, have the moments of the values within the window, and a saturated value leaves
/// a hole, and no answer. No background is subtracted.
pub(super) fn by_moments(
    scan: &Scan,
    curve: impl Iterator<Item = f32>,
    window: Option<Window<'_>>,
) -> Curve {
    let mut values = scan.values(curve, if window.is_some() { NEEDED } else { 3 });
    let has_hole = window.is_some() && values.flags & flags::SATURATED != 0;
    if has_hole || values.flags & flags::NO_ANSWER != 0 {
        let why = if window.is_some() { flags::FEW } else { 0 };
        return Curve::unknown(values.flags | why);
    }
    if values.values.len() < scan.places.len() {
        // Values that are left out leave wider gaps.
        let offsets: Vec<f64> = values.along_x().map(|[x, ..]| x).collect();
        values.shares = quadrature::weights(&offsets);
    }
    let measured = values.moments(0.0);
    let [light, _, _, xx, ..] = measured;
    if !(light > 0.0 && (window.is_some() || xx > 0.0)) {
        return Curve::unknown(values.flags | flags::NO_PEAK);
    }
    let corrected = match window {
        Some(window) => corrected(&values, window, &measured),
        None => (!is_cut(scan, &values)).then_some(measured),
    };
    let truncated = if corrected.is_some() { 0 } else { flags::TRUNCATED };
    let [light, x, z, xx, zz, xz] = corrected.unwrap_or(measured);
    let sigma = |of: &dyn Fn([f64; 2]) -> f64| {
        let terms = values.values.iter().zip(&values.shares).enumerate();
        let squares = terms.map(|(point, (value, share))| {
            (share * of(values.points.place(point))).powi(2) * scan.noise.variance(*value)
        });
        squares.sum::<f64>().sqrt() / light
    };
    let from = |[px, pz]: [f64; 2]| [(px - x).powi(2), (pz - z).powi(2), (px - x) * (pz - z)];
    let moments = [xx, zz, xz];
    Curve {
        area: light * window.map_or(1.0, |window| window.area),
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

/// Decides whether a curve of slits has light at the ends of its scan.
fn is_cut(scan: &Scan, values: &Values) -> bool {
    let [[low, high], _] = scan.points.ends();
    let at_ends = values.along_x().filter(|[x, ..]| *x <= low || *x >= high);
    let most = at_ends.fold(0.0_f64, |most, [_, y, _]| most.max(y));
    let of_noise = |gain: f64| 3.0 * scan.noise.variance(most.max(gain)).sqrt();
    most > EDGE * values.range[1] + scan.noise.gain.map_or(0.0, of_noise)
}

/// Moments of the Gaussian that has the measured moments in the window; `None` if there is none, as where the light
/// does not fall off within it.
fn corrected(
    values: &Values,
    Window { model, area }: Window<'_>,
    measured: &[f64; 6],
) -> Option<[f64; 6]> {
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
