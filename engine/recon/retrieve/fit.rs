//! Least squares in f64 on the host: Levenberg-Marquardt for the unknowns of a model.

use super::background_term::BackgroundTerm;
use super::curves::Curve;
use super::damping::{Damping, SETTLED, WEIGHED, WEIGHINGS};
use super::equations::{Equations, Matrix, UNKNOWNS, Unknowns, covariance};
use super::flags;
use super::model::{Model, SLITS, of_slits};
use super::scan::{Scan, Values};
use super::starts::{Known, of_period};
use super::strips::{MOST_CORRELATED, Tables};
use super::value_noise::Weights;

/// Steps of a descent, at most.
const STEPS: usize = 200;
/// Index of the background among the unknowns.
const BACKGROUND: usize = 6;
/// Condition number beyond which the values hardly determine a curve of slits.
const ILL_CONDITIONED: f64 = 100.0;
/// Noise of a value, as a part of the peak, by which fits are judged where it is not known.
pub(super) const NOISE: f64 = 0.005;
/// Largest relative uncertainty of a variance of the blur that values determine, and of a sample whose flat does not
/// determine it.
const WIDTH_LIMITS: [f64; 2] = [0.3, 0.1];
/// Uncertainty of the centre in pixels, at that noise, beyond which pixels do not determine it.
/// Where a border of pixels lies in a beamlet or in its penumbra it is below 0.01.
const CENTRE_LIMIT: f64 = 0.015;

/// A model that is fitted to the values of a curve, with what limits its unknowns.
#[derive(Debug, Clone, Copy)]
pub(super) struct Fitting<'a> {
    pub(super) model: &'a Model,
    pub(super) scan: &'a Scan,
    pub(super) values: &'a Values,
    /// Unknowns that keep their first value.
    pub(super) held: [bool; UNKNOWNS],
    /// Least variances xx and zz of the blur.
    pub(super) least: [f64; 2],
}

/// Where a fit ended.
#[derive(Debug, Clone)]
pub(super) struct Fit {
    pub(super) p: Unknowns,
    pub(super) settled: bool,
    /// Number of unknowns.
    pub(super) count: usize,
    /// Inverse of the equations in which all values weigh the same.
    pub(super) even: Option<Matrix>,
    /// Covariance of the unknowns; NaN where the noise is not known.
    pub(super) covariance: Option<Matrix>,
    pub(super) condition: f64,
    /// Largest factor by which the other unknowns raise the variance of one.
    pub(super) inflation: f64,
    /// Root mean square of the residuals.
    pub(super) residual: f64,
    /// Standard deviation of the light: of counts with weights by their noise, else by the residuals.
    light_sigma: f64,
}

/// Fits the curve of slits to values, from other starts where this first fit leaves doubts.
pub(super) fn fit_masks(
    model: &Model,
    scan: &Scan,
    curve: impl Iterator<Item = f32>,
    known: Known<'_>,
) -> Curve {
    fit(model, scan, curve, None, Some(known))
}

/// Fits the curve of slits to values. `blur`: its variance, where it is no unknown.
pub(super) fn fit_slits(
    model: &Model,
    scan: &Scan,
    curve: impl Iterator<Item = f32>,
    blur: Option<f64>,
) -> Curve {
    fit(model, scan, curve, blur, None)
}

