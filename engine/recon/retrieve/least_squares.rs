//! Least squares in f64 on the host: Levenberg-Marquardt for shapes with four unknowns.

use super::background::BackgroundTerm;
use super::curves::Curve;
use super::damping::{Damping, SETTLED, WEIGHED, WEIGHINGS};
use super::equations::{Equations, add, condition, covariance, inverse, solve};
use super::fitter::Weights;
use super::flags;
use super::shape::CurveShape;
use super::value_noise::ValueNoise;

/// Values that all curves share.
#[derive(Debug, Clone)]
pub(super) struct CurveScan {
    /// Offsets, m.
    pub(super) offsets: Vec<f64>,
    /// Weight of each offset in an integral over the scan, m.
    pub(super) shares: Vec<f64>,
    /// Noise of the values.
    pub(super) noise: ValueNoise,
    /// Background of the curves.
    pub(super) background: BackgroundTerm,
}

/// A curve's values that count, and the flags so far.
#[derive(Debug)]
pub(super) struct CurveValues {
    /// Offset, value, share.
    pub(crate) points: Vec<[f64; 3]>,
    pub(crate) flags: u32,
    pub(crate) least: f64,
    pub(crate) most: f64,
}

impl CurveScan {
    /// Sorts out values; flags say why there is no answer.
    pub(super) fn values(&self, curve: impl Iterator<Item = f32>, needed: usize) -> CurveValues {
        let mut points = Vec::with_capacity(self.offsets.len());
        let curve = curve.take(self.offsets.len());
        let (flags, [least, most]) = self.noise.sort_out(curve, needed, |index, y| {
            points.push([self.offsets[index], y, self.shares[index]]);
        });
        CurveValues { points, flags, least, most }
    }

    /// The flag of a centre outside of the scan; 0 within.
    pub(super) fn outside(&self, centre: f64) -> u32 {
        let [low, high] = self.ends();
        if centre < low || centre > high { flags::OUTSIDE } else { 0 }
    }

