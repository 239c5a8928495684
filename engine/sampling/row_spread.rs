//! How the light of a cell spreads over its row and the two beside it, blurred by the spot.

use crate::interface::RayResult;
use crate::numbers::single;
use std::f64::consts::{PI, SQRT_2};

impl RayResult {
    /// Displacement along z on the detector, m; `gap`: from analyser to detector, m.
    pub(super) fn landing_z(&self, gap: f32) -> f32 {
        self.displacement_z + gap * self.slope_z
    }
}

/// Light of an interval of a row (coordinates in rows, downwards, 0..1 inside the row).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct RowSpread {
    /// Standard deviation of the blur, rows.
    pub(super) blur: f64,
}

impl RowSpread {
    /// Shares that land in the row above and in the row below, or `None` where light lands
    /// farther off. `shift` is downwards.
    pub(super) fn shares(self, top: f64, bottom: f64, shift: f64) -> Option<[f32; 2]> {
        let (low, high) = (top + shift, bottom + shift);
        let reach = 6.0 * self.blur;
        if low - reach < -1.0 || high + reach > 2.0 {
            return None;
        }
        let above = self.share_below(0.0, low, high);
        let below = 1.0 - self.share_below(1.0, low, high);
        Some([single(above), single(below)])
    }

    /// Share of light spread evenly over [low, high] and blurred that lies before `e`.
    fn share_below(self, e: f64, low: f64, high: f64) -> f64 {
        if self.blur <= 0.0 {
            return ((e - low) / (high - low)).clamp(0.0, 1.0);
        }
        let (near, far) = ((e - high) / self.blur, (e - low) / self.blur);
        (ramp(far) - ramp(near)) / (far - near)
    }
}

/// Antiderivative of the normal distribution function: t Phi(t) + phi(t).
fn ramp(t: f64) -> f64 {
    if t > 8.0 {
        return t;
    }
    if t < -8.0 {
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
