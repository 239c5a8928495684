//! The fit of a beamlet, or of a curve over offsets in two directions, by least squares.

use super::super::background::BackgroundTerm;
use super::super::equations::covariance;
use super::super::fitter::Weights;
use super::super::flags;
use super::super::value_noise::ValueNoise;
use super::curve::PlanarCurve;
use super::descent::{Descent, Held};
use super::equations::{Equations, Matrix};
use super::scan::PlanarValues;
use super::shape::{MOST_CORRELATED, PlanarShape, Points, Tables, UNKNOWNS, Valued};

/// Noise of a value, as a part of the peak, by which fits are judged where it is not known.
const NOISE: f64 = 0.005;
/// Largest relative uncertainty of a variance of the blur that values determine, and of a sample whose flat
/// does not determine it.
const WIDTH_LIMITS: [f64; 2] = [0.3, 0.1];
/// Uncertainty of the centre in pixels, at that noise, beyond which pixels do not determine it.
const CENTRE_LIMIT: f64 = 0.015;
/// Uncertainty of the centre of a curve over offsets, at that noise, beyond which steps along an axis do not change the
/// light, as a part of half their range.
const BLIND: f64 = 0.5;
/// Least deviation of a blur, as a part of the light without it or of the distance of values.
const LEAST_BLUR: f64 = 0.01;
/// Variance inflation of an unknown from which on the values hardly determine it.
const ILL_CONDITIONED: f64 = 100.0;

/// Model of the curves of an image.
#[derive(Debug, Clone)]
pub(super) struct PlanarModel {
    pub(super) shape: PlanarShape,
    /// Variances xx and zz of the blur by the geometry, m^2; `None`: unknown, and the fitted ones count.
    pub(super) blur: Option<[f64; 2]>,
    /// Size of a pixel, m, of beamlets.
    pub(super) pixel: Option<[f64; 2]>,
    /// True of the curve of a list of apertures: it has many peaks, and fits begin at a known centre.
    pub(super) is_list: bool,
    /// Background of the curves.
    pub(super) background: BackgroundTerm,
}

/// A fit of flat or sample.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PlanarFit {
    pub(super) curve: PlanarCurve,
    /// Unknowns, for the fit of the sample.
    pub(super) unknowns: [f64; UNKNOWNS],
    /// Axes whose blur the values do not determine.
    pub(super) unresolved: [bool; 2],
    /// Axes along which the offsets do not change the light of the flat.
    pub(super) blind: [bool; 2],
}

impl PlanarFit {
    /// The curve of the fit.
    pub(crate) const fn curve(&self) -> &PlanarCurve {
        &self.curve
    }

    /// No fit.
    const fn none(flags: u32) -> Self {
        let curve = PlanarCurve::unknown(flags);
        Self { curve, unknowns: [f64::NAN; UNKNOWNS], unresolved: [false; 2], blind: [false; 2] }
    }
}

/// Where a fit ended.
struct Ended {
    p: [f64; UNKNOWNS],
    settled: bool,
    /// Inverse of the equations in which all values weigh the same.
    even: Option<Matrix>,
    /// Covariance of the unknowns.
    covariance: Option<Matrix>,
    inflation: f64,
    residual: f64,
}