    /// Half the distance of these.
    pub(super) fn half(&self) -> f64 {
        let [low, high] = self.ends();
        (high - low) / 2.0
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

/// A shape that is fitted to the values of a curve, with what limits its unknowns.
#[derive(Debug, Clone, Copy)]
pub(super) struct Fitting<'a> {
    pub(crate) shape: &'a CurveShape,
    pub(crate) scan: &'a CurveScan,
    pub(super) values: &'a CurveValues,
    /// Least spread.
    pub(super) least_spread: f64,
    /// The spread keeps its first value.
    pub(crate) held: bool,
}

/// Where a fit ended.
#[derive(Debug, Clone)]
pub(super) struct Fit {
    /// Scale, centre, spread, background.
    pub(crate) p: [f64; 4],
    pub(crate) settled: bool,
    /// Inverse of the equations in which all values weigh the same.
    pub(super) inverse: Option<[[f64; 4]; 4]>,
    /// Covariance of the unknowns; NaN where the noise is not known.
    pub(super) covariance: Option<[[f64; 4]; 4]>,
    condition: f64,
    /// Root mean square of the residuals.
    pub(crate) residual: f64,
    /// Standard deviation of the scale: of counts with weights by their noise, else by the residuals.
    scale_sigma: f64,
}

/// Fits a shape to a curve.
pub(super) fn fit(shape: &CurveShape, scan: &CurveScan, curve: impl Iterator<Item = f32>) -> Curve {
    fit_with(shape, scan, curve, None)
}

/// Fits a shape to a curve. `held`: the spread, where it is known.
pub(super) fn fit_with(
    shape: &CurveShape,
    scan: &CurveScan,
    curve: impl Iterator<Item = f32>,
    held: Option<f64>,
) -> Curve {
    let needed = match (scan.background, held) {
        (BackgroundTerm::Free, None) => 5,
        (background, None) => background.unknowns(4),
        (background, Some(_)) => background.unknowns(3),
    };
    let values = scan.values(curve, needed);
    if values.flags & flags::NO_ANSWER != 0 {
        return Curve::unknown(values.flags);
    }
    let [area, centre, deviation] = moments(&values.points, values.least);
    let [scale, spread] = shape.guess(area, deviation);
    let spread = held.unwrap_or(spread);
    let least_spread = shape.limits(scan.half())[0].min(spread);
    let fitting = Fitting { shape, scan, values: &values, least_spread, held: held.is_some() };
    fitting.curve(&fitting.from(fitting.scaled([scale, centre, spread, values.least])))
}

impl Fitting<'_> {
    /// Fits from these unknowns on.
    pub(super) fn from(&self, p: [f64; 4]) -> Fit {
        let points = &self.values.points;
        let mut weights = vec![1.0; points.len()];
        let mut last = self.descend(p, &weights);
        if self.scan.noise.weights == Weights::Poisson {
            for _ in 0..WEIGHINGS {
                let peak = self.peak(&last.p);
                for (weight, (value, _)) in weights.iter_mut().zip(self.fitted(&last.p)) {
                    *weight = self.scan.noise.weight(value, peak);
                }
                let next = self.descend(last.p, &weights);
                let moved = self.length(&last.p, &next.p);
                last = next;
                if moved < WEIGHED {
                    break;
                }
                last.settled &= moved < 100.0 * WEIGHED;
            }
        }
        let Descent { p, equations, settled } = last;
        let (even, squares) = self.normal(&p, &vec![1.0; points.len()]);
        let weighted = inverse(&equations);
        let condition = weighted.as_ref().map_or(f64::INFINITY, |c| condition(&equations, c));
        let unknowns = self.scan.background.unknowns(if self.held { 3 } else { 4 });
        let freedom = points.len() as f64 - unknowns as f64;
        let by_residuals = if freedom > 0.0 { squares / freedom } else { f64::NAN };
        let even = inverse(&even);
        let covariance =
            weighted.map(|inverse| match (self.scan.noise.weights, self.scan.noise.gain) {
                (Weights::None, None) => inverse.map(|row| row.map(|c| by_residuals * c)),
                _ => {
                    // Weights are the inverse of variances at most: far from the peak they are less.
                    for (weight, (value, _)) in weights.iter_mut().zip(self.fitted(&p)) {
                        *weight = weight.powi(2) * self.scan.noise.variance_of_fit(value);
                    }
                    let noise = self.normal(&p, &weights).0;
                    covariance(&inverse, |k, j| noise[k][j])
                }
            });
        let residual = (squares / points.len() as f64).sqrt();
        let scale_variance = match (&covariance, &even) {
            (Some(covariance), _) if self.scan.noise.weights == Weights::Poisson => {
                covariance[0][0]
            }
            (_, Some(even)) => by_residuals * even[0][0],
            _ => f64::NAN,
        };
        let scale_sigma = scale_variance.sqrt();
        Fit { p, settled, inverse: even, covariance, condition, residual, scale_sigma }
    }

    /// Curve of a fit, with its uncertainties and flags.
    pub(super) fn curve(&self, fit: &Fit) -> Curve {
        let Fit { p, .. } = fit;
        let mut flags = self.values.flags | self.scan.outside(p[1]);
        if !fit.settled {
            flags |= flags::NOT_CONVERGED;
        }
        if fit.condition > 100.0 {
            flags |= flags::ILL_CONDITIONED;
        }
        let of = |i: usize, j: usize| match &fit.covariance {
            Some(_) if self.held && (i == 2 || j == 2) => 0.0,
            Some(covariance) => covariance[i][j],
            None => f64::NAN,
        };
        if p[0] <= 0.0 || p[0] <= 3.0 * fit.scale_sigma {
            flags |= flags::NO_PEAK;
        }
        let [area, width] = self.shape.area_and_width(p);
        // Masks of sharp curves have apertures of known width, whatever the blur is.
        let is_sharp = matches!(self.shape, CurveShape::Masks(_));
        let resolved = self.held || is_sharp || p[2] > 1.01 * self.least_spread;
        if !(resolved && width[0] < 2.0 * self.scan.half()) {
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
            amplitude: self.peak(p),
            centre: p[1],
            width: width[0],
            background: p[3],
            residual: fit.residual,
            area_sigma: sigma(area) / area[0],
            centre_sigma: of(1, 1).sqrt(),
            width_sigma: sigma(width),
            condition: fit.condition,
            flags,
        }
    }

    /// Height of a curve above its background.
    fn peak(&self, p: &[f64; 4]) -> f64 {
        self.shape.at(p, p[1]).0 - p[3]
    }

