//! How the light of a cell spreads over its row and the two beside it, blurred by the spot.

use beamlet_core::numbers::single;
use beamlet_interface::NO_LIGHT;
use std::f64::consts::{PI, SQRT_2};

/// Distance from which on integrals of a blur are those of a sharp border, standard deviations: over intervals of 1/65536
/// row, a second integral that ended at 6 would be 3e-5 off.
const SHARP: f64 = 8.0;

/// Light of an interval of a row (coordinates in rows, downwards, 0..1 inside the row).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct RowSpread {
    /// Standard deviation of the blur, rows.
    pub(super) blur: f64,
}

/// Change of the density of light over an interval, relative to its mean density, where the optical depth
/// rises by `rise` over it: of the line with the same centroid.
pub(crate) fn tilt_by_depth(rise: f64) -> f64 {
    let half = 0.5 * rise;
    let langevin = if half.abs() < 1e-2 { half / 3.0 } else { 1.0 / libm::tanh(half) - 1.0 / half };
    // A tilt moves the centroid of an interval by a twelfth of its height.
    -6.0 * langevin
}

impl RowSpread {
    /// Distance over which the blur takes light, rows.
    pub(super) fn reach(self) -> f64 {
        NO_LIGHT * self.blur
    }

    /// True if the blur takes light of every interval beyond the rows beside.
    pub(super) fn is_wide(self) -> bool {
        self.reach() > 1.0
    }

    /// True if all light of an interval of a row lands in the row and the two beside it.
    pub(super) fn lands_beside(self, low: f64, high: f64) -> bool {
        let reach = self.reach();
        !self.is_wide() && low - reach >= -1.0 && high + reach <= 2.0
    }

    /// Shares that land in the row above and in the row below, or `None` where light lands
    /// farther off. `shift` is downwards.
    pub(super) fn shares(self, top: f64, bottom: f64, shift: f64) -> Option<[f32; 2]> {
        let (low, high) = (top + shift, bottom + shift);
        if !self.lands_beside(low, high) {
            return None;
        }
        let above = self.share_below(0.0, low, high);
        let below = 1.0 - self.share_below(1.0, low, high);
        Some([single(above), single(below)])
    }

    /// Share of light spread evenly over [low, high] and blurred that lies before `e`.
    pub(super) fn share_below(self, e: f64, low: f64, high: f64) -> f64 {
        if self.blur <= 0.0 {
            return ((e - low) / (high - low)).clamp(0.0, 1.0);
        }
        let (near, far) = ((e - high) / self.blur, (e - low) / self.blur);
        (ramp(far) - ramp(near)) / (far - near)
    }
}

/// Light that is linear along z.
impl RowSpread {
    /// Integrals over [low, high] of light that falls from 1 to 0 and of light that rises from 0 to 1, times its
    /// share before `e`: by parts, of the first two antiderivatives of the normal distribution function.
    pub(super) fn linear_below(self, e: f64, [low, high]: [f64; 2]) -> [f64; 2] {
        // A point spot has a sharp border.
        let blur = self.blur.max(1e-9);
        let [from, to] = [low, high].map(|end| antiderivatives((e - end) / blur));
        let whole = blur * (from[0] - to[0]);
        let rises = blur * blur * (from[1] - to[1]) / (high - low) - blur * to[0];
        [whole - rises, rises]
    }
}

/// The normal distribution function.
pub(super) fn normal_share(t: f64) -> f64 {
    0.5 * libm::erfc(-t / SQRT_2)
}

/// The first two antiderivatives of the normal distribution function that vanish far below.
fn antiderivatives(t: f64) -> [f64; 2] {
    if t < -SHARP {
        return [0.0; 2];
    }
    let (share, density) = if t > SHARP {
        (1.0, 0.0)
    } else {
        (normal_share(t), libm::exp(-0.5 * t * t) / (2.0 * PI).sqrt())
    };
    [t * share + density, 0.5 * ((t * t + 1.0) * share + t * density)]
}

/// Antiderivative of the normal distribution function: t Phi(t) + phi(t).
fn ramp(t: f64) -> f64 {
    if t > SHARP {
        return t;
    }
    if t < -SHARP {
        return 0.0;
    }
    // Most light is hardly moved in z: the series is exact to 1e-13 there, and much faster.
    if t.abs() < 0.05 {
        let t2 = t * t;
        let even = 1.0 + t2 * (0.5 - t2 * (1.0 / 24.0 - t2 / 240.0));
        return 0.5 * t + even / (2.0 * PI).sqrt();
    }
    0.5 * t * libm::erfc(-t / SQRT_2) + libm::exp(-0.5 * t * t) / (2.0 * PI).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_series_of_the_ramp_is_its_closed_form() {
        for t in [-0.0499, -1e-3, 0.0, 1e-9, 0.02, 0.0499] {
            let closed =
                0.5 * t * libm::erfc(-t / SQRT_2) + libm::exp(-0.5 * t * t) / (2.0 * PI).sqrt();
            assert!((ramp(t) - closed).abs() < 1e-13, "{t}");
        }
    }

    /// Ramps of light over intervals of any height, blurred by 0 to 1 row, against sums of 1e4 lines.
    #[test]
    fn linear_light_before_a_border_is_the_integral_over_its_lines() {
        for blur in [0.0, 1e-3, 0.1, 0.4, 1.0] {
            let spread = RowSpread { blur };
            for (e, ends) in
                [(0.0, [0.0, 0.5]), (1.0, [0.2, 0.9]), (0.3, [0.25, 0.31]), (2.0, [0.0, 1.0])]
            {
                let height = (ends[1] - ends[0]) / 1e4;
                let mut sums = [0.0; 2];
                for line in 0..10_000 {
                    let share = (f64::from(line) + 0.5) / 1e4;
                    let z = ends[0] + share * (ends[1] - ends[0]);
                    let before = normal_share((e - z) / blur.max(1e-12)) * height;
                    sums[0] += (1.0 - share) * before;
                    sums[1] += share * before;
                }
                let got = spread.linear_below(e, ends);
                for (got, sum) in got.into_iter().zip(sums) {
                    // A sharp border divides a line.
                    assert!((got - sum).abs() < 3e-6, "{blur} {e} {ends:?}: {got} {sum}");
                }
            }
        }
    }

    #[test]
    fn a_whole_row_loses_the_same_share_on_both_sides() {
        let spread = RowSpread { blur: 0.036 };
        let [above, below] = spread.shares(0.0, 1.0, 0.0).unwrap();
        // Each edge loses blur / sqrt(2 pi).
        let lost = 0.036 / (2.0 * PI).sqrt();
        assert!((f64::from(above) - lost).abs() < 1e-8 && (f64::from(below) - lost).abs() < 1e-8);
        assert!(spread.shares(0.0, 1.0, 1.5).is_none());
    }
}
