//! Least distance of placed surfaces from each other and from triangles, in f64.

use glam::DVec3;

pub(super) use super::around::Distance;
use super::pipe::Pipe;
use super::{Place, Prototype};
use crate::geometry::analytic::{AnalyticShape, Form, Tube};
use crate::geometry::convex::{Separation, separation};
use crate::geometry::distance::distance;
use crate::geometry::surface::{bounds_of, near};
use crate::geometry::tree::Tree;

/// Triangles or vertices that are gone through one by one.
const FEW: usize = 256;
/// A surface in its place.
#[derive(Clone, Copy)]
pub(super) struct Standing<'a> {
    pub(super) prototype: &'a Prototype,
    pub(super) place: &'a Place,
    /// Over the triangles of the prototype; of meshes alone.
    pub(super) tree: Option<&'a Tree>,
    /// Whether it is the hull of its vertices, which are few.
    pub(super) is_hull: bool,
}

/// An analytic shape in its place, about a point near it.
#[derive(Clone, Copy)]
enum Solid<'a> {
    Convex(AnalyticShape, &'a Place, DVec3),
    Pipe(Pipe),
}

impl Standing<'_> {
    /// Box in the world, m.
    pub(super) fn bounds(&self) -> [DVec3; 2] {
        self.place.bounds(self.prototype.bounds())
    }

    /// Least distance of two surfaces, neither of which lies in the other, where it is within a limit.
    pub(super) fn distance(&self, other: &Self, limit: f64) -> Option<Distance> {
        if !near(self.bounds(), other.bounds(), limit) || self.are_apart(other, limit) {
            return None;
        }
        let about = self.place.position;
        match (self.solid(about), other.solid(about)) {
            (Some(a), Some(b)) => a.distance(&b, limit).map(|(least, at)| (least, at + about)),
            (Some(_), None) => self.gap_to_triangles(&other.triangles(self.bounds(), limit), limit),
            (None, None) if self.is_hull && other.is_hull => {
                match separation(self.hull(about), other.hull(about), limit) {
                    Separation::Apart => None,
                    Separation::Known(least, at) => Some((least, at + about)),
                    Separation::Unclear => {
                        self.gap_to_triangles(&other.triangles(self.bounds(), limit), limit)
                    }
                }
            }
            (None, Some(_)) => {
                other.gap_to_triangles(&self.triangles(other.bounds(), limit), limit)
            }
            (None, None) => self.gap_to_triangles(&other.triangles(self.bounds(), limit), limit),
        }
    }

    /// Least distance from some triangles, where it is within a limit.
    pub(super) fn gap_to_triangles(&self, others: &[[DVec3; 3]], limit: f64) -> Option<Distance> {
        let mut least: Option<Distance> = None;
        let mut take = |found: Option<Distance>| {
            let known = least.map_or(f64::INFINITY, |it| it.0);
            if let Some(found) = found.filter(|it| it.0 < known) {
                least = Some(found);
            }
            least.map_or(limit, |it| it.0)
        };
        let about = self.place.position;
        let reach = limit;
        if let Some(solid) = self.solid(about) {
            let mut limit = limit;
            for corners in others {
                let found = solid.gap_to_triangle(corners.map(|it| it - about), limit);
                limit = take(found.map(|(width, at)| (width, at + about)));
            }
            return least;
        }
        let around = bounds_of(others.iter().flatten().copied());
        let own = self.triangles(around, limit);
        let boxes: Vec<[DVec3; 2]> = own.iter().map(|it| bounds_of(it.iter().copied())).collect();
        let tree = (own.len() > FEW).then(|| Tree::of_boxes(&boxes));
        let mut limit = limit;
        for corners in others {
            let bounds = bounds_of(corners.iter().copied());
            let mut visit = |number: usize| {
                if near(boxes[number], bounds, limit) {
                    let found = distance(*corners, own[number]);
                    limit = take((found.0 <= limit).then_some(found));
                }
            };
            match &tree {
                None => (0..own.len()).for_each(visit),
                Some(tree) => {
                    let wide = [bounds[0] - reach, bounds[1] + reach];
                    tree.within(wide, |number| visit(number as usize));
                }
            }
        }
        least
    }

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
            let found = solid.gap_to_triangle(corners, f64::INFINITY)?;
            Some(least.min(found.0))
        })
    }

    /// The same from another analytic surface.
    pub(super) fn clearance_of(&self, other: &Self) -> Option<f64> {
        let about = self.place.position;
        let both = self.solid(about)?.distance(&other.solid(about)?, f64::INFINITY);
        both.map(|it| it.0)
    }

    /// The vertex that is farthest along a direction, relative to a point.
    fn hull(&self, about: DVec3) -> impl Fn(DVec3) -> DVec3 {
        let (vertices, place) = (&self.prototype.vertices, self.place);
        let (linear, off) = (place.linear(), place.position - about);
        move |along| {
            let own = linear.transpose() * along;
            let farther = |best: (f64, DVec3), vertex: &DVec3| {
                let reach = own.dot(*vertex);
                if reach > best.0 { (reach, *vertex) } else { best }
            };
            let found = vertices.iter().fold((f64::NEG_INFINITY, DVec3::ZERO), farther);
            linear * found.1 + off
        }
    }

    /// Whether a plane across the line between them keeps them apart, as most neighbours are.
    fn are_apart(&self, other: &Self, limit: f64) -> bool {
        let apart = other.place.position - self.place.position;
        let along = apart.normalize_or_zero();
        let reach =
            |it: &Self, along: DVec3| it.prototype.reach(it.place.linear().transpose() * along);
        let is_quick =
            |it: &Self| it.prototype.shape.is_some() || it.prototype.vertices.len() <= FEW;
        is_quick(self)
            && is_quick(other)
            && along != DVec3::ZERO
            && reach(self, along) + reach(other, -along) + limit < along.dot(apart)
    }

    /// Its exact surface; `None` for a mesh.
    fn solid(&self, about: DVec3) -> Option<Solid<'_>> {
        let shape = self.prototype.shape?;
        let scale = self.place.scale;
        let centre = self.place.position - about;
        Some(match shape.form() {
            Form::Tube(it) => {
                let half_height = it.half_height * scale * self.place.stretch;
                let size = Tube { outer: it.outer * scale, inner: it.inner * scale, half_height };
                let axes = [DVec3::X, DVec3::Y, DVec3::Z].map(|it| self.place.rotation * it);
                Solid::Pipe(Pipe { centre, axes, size })
            }
            Form::Frustum(_) | Form::Ellipsoid(_) => Solid::Convex(shape, self.place, centre),
        })
    }

    /// Triangles of a mesh that come within a margin of a box, in the world.
    fn triangles(&self, [low, high]: [DVec3; 2], margin: f64) -> Vec<[DVec3; 3]> {
        let wide = [low - margin, high + margin];
        let corners = (0..8).map(|corner| {
            let of = |bit: usize| wide[(corner >> bit) & 1];
            self.place.own_from_world(DVec3::new(of(0).x, of(1).y, of(2).z))
        });
        let mut found = Vec::new();
        let mut visit = |triangle: u32| {
            let corners = self.prototype.corners(triangle as usize);
            let corners = corners.map(|it| self.place.world_from_own(it));
            if near(bounds_of(corners.into_iter()), wide, 0.0) {
                found.push(corners);
            }
        };
        if let Some(tree) = self.tree {
            tree.within(bounds_of(corners), &mut visit);
        }
        found
    }
}

