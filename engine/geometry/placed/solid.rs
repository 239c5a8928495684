//! A closed surface in its place: what it contains, its facets, and its least distance from others in f64.

use glam::DVec3;

use super::pipe::Pipe;
use super::{Place, Prototype};
use crate::Component;
use crate::analytic::{AnalyticShape, Form, Tube};
use crate::convex::separation;
use crate::surface::{bounds_of, corners_of};

/// A prototype in a place: the exact surface of a shape, or a mesh.
#[derive(Clone, Copy)]
pub(super) struct Solid<'a> {
    /// Its object, by the order of the scene.
    pub(super) object: u32,
    pub(super) prototype: &'a Prototype,
    pub(super) place: &'a Place,
}

/// An analytic shape in its place, about a point near it.
#[derive(Clone, Copy)]
enum PlacedShape<'a> {
    Convex(AnalyticShape, &'a Place, DVec3),
    Pipe(Pipe),
}

impl<'a> Solid<'a> {
    /// True if a point of the world lies in it.
    pub(super) fn contains(&self, point: DVec3) -> bool {
        self.prototype.contains(self.place.own_from_world(point))
    }

    /// True if it is an exact shape.
    pub(super) const fn is_exact(&self) -> bool {
        self.prototype.shape.is_some()
    }

    pub(super) fn is_convex(&self) -> bool {
        self.prototype.shape.is_some_and(AnalyticShape::is_convex)
    }

    /// Corners of its triangles in the world, m.
    pub(super) fn facets(&self) -> impl Iterator<Item = [DVec3; 3]> {
        let own = (0..self.prototype.triangles.len()).map(|it| self.prototype.corners(it));
        own.map(|corners| corners.map(|corner| self.place.world_from_own(corner)))
    }

    /// How far its facets are off its surface at most, m.
    pub(super) fn facet_error(&self) -> f64 {
        self.prototype.error() * self.place.largest_scale()
    }

    /// It with other facets, if there are some.
    pub(super) fn with_facets<'b>(self, prototype: Option<&'b Prototype>) -> Solid<'b>
    where
        'a: 'b,
    {
        Solid { prototype: prototype.unwrap_or(self.prototype), ..self }
    }

    /// A point of its surface.
    pub(super) fn point(&self) -> DVec3 {
        self.place.world_from_own(self.prototype.corners(0)[0])
    }

    /// A point of each of its components.
    pub(super) fn starts(&self) -> impl Iterator<Item = DVec3> {
        self.prototype.starts().map(|start| self.place.world_from_own(start))
    }

    /// A box that lies in the box around any solid that contains it: around itself for a shape, and around some
    /// points of it for a mesh. Boxes of turned boxes are larger, and may reach out of the other solid.
    pub(super) fn core(&self) -> [DVec3; 2] {
        let axes = [DVec3::X, DVec3::Y, DVec3::Z];
        match self.prototype.shape {
            Some(shape) => {
                let linear = self.place.linear();
                let farthest = |along: DVec3| shape.support(linear.transpose() * along);
                let points = axes.into_iter().flat_map(|axis| [farthest(axis), farthest(-axis)]);
                bounds_of(points.map(|point| self.place.world_from_own(point)))
            }
            None => {
                let vertices = self.prototype.extremes().iter();
                bounds_of(vertices.map(|vertex| self.place.world_from_own(*vertex)))
            }
        }
    }

    /// Its components; `outside`: the object around it.
    pub(super) fn components(self, outside: Option<u32>) -> impl Iterator<Item = Component> {
        let Self { object, prototype, place } = self;
        prototype.components.iter().zip(prototype.areas(place)).map(move |(own, area)| Component {
            object,
            outside,
            volume: own.volume * place.volume(),
            area,
            bounds: place.bounds(corners_of(own)).map(Into::into),
            lids: own.lids.and_then(|lids| place.lids(lids)),
            ..Component::default()
        })
    }

    /// Least distance of an exact shape from triangles; `None` if unknown: if it intersects one, lies in it, or is
    /// a mesh.
    pub(super) fn clearance(&self, others: &[[DVec3; 3]]) -> Option<f64> {
        let about = self.place.position;
        let shape = self.shape(about)?;
        others.iter().try_fold(f64::INFINITY, |least, corners| {
            let corners = corners.map(|it| it - about);
            if shape.is_surely_beyond(corners, least) {
                return Some(least);
            }
            Some(least.min(shape.gap_to_triangle(corners)?))
        })
    }

    /// The same from another exact shape.
    pub(super) fn clearance_of(&self, other: &Self) -> Option<f64> {
        let about = self.place.position;
        self.shape(about)?.distance(&other.shape(about)?)
    }

    /// Its exact surface; `None` for a mesh.
    fn shape(&self, about: DVec3) -> Option<PlacedShape<'_>> {
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
