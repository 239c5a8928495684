//! Weights of views and columns: views over a whole turn see each line twice, views over less share it by
//! Parker's weights.

use super::geometry::ScanGeometry;
use crate::{Error, Result};
use std::f64::consts::{FRAC_PI_4, PI, TAU};

/// Weights of lines; the weights of a line and its conjugate sum to 1.
#[derive(Debug)]
pub(super) struct Redundancy {
    /// Angle that each view stands for, rad.
    shares: Vec<f64>,
    /// Angle of each view from the beginning of a short scan; `None` for a whole turn.
    since: Option<Vec<f64>>,
    /// Half of the angle by which a short scan exceeds half a turn.
    excess: f64,
    per_distance: f64,
    /// Fan angle of the axis of rotation.
    axis_angle: f64,
}

impl Redundancy {
    /// # Errors
    /// [`Error::Argument`] for views that do not serve: less than half a turn and the fan, more than
    /// a turn, or a gap in between.
    pub(super) fn of(geometry: &ScanGeometry) -> Result<Self> {
        let angles = &geometry.angles;
        let mut order: Vec<usize> = (0..angles.len()).collect();
        order.sort_by(|a, b| angles[*a].total_cmp(&angles[*b]));
        let gaps: Vec<f64> =
            order.windows(2).map(|pair| angles[pair[1]] - angles[pair[0]]).collect();
        let mut sorted = gaps.clone();
        sorted.sort_by(f64::total_cmp);
        let (step, largest) = (sorted[sorted.len() / 2], sorted[sorted.len() - 1]);
        let [first, last] = [order[0], order[order.len() - 1]].map(|view| angles[view]);
        let span = last - first + step;
        let wrong = |found: String, allowed: String| Err(Error::argument("angles", found, allowed));
        if step <= 0.0 || largest > 5.0 * step {
            let found = format!("a gap of {:.3}°", largest.to_degrees());
            let allowed = format!("at most five times the usual {:.3}°", step.to_degrees());
            return wrong(found, allowed);
        }
        if span > TAU + step / 2.0 {
            let found = format!("views over {:.2}°", span.to_degrees());
            return wrong(found, "at most a turn".into());
        }
        let is_turn = span > TAU - step / 2.0;
        let per_distance = geometry.per_distance();
        let axis_angle = libm::atan(geometry.axis * per_distance);
        let mut made = Self {
            shares: vec![0.0; angles.len()],
            since: None,
            excess: (span - PI) / 2.0,
            per_distance,
            axis_angle,
        };
        let around = if is_turn { TAU - (last - first) } else { step };
        for (n, view) in order.iter().enumerate() {
            let before = if n == 0 { around } else { gaps[n - 1] };
            made.shares[*view] = f64::midpoint(before, *gaps.get(n).unwrap_or(&around));
        }
        if !is_turn {
            let scale = geometry.magnification();
            let [left, right] = [geometry.columns[0], geometry.columns[geometry.columns.len() - 1]]
                .map(|place| made.fan_angle(place / scale).abs());
            let fan = left.max(right);
            if made.excess < fan - step / 4.0 {
                let found = format!("views over {:.2}°", span.to_degrees());
                let needed = (PI + 2.0 * fan).to_degrees();
                return wrong(found, format!("at least {needed:.2}°: half a turn and the fan"));
            }
            made.excess = made.excess.max(fan);
            let start = first - step / 2.0;
            made.since = Some(angles.iter().map(|angle| angle - start).collect());
        }
        Ok(made)
    }

    /// Views over a whole turn.
    pub(super) const fn is_turn(&self) -> bool {
        self.since.is_none()
    }

    /// Angle between the line through `u` on the virtual detector and that through the axis.
    fn fan_angle(&self, u: f64) -> f64 {
        libm::atan(u * self.per_distance) - self.axis_angle
    }

    /// Angle that a view stands for at `u` on the virtual detector, m: its share times the weight.
    pub(super) fn angle(&self, view: usize, u: f64) -> f64 {
        let Some(since) = &self.since else { return self.shares[view] / 2.0 };
        let (b, q, g) = (since[view], -self.fan_angle(u), self.excess);
        let half = |ratio: f64| {
            let sine = libm::sin(FRAC_PI_4 * ratio.clamp(0.0, 2.0));
            sine * sine
        };
        let weight = if b < 2.0 * (g - q) {
            half(b / (g - q))
        } else if b > PI - 2.0 * q {
            half((PI + 2.0 * g - b) / (g + q).max(f64::MIN_POSITIVE))
        } else {
            1.0
        };
        self.shares[view] * weight
    }
}
