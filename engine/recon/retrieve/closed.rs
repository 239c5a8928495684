//! Estimators in closed form: two and three steps, and moments.

use super::curves::Curve;
use super::least_squares::{CurveScan, moments};
use super::shape::CurveShape;
use super::{flags, quadrature};

/// Part of the greatest value that the ends of a scan may have for moments to count: the paper's
/// curve, cut there, loses 0.2 % of its shift and 2.5 % of what it widens.
const EDGE: f64 = 1e-3;

/// One-sigma uncertainties of what `of` makes of values with this variance, to first order; `NaN` where
/// that is.
fn propagate<const N: usize>(
    ys: &[f64],
    variance: impl Fn(f64) -> f64,
    of: impl Fn(&[f64]) -> Option<[f64; N]>,
) -> [f64; N] {
    if variance(0.0).is_nan() {
        return [f64::NAN; N];
    }
    let mut sums = [0.0; N];
    let mut changed = ys.to_vec();
    for (i, y) in ys.iter().enumerate() {
        let h = 1e-4 * y.abs().max(1e-30);
        let mut at = |value: f64| {
            changed[i] = value;
            of(&changed)
        };
        let (above, below) = (at(y + h), at(y - h));
        changed[i] = *y;
        let (Some(above), Some(below)) = (above, below) else { return [f64::NAN; N] };
        for ((sum, a), b) in sums.iter_mut().zip(above).zip(below) {
            *sum += ((a - b) / (2.0 * h)).powi(2) * variance(*y);
        }
    }
    sums.map(f64::sqrt)
}

/// A Gaussian without background through three points: logarithm of the height, centre, width.
fn through_three(x: &[f64], y: &[f64]) -> Option<[f64; 3]> {
    let l: Vec<f64> = y.iter().map(|y| y.ln()).collect();
    let first = (l[1] - l[0]) / (x[1] - x[0]);
    let second = ((l[2] - l[1]) / (x[2] - x[1]) - first) / (x[2] - x[0]);
    if !second.is_finite() || second >= 0.0 {
        return None;
    }
    let variance = -0.5 / second;
    let centre = f64::midpoint(x[0], x[1]) + first * variance;
    let height = l[0] + (x[0] - centre).powi(2) / (2.0 * variance);
    Some([height, centre, variance.sqrt()])
}

/// Logarithm of the area up to a constant, centre and width of the curve through three points.
fn three_numbers(x: &[f64], y: &[f64]) -> Option<[f64; 3]> {
    through_three(x, y).map(|[height, centre, width]| [height + width.ln(), centre, width])
}

/// Halvings of the interval of a centre: to the last digits.
const HALVINGS: u32 = 60;

/// Logarithm of the area and centre of the curve of a shape of known spread through two points. `reach`: from the
/// middle of the points to the farthest centre.
fn two_numbers(
    shape: &CurveShape,
    spread: f64,
    reach: f64,
    x: &[f64],
    y: &[f64],
) -> Option<[f64; 2]> {
    let unit = |x: f64| shape.at(&[1.0, 0.0, spread, 0.0], x).0;
    let wanted = (y[1] / y[0]).ln();
    // The ratio of the second value to the first grows with the centre, since curves of boxes are
    // logarithmically concave.
    let off = |centre: f64| (unit(x[1] - centre) / unit(x[0] - centre)).ln() - wanted;
    let middle = f64::midpoint(x[0], x[1]);
    let side = if x[1] > x[0] { 1.0 } else { -1.0 };
    let [mut low, mut high] = [middle - side * reach, middle + side * reach];
    if !(wanted.is_finite() && off(low) <= 0.0 && off(high) >= 0.0) {
        return None;
    }
    for _ in 0..HALVINGS {
        let centre = f64::midpoint(low, high);
        match off(centre) < 0.0 {
            true => low = centre,
            false => high = centre,
        }
    }
    let centre = f64::midpoint(low, high);
    let brighter = usize::from(y[1] > y[0]);
    let scale = y[brighter] / unit(x[brighter] - centre);
    let [[area, ..], _] = shape.area_and_width(&[scale, centre, spread, 0.0]);
    Some([area.ln(), centre])
}

