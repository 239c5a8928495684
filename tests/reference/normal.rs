//! The normal distribution in f64, from its series and continued fraction.

use std::f64::consts::{PI, SQRT_2};

/// Standard deviation of a Gaussian of unit full width at half maximum.
pub const SIGMA_PER_FWHM: f64 = 0.424_660_900_144_009_5;

/// Density of the standard normal.
pub fn density(v: f64) -> f64 {
    (-0.5 * v * v).exp() / (2.0 * PI).sqrt()
}

/// Distribution function of the standard normal.
pub fn cumulative(v: f64) -> f64 {
    0.5 * complementary_error(-v / SQRT_2)
}

/// Quantile of the standard normal by bisection; `p` in (0, 1).
pub fn quantile(p: f64) -> f64 {
    let (mut low, mut high) = (-9.0, 9.0);
    for _ in 0..70 {
        let middle = 0.5 * (low + high);
        if cumulative(middle) < p { low = middle } else { high = middle }
    }
    0.5 * (low + high)
}

/// erfc to about 1e-15; 0 below 1e-44.
fn complementary_error(x: f64) -> f64 {
    if x > 10.0 {
        return 0.0;
    }
    if x < 0.0 {
        return 2.0 - complementary_error(-x);
    }
    if x < 2.5 {
        // erf x = 2/sqrt(pi) e^{-x^2} sum of 2^k x^{2k+1} / (2k+1)!!
        let (mut term, mut sum, mut k) = (x, x, 0.0);
        while term > 1e-18 * sum {
            k += 1.0;
            term *= 2.0 * x * x / (2.0 * k + 1.0);
            sum += term;
        }
        return 1.0 - 2.0 / PI.sqrt() * (-x * x).exp() * sum;
    }
    // erfc x = e^{-x^2}/sqrt(pi) / (x + (1/2)/(x + (2/2)/(x + ...))): 38 terms reach 2e-16 at 2.5.
    let mut tail = x;
    for k in (1..=40).rev() {
        tail = x + 0.5 * f64::from(k) / tail;
    }
    (-x * x).exp() / PI.sqrt() / tail
}

/// Nodes and weights (sum 1) of a fine trapezoid over a Gaussian of standard deviation
/// `sigma`, to `reach` sigmas on either side. One node where `sigma` is 0.
pub fn nodes(sigma: f64, count: usize, reach: f64) -> Vec<(f64, f64)> {
    if sigma <= 0.0 || count <= 1 {
        return vec![(0.0, 1.0)];
    }
    let step = 2.0 * reach / (count - 1) as f64;
    let at: Vec<f64> = (0..count).map(|i| -reach + step * i as f64).collect();
    let total: f64 = at.iter().map(|&v| density(v)).sum();
    at.into_iter().map(|v| (v * sigma, density(v) / total)).collect()
}
