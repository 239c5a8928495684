//! Curve of the slits of two masks over the offsets of the sample mask, as a Fourier series.

use beamlet_core::numbers::whole;
use beamlet_model::optics::Optics;
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;

/// Least standard deviation of the blur of a fit, as a part of half the base of the narrowest curve.
const LEAST_BLUR: f64 = 0.02;
/// Exponent of a Gaussian beyond which an order is nothing in frames of f32: e^-20 is 2e-9.
const NOTHING: f64 = 20.0;
/// Points that are evaluated together.
const LANES: usize = 4;

/// Curve of unit area for each slit of the sample mask, about the centroid of the first one, without the blur of the
/// narrowest part of the spot. Lengths are in the plane of the sample mask, m.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct MaskCurve {
    /// Length after which the curve repeats: of all shifts.
    period: f64,
    /// Coefficients of cosine and sine by order, from 1 on.
    orders: Vec<[f64; 2]>,
    /// Variance without the blur of the narrowest part of the spot.
    variance: f64,
    /// Least variance of the blur.
    least: f64,
    /// Standard deviation of the blur of the narrowest part of the spot.
    blur: f64,
    /// From the own slit of a column of a group to its place in the curve of all slits; empty without shifts.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    columns: Vec<f64>,
}

/// Overlap of two slits, or a part of the focal spot: a share of the light and its place.
struct Term {
    share: f64,
    place: f64,
    /// Widths of two boxes.
    boxes: [f64; 2],
    /// Variance beyond the variance of the narrowest part.
    variance: f64,
}

impl MaskCurve {
    /// The curve of a set-up; `None` without two masks.
    pub(super) fn of(optics: &Optics) -> Option<Self> {
        let (first, second) = (optics.sample_mask.as_ref()?, optics.detector_mask.as_ref()?);
        let [seen, own] = [first, second].map(|mask| mask.without_shifts(optics.analyser));
        let magnification = optics.analyser / first.distance();
        let width = |[low, high]: [f64; 2]| (high - low) / magnification;
        let middle = |[low, high]: [f64; 2]| f64::midpoint(low, high) / magnification;
        // Overlaps of a slit of each mask: a slit on the right lies before the other at an offset to the left.
        let pair = |a: [f64; 2], b: [f64; 2]| Term {
            share: width(a) * width(b),
            place: middle(b) - middle(a),
            boxes: [width(a), width(b)],
            variance: 0.0,
        };
        let pairs: Vec<Term> =
            seen.ends().flat_map(|a| own.ends().map(move |b| pair(a, b))).collect();
        let parts = optics.spot.placed();
        let scale = (magnification - 1.0) / magnification;
        let variances: Vec<f64> =
            parts.iter().map(|part| (scale * part.deviation[0]).powi(2)).collect();
        let narrowest = variances.iter().copied().fold(f64::INFINITY, f64::min);
        let parts: Vec<Term> = parts
            .iter()
            .zip(variances)
            .map(|(part, variance)| Term {
                share: part.share,
                place: scale * part.offset[0],
                boxes: [0.0; 2],
                variance: variance - narrowest,
            })
            .collect();
        let period = seen.period[0] / magnification;
        let own = first.shifts().iter().zip(0..);
        let slits = own.map(|(shift, k)| f64::from(k) * period + shift - first.shifts()[0]);
        Some(Self::new(period, slits.collect(), [pairs, parts], narrowest.sqrt()))
    }

    /// The curve of overlaps and parts of the spot. `period`: of a mask without shifts; `slits`: places of the slits of
    /// successive periods from the first one, none without shifts; `blur`: standard deviation of the narrowest part.
    fn new(period: f64, slits: Vec<f64>, [pairs, parts]: [Vec<Term>; 2], blur: f64) -> Self {
        let period = period * slits.len().max(1) as f64;
        // A slit on the right lies before the other mask's at an offset to the left.
        let columns: Vec<f64> = slits.iter().map(|slit| -slit).collect();
        let base = pairs.iter().map(|pair| 0.5 * (pair.boxes[0] + pair.boxes[1]));
        let least = (LEAST_BLUR * base.fold(f64::INFINITY, f64::min)).powi(2);
        let highest = (NOTHING / (2.0 * least)).sqrt() * period / PI;
        let [pairs, parts] = [centred(pairs), centred(parts)];
        let orders = (1..=whole::<u32>(highest.ceil()).max(1)).map(|order| {
            let frequency = f64::from(order) / period;
            let [a, b] = [&pairs, &parts].map(|terms| coefficient(terms, frequency));
            let one = [a[0] * b[0] - a[1] * b[1], a[0] * b[1] + a[1] * b[0]];
            let all = if columns.is_empty() { one } else { repeated(one, &columns, frequency) };
            all.map(|part| 2.0 * part / period)
        });
        let orders = orders.collect();
        let variance = [&pairs, &parts].into_iter().flatten().map(Term::second_moment).sum();
        Self { period, orders, variance, least, blur, columns }
    }

