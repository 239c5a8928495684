//! Weights of views and columns: views over a whole turn see each line twice, but for lines that pass
//! beyond the shorter side of the detector (half-fan); views over less share it by Parker's weights.

use super::geometry::ScanGeometry;
use crate::numbers::whole;
use crate::{Error, Result};
use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI, TAU};

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
    /// x of the axis of rotation, and its fan angle.
    axis: f64,
    axis_angle: f64,
    half_fan: Option<HalfFan>,
}

/// A whole turn of views with the axis beside the middle of the detector.
#[derive(Debug, Clone, Copy)]
struct HalfFan {
    /// 1 where columns reach farther at greater u, −1 where at smaller u.
    sign: f64,
    /// Distance of the shorter side from the axis, as [`Redundancy::beside`].
    short: f64,
    /// Weights go from 0 to ½ and from ½ to 1 over this distance at either border of what is seen twice.
    ramp: f64,
}

/// Distance of the axis from the middle of the detector from which on a scan over a whole turn is taken
/// for a half-fan, as a share of the width.
const HALF_FAN: f64 = 0.1;
/// Least ramp of a half-fan, as a share of its shorter side.
const RAMP: f64 = 0.25;

impl HalfFan {
    fn weight(self, beside: f64) -> f64 {
        let from_axis = self.sign * beside;
        let way = ((self.short - from_axis.abs()) / self.ramp).clamp(0.0, 1.0);
        let sine = libm::sin(FRAC_PI_2 * way);
        let single = 0.5 - 0.5 * sine * sine;
        0.5 + if from_axis < 0.0 { -single } else { single }
    }
}

impl Redundancy {
    /// # Errors
    /// [`Error::Argument`] for views that do not serve: no circle, less than half a turn and the fan, more than
    /// a turn, or a gap in between.
    pub(super) fn of(geometry: &ScanGeometry) -> Result<Self> {
        geometry.require_circle("fbp")?;
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
            axis: geometry.axis,
            axis_angle,
            half_fan: None,
        };
        let around = if is_turn { TAU - (last - first) } else { step };
        for (n, view) in order.iter().enumerate() {
            let before = if n == 0 { around } else { gaps[n - 1] };
            made.shares[*view] = f64::midpoint(before, *gaps.get(n).unwrap_or(&around));
        }
        if is_turn {
            made.half_fan = made.half_fan(geometry)?;
        } else {
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

    /// # Errors
    /// [`Error::Argument`] where the axis of rotation is beyond the detector.
    fn half_fan(&self, geometry: &ScanGeometry) -> Result<Option<HalfFan>> {
        let Some([sign, short, long]) = self.sides(geometry)? else { return Ok(None) };
        let ramp = (long - short).clamp(RAMP * short, short);
        Ok(Some(HalfFan { sign, short, ramp }))
    }

    /// Side of the detector that is farther from the axis, and the distances of the nearer and the farther
    /// side; `None` where they are alike to a column.
    fn sides(&self, geometry: &ScanGeometry) -> Result<Option<[f64; 3]>> {
        let scale = geometry.magnification();
        let [first, last] = [geometry.columns[0], geometry.columns[geometry.columns.len() - 1]]
            .map(|place| self.beside(place / scale));
        if first >= 0.0 || last <= 0.0 {
            let found = format!("the axis of rotation in column {:.2}", geometry.axis_column());
            let allowed = format!("an axis between columns 0 and {}", geometry.columns.len() - 1);
            return Err(Error::argument("axis", found, allowed));
        }
        let column = (last - first) / (geometry.columns.len() - 1) as f64;
        let [left, right] = [-first, last];
        Ok(match (right - left).abs() > column {
            true if right > left => Some([1.0, left, right]),
            true => Some([-1.0, right, left]),
            false => None,
        })
    }

    /// Distance of the line through `u` from the axis, of which the conjugate line has the opposite: the
    /// fan angle, in parallel beams a length.
    fn beside(&self, u: f64) -> f64 {
        if self.per_distance == 0.0 { u - self.axis } else { self.fan_angle(u) }
    }

    /// Columns of this distance, `first` at their lowest, to be added below and above `count` of them, so
    /// that a half-fan reaches as far on its shorter side: filtered rows go on there.
    pub(super) fn missing(
        &self,
        geometry: &ScanGeometry,
        [first, pitch]: [f64; 2],
        count: usize,
    ) -> [usize; 2] {
        let Some(half) = self.half_fan else { return [0; 2] };
        let scale = geometry.magnification();
        let ends = [first, first + (count - 1) as f64 * pitch].map(|place| place / scale);
        // The place whose line is as far on the other side.
        let other = |u: f64| match self.per_distance {
            0.0 => 2.0 * self.axis - u,
            per => libm::tan(self.axis_angle - self.fan_angle(u)) / per,
        };
        let columns = |way: f64| whole::<usize>((way * scale / pitch).ceil().max(0.0));
        match half.sign > 0.0 {
            true => [columns(ends[0] - other(ends[1])), 0],
            false => [0, columns(other(ends[0]) - ends[1])],
        }
    }

    /// Angle between the line through `u` on the virtual detector and that through the axis.
    fn fan_angle(&self, u: f64) -> f64 {
        libm::atan(u * self.per_distance) - self.axis_angle
    }

    /// Angle that a view stands for at `u` on the virtual detector, m: its share times the weight.
    pub(super) fn angle(&self, view: usize, u: f64) -> f64 {
        let Some(since) = &self.since else {
            let weight = self.half_fan.map_or(0.5, |half| half.weight(self.beside(u)));
            return self.shares[view] * weight;
        };
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

impl ScanGeometry {
    /// Columns of a detector that were as wide to either side of the axis as to the longer one, in a whole
    /// turn with the axis a tenth of the detector or more beside its middle; 0 in other scans.
    pub(super) fn columns_of_half_fan(&self) -> usize {
        let last = self.columns.len() - 1;
        // By the mean distance of the columns.
        let axis = (self.axis * self.magnification() - self.columns[0]) / self.column_pitch();
        let from_middle = (axis - last as f64 / 2.0).abs();
        let is_turn = self.motions.is_none() && Redundancy::of(self).is_ok_and(|all| all.is_turn());
        if !is_turn || from_middle < HALF_FAN * self.columns.len() as f64 {
            return 0;
        }
        self.columns.len() + whole::<usize>((2.0 * from_middle).ceil())
    }
}