impl Solid<'_> {
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

    fn distance(&self, other: &Self, limit: f64) -> Option<Distance> {
        match (self, other) {
            (Self::Pipe(pipe), Self::Pipe(other)) => pipe.distance(other, limit),
            (Self::Pipe(pipe), convex) | (convex, Self::Pipe(pipe)) => {
                pipe.gap_to_set(|along| convex.support(along), limit)
            }
            (convex, other) => convex.gap_to_set(|along| other.support(along), limit),
        }
    }

    /// Distance of a convex solid from another convex set.
    fn gap_to_set(&self, set: impl Fn(DVec3) -> DVec3, limit: f64) -> Option<Distance> {
        separation(|along| self.support(along), set, limit).known()
    }

    /// Whether a triangle is farther away than a limit, m, by its size and one point of it: asked of shapes
    /// alone from which the distance takes long.
    fn is_surely_beyond(&self, corners: [DVec3; 3], limit: f64) -> bool {
        let Self::Pipe(pipe) = self else { return false };
        let middle = (corners[0] + corners[1] + corners[2]) / 3.0;
        let reach = corners.iter().map(|it| it.distance(middle)).fold(0.0, f64::max);
        pipe.nearest(middle).distance(middle) - reach > limit
    }

    fn gap_to_triangle(&self, corners: [DVec3; 3], limit: f64) -> Option<Distance> {
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
            Self::Pipe(_) if self.is_surely_beyond(corners, limit) => None,
            Self::Pipe(pipe) => match pipe.width_around(corners) {
                Some(found) => (found.0 <= limit).then_some(found),
                None => pipe.gap_to_set(farthest, limit),
            },
            _ => self.gap_to_set(farthest, limit),
        }
    }
}