fn fit(
    model: &Model,
    scan: &Scan,
    curve: impl Iterator<Item = f32>,
    blur: Option<f64>,
    known: Option<Known<'_>>,
) -> Curve {
    let needed = match (scan.background, blur) {
        (BackgroundTerm::Free, None) => 5,
        (background, None) => background.unknowns(4),
        (background, Some(_)) => background.unknowns(3),
    };
    let values = scan.values(curve, needed);
    if values.flags & flags::NO_ANSWER != 0 {
        return Curve::unknown(values.flags);
    }
    let [light, centre, _, variance, ..] = values.moments(values.range[0]);
    let [own, _] = model.own_variances();
    let xx = blur.unwrap_or((variance - own).max(0.05 * own));
    let mut held = SLITS;
    held[3] = blur.is_some();
    let least = model.least_blur(&scan.points).map(|least| least.min(xx));
    let fitting = Fitting { model, scan, values: &values, held, least };
    let start = of_slits([light, centre, xx, values.range[0]]);
    let fit = fitting.from(match scan.background {
        BackgroundTerm::Free => start,
        BackgroundTerm::PerArea(_) | BackgroundTerm::Value(_) => fitting.linear(start),
    });
    let Some(known) = known else { return fitting.curve_of_slits(&fit) };
    let (fit, doubts) = fitting.best(fit, known);
    let mut curve = fitting.curve_of_slits(&fit);
    curve.flags = doubts | of_period(model, &curve, known.flat, scan.points.ends()[0]);
    curve
}

