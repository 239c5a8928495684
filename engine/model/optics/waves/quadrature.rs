//! Quadrature of functions with square-root ends.

use glam::DVec2;
use std::f64::consts::FRAC_PI_2;

/// End of the variable t, where the weights are 1e-16 of the greatest.
const LAST: f64 = 3.2;

/// ∫ f dx over [low, high] by `points` midpoints of t in x = middle + half tanh(π/2 sinh t): the error falls
/// exponentially with the points, with square roots at the ends too.
pub(super) fn between([low, high]: [f64; 2], points: usize, f: impl Fn(f64) -> DVec2) -> DVec2 {
    if high <= low {
        return DVec2::ZERO;
    }
    let (middle, half) = (f64::midpoint(low, high), 0.5 * (high - low));
    let step = 2.0 * LAST / points as f64;
    let value = |at: usize| {
        let t = step * (at as f64 + 0.5) - LAST;
        let inner = FRAC_PI_2 * libm::sinh(t);
        let weight = FRAC_PI_2 * libm::cosh(t) / libm::cosh(inner).powi(2);
        f(middle + half * libm::tanh(inner)) * weight
    };
    (0..points).map(value).sum::<DVec2>() * (half * step)
}

/// As [`between`], over the pieces of an interval between places where the function has kinks.
pub(super) fn pieces(
    [low, high]: [f64; 2],
    kinks: &[f64],
    points: usize,
    f: impl Fn(f64) -> DVec2 + Copy,
) -> DVec2 {
    let mut ends: Vec<f64> = kinks.iter().copied().filter(|at| *at > low && *at < high).collect();
    ends.extend([low, high]);
    ends.sort_by(f64::total_cmp);
    ends.windows(2).map(|pair| between([pair[0], pair[1]], points, f)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// ∫ √(1 − x²) dx = π/2, and ∫ cos(20x) dx = sin(20)/10.
    #[test]
    fn square_roots_and_waves_are_integrated_within_1e_12() {
        let root = between([-1.0, 1.0], 64, |x| DVec2::new((1.0 - x * x).max(0.0).sqrt(), 0.0));
        assert!((root.x - FRAC_PI_2).abs() < 1e-12, "{root}");
        let wave = pieces([-1.0, 1.0], &[0.3], 96, |x| DVec2::new(libm::cos(20.0 * x), 0.0));
        assert!((wave.x - 0.1 * libm::sin(20.0)).abs() < 1e-12, "{wave}");
    }
}