    /// Columns after which the slits repeat: 1 without shifts.
    #[must_use]
    pub fn repeats(&self) -> usize {
        self.columns.len().max(1)
    }

    /// From a place about the own slit of the value of this index to its place in the curve. Values are those of the
    /// columns of a group, step after step.
    #[must_use]
    pub fn to_slit(&self, value: usize) -> f64 {
        self.columns.get(value % self.repeats()).copied().unwrap_or(0.0)
    }

    /// Mean over a period, 1/m.
    #[must_use]
    pub fn mean(&self) -> f64 {
        self.repeats() as f64 / self.period
    }

    /// Value at a place from the centre of a curve of this standard deviation, over the value at the centre.
    #[must_use]
    pub fn relative(&self, place: f64, width: f64) -> f64 {
        let variance = (width * width - self.variance).max(self.least);
        let values = self.evaluate([place, 0.0].into_iter(), variance);
        values[0][0] / values[1][0]
    }

    /// Length after which the curve repeats, m: of all shifts of the sample mask.
    #[must_use]
    pub const fn period(&self) -> f64 {
        self.period
    }

    /// Coefficients of cosine and sine of the places by order, from 1 on, for a blur of variance 0 and an area of 1 for
    /// each slit, 1/m. A blur of variance v multiplies order k by exp(-2 (pi k/period)^2 v).
    #[must_use]
    pub fn orders(&self) -> &[[f64; 2]] {
        &self.orders
    }

    /// Variance of the curve without the blur of the narrowest part of the spot.
    #[must_use]
    pub const fn variance(&self) -> f64 {
        self.variance
    }

    /// Least variance of the blur of a fit.
    pub(super) const fn least(&self) -> f64 {
        self.least
    }

    /// Variance of the blur by the geometry.
    pub(super) fn spread(&self) -> f64 {
        self.blur.powi(2).max(self.least)
    }

    /// Values, slopes by place and slopes by the variance of the blur at places about the centre.
    pub(super) fn evaluate(
        &self,
        places: impl Iterator<Item = f64>,
        variance: f64,
    ) -> Vec<[f64; 3]> {
        let turn = 2.0 * PI / self.period;
        let rate = 0.5 * turn * turn;
        // e^(-rate v k^2), by its ratios from order to order.
        let first = (-rate * variance).exp();
        let (mut factor, mut ratio) = (first, first * first * first);
        let last = (NOTHING / (rate * variance)).sqrt();
        let count = whole::<usize>(last.ceil()).clamp(1, self.orders.len());
        let weights: Vec<[f64; 2]> = self.orders[..count]
            .iter()
            .map(|[even, odd]| {
                let of_order = [factor * even, factor * odd];
                factor *= ratio;
                ratio *= first * first;
                of_order
            })
            .collect();
        let angles: Vec<f64> = places.map(|place| turn * place).collect();
        let mut out = Vec::with_capacity(angles.len());
        for angles in angles.chunks(LANES) {
            let mut lanes = [0.0; LANES];
            lanes[..angles.len()].copy_from_slice(angles);
            let sums = series(&weights, lanes);
            let of_lane = |at: usize| {
                let [value, slope, curvature] = sums.map(|sum| sum[at]);
                [self.mean() + value, -turn * slope, -rate * curvature]
            };
            out.extend((0..angles.len()).map(of_lane));
        }
        out
    }
}

impl Term {
    /// Share times second moment about the centroid of the curve.
    fn second_moment(&self) -> f64 {
        let [a, b] = self.boxes;
        self.share * (self.place * self.place + (a * a + b * b) / 12.0 + self.variance)
    }
}

