//! Share of the values of a curve that its fit follows.

use super::fitted::FittedCurve;
use crate::retrieve::equations::{Equations, Unknowns};
use crate::retrieve::value_noise::{ValueNoise, Weights};

/// Least expected value, as a part of the amplitude, as in weighted fits.
const LEAST: f64 = 1e-3;

/// A fitted curve at the offsets of a scan.
pub(super) struct Leverage {
    /// Values of the curve.
    pub(super) values: Vec<f64>,
    /// Variance of each value by the noise of photons and of reading.
    pub(super) variances: Vec<f64>,
    /// Slopes of the values by the unknowns.
    pub(super) slopes: Vec<Unknowns>,
    /// Equations without values.
    equations: Equations,
    /// `[i][j]`: change of fitted value i by measured value j.
    hat: Vec<Vec<f64>>,
    weights: Vec<f64>,
}

impl Leverage {
    /// A curve of values with this noise. `None` where the fit is singular.
    pub(super) fn of(curve: &FittedCurve, offsets: &[[f64; 2]], noise: ValueNoise) -> Option<Self> {
        let fitted = curve.at(offsets).into_iter();
        let (values, slopes): (Vec<f64>, Vec<Unknowns>) =
            fitted.map(|[value, slopes @ ..]| (value, slopes)).unzip();
        let (gain, least) = (noise.gain.unwrap_or(1.0), LEAST * curve.amplitude);
        let of_reading = noise.read_noise.powi(2);
        let variances: Vec<f64> = values.iter().map(|y| gain * y.max(least) + of_reading).collect();
        let weights: Vec<f64> = match noise.weights {
            Weights::Poisson => variances.iter().map(|variance| variance.recip()).collect(),
            Weights::None => vec![1.0; values.len()],
        };
        let equations = curve.equations();
        let mut hat = equations.influence(&slopes, &weights)?;
        for row in &mut hat {
            row.iter_mut().zip(&weights).for_each(|(of, weight)| *of *= weight);
        }
        Some(Self { values, variances, slopes, equations, hat, weights })
    }

    /// Sum of weighted squares of residuals, and its expectation by the noise alone. In units of the
    /// weights, so that only their quotient means something.
    pub(super) fn squares(&self, measured: &[f64]) -> [f64; 2] {
        let found = (0..self.values.len())
            .map(|k| self.weights[k] * (measured[k] - self.values[k]).powi(2))
            .sum();
        [found, self.expected()]
    }

    /// Measured values less those of the curve, over a height.
    pub(super) fn residuals(&self, measured: &[f64], height: f64) -> Vec<f64> {
        measured.iter().zip(&self.values).map(|(y, fitted)| (y - fitted) / height).collect()
    }

    /// Expected sum of weighted squares of residuals.
    fn expected(&self) -> f64 {
        let terms = (0..self.values.len())
            .map(|k| self.weights[k] * self.variances[k] * (1.0 - self.hat[k][k]));
        terms.sum()
    }

    /// `(1 - J (JT J)^-1 JT) / variance` for values of one variance, J the slopes: the weights of residuals
    /// that the curve does not follow, whatever the weights of its fit were. `None` where the fit is
    /// singular.
    pub(super) fn remainder(&self, variance: f64) -> Option<Vec<Vec<f64>>> {
        let n = self.slopes.len();
        let hat = self.equations.influence(&self.slopes, &vec![1.0; n])?;
        let of = |i: usize, k: usize| (f64::from(u8::from(i == k)) - hat[i][k]) / variance;
        Some((0..n).map(|i| (0..n).map(|k| of(i, k)).collect()).collect())
    }

    /// Sum of terms, one for each value, by the weights of the fit.
    pub(super) fn weighted(&self, terms: &[f64]) -> f64 {
        self.weights.iter().zip(terms).map(|(weight, term)| weight * term).sum()
    }

    /// Variance of each value times the share of it that the fit does not follow.
    pub(super) fn residual_variances(&self) -> Vec<f64> {
        (0..self.values.len())
            .map(|k| self.variances[k] * (1.0 - self.hat[k][k]).max(0.0))
            .collect()
    }
}