/// Curve of known shape and spread through two points. `reach`: as of [`two_numbers`].
pub(super) fn two_points(
    scan: &CurveScan,
    (shape, spread, reach): (&CurveShape, f64, f64),
    curve: impl Iterator<Item = f32>,
) -> Curve {
    let mut values = scan.values(curve, 2);
    if values.most > 0.0 {
        // Equal values on both sides of a peak.
        values.flags &= !flags::DEAD;
    }
    if values.flags & flags::NO_ANSWER != 0 {
        return Curve::unknown(values.flags);
    }
    let y: Vec<f64> = values.points.iter().map(|[_, y, _]| *y).collect();
    let first = values.points[0][0];
    let Some(second) = values.points.iter().map(|[x, ..]| *x).find(|x| (x - first).abs() > 0.0)
    else {
        return Curve::unknown(values.flags | flags::FEW);
    };
    // Several values at one offset are their mean.
    let numbers = |y: &[f64]| {
        let mean = |at: f64| {
            let own = values.points.iter().zip(y).filter(|([x, ..], _)| (x - at).abs() <= 0.0);
            let (count, sum) = own.fold((0.0, 0.0), |(count, sum), (_, y)| (count + 1.0, sum + y));
            sum / count
        };
        two_numbers(shape, spread, reach, &[first, second], &[mean(first), mean(second)])
    };
    let Some([area, centre]) = numbers(&y) else {
        return Curve::unknown(values.flags | flags::NO_PEAK);
    };
    let [area_sigma, centre_sigma] = propagate(&y, |y| scan.noise.variance(y), numbers);
    let [[unit, ..], [width, ..]] = shape.area_and_width(&[1.0, centre, spread, 0.0]);
    let scale = area.exp() / unit;
    Curve {
        area: area.exp(),
        amplitude: shape.at(&[scale, 0.0, spread, 0.0], 0.0).0,
        centre,
        width,
        background: 0.0,
        residual: 0.0,
        area_sigma,
        centre_sigma,
        width_sigma: f64::NAN,
        condition: f64::NAN,
        flags: values.flags | scan.outside(centre),
    }
}

/// Three steps.
pub(super) fn three_step(scan: &CurveScan, curve: impl Iterator<Item = f32>) -> Curve {
    let values = scan.values(curve, 3);
    if values.flags & flags::NO_ANSWER != 0 {
        return Curve::unknown(values.flags);
    }
    let (x, y): (Vec<f64>, Vec<f64>) = values.points.iter().map(|[x, y, _]| (*x, *y)).unzip();
    let Some([height, centre, width]) = through_three(&x, &y) else {
        return Curve::unknown(values.flags | flags::NO_PEAK);
    };
    let [area_sigma, centre_sigma, width_sigma] =
        propagate(&y, |y| scan.noise.variance(y), |y| three_numbers(&x, y));
    Curve {
        area: height.exp() * width,
        amplitude: height.exp(),
        centre,
        width,
        background: 0.0,
        residual: 0.0,
        area_sigma,
        centre_sigma,
        width_sigma,
        condition: f64::NAN,
        flags: values.flags | scan.outside(centre),
    }
}

/// Area, centroid and standard deviation. The shares of `scan` are [`quadrature::weights`].
pub(super) fn by_moments(scan: &CurveScan, curve: impl Iterator<Item = f32>) -> Curve {
    let mut values = scan.values(curve, 3);
    if values.flags & flags::NO_ANSWER != 0 {
        return Curve::unknown(values.flags);
    }
    if values.points.len() < scan.offsets.len() {
        // Values that are left out leave wider gaps.
        let offsets: Vec<f64> = values.points.iter().map(|[x, ..]| *x).collect();
        let weights = quadrature::weights(&offsets);
        values.points.iter_mut().zip(weights).for_each(|(point, weight)| point[2] = weight);
    }
    let [area, centre, width] = moments(&values.points, 0.0);
    if !(area > 0.0 && width > 0.0) {
        return Curve::unknown(values.flags | flags::NO_PEAK);
    }
    let [low, high] = scan.ends();
    let at_ends = values.points.iter().filter(|[x, ..]| *x <= low || *x >= high);
    let most_at_ends = at_ends.fold(0.0_f64, |most, [_, y, _]| most.max(*y));
    let noise = scan
        .noise
        .gain
        .map_or(0.0, |gain| 3.0 * scan.noise.variance(most_at_ends.max(gain)).sqrt());
    let sum = |of: &dyn Fn(f64) -> f64| {
        let terms = values
            .points
            .iter()
            .map(|[x, y, share]| (share * of(x - centre)).powi(2) * scan.noise.variance(*y));
        terms.sum::<f64>().sqrt() / area
    };
    Curve {
        area,
        amplitude: values.most,
        centre,
        width,
        background: 0.0,
        residual: f64::NAN,
        area_sigma: sum(&|_| 1.0),
        centre_sigma: sum(&|d| d),
        width_sigma: sum(&|d| d * d - width * width) / (2.0 * width),
        condition: f64::NAN,
        flags: values.flags
            | if most_at_ends > EDGE * values.most + noise { flags::TRUNCATED } else { 0 },
    }
}
