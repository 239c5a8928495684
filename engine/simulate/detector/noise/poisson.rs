//! Exact draws of the Poisson and the gamma distribution at any mean.

#![allow(clippy::float_cmp, reason = "counts are whole numbers held in f64")]

use beamlet_core::random::Draws;

/// Means below are drawn by inversion.
const SMALL: f64 = 10.0;

/// A Poisson number of this mean, up to about 1e12.
pub(super) fn poisson(mean: f64, draws: &mut Draws) -> f64 {
    if mean.is_nan() || mean <= 0.0 {
        return 0.0;
    }
    if mean < SMALL { inversion(mean, draws) } else { rejection(mean, draws) }
}

/// Sums the distribution until it passes a random number.
fn inversion(mean: f64, draws: &mut Draws) -> f64 {
    let mut left = draws.uniform();
    let mut term = libm::exp(-mean);
    let mut count = 0.0;
    while left > term && count < 200.0 {
        left -= term;
        count += 1.0;
        term *= mean / count;
    }
    count
}

/// Transformed rejection with a squeeze: PTRS of Hoermann 1993, "The transformed rejection method
/// for generating Poisson random variables".
fn rejection(mean: f64, draws: &mut Draws) -> f64 {
    let root = mean.sqrt();
    let b = 0.931 + 2.53 * root;
    let a = -0.059 + 0.024_83 * b;
    let inverse_alpha = 1.1239 + 1.1328 / (b - 3.4);
    let squeeze = 0.9277 - 3.6224 / (b - 2.0);
    loop {
        let [u, v] = draws.pair();
        let u = u - 0.5;
        let edge = 0.5 - u.abs();
        let count = ((2.0 * a / edge + b) * u + mean + 0.43).floor();
        if edge >= 0.07 && v <= squeeze {
            return count;
        }
        if count < 0.0 || (edge < 0.013 && v > edge) {
            continue;
        }
        let hat = libm::log(v * inverse_alpha / (a / (edge * edge) + b));
        if hat <= log_probability(count, mean) {
            return count;
        }
    }
}

/// Logarithm of the Poisson probability, without the cancellation of large terms (Loader 2000,
/// "Fast and accurate computation of binomial probabilities").
fn log_probability(count: f64, mean: f64) -> f64 {
    if count == 0.0 {
        return -mean;
    }
    -stirling_error(count) - deviance(count, mean) - 0.5 * libm::log(std::f64::consts::TAU * count)
}

/// ln n! less Stirling's formula.
fn stirling_error(n: f64) -> f64 {
    if n < 16.0 {
        let half_log_tau = 0.918_938_533_204_672_7;
        return libm::lgamma(n + 1.0) - (n + 0.5) * libm::log(n) + n - half_log_tau;
    }
    let square = n * n;
    (1.0 / 12.0 - (1.0 / 360.0 - (1.0 / 1260.0 - 1.0 / 1680.0 / square) / square) / square) / n
}

/// x ln(x / mean) + mean - x.
fn deviance(x: f64, mean: f64) -> f64 {
    let difference = x - mean;
    if difference.abs() >= 0.1 * (x + mean) {
        return x * libm::log(x / mean) - difference;
    }
    let ratio = difference / (x + mean);
    let mut sum = difference * ratio;
    let mut power = 2.0 * x * ratio;
    for odd in (3..).step_by(2) {
        power *= ratio * ratio;
        let next = sum + power / f64::from(odd);
        if next == sum {
            break;
        }
        sum = next;
    }
    sum
}