impl Fitting<'_> {
    /// Fits from these unknowns on, with weights that follow the fit.
    pub(super) fn from(&self, start: Unknowns) -> Fit {
        let (noise, points) = (&self.scan.noise, &self.values.points);
        let mut tables = Tables::default();
        let mut weights = vec![1.0; self.values.values.len()];
        let mut last = self.descend(start, &weights, &mut tables);
        for _ in 0..if noise.weights == Weights::Poisson { WEIGHINGS } else { 0 } {
            let p = last.p;
            let peak = self.peak(&p);
            let fitted = self.model.evaluate(points, &p, &mut tables);
            weights.clear();
            weights.extend(fitted.iter().map(|value| noise.weight(value[0], peak)));
            last = self.descend(p, &weights, &mut tables);
            let moved = self.length(&p, &last.p);
            if moved < WEIGHED {
                break;
            }
            last.settled &= moved < 100.0 * WEIGHED;
        }
        let Descent { p, settled, equations, squares } = last;
        let inverse = equations.inverse();
        let (even, squares) = match noise.weights {
            Weights::None => (inverse, squares),
            Weights::Poisson => {
                let (even, squares) = self.normal(&p, &vec![1.0; weights.len()], &mut tables);
                (even.inverse(), squares)
            }
        };
        let freedom = weights.len() as f64 - equations.count() as f64;
        let by_residuals = if freedom > 0.0 { squares / freedom } else { f64::NAN };
        let condition = inverse.as_ref().map_or(f64::INFINITY, |it| equations.condition(it));
        let inflation = inverse.as_ref().map_or(f64::INFINITY, |it| equations.inflation(it));
        let covariance = inverse.map(|inverse| {
            if noise.gain.is_none() && noise.weights == Weights::None {
                return inverse.map(|row| row.map(|value| by_residuals * value));
            }
            // Weights are the inverse of variances at most: far from the peak they are less.
            let fitted = self.model.evaluate(points, &p, &mut tables).iter().zip(&mut weights);
            fitted.for_each(|(value, weight)| {
                *weight = weight.powi(2) * noise.variance_of_fit(value[0]);
            });
            covariance(&inverse, &self.normal(&p, &weights, &mut tables).0.matrix())
        });
        let light_variance = match (&covariance, &even) {
            (Some(covariance), _) if noise.weights == Weights::Poisson => covariance[0][0],
            (_, Some(even)) => by_residuals * even[0][0],
            _ => f64::NAN,
        };
        let residual = (squares / self.values.values.len() as f64).sqrt();
        let light_sigma = light_variance.sqrt();
        let count = equations.count();
        Fit { p, settled, count, even, covariance, condition, inflation, residual, light_sigma }
    }

    /// Height of a curve above its background.
    pub(super) fn peak(&self, p: &Unknowns) -> f64 {
        self.model.peak(&self.values.points, p)
    }

    /// Unknowns with the light and the background that fit the values best, by linear least squares.
    pub(super) fn linear(&self, mut p: Unknowns) -> Unknowns {
        let mut tables = Tables::default();
        let units = self.model.evaluate(&self.values.points, &p, &mut tables).iter();
        let pairs = || units.clone().map(|unit| unit[1]).zip(self.values.values.iter().copied());
        // The light of units about `unit` and values about `value`.
        let light = |unit: f64, value: f64| {
            let [product, square] = pairs().fold([0.0; 2], |[product, square], (u, y)| {
                let u = u - unit;
                [product + u * (y - value), square + u * u]
            });
            product / square.max(f64::MIN_POSITIVE)
        };
        let count = self.values.values.len() as f64;
        [p[0], p[BACKGROUND]] = match self.scan.background {
            BackgroundTerm::Free => {
                let [unit, value] = pairs().fold([0.0; 2], |[a, b], (u, y)| [a + u, b + y]);
                let light = light(unit / count, value / count);
                [light, (value - light * unit) / count]
            }
            BackgroundTerm::PerArea(share) => {
                let light = light(-share, 0.0);
                [light, share * light]
            }
            BackgroundTerm::Value(value) => [light(0.0, value), value],
        };
        p
    }

    /// The curve of a fit, with its uncertainties and the flags that all models share.
    pub(super) fn curve(&self, fit: &Fit) -> Curve {
        let Fit { p, .. } = fit;
        let sigma = |k: usize| match &fit.covariance {
            _ if self.held[k] => 0.0,
            Some(covariance) => covariance[k][k].max(0.0).sqrt(),
            None => f64::NAN,
        };
        let mut flags = self.values.flags | self.scan.outside([p[1], p[2]]);
        if !fit.settled {
            flags |= flags::NOT_CONVERGED;
        }
        if p[0] <= 0.0 || p[0] <= 3.0 * fit.light_sigma {
            flags |= flags::NO_PEAK;
        }
        let own = self.model.own_variances();
        Curve {
            area: p[0],
            amplitude: self.peak(p),
            centre: [p[1], p[2]],
            moments: [p[3] + own[0], p[4] + own[1], p[5]],
            background: p[BACKGROUND],
            residual: fit.residual,
            area_sigma: sigma(0) / p[0],
            centre_sigma: [sigma(1), sigma(2)],
            moments_sigma: [sigma(3), sigma(4), sigma(5)],
            unresolved: [false; 2],
            uncentred: [false; 2],
            condition: fit.condition,
            flags,
        }
    }

    /// The curve of a fit of slits, with the flags of its width.
    pub(super) fn curve_of_slits(&self, fit: &Fit) -> Curve {
        let mut curve = self.curve(fit);
        if fit.condition > ILL_CONDITIONED {
            curve.flags |= flags::ILL_CONDITIONED;
        }
        // Masks of sharp curves have apertures of known width, whatever the blur is.
        let is_sharp = matches!(self.model, Model::Masks(_));
        let resolved = self.held[3] || is_sharp || fit.p[3] > 1.01 * self.least[0];
        if !(resolved && curve.width() < 2.0 * self.scan.half()) {
            curve.flags |= flags::WIDTH;
        }
        curve
    }

    /// Decides whether the values determine the blur along an axis. `known`: its variance by the geometry; `flat`: of a
    /// sample, true if its flat determines it.
    pub(super) fn resolves_blur(
        &self,
        fit: &Fit,
        axis: usize,
        known: Option<f64>,
        flat: Option<bool>,
    ) -> bool {
        let (at, value) = (3 + axis, fit.p[3 + axis]);
        let variance = match (&fit.covariance, &fit.even, self.scan.noise.gain) {
            (Some(covariance), _, Some(_)) => covariance[at][at],
            (_, Some(even), _) => even[at][at] * (NOISE * self.peak(&fit.p)).powi(2),
            _ => f64::NAN,
        };
        // Noise that widens a beamlet adds pixels that determine its width: a flat is judged by its known blur.
        let limit = match flat {
            None => WIDTH_LIMITS[0] * known.map_or(value, |known| value.min(known)),
            Some(true) => WIDTH_LIMITS[0] * value,
            Some(false) => WIDTH_LIMITS[1] * value,
        };
        fit.settled && value > 1.01 * self.least[axis] && variance.sqrt() < limit
    }

    /// Decides whether pixels of this size determine the centre along an axis.
    pub(super) fn resolves_centre(&self, fit: &Fit, axis: usize, pixel: f64) -> bool {
        let variance = fit.even.as_ref().map_or(f64::NAN, |even| even[1 + axis][1 + axis]);
        variance.sqrt() * NOISE * self.peak(&fit.p) < CENTRE_LIMIT * pixel
    }

    /// Largest difference of two sets of unknowns, in their units.
    fn length(&self, p: &Unknowns, q: &Unknowns) -> f64 {
        let [half_x, half_z] = self.values.points.half();
        let own = self.model.own_variances();
        let xx = half_x * (p[3] + own[0]).sqrt();
        let zz = half_z * (p[4] + own[1]).sqrt();
        let range = self.values.range[1] - self.values.range[0];
        let units = [p[0].abs(), half_x, half_z, xx, zz, (xx * zz).sqrt(), range];
        let free = (0..UNKNOWNS).filter(|k| !self.held[*k]);
        free.map(|k| (p[k] - q[k]).abs() / units[k]).fold(0.0, f64::max)
    }

    /// Unknowns within their limits.
    fn limited(&self, p: &Unknowns, step: &Unknowns) -> Unknowns {
        let mut next: Unknowns = std::array::from_fn(|k| p[k] + step[k]);
        for axis in [0, 1] {
            let at = 3 + axis;
            if !self.held[at] {
                next[at] = next[at].clamp(0.1 * p[at], 10.0 * p[at]).max(self.least[axis]);
            }
        }
        next[5] = clamp_covariance(next[5], next[3] * next[4]);
        next[BACKGROUND] = self.scan.background.of_area(next[0]).unwrap_or(next[BACKGROUND]);
        next
    }

    /// Normal equations and the weighted sum of squares.
    pub(super) fn normal(
        &self,
        p: &Unknowns,
        weights: &[f64],
        tables: &mut Tables,
    ) -> (Equations, f64) {
        let background = self.scan.background;
        let (mut equations, mut squares) = (Equations::new(&background.held(self.held)), 0.0);
        let fitted = self.model.evaluate(&self.values.points, p, tables);
        for ((fitted, value), weight) in fitted.iter().zip(&self.values.values).zip(weights) {
            let [at, slopes @ ..] = background.tied(*fitted);
            let rest = value - at;
            squares += weight * rest * rest;
            equations.add(&slopes, *weight, rest);
        }
        (equations, squares)
    }

    /// A step of the damped equations. A variance at its least stays there if the step would lower it.
    fn step(&self, equations: &Equations, p: &Unknowns, damping: f64) -> Option<Unknowns> {
        let mut step = equations.solve(damping)?;
        for at in [3, 4] {
            if p[at] <= self.least[at - 3] && step[at] < 0.0 {
                step = equations.without(at).solve(damping)?;
            }
        }
        Some(step)
    }

    /// Levenberg-Marquardt with fixed weights.
    fn descend(&self, mut p: Unknowns, weights: &[f64], tables: &mut Tables) -> Descent {
        let (mut equations, mut squares) = self.normal(&p, weights, tables);
        let (mut damping, mut settled) = (Damping::new(), false);
        for _ in 0..STEPS {
            let Some(step) = self.step(&equations, &p, damping.value()) else {
                if damping.is_hopeless() {
                    break;
                }
                damping.lift();
                continue;
            };
            let next = self.limited(&p, &step);
            let (next_equations, next_squares) = self.normal(&next, weights, tables);
            let length = self.length(&p, &next);
            if next_squares <= squares {
                damping.ease(squares - next_squares, equations.gain(&step, damping.value()));
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
        Descent { p, settled, equations, squares }
    }
}

/// Where a descent to the least squares ended.
struct Descent {
    p: Unknowns,
    settled: bool,
    equations: Equations,
    squares: f64,
}

/// The covariance nearest to it that two variances of this product have.
pub(super) fn clamp_covariance(covariance: f64, product: f64) -> f64 {
    let most = MOST_CORRELATED * product.max(0.0).sqrt();
    covariance.clamp(-most, most)
}