/// Terms with shares of one, about their centroid.
fn centred(mut terms: Vec<Term>) -> Vec<Term> {
    let all: f64 = terms.iter().map(|term| term.share).sum();
    terms.iter_mut().for_each(|term| term.share /= all);
    let centroid: f64 = terms.iter().map(|term| term.share * term.place).sum();
    terms.iter_mut().for_each(|term| term.place -= centroid);
    terms
}

/// Integral of the terms times the cosine and the sine of a frequency, 1/m.
fn coefficient(terms: &[Term], frequency: f64) -> [f64; 2] {
    let turn = 2.0 * PI * frequency;
    terms.iter().fold([0.0; 2], |[even, odd], term| {
        let boxes: f64 = term.boxes.iter().map(|width| sinc(0.5 * turn * width)).product();
        let size = term.share * boxes * (-0.5 * turn * turn * term.variance).exp();
        let (sin, cos) = (turn * term.place).sin_cos();
        [even + size * cos, odd + size * sin]
    })
}

/// Coefficients of a sum of curves at these places, of the coefficients of one of them.
fn repeated([even, odd]: [f64; 2], places: &[f64], frequency: f64) -> [f64; 2] {
    let turns = places.iter().map(|place| (2.0 * PI * frequency * place).sin_cos());
    let [sin, cos] = turns.fold([0.0; 2], |[s, c], (sin, cos)| [s + sin, c + cos]);
    [even * cos - odd * sin, even * sin + odd * cos]
}

/// Sine of x over x.
fn sinc(x: f64) -> f64 {
    if x.abs() < 1e-4 { 1.0 - x * x / 6.0 } else { x.sin() / x }
}

/// Sums over orders k at angles: of the terms, of k times their slopes, and of k squared times the terms.
fn series(weights: &[[f64; 2]], angles: [f64; LANES]) -> [[f64; LANES]; 3] {
    let [sin, cos] = [angles.map(f64::sin), angles.map(f64::cos)];
    let [mut s, mut c] = [sin, cos];
    let mut sums = [[0.0; LANES]; 3];
    let mut order = 1.0;
    for [even, odd] in weights {
        for i in 0..LANES {
            let term = even * c[i] + odd * s[i];
            sums[0][i] += term;
            sums[1][i] += order * (even * s[i] - odd * c[i]);
            sums[2][i] += order * order * term;
            let next = c[i] * cos[i] - s[i] * sin[i];
            s[i] = s[i] * cos[i] + c[i] * sin[i];
            c[i] = next;
        }
        order += 1.0;
    }
    sums
}

#[cfg(test)]
mod tests {
    use super::*;
    use libm::erf;

    fn term(share: f64, place: f64, boxes: [f64; 2], variance: f64) -> Term {
        Term { share, place, boxes, variance }
    }

    /// Two boxes behind a Gaussian of this variance about zero, by their ramps: unit area.
    fn overlap(x: f64, [a, b]: [f64; 2], variance: f64) -> f64 {
        let s = variance.sqrt();
        let ramp = |v: f64| {
            let t = v / s;
            let below = 0.5 * (1.0 + erf(t / 2.0_f64.sqrt()));
            v * below + s * (-0.5 * t * t).exp() / (2.0 * PI).sqrt()
        };
        let [sum, difference] = [0.5 * (a + b), 0.5 * (a - b)];
        (ramp(x + sum) - ramp(x + difference) - ramp(x - difference) + ramp(x - sum)) / (a * b)
    }

