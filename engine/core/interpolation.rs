//! Interpolation in tables.

/// Value at `x` on the straight line through two points (x, y) in the logarithms of both; beyond
/// them the line goes on. All are above zero.
pub fn log_log(x: f64, low: [f64; 2], high: [f64; 2]) -> f64 {
    // Where both points are one, every line goes through it.
    let t = if low[0] < high[0] { (x / low[0]).ln() / (high[0] / low[0]).ln() } else { 0.0 };
    low[1] * (high[1] / low[1]).powf(t)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn powers_are_met_everywhere_and_points_exactly() {
        let cube = |x: f64| 5.0 / (x * x * x);
        let [low, high] = [10.0, 20.0].map(|x| [x, cube(x)]);
        for x in [5.0, 10.0, 13.0, 20.0, 40.0] {
            assert!((log_log(x, low, high) / cube(x) - 1.0).abs() < 1e-14, "{x}");
        }
        assert_eq!(log_log(10.0, low, low).to_bits(), cube(10.0).to_bits());
    }
}
