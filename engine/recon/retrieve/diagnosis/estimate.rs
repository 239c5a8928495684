//! Medians with their uncertainty.

use crate::retrieve::misfit::median;

/// Standard deviation of a normal distribution over its median absolute deviation.
const SIGMA_PER_DEVIATION: f64 = 1.4826;
/// Standard deviation of a median over the deviation of a mean.
const OF_MEDIAN: f64 = 1.2533;

/// A median over pixels.
#[derive(Debug, Clone, Copy)]
pub(super) struct Estimate {
    pub(super) value: f64,
    /// One-sigma uncertainty of the value.
    pub(super) sigma: f64,
    /// Standard deviation of a pixel.
    pub(super) scatter: f64,
}

impl Estimate {
    /// Median of the finite values; `None` with fewer than two.
    pub(super) fn of(values: Vec<f64>) -> Option<Self> {
        let values: Vec<f64> = values.into_iter().filter(|value| value.is_finite()).collect();
        if values.len() < 2 {
            return None;
        }
        let value = median(values.clone())?;
        let deviations = values.iter().map(|other| (other - value).abs()).collect();
        let scatter = SIGMA_PER_DEVIATION * median(deviations)?;
        Some(Self { value, sigma: OF_MEDIAN * scatter / (values.len() as f64).sqrt(), scatter })
    }

    /// True if the value differs from `expected` by more than `sigmas` of its deviations and by more
    /// than `least`.
    pub(super) fn differs(&self, expected: f64, sigmas: f64, least: f64) -> bool {
        (self.value - expected).abs() > (sigmas * self.sigma).max(least)
    }

    /// True if two agree within four of their deviations, or within `slack`.
    pub(super) fn agrees(&self, other: &Self, slack: f64) -> bool {
        (self.value - other.value).abs() <= (4.0 * self.sigma.hypot(other.sigma)).max(slack)
    }
}
