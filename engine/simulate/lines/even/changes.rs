//! Changes of light between evenly spread rays, and the error that follows.

use crate::lines::line::PER_JUMP;

/// Mean squares of changes of the light at one mask step.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Changes {
    /// To the next ray, weighted by the squares of areas; and to the one after it.
    pub(super) squares: [f64; 2],
    /// Weights of both.
    pub(super) weights: [f64; 2],
    /// Squares of all areas.
    pub(super) areas: f64,
}

impl Changes {
    /// Error of the light.
    pub(super) fn error(&self) -> f64 {
        let least = PER_JUMP * PER_JUMP;
        let [near, growth] = self.near_and_growth();
        (self.areas * near * (least + (0.5 - least) * (2.0 - growth))).sqrt()
    }

    /// Mean square of the change to the next ray, and how much more that to the one after it is: 2 where jumps are
    /// few, 1 where nothing is resolved.
    fn near_and_growth(&self) -> [f64; 2] {
        let [near, far] = [0, 1].map(|it| self.squares[it] / self.weights[it]);
        if near > 0.0 && far.is_finite() {
            [near, (far / near).clamp(1.0, 2.0)]
        } else {
            [if near > 0.0 { near } else { 0.0 }, 1.0]
        }
    }

    /// Factor by which the number of rays has to grow for an error that is smaller by the factor `less`. The square of
    /// the error is inverse to the number of rays, and proportional to the mean square of the change from one to the
    /// next.
    pub(super) fn times(&self, less: f64) -> f64 {
        let [_, growth] = self.near_and_growth();
        less.powf(2.0 / (1.0 + growth.log2()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Changes between `count` values, all of one area.
    fn changes(count: u32, value: impl Fn(u32) -> f64) -> Changes {
        let squares = |apart: u32| -> f64 {
            (0..count - apart).map(|i| (value(i + apart) - value(i)).powi(2)).sum()
        };
        Changes {
            squares: [squares(1), squares(2)],
            weights: [f64::from(count - 1), f64::from(count - 2)],
            areas: f64::from(count),
        }
    }

    #[test]
    fn error_is_that_of_a_jump_between_two_rays_and_that_of_samples() {
        let close = |got: f64, want: f64| assert!((got / want - 1.0).abs() < 0.05, "{got} {want}");
        // Anywhere between two of 100 rays: a share of one area, spread evenly.
        let jump = changes(100, |i| f64::from(u8::from(i > 30)));
        close(jump.error(), (1.0_f64 / 12.0).sqrt());
        close(jump.times(3.0), 3.0);
        // Values of 0 and 1 by chance have a variance of 1/4 each.
        let random = |i: u32| f64::from(i.wrapping_mul(0x9e37_79b9).reverse_bits() >> 7 & 1);
        let hashed = |i: u32| random(i.wrapping_mul(0x85eb_ca6b) ^ (i << 13 | i >> 3));
        let samples = changes(40_000, hashed);
        close(samples.error(), 0.5 * 200.0);
        close(samples.times(3.0), 9.0);
        assert_eq!(changes(10, |_| 1.0).error().to_bits(), 0.0_f64.to_bits());
    }
}