    /// The series against the closed form of every pair of slits and part of the spot, periods on either side
    /// included: 2e-8 of the peak, the orders that are left out. Slopes against central differences.
    #[test]
    fn series_is_the_sum_of_the_overlaps() {
        let period = 100e-6;
        let pairs = || {
            vec![
                term(400.0, 0.0, [20e-6, 20e-6], 0.0),
                term(120.0, 31e-6, [12e-6, 10e-6], 0.0),
                term(300.0, -22e-6, [15e-6, 20e-6], 0.0),
            ]
        };
        let parts = || vec![term(0.7, -1e-6, [0.0; 2], 0.0), term(0.3, 4e-6, [0.0; 2], 30e-12)];
        let curve = MaskCurve::new(period, Vec::new(), [pairs(), parts()], 4e-6);
        let [pairs, parts] = [centred(pairs()), centred(parts())];
        let truth = |x: f64, variance: f64| -> f64 {
            let of = |pair: &Term, part: &Term, k: i32| {
                let at = x - pair.place - part.place - f64::from(k) * period;
                pair.share * part.share * overlap(at, pair.boxes, variance + part.variance)
            };
            let periods = (-4..=4).flat_map(|k| parts.iter().map(move |part| (k, part)));
            periods.flat_map(|(k, part)| pairs.iter().map(move |pair| of(pair, part, k))).sum()
        };
        for variance in [curve.spread(), 2e-12, 150e-12, 900e-12] {
            let at = |x: f64, v: f64| curve.evaluate(std::iter::once(x), v)[0];
            let peak = truth(0.0, variance);
            for x in [-61e-6, -23e-6, -7e-6, 0.0, 1e-6, 12e-6, 33e-6, 49e-6] {
                let [value, by_x, by_variance] = at(x, variance);
                let error = (value - truth(x, variance)).abs();
                assert!(error < 2e-8 * peak, "{variance:e} {x:e}: {value} {error:e}");
                let (h, v) = (1e-9, 1e-3 * variance);
                let slope = (at(x + h, variance)[0] - at(x - h, variance)[0]) / (2.0 * h);
                let widened = (at(x, variance + v)[0] - at(x, variance - v)[0]) / (2.0 * v);
                assert!((by_x - slope).abs() < 1e-5 * peak / 20e-6, "{x:e}: {by_x} {slope}");
                assert!((by_variance - widened).abs() < 1e-5 * peak / variance, "{x:e}");
            }
        }
    }

    /// Slits displaced by 0, 8 and -15 um, before three columns: the value of each column is the sum of the overlaps of all
    /// slits where they are, 2e-8 of the peak.
    #[test]
    fn neighbours_of_displaced_slits_add_their_light_from_where_they_are() {
        let (period, shifts, variance) = (100e-6, [0.0, 8e-6, -15e-6], 16e-12);
        let pairs = vec![term(1.0, 0.0, [30e-6, 20e-6], 0.0)];
        let slits: Vec<f64> =
            shifts.iter().zip(0..).map(|(s, k)| f64::from(k) * period + s).collect();
        let parts = vec![term(1.0, 0.0, [0.0; 2], 0.0)];
        let curve = MaskCurve::new(period, slits, [pairs, parts], 4e-6);
        for column in 0..3_i32 {
            for offset in [-52e-6, -40e-6, -10e-6, 0.0, 24e-6, 47e-6] {
                // The slits of periods before and behind the column's, with their own shifts.
                let slit = |k: i32| {
                    let shift = shifts[usize::try_from((column + k).rem_euclid(3)).unwrap()];
                    overlap(offset + f64::from(k) * period + shift, [30e-6, 20e-6], variance)
                };
                let truth: f64 = (-4..=4).map(slit).sum();
                let value = usize::try_from(column).unwrap();
                let place = offset + shifts[value] + curve.to_slit(value + 3);
                let [value, ..] = curve.evaluate(std::iter::once(place), variance)[0];
                let error = (value - truth).abs() * 30e-6;
                assert!(error < 2e-8, "column {column}, {offset:e}: {value} for {truth}");
            }
        }
    }

    /// The variance is the second moment of a curve within its period, less the blur.
    #[test]
    fn variance_is_that_of_the_slits_and_the_parts() {
        let pairs = vec![term(1.0, 0.0, [20e-6, 16e-6], 0.0)];
        let parts = vec![term(0.5, -2e-6, [0.0; 2], 0.0), term(0.5, 2e-6, [0.0; 2], 10e-12)];
        let curve = MaskCurve::new(200e-6, Vec::new(), [pairs, parts], 3e-6);
        let steps = 4000;
        let place = |i: i32| 200e-6 * ((f64::from(i) + 0.5) / f64::from(steps) - 0.5);
        let values = curve.evaluate((0..steps).map(place), 9e-12);
        let step = 200e-6 / f64::from(steps);
        let moment: f64 =
            (0..steps).zip(&values).map(|(i, value)| place(i).powi(2) * value[0] * step).sum();
        let expected = curve.variance() + 9e-12;
        assert!((moment / expected - 1.0).abs() < 1e-6, "{moment:e} {expected:e}");
    }
}
