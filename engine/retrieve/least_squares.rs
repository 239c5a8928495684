//! Least squares in f64 on the host: Levenberg-Marquardt for shapes with four unknowns.

use super::curves::Curve;
use super::flags;
use super::shape::CurveShape;

/// Steps below this, in half widths of the scan and ranges of the curve, end a fit.
const SETTLED: f64 = 1e-7;

/// What all curves share.
#[derive(Debug, Clone)]
pub(super) struct CurveScan {
    /// Offsets, m.
    pub(super) offsets: Vec<f64>,
    /// The part of the scan that each offset stands for, m.
    pub(super) shares: Vec<f64>,
    /// Values from here on are left out.
    pub(super) saturation: f64,
    /// Value of one count, where the values are counts.
    pub(super) gain: Option<f64>,
    /// Standard deviation of a value without light.
    pub(super) read_noise: f64,
}

/// A curve's values that count, and the flags so far.
pub(super) struct CurveValues {
    /// Offset, value, share.
    pub(super) points: Vec<[f64; 3]>,
    pub(super) flags: u32,
    pub(super) least: f64,
    pub(super) most: f64,
}

impl CurveScan {
    /// Sorts out values; flags say why there is no answer.
    pub(super) fn values(&self, curve: impl Iterator<Item = f32>, needed: usize) -> CurveValues {
        let mut values = CurveValues {
            points: Vec::with_capacity(self.offsets.len()),
            flags: 0,
            least: f64::INFINITY,
            most: f64::NEG_INFINITY,
        };
        for ((offset, share), y) in self.offsets.iter().zip(&self.shares).zip(curve) {
            let y = f64::from(y);
            if !y.is_finite() {
                values.flags |= flags::NOT_FINITE;
            } else if y >= self.saturation {
                values.flags |= flags::SATURATED;
            } else {
                values.points.push([*offset, y, *share]);
                values.least = values.least.min(y);
                values.most = values.most.max(y);
            }
        }
        if values.points.len() < needed {
            values.flags |= flags::FEW;
        } else if values.most <= values.least {
            values.flags |= flags::DEAD;
        }
        values
    }

    /// Variance of a value; `NaN` where values are no counts.
    pub(super) fn variance(&self, value: f64) -> f64 {
        let read_noise = self.read_noise;
        self.gain.map_or(f64::NAN, |gain| gain * value.max(0.0) + read_noise * read_noise)
    }

    /// Least and greatest offset.
    pub(super) fn ends(&self) -> [f64; 2] {
        self.offsets
            .iter()
            .fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], x| [a.min(*x), b.max(*x)])
    }
}

/// Area, centroid and standard deviation of points above `floor`.
pub(super) fn moments(points: &[[f64; 3]], floor: f64) -> [f64; 3] {
    let sum = |f: &dyn Fn(f64) -> f64| -> f64 {
        points.iter().map(|[x, y, share]| share * (y - floor) * f(*x)).sum()
    };
    let area = sum(&|_| 1.0);
    let centre = sum(&|x| x) / area;
    let variance = sum(&|x| (x - centre) * (x - centre)) / area;
    [area, centre, variance.max(0.0).sqrt()]
}

/// Fits a shape to a curve.
pub(super) fn fit(shape: CurveShape, scan: &CurveScan, curve: impl Iterator<Item = f32>) -> Curve {
    let values = scan.values(curve, 5);
    if values.flags & flags::NO_ANSWER != 0 {
        return Curve::unknown(values.flags);
    }
    let [low, high] = scan.ends();
    let unit = (high - low) / 2.0;
    let points = &values.points;
    let [area, centre, deviation] = moments(points, values.least);
    let [scale, spread] = shape.guess(area, deviation);
    let p = [scale, centre, spread, values.least];
    // Steps are judged in these.
    let [least_spread, spread_unit] = shape.limits(unit);
    let units = [values.most - values.least, unit, spread_unit, values.most - values.least];
    let Descent { p, equations, squares, settled } = descend(shape, points, p, least_spread, units);
    let mut flags = values.flags | if settled { 0 } else { flags::NOT_CONVERGED };
    let freedom = points.len() as f64 - 4.0;
    let variance = if freedom > 0.0 { squares / freedom } else { f64::NAN };
    let covariance = inverse(&equations);
    let condition = covariance.as_ref().map_or(f64::INFINITY, |c| condition(&equations, c));
    if condition > 100.0 {
        flags |= flags::ILL_CONDITIONED;
    }
    if p[1] < low || p[1] > high {
        flags |= flags::OUTSIDE;
    }

    let of = |i: usize, j: usize| covariance.as_ref().map_or(f64::NAN, |c| variance * c[i][j]);
    if p[0] <= 0.0 || p[0] <= 3.0 * of(0, 0).sqrt() {
        flags |= flags::NO_PEAK;
    }
    let [area, width] = shape.area_and_width(&p);
    if !(p[2] > 1.01 * least_spread && width[0] < 2.0 * unit) {
        flags |= flags::WIDTH;
    }
    let sigma = |[_, by_scale, by_spread]: [f64; 3]| {
        let v = by_scale * by_scale * of(0, 0)
            + 2.0 * by_scale * by_spread * of(0, 2)
            + by_spread * by_spread * of(2, 2);
        v.max(0.0).sqrt()
    };
    Curve {
        area: area[0],
        amplitude: shape.at(&p, p[1]).0 - p[3],
        centre: p[1],
        width: width[0],
        background: p[3],
        residual: (squares / points.len() as f64).sqrt(),
        area_sigma: sigma(area) / area[0],
        centre_sigma: of(1, 1).sqrt(),
        width_sigma: sigma(width),
        condition,
        flags,
    }
}