impl PlanarModel {
    /// Fits values. `flat`: the fit of the same curve of the flat, `None` for the flat itself; `centre`: centre of the
    /// flat's curve to begin with, for a list.
    pub(super) fn fit(
        &self,
        values: &PlanarValues,
        noise: &ValueNoise,
        flat: Option<&PlanarFit>,
        centre: Option<[f64; 2]>,
    ) -> PlanarFit {
        if values.flags & flags::NO_ANSWER != 0 {
            return PlanarFit::none(values.flags);
        }
        let least = self.least_blur(&values.points);
        let start = match centre {
            Some(centre) => self.start_at(values, flat, (centre, least)),
            None => self.start(values, flat, least),
        };
        let mut free = [false; UNKNOWNS];
        free[6] = self.background != BackgroundTerm::Free;
        let mut ended = self.descend(values, noise, start, (free, least));
        let peak = self.peak(&values.points, &ended.p);
        let blind = match flat.filter(|flat| flat.curve.has_answer()) {
            Some(flat) => flat.blind,
            None => self.blind(values, &ended.p, least),
        };
        let unresolved = [0, 1]
            .map(|axis| blind[axis] || !self.resolves(&ended, noise, flat, (axis, peak, least)));
        let mut held = free;
        held[1..3].copy_from_slice(&blind);
        if unresolved[0] || unresolved[1] {
            let mut p = ended.p;
            for axis in [0, 1].into_iter().filter(|axis| unresolved[*axis]) {
                let known = flat.map(|flat| flat.unknowns[3 + axis]).filter(|v| v.is_finite());
                let of_geometry = self.blur.map(|blur| blur[axis]);
                p[3 + axis] = known.or(of_geometry).unwrap_or(p[3 + axis]).max(least[axis]);
                if let (true, Some(flat)) = (blind[axis], flat) {
                    p[1 + axis] = flat.unknowns[1 + axis];
                }
                held[3 + axis] = true;
            }
            p[5] = flat.map_or(0.0, |flat| flat.unknowns[5]).clamp_to(p[3] * p[4]);
            held[5] = true;
            ended = self.descend(values, noise, p, (held, least));
        }
        let mut curve = self.curve(values, &ended, (held, unresolved));
        for axis in [0, 1].into_iter().filter(|axis| blind[*axis]) {
            curve.centre[axis] = f64::NAN;
            curve.centre_sigma[axis] = f64::NAN;
        }
        if blind == [true; 2] {
            curve.flags |= flags::NO_PEAK;
        }
        PlanarFit { curve, unknowns: ended.p, unresolved, blind }
    }

    /// Axes along which the offsets do not change the light: of the curve by the geometry, else of the fitted one.
    fn blind(&self, values: &PlanarValues, fitted: &[f64; UNKNOWNS], least: [f64; 2]) -> [bool; 2] {
        if self.pixel.is_some() {
            return [false; 2];
        }
        let points = &values.points;
        let middle = |axis: usize| {
            let all = &points.along[axis];
            f64::midpoint(all.first().copied().unwrap_or(0.0), all.last().copied().unwrap_or(0.0))
        };
        let of_geometry = |[xx, zz]: [f64; 2]| {
            [1.0, middle(0), middle(1), xx.max(least[0]), zz.max(least[1]), 0.0, 0.0]
        };
        let p = self.blur.map_or(*fitted, of_geometry);
        let background = BackgroundTerm::Free;
        let held = Held { unknowns: [false; UNKNOWNS], least, background };
        let mut descent = Descent::new(&self.shape, values, held);
        let (equations, _) = descent.normal(&p, &vec![1.0; values.values.len()]);
        let peak = self.peak(points, &p);
        [0, 1].map(|axis| {
            let sigma = NOISE * peak / equations.matrix[1 + axis][1 + axis].sqrt();
            sigma > BLIND * points.half()[axis]
        })
    }

    /// Least variances of the blur.
    fn least_blur(&self, points: &Points) -> [f64; 2] {
        let own = self.shape.own_variances();
        [0, 1].map(|axis| {
            let all = &points.along[axis];
            let between = 2.0 * points.half()[axis] / (all.len().max(2) - 1) as f64;
            (LEAST_BLUR * LEAST_BLUR) * own[axis].max(between * between)
        })
    }

    /// Unknowns to begin with: of a sample the flat's, displaced as the centroid is; of the flat of a curve over offsets
    /// the blur by the geometry, since moments of a coarse scan are too wide.
    fn start(
        &self,
        values: &PlanarValues,
        flat: Option<&PlanarFit>,
        least: [f64; 2],
    ) -> [f64; UNKNOWNS] {
        let (_, centroid, second) = values.about_least();
        let own = self.shape.own_variances();
        let mut p = [1.0, centroid[0], centroid[1], 0.0, 0.0, 0.0, 0.0];
        for axis in [0, 1] {
            let by_moments = (second[axis] - own[axis]).max(0.1 * second[axis]);
            let by_geometry = self.blur.filter(|_| self.pixel.is_none()).map(|blur| blur[axis]);
            p[3 + axis] = by_geometry.unwrap_or(by_moments).max(2.0 * least[axis]);
        }
        p[5] = second[2].clamp_to(0.3 * p[3] * p[4]);
        if let Some(flat) = flat.filter(|flat| flat.curve.has_answer()) {
            p[3..6].copy_from_slice(&flat.unknowns[3..6]);
        }
        let [scale, background] = self.linear(values, &p);
        (p[0], p[6]) = (scale, background);
        p
    }

