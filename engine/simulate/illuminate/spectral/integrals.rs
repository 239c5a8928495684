//! Straight lines closest to piecewise linear functions.

/// Integrals of a piecewise linear function over a run, x from its low end.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Integrals {
    value: f64,
    times_x: f64,
    square: f64,
}

impl Integrals {
    pub(super) fn add(&mut self, [a, b]: [f64; 2], [at_a, at_b]: [f64; 2]) {
        let width = b - a;
        self.value += width * 0.5 * (at_a + at_b);
        self.times_x += width / 6.0 * (2.0 * a * at_a + a * at_b + b * at_a + 2.0 * b * at_b);
        self.square += width / 3.0 * (at_a * at_a + at_a * at_b + at_b * at_b);
    }

    /// Ends of the straight line closest over [0, width], and the mean square that it leaves.
    pub(super) fn line(&self, width: f64) -> ([f64; 2], f64) {
        let mean = self.value / width;
        let rise = 12.0 * (self.times_x - 0.5 * width * self.value) / (width * width);
        let left = self.square / width - mean * mean - rise * rise / 12.0;
        ([mean - 0.5 * rise, mean + 0.5 * rise], left.max(0.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_run_of_one_line_is_that_line_and_steps_leave_their_variance() {
        let mut sum = Integrals::default();
        for (a, b) in [(0.0, 0.5), (0.5, 0.6), (0.6, 2.0)] {
            sum.add([a, b], [2.0 * a + 1.0, 2.0 * b + 1.0]);
        }
        let ([low, high], left) = sum.line(2.0);
        assert!((low - 1.0).abs() < 1e-12 && (high - 5.0).abs() < 1e-12, "{low} {high}");
        assert!(left < 1e-12, "{left}");

        // A step of height 1 in the middle: the closest line rises by 1.5 and leaves 1/16.
        let mut sum = Integrals::default();
        sum.add([0.0, 1.0], [0.0, 0.0]);
        sum.add([1.0, 2.0], [1.0, 1.0]);
        let ([low, high], left) = sum.line(2.0);
        assert!((high - low - 1.5).abs() < 1e-12, "{low} {high}");
        assert!((left - 1.0 / 16.0).abs() < 1e-12, "{left}");
    }
}