/// Where the descent to the least squares ended.
struct Descent {
    p: [f64; 4],
    equations: Equations,
    squares: f64,
    settled: bool,
}

/// Levenberg-Marquardt from `p`; steps are judged in `units`.
fn descend(
    shape: CurveShape,
    points: &[[f64; 3]],
    mut p: [f64; 4],
    least_spread: f64,
    units: [f64; 4],
) -> Descent {
    let (mut equations, mut squares) = normal(shape, points, &p);
    let (mut damping, mut settled) = (1e-3, false);
    for _ in 0..200 {
        let Some(step) = solve(&equations, damping) else { break };
        let mut next: [f64; 4] = std::array::from_fn(|i| p[i] + step[i]);
        next[2] = next[2].clamp(0.1 * p[2], 10.0 * p[2]).max(least_spread);
        let (next_equations, next_squares) = normal(shape, points, &next);
        let length = (0..4).map(|i| (next[i] - p[i]).abs() / units[i]).fold(0.0, f64::max);
        if next_squares <= squares {
            // Nielsen's rule: by how well the step was foretold.
            let foretold: f64 = (0..4)
                .map(|i| step[i] * (damping * equations[i][i] * step[i] + equations[i][4]))
                .sum();
            let ratio = (squares - next_squares) / foretold.max(f64::MIN_POSITIVE);
            let factor = (1.0 - (2.0 * ratio - 1.0).powi(3)).max(0.1);
            (p, equations, squares) = (next, next_equations, next_squares);
            damping = (damping * factor).clamp(1e-12, 1e12);
            // What is left is a part of this step.
            settled = length < SETTLED;
        } else {
            damping *= 8.0;
            // No better place near: at the bottom, to the last digits.
            settled = length < 10.0 * SETTLED;
        }
        if settled || damping > 1e12 {
            break;
        }
    }
    Descent { p, equations, squares, settled }
}

type Equations = [[f64; 5]; 4];

/// Normal equations with their right side, and the sum of squares.
fn normal(shape: CurveShape, points: &[[f64; 3]], p: &[f64; 4]) -> (Equations, f64) {
    let (mut n, mut squares) = ([[0.0; 5]; 4], 0.0);
    for [x, y, _] in points {
        let (value, slope) = shape.at(p, *x);
        let rest = y - value;
        squares += rest * rest;
        for (row, s) in n.iter_mut().zip(slope) {
            for (sum, other) in row.iter_mut().zip(slope) {
                *sum += s * other;
            }
            row[4] += s * rest;
        }
    }
    (n, squares)
}

/// Scales that give the matrix a unit diagonal.
fn scales(n: &Equations) -> [f64; 4] {
    std::array::from_fn(|i| 1.0 / n[i][i].max(f64::MIN_POSITIVE).sqrt())
}

/// Solves the equations, scaled and damped; `None` where they are singular.
fn solve(n: &Equations, damping: f64) -> Option<[f64; 4]> {
    let scale = scales(n);
    let mut a = *n;
    for i in 0..4 {
        for j in 0..4 {
            a[i][j] *= scale[i] * scale[j];
        }
        a[i][i] += damping;
        a[i][4] *= scale[i];
    }
    for i in 0..4 {
        let above = a[i];
        if above[i].abs() < 1e-14 {
            return None;
        }
        for row in &mut a[i + 1..] {
            let factor = row[i] / above[i];
            for (value, from) in row.iter_mut().zip(above) {
                *value -= factor * from;
            }
        }
    }
    let mut x = [0.0; 4];
    for i in (0..4).rev() {
        let known: f64 = (i + 1..4).map(|k| a[i][k] * x[k]).sum();
        x[i] = (a[i][4] - known) / a[i][i];
    }
    Some(std::array::from_fn(|i| x[i] * scale[i]))
}

/// Inverse of the matrix.
fn inverse(n: &Equations) -> Option<[[f64; 4]; 4]> {
    let mut columns = [[0.0; 4]; 4];
    for (k, column) in columns.iter_mut().enumerate() {
        let mut unit = *n;
        for (i, row) in unit.iter_mut().enumerate() {
            row[4] = if i == k { 1.0 } else { 0.0 };
        }
        *column = solve(&unit, 0.0)?;
    }
    Some(columns)
}

/// Largest over smallest eigenvalue of the matrix scaled to a unit diagonal, by the power method.
fn condition(n: &Equations, inverse: &[[f64; 4]; 4]) -> f64 {
    let scale = scales(n);
    let largest = |of: &dyn Fn(usize, usize) -> f64| {
        let (mut v, mut value) = ([0.5, 0.3, -0.6, 0.7], 0.0);
        for _ in 0..30 {
            let w: [f64; 4] = std::array::from_fn(|i| (0..4).map(|j| of(i, j) * v[j]).sum());
            value = w.iter().map(|w| w * w).sum::<f64>().sqrt();
            v = w.map(|w| w / value);
        }
        value
    };
    largest(&|i, j| n[i][j] * scale[i] * scale[j])
        * largest(&|i, j| inverse[i][j] / (scale[i] * scale[j]))
}