    /// Unknowns of a list to begin with: of a sample the flat's, of a flat the blur by the geometry about a centre.
    fn start_at(
        &self,
        values: &PlanarValues,
        flat: Option<&PlanarFit>,
        ([x, z], least): ([f64; 2], [f64; 2]),
    ) -> [f64; UNKNOWNS] {
        let [xx, zz] =
            [0, 1].map(|axis| self.blur.map_or(0.0, |it| it[axis]).max(2.0 * least[axis]));
        let known = flat.filter(|flat| flat.curve.has_answer()).map(|flat| flat.unknowns);
        let mut p = known.unwrap_or([1.0, x, z, xx, zz, 0.0, 0.0]);
        [p[0], p[6]] = self.linear(values, &p);
        p
    }

    /// Light and background for the other unknowns, by linear least squares.
    fn linear(&self, values: &PlanarValues, p: &[f64; UNKNOWNS]) -> [f64; 2] {
        let mut out = Vec::new();
        self.shape.evaluate(&values.points, p, &mut Tables::default(), &mut out);
        let count = values.values.len() as f64;
        let tied = match self.background {
            BackgroundTerm::Free => None,
            BackgroundTerm::PerArea(share) => Some((share, 0.0)),
            BackgroundTerm::Value(value) => Some((0.0, value)),
        };
        if let Some((share, fixed)) = tied {
            let [mut product, mut square] = [0.0; 2];
            for (unit, value) in out.iter().zip(&values.values) {
                product += (unit[1] + share) * (value - fixed);
                square += (unit[1] + share).powi(2);
            }
            let scale = product / square.max(f64::MIN_POSITIVE);
            return [scale, share * scale + fixed];
        }
        let mean = out.iter().map(|value| value[1]).sum::<f64>() / count;
        let mean_value = values.values.iter().sum::<f64>() / count;
        let [mut product, mut square] = [0.0; 2];
        for (unit, value) in out.iter().zip(&values.values) {
            product += (unit[1] - mean) * (value - mean_value);
            square += (unit[1] - mean).powi(2);
        }
        let scale = product / square.max(f64::MIN_POSITIVE);
        [scale, mean_value - scale * mean]
    }

    /// Height above the background: at the centre, or of a list at these points.
    pub(super) fn peak(&self, points: &Points, p: &[f64; UNKNOWNS]) -> f64 {
        let mut out: Vec<Valued> = Vec::new();
        let centre = Points::of(&[[p[1], p[2]]]);
        let points = if self.is_list { points } else { &centre };
        self.shape.evaluate(points, p, &mut Tables::default(), &mut out);
        out.iter().map(|value| value[0] - p[6]).fold(f64::NAN, f64::max)
    }

    /// Decides whether values determine the blur along an axis.
    fn resolves(
        &self,
        ended: &Ended,
        noise: &ValueNoise,
        flat: Option<&PlanarFit>,
        (axis, peak, least): (usize, f64, [f64; 2]),
    ) -> bool {
        let (at, value) = (3 + axis, ended.p[3 + axis]);
        let variance = match (&ended.covariance, &ended.even, noise.gain) {
            (Some(covariance), _, Some(_)) => covariance[at][at],
            (_, Some(even), _) => even[at][at] * (NOISE * peak).powi(2),
            _ => f64::NAN,
        };
        let limit = match flat {
            None => WIDTH_LIMITS[0] * self.blur.map_or(value, |blur| value.min(blur[axis])),
            Some(flat) if flat.unresolved[axis] => WIDTH_LIMITS[1] * value,
            Some(_) => WIDTH_LIMITS[0] * value,
        };
        ended.settled && value > 1.01 * least[axis] && variance.sqrt() < limit
    }

