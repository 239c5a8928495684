//! Least distance of placed surfaces from each other and from triangles, in f64.

use glam::DVec3;

use super::pipe::Pipe;
use super::{Place, Prototype};
use crate::analytic::{AnalyticShape, Form, Tube};
use crate::convex::separation;

/// A surface in its place.
#[derive(Clone, Copy)]
pub(super) struct Standing<'a> {
    pub(super) prototype: &'a Prototype,
    pub(super) place: &'a Place,
}

/// An analytic shape in its place, about a point near it.
#[derive(Clone, Copy)]
pub(super) enum PlacedShape<'a> {
    Convex(AnalyticShape, &'a Place, DVec3),
    Pipe(Pipe),
}

impl Standing<'_> {
    /// Least distance of an analytic surface from triangles; `None` if unknown: if it intersects one,
    /// lies in it, or is a mesh.
    pub(super) fn clearance(&self, others: &[[DVec3; 3]]) -> Option<f64> {
        let about = self.place.position;
        let solid = self.solid(about)?;
        others.iter().try_fold(f64::INFINITY, |least, corners| {
            let corners = corners.map(|it| it - about);
            if solid.is_surely_beyond(corners, least) {
                return Some(least);
            }
            Some(least.min(solid.gap_to_triangle(corners)?))
        })
    }

    /// The same from another analytic surface.
    pub(super) fn clearance_of(&self, other: &Self) -> Option<f64> {
        let about = self.place.position;
        self.solid(about)?.distance(&other.solid(about)?)
    }

    /// Its exact surface; `None` for a mesh.
    fn solid(&self, about: DVec3) -> Option<PlacedShape<'_>> {
        let shape = self.prototype.shape?;
        let scale = self.place.scale;
        let centre = self.place.position - about;
        Some(match shape.form() {
            Form::Tube(it) => {
                let half_height = it.half_height * scale * self.place.stretch;
                let size = Tube { outer: it.outer * scale, inner: it.inner * scale, half_height };
                let axes = [DVec3::X, DVec3::Y, DVec3::Z].map(|it| self.place.rotation * it);
                PlacedShape::Pipe(Pipe { centre, axes, size })
            }
            Form::Frustum(_) | Form::Ellipsoid(_) => PlacedShape::Convex(shape, self.place, centre),
        })
    }
}

impl PlacedShape<'_> {
    /// The point of a convex solid that is farthest along a direction.
    fn support(&self, direction: DVec3) -> DVec3 {
        match self {
            Self::Convex(shape, place, centre) => {
                let linear = place.linear();
                linear * shape.support(linear.transpose() * direction) + *centre
            }
            Self::Pipe(pipe) => pipe.support(direction),
        }
    }

    fn distance(&self, other: &Self) -> Option<f64> {
        match (self, other) {
            (Self::Pipe(pipe), Self::Pipe(other)) => pipe.distance(other),
            (Self::Pipe(pipe), convex) | (convex, Self::Pipe(pipe)) => {
                pipe.gap_to_set(|along| convex.support(along))
            }
            (convex, other) => convex.gap_to_set(|along| other.support(along)),
        }
    }

    /// Distance of a convex solid from another convex set.
    fn gap_to_set(&self, set: impl Fn(DVec3) -> DVec3) -> Option<f64> {
        separation(|along| self.support(along), set).map(|it| it.0)
    }

    /// True if a triangle is farther away than a limit, m, by its size and one point of it: asked of shapes
    /// alone from which the distance takes long.
    fn is_surely_beyond(&self, corners: [DVec3; 3], limit: f64) -> bool {
        let Self::Pipe(pipe) = self else { return false };
        let middle = (corners[0] + corners[1] + corners[2]) / 3.0;
        let reach = corners.iter().map(|it| it.distance(middle)).fold(0.0, f64::max);
        pipe.nearest(middle).distance(middle) - reach > limit
    }

    fn gap_to_triangle(&self, corners: [DVec3; 3]) -> Option<f64> {
        let farthest = |along: DVec3| {
            let [a, b, c] = corners.map(|it| it.dot(along));
            corners[if a >= b && a >= c {
                0
            } else if b >= c {
                1
            } else {
                2
            }]
        };
        match self {
            Self::Pipe(pipe) => pipe.width_around(corners).or_else(|| pipe.gap_to_set(farthest)),
            Self::Convex(..) => self.gap_to_set(farthest),
        }
    }
}