/// A gamma number of this shape and scale 1 (Marsaglia and Tsang 2000, "A simple method for
/// generating gamma variables").
pub(super) fn gamma(shape: f64, draws: &mut Draws) -> f64 {
    if shape.is_nan() || shape <= 0.0 {
        return 0.0;
    }
    if shape < 1.0 {
        let power = libm::pow(draws.uniform(), 1.0 / shape);
        return gamma(shape + 1.0, draws) * power;
    }
    let d = shape - 1.0 / 3.0;
    let c = 1.0 / (9.0 * d).sqrt();
    loop {
        let x = draws.normal();
        let root = 1.0 + c * x;
        if root <= 0.0 {
            continue;
        }
        let v = root * root * root;
        let u = draws.uniform();
        // A squeeze that spares the logarithms nearly always.
        if u < 1.0 - 0.0331 * x * x * x * x
            || libm::log(u) < 0.5 * x * x + d - d * v + d * libm::log(v)
        {
            return d * v;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use beamlet_core::numbers::whole;

    /// Bins of counts of draws against the exact probabilities: the sum of squares over
    /// expected numbers is chi-squared, held to 5 of its standard deviations.
    fn chi_squared(mean: f64) -> [f64; 2] {
        let draws = 200_000_u32;
        let low = (mean - 4.0 * mean.sqrt()).floor().max(0.0);
        let bins = whole::<usize>((8.0 * mean.sqrt()).ceil()) + 3;
        let mut found = vec![0.0; bins];
        for place in 0..draws {
            let count = poisson(mean, &mut Draws::new(7, [place, 0, 0], 1));
            let bin = whole::<usize>((count - low + 1.0).clamp(0.0, bins as f64 - 1.0));
            found[bin] += 1.0;
        }
        let probability = |bin: usize| libm::exp(log_probability(low + bin as f64 - 1.0, mean));
        let mut wanted: Vec<f64> =
            (0..bins).map(|b| if b == 0 { 0.0 } else { probability(b) }).collect();
        let below: f64 =
            (0..whole::<usize>(low)).map(|k| libm::exp(log_probability(k as f64, mean))).sum();
        wanted[0] = below;
        wanted[bins - 1] = 1.0 - wanted[..bins - 1].iter().sum::<f64>();
        let (mut sum, mut freedom) = (0.0, -1.0);
        let (mut pool, mut pooled) = (0.0, 0.0);
        for (found, wanted) in found.iter().zip(&wanted) {
            pool += found;
            pooled += wanted * f64::from(draws);
            // Bins of few are pooled with their neighbours: chi-squared is meant for many.
            if pooled >= 10.0 {
                sum += (pool - pooled) * (pool - pooled) / pooled;
                freedom += 1.0;
                (pool, pooled) = (0.0, 0.0);
            }
        }
        [sum, freedom]
    }

    #[test]
    fn draws_have_the_poisson_distribution() {
        for mean in [0.02, 0.5, 3.0, 9.99, 10.01, 25.0, 300.0, 5000.0] {
            let [sum, freedom] = chi_squared(mean);
            let score = (sum - freedom) / (2.0 * freedom.max(1.0)).sqrt();
            assert!(score < 5.0, "mean {mean}: chi-squared {sum} of {freedom}");
        }
    }

    #[test]
    fn probabilities_sum_to_one_at_large_means() {
        for mean in [1e6_f64, 1e9, 1e12] {
            let middle = mean.floor();
            // Within 8 deviations, in 4001 trapezoids.
            let step = (16.0 * mean.sqrt() / 4000.0).round().max(1.0);
            let sum: f64 = (-2000..=2000)
                .map(|i| step * libm::exp(log_probability(middle + step * f64::from(i), mean)))
                .sum();
            assert!((sum - 1.0).abs() < 1e-6, "mean {mean}: {sum}");
        }
    }

    #[test]
    fn gamma_numbers_have_mean_and_variance_of_their_shape() {
        for shape in [0.1, 0.7, 1.0, 4.0, 1000.0] {
            let n = 200_000_u32;
            let all: Vec<f64> =
                (0..n).map(|i| gamma(shape, &mut Draws::new(3, [i, 1, 0], 2))).collect();
            let count = f64::from(n);
            let mean = all.iter().sum::<f64>() / count;
            let variance = all.iter().map(|g| (g - mean) * (g - mean)).sum::<f64>() / count;
            // Variance of the sample variance: (kurtosis - 1) shape^2 / n, kurtosis 3 + 6 / shape.
            let scores = [
                (mean - shape) / (shape / count).sqrt(),
                (variance - shape) / (shape * ((2.0 + 6.0 / shape) / count).sqrt()),
            ];
            assert!(scores.iter().all(|s| s.abs() < 4.5), "shape {shape}: {scores:?}");
        }
    }
}