    /// Levenberg-Marquardt with weights that follow the fit, and the covariance of the unknowns.
    fn descend(
        &self,
        values: &PlanarValues,
        noise: &ValueNoise,
        start: [f64; UNKNOWNS],
        (held, least): ([bool; UNKNOWNS], [f64; 2]),
    ) -> Ended {
        let background = self.background;
        let limits = Held { unknowns: held, least, background };
        let mut descent = Descent::new(&self.shape, values, limits);
        let (p, settled, weights) = descent.run(
            start,
            |p, fitted| {
                let peak = self.peak(&values.points, p);
                fitted.iter().map(|value| noise.weight(value[0], peak)).collect()
            },
            noise.weights == Weights::Poisson,
        );
        let (equations, _) = descent.normal(&p, &weights);
        let (even, squares) = descent.normal(&p, &vec![1.0; weights.len()]);
        let inverse = equations.inverse();
        let inflation = inverse.as_ref().map_or(f64::INFINITY, |it| equations.inflation(it));
        let covariance = inverse.map(|inverse| {
            if noise.gain.is_none() && noise.weights == Weights::None {
                let free = held.iter().filter(|held| !**held).count();
                let freedom = values.values.len() as f64 - free as f64;
                let variance = if freedom > 0.0 { squares / freedom } else { f64::NAN };
                return inverse.map(|row| row.map(|value| variance * value));
            }
            let of_noise: Vec<f64> = descent
                .fitted(&p)
                .iter()
                .zip(&weights)
                .map(|(value, weight)| weight * weight * noise.variance_of_fit(value[0]))
                .collect();
            let noise = without_held(descent.normal(&p, &of_noise).0, &held).matrix;
            covariance(&inverse, |k, j| noise[k][j])
        });
        let residual = (squares / values.values.len() as f64).sqrt();
        Ended { p, settled, even: even.inverse(), covariance, inflation, residual }
    }

    /// The curve of a fit, with its uncertainties and flags.
    fn curve(
        &self,
        values: &PlanarValues,
        ended: &Ended,
        (held, unresolved): ([bool; UNKNOWNS], [bool; 2]),
    ) -> PlanarCurve {
        let p = &ended.p;
        let sigma = |k: usize| match &ended.covariance {
            _ if held[k] => 0.0,
            Some(covariance) => covariance[k][k].max(0.0).sqrt(),
            None => f64::NAN,
        };
        let mut flags = values.flags | if ended.settled { 0 } else { flags::NOT_CONVERGED };
        let correlation = p[5].abs() / (p[3] * p[4]).sqrt();
        if unresolved[0] || unresolved[1] || correlation > 0.999 * MOST_CORRELATED {
            flags |= flags::UNRESOLVED;
        }
        if ended.inflation > ILL_CONDITIONED {
            flags |= flags::ILL_CONDITIONED;
        }
        if p[0] <= 0.0 || p[0] <= 3.0 * sigma(0) {
            flags |= flags::NO_PEAK;
        }
        let is_outside = (0..2).any(|axis| {
            let all = &values.points.along[axis];
            all.first().is_some_and(|low| p[1 + axis] < *low)
                || all.last().is_some_and(|high| p[1 + axis] > *high)
        });
        if is_outside && !self.is_list {
            flags |= flags::OUTSIDE;
        }
        let amplitude = self.peak(&values.points, p);
        let mut centre = [p[1], p[2]];
        for axis in [0, 1] {
            let variance = ended.even.as_ref().map_or(f64::NAN, |even| even[1 + axis][1 + axis]);
            let is_fine =
                |pixel: [f64; 2]| variance.sqrt() * NOISE * amplitude < CENTRE_LIMIT * pixel[axis];
            if !self.pixel.is_none_or(is_fine) {
                centre[axis] = f64::NAN;
                flags |= flags::UNRESOLVED;
            }
        }
        let own = self.shape.own_variances();
        PlanarCurve {
            area: p[0],
            amplitude,
            centre,
            moments: [p[3] + own[0], p[4] + own[1], p[5]],
            background: p[6],
            residual: ended.residual,
            area_sigma: sigma(0) / p[0],
            centre_sigma: [sigma(1), sigma(2)],
            moments_sigma: [sigma(3), sigma(4), sigma(5)],
            flags,
        }
    }
}

/// Takes the equations of unknowns that keep their value out again.
fn without_held(mut equations: Equations, held: &[bool; UNKNOWNS]) -> Equations {
    for (k, held) in held.iter().enumerate() {
        if *held {
            equations.matrix[k][k] = 0.0;
        }
    }
    equations
}

/// Limits a covariance.
pub(super) trait Correlated {
    /// The covariance nearest to it that two variances of this product have.
    fn clamp_to(self, product: f64) -> f64;
}

impl Correlated for f64 {
    fn clamp_to(self, product: f64) -> f64 {
        let most = MOST_CORRELATED * product.max(0.0).sqrt();
        self.clamp(-most, most)
    }
}
