//! Weights of views and columns: views over a whole turn see each line twice, but for lines that pass
//! beyond the shorter side of the detector (half-fan); views over less share it by Parker's weights. Views of
//! one direction share its weight: repeated exposures, both ends of a turn, several turns.

use super::geometry::ScanGeometry;
use beamlet_core::numbers::whole;
use beamlet_core::{Error, Result};
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
/// Angle up to which views have one direction, rad.
const SAME: f64 = 1e-6;
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

/// Directions of views, ascending.
struct Circle {
    /// Angle of the first, rad.
    first: f64,
    /// Views of each direction.
    views: Vec<Vec<usize>>,
    /// Angles from a direction to the next, rad.
    gaps: Vec<f64>,
    /// Median of the gaps.
    step: f64,
    /// Angle from the first to the last, rad.
    width: f64,
}

impl Circle {
    /// Views by their directions.
    fn of(angles: &[f64]) -> Self {
        Self::sorted(angles.iter().copied().zip(0..).collect())
    }

    /// Views over more than a turn by their directions in one.
    fn of_one_turn(angles: &[f64]) -> Self {
        let first = angles.iter().copied().fold(f64::INFINITY, f64::min);
        let wrapped = angles.iter().map(|angle| {
            let turned = (angle - first).rem_euclid(TAU);
            first + if TAU - turned < SAME { 0.0 } else { turned }
        });
        Self::sorted(wrapped.zip(0..).collect())
    }

    /// Views with their angles.
    fn sorted(mut angles: Vec<(f64, usize)>) -> Self {
        angles.sort_by(|a, b| a.0.total_cmp(&b.0));
        let (first, mut last) = (angles[0].0, angles[0].0);
        let (mut views, mut gaps) = (vec![vec![angles[0].1]], Vec::new());
        for (angle, view) in &angles[1..] {
            match views.last_mut() {
                Some(of_last) if angle - last <= SAME => of_last.push(*view),
                _ => {
                    gaps.push(angle - last);
                    views.push(vec![*view]);
                    last = *angle;
                }
            }
        }
        let mut ascending = gaps.clone();
        ascending.sort_by(f64::total_cmp);
        let step = ascending.get(ascending.len() / 2).copied().unwrap_or_default();
        Self { first, views, gaps, step, width: last - first }
    }

    /// Angle that the views cover, rad.
    fn span(&self) -> f64 {
        self.width + self.step
    }

    /// True if the last view has the direction of the first, or is beyond it.
    fn is_more_than_a_turn(&self) -> bool {
        self.width > TAU - SAME
    }

    /// Angle that each view stands for, rad.
    fn shares(&self, is_turn: bool) -> Vec<f64> {
        let around = if is_turn { TAU - self.width } else { self.step };
        let mut shares = vec![0.0; self.views.iter().map(Vec::len).sum()];
        for (n, views) in self.views.iter().enumerate() {
            let before = if n == 0 { around } else { self.gaps[n - 1] };
            let share = f64::midpoint(before, *self.gaps.get(n).unwrap_or(&around));
            views.iter().for_each(|view| shares[*view] = share / views.len() as f64);
        }
        shares
    }
}

impl Redundancy {
    /// # Errors
    /// [`Error::Argument`] for views that do not serve: no circle, less than half a turn and the fan, or a gap
    /// in between.
    pub(super) fn of(geometry: &ScanGeometry) -> Result<Self> {
        geometry.require_circle("fbp")?;
        let angles = &geometry.angles;
        let mut circle = Circle::of(angles);
        let (step, span) = (circle.step, circle.span());
        let wrong = |found: String, allowed: String| {
            let allowed = format!("{allowed}; the methods cgls and sirt take any views");
            Err(Error::argument("angles", found, allowed))
        };
        if circle.is_more_than_a_turn() {
            circle = Circle::of_one_turn(angles);
        }
        let largest = circle.gaps.iter().copied().fold(0.0, f64::max);
        if circle.step <= 0.0 || largest > 5.0 * circle.step {
            let found = format!("a gap of {:.3}°", largest.to_degrees());
            let allowed = format!("at most five times the usual {:.3}°", circle.step.to_degrees());
            return wrong(found, allowed);
        }
        let is_turn = span > TAU - step / 2.0;
        let per_distance = geometry.per_distance();
        let axis_angle = libm::atan(geometry.axis * per_distance);
        let mut made = Self {
            shares: circle.shares(is_turn),
            since: None,
            excess: (span - PI) / 2.0,
            per_distance,
            axis: geometry.axis,
            axis_angle,
            half_fan: None,
        };
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
            let start = circle.first - step / 2.0;
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
    /// Number of views of a circle that repeat the direction of another: 1 for angles from 0° to 360° with both
    /// ends, half of the views for two exposures at each angle. [`fbp`](super::fbp()) lets them share its weight.
    #[must_use]
    pub fn repeated_views(&self) -> usize {
        if self.motions.is_some() || self.angles.is_empty() {
            return 0;
        }
        self.angles.len() - Circle::of_one_turn(&self.angles).views.len()
    }

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

#[cfg(test)]
mod tests {
    use super::*;

    /// The angle from the last view on to the first counts where it differs from the step of the others.
    #[test]
    fn views_over_a_turn_share_the_whole_turn() {
        let step = TAU / 40.25;
        let angles: Vec<f64> = (0..40).map(|view| f64::from(view) * step).collect();
        let shares = Circle::of(&angles).shares(true);
        assert!((shares.iter().sum::<f64>() - TAU).abs() < 1e-12, "{shares:?}");
        for view in [0, 39] {
            assert!((shares[view] - 1.125 * step).abs() < 1e-12, "{shares:?}");
        }
    }
}