    /// Values of the curve and slopes by its unknowns at the offsets of the values.
    fn fitted(&self, p: &[f64; 4]) -> Vec<(f64, [f64; 4])> {
        self.shape.evaluate(p, self.values.points.iter().map(|[x, ..]| *x))
    }

    /// Unknowns with the scale that fits the values best where the background is no unknown.
    fn scaled(&self, p: [f64; 4]) -> [f64; 4] {
        let [per_scale, fixed] = match self.scan.background {
            BackgroundTerm::Free => return p,
            BackgroundTerm::PerArea(share) => [share * self.shape.area_and_width(&p)[0][1], 0.0],
            BackgroundTerm::Value(value) => [0.0, value],
        };
        let unit = self.fitted(&[1.0, p[1], p[2], 0.0]);
        let sums = self.values.points.iter().zip(unit).fold([0.0; 2], |sums, ([_, y, _], of)| {
            let u = of.0 + per_scale;
            [sums[0] + u * (y - fixed), sums[1] + u * u]
        });
        self.tied([sums[0] / sums[1].max(f64::MIN_POSITIVE), p[1], p[2], p[3]])
    }

    /// Unknowns with the background that follows from them.
    fn tied(&self, mut p: [f64; 4]) -> [f64; 4] {
        let [area, _] = self.shape.area_and_width(&p);
        p[3] = self.scan.background.of_area(area[0]).unwrap_or(p[3]);
        p
    }

    /// Largest difference of two sets of unknowns, in half widths of the scan and ranges of the
    /// curve.
    fn length(&self, p: &[f64; 4], q: &[f64; 4]) -> f64 {
        let half = self.scan.half();
        let range = self.values.most - self.values.least;
        let units = [self.shape.scale_of(range), half, self.shape.limits(half)[1], range];
        (0..4).map(|i| (q[i] - p[i]).abs() / units[i]).fold(0.0, f64::max)
    }

    /// Levenberg-Marquardt from `p`.
    fn descend(&self, mut p: [f64; 4], weights: &[f64]) -> Descent {
        let (mut equations, mut squares) = self.normal(&p, weights);
        let (mut damping, mut settled) = (Damping::new(), false);
        for _ in 0..200 {
            let Some(step) = solve(&equations, damping.value()) else { break };
            let mut next: [f64; 4] = std::array::from_fn(|i| p[i] + step[i]);
            next[2] = next[2].clamp(0.1 * p[2], 10.0 * p[2]).max(self.least_spread);
            let next = self.tied(next);
            let (next_equations, next_squares) = self.normal(&next, weights);
            let length = self.length(&p, &next);
            if next_squares <= squares {
                let parts = (0..4).map(|i| [step[i], equations[i][i], equations[i][4]]);
                damping.ease(squares - next_squares, parts);
                (p, equations, squares) = (next, next_equations, next_squares);
                // The remaining distance is a part of this step.
                settled = length < SETTLED;
            } else {
                damping.tighten();
                // No better place near: at the bottom, to the last digits.
                settled = length < 10.0 * SETTLED;
            }
            if settled || damping.is_hopeless() {
                break;
            }
        }
        Descent { p, equations, settled }
    }

    /// Normal equations with their right side, and the weighted sum of squares.
    fn normal(&self, p: &[f64; 4], weights: &[f64]) -> (Equations, f64) {
        let (mut n, mut squares) = ([[0.0; 5]; 4], 0.0);
        let background = self.scan.background;
        let [[_, by_scale, by_spread], _] = self.shape.area_and_width(p);
        let fitted = self.fitted(p);
        for (([_, y, _], weight), (value, mut slope)) in
            self.values.points.iter().zip(weights).zip(fitted)
        {
            if let BackgroundTerm::PerArea(share) = background {
                slope[0] += share * by_scale;
                slope[2] += share * by_spread;
            }
            if background != BackgroundTerm::Free {
                slope[3] = 0.0;
            }
            if self.held {
                slope[2] = 0.0;
            }
            let rest = y - value;
            squares += weight * rest * rest;
            add(&mut n, slope, *weight, rest);
        }
        // Equations of their own: no step.
        if self.held {
            n[2][2] = 1.0;
        }
        if background != BackgroundTerm::Free {
            n[3][3] = 1.0;
        }
        (n, squares)
    }
}

/// Where the descent to the least squares ended.
struct Descent {
    p: [f64; 4],
    equations: Equations,
    settled: bool,
}
