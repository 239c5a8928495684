//! Least distance of a tube in its place from other surfaces, in f64. Its bore is no part of it: what
//! lies in the bore lies apart from it.

use glam::{DVec2, DVec3};
use std::f64::consts::TAU;

use crate::analytic::{AnalyticShape, Tube};
use crate::convex::separation;

/// Angles at which the search for the least distance begins.
const STARTS: u32 = 64;
/// Narrowings of an interval between three of them: to 1e-10 of it.
const NARROWINGS: usize = 48;

/// A tube in its place, about a point near it.
#[derive(Clone, Copy)]
pub(super) struct Pipe {
    pub(super) centre: DVec3,
    /// Axes of its frame; the last one is along it.
    pub(super) axes: [DVec3; 3],
    pub(super) size: Tube,
}

impl Pipe {
    fn own(&self, point: DVec3) -> DVec3 {
        let off = point - self.centre;
        DVec3::from_array(self.axes.map(|axis| axis.dot(off)))
    }

    fn world_direction(&self, v: DVec3) -> DVec3 {
        v.x * self.axes[0] + v.y * self.axes[1] + v.z * self.axes[2]
    }

    /// The point of the cylinder around it that is farthest along a direction.
    pub(super) fn support(&self, direction: DVec3) -> DVec3 {
        let own = DVec3::from_array(self.axes.map(|axis| axis.dot(direction)));
        self.centre + self.world_direction(AnalyticShape::Tube(self.size).support(own))
    }

    /// The point of it that is nearest to a point.
    pub(super) fn nearest(&self, point: DVec3) -> DVec3 {
        let Tube { outer, inner, half_height } = self.size;
        let own = self.own(point);
        let across = own.truncate().length();
        let flat = own.truncate().normalize_or(DVec2::X) * across.clamp(inner, outer);
        self.centre + self.world_direction(flat.extend(own.z.clamp(-half_height, half_height)))
    }

    /// Distance of a triangle that lies in the bore, m; `None` for others.
    pub(super) fn width_around(&self, corners: [DVec3; 3]) -> Option<f64> {
        let width = |corner: &DVec3| {
            let own = self.own(*corner);
            let width = self.size.inner - own.truncate().length();
            (width > 0.0 && own.z.abs() <= self.size.half_height).then_some(width)
        };
        let widths: Option<Vec<f64>> = corners.iter().map(width).collect();
        widths?.into_iter().min_by(f64::total_cmp)
    }

    /// Distance from a convex set, m; `None` if they intersect.
    pub(super) fn gap_to_set(&self, set: impl Fn(DVec3) -> DVec3) -> Option<f64> {
        // In the mouth of the bore there is nothing of the tube.
        if let Some((width, at)) = separation(|along| self.support(along), &set)
            && self.own(at).truncate().length() >= self.size.inner
        {
            return Some(width);
        }
        // From the section of the wall at an angle, which is a rectangle.
        let Tube { outer, inner, half_height } = self.size;
        let to_section = |angle: f64| {
            let (sin, cos) = angle.sin_cos();
            let out = cos * self.axes[0] + sin * self.axes[1];
            let section = |along: DVec3| {
                let across = if out.dot(along) > 0.0 { outer } else { inner };
                self.centre
                    + across * out
                    + half_height.copysign(self.axes[2].dot(along)) * self.axes[2]
            };
            separation(section, &set).map_or(0.0, |it| it.0)
        };
        around(to_section).filter(|width| *width > 0.0)
    }

    /// Distance from another tube, m; `None` if they intersect or are links of a chain. If the mouths of
    /// their bores face each other it may be less than the distance.
    pub(super) fn distance(&self, other: &Self) -> Option<f64> {
        let hulls = [self, other].map(|it| move |along| it.support(along));
        // One of them lies outside the cylinder around the other, or in its bore.
        let both = [self.gap_to_set(hulls[1]), other.gap_to_set(hulls[0])];
        both.into_iter().flatten().max_by(f64::total_cmp)
    }
}

/// The least of distances at angles around an axis, m.
fn around(at: impl Fn(f64) -> f64) -> Option<f64> {
    let step = TAU / f64::from(STARTS);
    let starts: Vec<f64> = (0..STARTS).map(|k| at(f64::from(k) * step)).collect();
    let count = starts.len();
    let is_least = |k: &usize| {
        let [before, here, after] = [k + count - 1, *k, k + 1].map(|it| starts[it % count]);
        here <= before && here <= after
    };
    let found = (0..count)
        .filter(is_least)
        .map(|k| at(lowest(&at, [k as f64 - 1.0, k as f64 + 1.0], step)));
    found.min_by(f64::total_cmp)
}

/// Where a function of one minimum is least in an interval, by golden sections; the interval in
/// steps.
fn lowest(of: impl Fn(f64) -> f64, interval: [f64; 2], step: f64) -> f64 {
    let golden = (5.0_f64.sqrt() - 1.0) / 2.0;
    let [mut low, mut high] = interval.map(|it| it * step);
    let mut inner = [high - golden * (high - low), low + golden * (high - low)];
    let mut values = inner.map(&of);
    for _ in 0..NARROWINGS {
        if values[0] <= values[1] {
            high = inner[1];
            inner = [high - golden * (high - low), inner[0]];
            values = [of(inner[0]), values[0]];
        } else {
            low = inner[0];
            inner = [inner[1], low + golden * (high - low)];
            values = [values[1], of(inner[1])];
        }
    }
    low.midpoint(high)
}
