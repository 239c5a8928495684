//! Estimators in closed form: two and three steps.

use super::curves::Curve;
use super::flags;
use super::model::{Model, of_slits};
use super::scan::{Points, Scan};
use super::strips::Tables;

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

/// Halvings of the interval of a centre: to 3e-14 of it.
const HALVINGS: u32 = 45;

/// Curves of a model with a known blur.
#[derive(Debug, Clone, Copy)]
pub(super) struct KnownBlur<'a> {
    pub(super) model: &'a Model,
    /// Variance of the blur, m2.
    pub(super) blur: f64,
    /// From the middle of two points to the farthest centre, m.
    pub(super) reach: f64,
}

/// Logarithm of the area and centre of the curve with a known blur through two points, x ascending.
fn two_numbers(
    KnownBlur { model, blur, reach }: KnownBlur<'_>,
    x: [f64; 2],
    y: [f64; 2],
) -> Option<[f64; 2]> {
    let (points, mut tables) = (Points::along_x(x.into_iter()), Tables::default());
    let mut units = |centre: f64| {
        let values = model.evaluate(&points, &of_slits([1.0, centre, blur, 0.0]), &mut tables);
        [values[0][0], values[1][0]]
    };
    let wanted = (y[1] / y[0]).ln();
    // The ratio of the second value to the first grows with the centre, since curves of boxes are
    // logarithmically concave.
    let mut off = |centre: f64| {
        let [first, second] = units(centre);
        (second / first).ln() - wanted
    };
    let middle = f64::midpoint(x[0], x[1]);
    let [mut low, mut high] = [middle - reach, middle + reach];
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
    Some([(y[brighter] / units(centre)[brighter]).ln(), centre])
}

/// Curve of a model with a known blur through two points.
pub(super) fn two_points(
    scan: &Scan,
    known: KnownBlur<'_>,
    curve: impl Iterator<Item = f32>,
) -> Curve {
    let mut values = scan.values(curve, 2);
    if values.range[1] > 0.0 {
        // Equal values on both sides of a peak.
        values.flags &= !flags::DEAD;
    }
    if values.flags & flags::NO_ANSWER != 0 {
        return Curve::unknown(values.flags);
    }
    let [first, second] = match values.points.along[0][..] {
        [low, .., high] => [low, high],
        _ => return Curve::unknown(values.flags | flags::FEW),
    };
    // Several values at one offset are their mean.
    let numbers = |y: &[f64]| {
        let mean = |at: usize| {
            let own = values.points.at.iter().zip(y).filter(|([x, _], _)| *x == at);
            let (count, sum) = own.fold((0.0, 0.0), |(count, sum), (_, y)| (count + 1.0, sum + y));
            sum / count
        };
        two_numbers(known, [first, second], [mean(0), mean(1)])
    };
    let Some([area, centre]) = numbers(&values.values) else {
        return Curve::unknown(values.flags | flags::NO_PEAK);
    };
    let [area_sigma, centre_sigma] = propagate(&values.values, |y| scan.noise.variance(y), numbers);
    let KnownBlur { model, blur, .. } = known;
    let p = of_slits([area.exp(), centre, blur, 0.0]);
    Curve::of_slits(
        [area.exp(), model.peak(&values.points, &p), centre, model.width(&p)],
        [area_sigma, centre_sigma, f64::NAN],
        values.flags | scan.outside([centre, 0.0]),
    )
}

/// Three steps.
pub(super) fn three_step(scan: &Scan, curve: impl Iterator<Item = f32>) -> Curve {
    let values = scan.values(curve, 3);
    if values.flags & flags::NO_ANSWER != 0 {
        return Curve::unknown(values.flags);
    }
    let (x, y): (Vec<f64>, Vec<f64>) = values.along_x().map(|[x, y, _]| (x, y)).unzip();
    let Some([height, centre, width]) = through_three(&x, &y) else {
        return Curve::unknown(values.flags | flags::NO_PEAK);
    };
    let [area_sigma, centre_sigma, width_sigma] =
        propagate(&y, |y| scan.noise.variance(y), |y| three_numbers(&x, y));
    Curve::of_slits(
        [height.exp() * width, height.exp(), centre, width],
        [area_sigma, centre_sigma, width_sigma],
        values.flags | scan.outside([centre, 0.0]),
    )
}
