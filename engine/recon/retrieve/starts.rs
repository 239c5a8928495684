//! Other solutions of a fit of slits, by starts at other places and blurs.

use super::curves::Curve;
use super::equations::Unknowns;
use super::fit::{Fit, Fitting, NOISE};
use super::flags;
use super::model::{Model, of_slits};
use super::strips::Tables;
use super::value_noise::Weights;

/// Places in a period, or over the scan of a curve that does not repeat, and blurs in known variances, of starts.
const PLACES: u32 = 16;
const BLURS: [f64; 3] = [1.0, 4.0, 16.0];
/// Most starts of descents.
const STARTS: usize = 5;
/// Residual of a flat, rms over the height, that masks explain whose light differs from the curve of thin masks.
const OF_MASKS: f64 = 0.02;
/// Standard deviations of noise that explain a residual.
const SIGMAS: f64 = 3.0;
/// Difference of two residuals, rms over the height, that tells solutions apart without a known noise.
const SAME: f64 = 1e-3;
/// Residual over the other's from which on the other solution is the better one.
const BETTER: f64 = 0.5;
/// Differences of centres in widths, and relative ones of areas, from which on two solutions differ.
const OTHER: f64 = 0.02;
/// Distance of a centre from the flat's, in periods, from which on the centre a period away is as near.
const FAR: f64 = 0.4;
/// Largest transmission, and least variance over the flat's, of another solution of a sample.
const OF_SAMPLE: [f64; 2] = [1.05, 0.95];

/// What is known of a curve before its fit.
#[derive(Debug, Clone, Copy)]
pub(super) struct Known<'a> {
    /// Variance of the blur by the geometry, m^2.
    pub(super) blur: f64,
    /// The same curve of the flat; `None` of the flat itself.
    pub(super) flat: Option<&'a Curve>,
    /// Median residual of the curves of the flat, rms over the height.
    pub(super) misfit: f64,
}

impl Known<'_> {
    /// The flat's curve where it has an answer.
    fn answer(&self) -> Option<&Curve> {
        self.flat.filter(|flat| flat.has_answer())
    }
}

impl Fitting<'_> {
    /// The best solution from the first fit and from other starts, with the flag of a doubtful one: residuals that remain
    /// unexplained, or another solution that fits as well, which leaves no uncertainties. Fits begin elsewhere where
    /// residuals are unexplained, or where hardly more values than unknowns make none.
    pub(super) fn best(&self, first: Fit, known: Known<'_>) -> (Fit, u32) {
        let freedom = self.values.values.len() as i64 - first.count as i64;
        if freedom > 1 && self.explains(&first, known) {
            return (first, 0);
        }
        let starts = self.starts(known);
        let others: Vec<Fit> = starts.into_iter().map(|start| self.from(start)).collect();
        let (mut best, mut others) = (first, others);
        others.retain(|other| other.settled && other.p[0] > 0.0 && self.is_possible(other, known));
        others.sort_by(|a, b| a.residual.total_cmp(&b.residual));
        let is_better = |other: &Fit, than: &Fit| {
            let is_lower = other.residual < BETTER * than.residual;
            !than.settled || (is_lower && !self.is_as_good(than, other))
        };
        if let Some(other) = others.first().filter(|other| is_better(other, &best)) {
            best = other.clone();
        }
        if !self.explains(&best, known) {
            return (best, flags::DOUBTFUL);
        }
        if others.iter().any(|other| self.is_as_good(other, &best) && self.differ(other, &best)) {
            best.covariance = None;
            return (best, flags::DOUBTFUL);
        }
        (best, 0)
    }

    /// True if the noise of values, or the difference of the curve from that of the masks as the flat shows it, explains
    /// the residual of a fit.
    fn explains(&self, fit: &Fit, known: Known<'_>) -> bool {
        let peak = self.peak(&fit.p).abs();
        let of_masks = known.answer().map_or(OF_MASKS, |flat| {
            // The noise of less light is larger in proportion to it.
            let dimmed = (flat.amplitude / peak).max(1.0).sqrt();
            let misfit = known.misfit.max(flat.residual / flat.amplitude);
            (SIGMAS * dimmed * misfit).max(NOISE)
        });
        fit.residual.powi(2) < (of_masks * peak).powi(2) + SIGMAS.powi(2) * self.noise(fit)
    }

    /// Mean variance of the values by their noise; 0 where it is not known.
    fn noise(&self, fit: &Fit) -> f64 {
        let noise = &self.scan.noise;
        if noise.gain.is_none() && noise.weights == Weights::None {
            return 0.0;
        }
        let mut tables = Tables::default();
        let fitted = self.model.evaluate(&self.values.points, &fit.p, &mut tables);
        fitted.iter().map(|value| noise.variance_of_fit(value[0])).sum::<f64>()
            / fitted.len() as f64
    }

    /// True if values do not prefer another fit to one.
    fn is_as_good(&self, one: &Fit, other: &Fit) -> bool {
        let count = self.values.values.len() as f64;
        let more = count * (one.residual.powi(2) - other.residual.powi(2));
        let same = count * (SAME * self.peak(&other.p)).powi(2);
        let noise = self.noise(other);
        more < if noise > 0.0 { SIGMAS.powi(2) * noise } else { same }
    }

    /// True if two solutions are not one to the digits of a descent.
    fn differ(&self, a: &Fit, b: &Fit) -> bool {
        let width = self.model.width(&b.p);
        let apart = match self.model.period() {
            Some(period) => libm::remainder(a.p[1] - b.p[1], period),
            None => a.p[1] - b.p[1],
        };
        apart.abs() > OTHER * width || (a.p[0] / b.p[0] - 1.0).abs() > OTHER
    }

    /// False of a sample with more light, or a narrower curve, than its flat.
    fn is_possible(&self, fit: &Fit, known: Known<'_>) -> bool {
        let [transmission, narrowed] = OF_SAMPLE;
        known.answer().is_none_or(|flat| {
            let variance = self.model.width(&fit.p).powi(2);
            fit.p[0] < transmission * flat.area && variance > narrowed * flat.moments[0]
        })
    }

    /// Unknowns from which on descents may end elsewhere: the lowest of a grid of places and blurs.
    fn starts(&self, known: Known<'_>) -> Vec<Unknowns> {
        let own = self.model.own_variances()[0];
        let of_flat = known.answer().map(|flat| flat.moments[0] - own);
        let blur = of_flat.unwrap_or(known.blur).max(self.least[0]);
        let [low, high] = self.values.points.ends()[0];
        let range = self.model.period().unwrap_or(high - low);
        let first = f64::midpoint(low, high) - 0.5 * range;
        let (weights, mut tables) = (vec![1.0; self.values.values.len()], Tables::default());
        let mut at = |place: u32, blur: f64| {
            let x = first + range * (f64::from(place) + 0.5) / f64::from(PLACES);
            let p = self.linear(of_slits([1.0, x, blur, self.values.range[0]]));
            (self.normal(&p, &weights, &mut tables).1, p)
        };
        let mut lowest = Vec::new();
        for times in BLURS {
            let row: Vec<(f64, Unknowns)> = (0..PLACES).map(|k| at(k, times * blur)).collect();
            let count = row.len();
            let is_lowest = |k: &usize| {
                let [before, after] = [(k + count - 1) % count, (k + 1) % count];
                row[*k].0 <= row[before].0.min(row[after].0) && row[*k].1[0] > 0.0
            };
            lowest.extend((0..count).filter(is_lowest).map(|k| row[k]));
        }
        lowest.sort_by(|a, b| a.0.total_cmp(&b.0));
        lowest.into_iter().take(STARTS).map(|(_, p)| p).collect()
    }
}

/// Flags of the place of a curve that repeats: a centre far from the flat's, or outside of the scan but for a whole period,
/// is as well a period off, and is not extrapolated.
pub(super) fn of_period(model: &Model, curve: &Curve, flat: Option<&Curve>, ends: [f64; 2]) -> u32 {
    let Some(period) = model.period() else { return curve.flags };
    let [low, high] = ends;
    let centre = curve.centre[0];
    let nearest = |from: f64| from + libm::remainder(centre - from, period);
    let within = nearest(f64::midpoint(low, high));
    let is_repeated = curve.flags & flags::OUTSIDE != 0 && within >= low && within <= high;
    let is_far = flat
        .filter(|flat| flat.has_answer())
        .is_some_and(|flat| (centre - flat.centre[0]).abs() > FAR * period);
    match is_repeated || is_far {
        true => curve.flags & !flags::OUTSIDE | flags::DOUBTFUL,
        false => curve.flags,
    }
}
