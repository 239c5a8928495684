//! Whether a solid in its place intersects a body or another solid.

use glam::DVec3;

use super::groups::Boxed;
use super::solid::Solid;
use crate::distance::meet;
use crate::overlap::tolerance;
use crate::surface::{bounds_of, near};
use crate::tree::Tree;

/// Error of the finest facets of a shape that nearly touches another surface, m.
const FINEST: f64 = 1e-9;
/// Share of the limit below which the distance of shapes is nothing but rounding.
const LEAST_CLEARANCE: f64 = 1e-3;

/// Contact of two instances of one object.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Contact {
    Overlap,
    /// The first one lies in the other.
    Inside,
    /// The other way round.
    Around,
}

/// Contact of two instances of one object in their boxes; `None` if they are disjoint, or touch and can stay.
pub(super) fn contact(both: [Solid<'_>; 2], bounds: [[DVec3; 2]; 2]) -> Option<Contact> {
    let limit = tolerance(bounds[0], bounds[1]);
    if are_apart(both, limit) || touch_at_most(both, limit) {
        return None;
    }
    if intersect(both, bounds) {
        return Some(Contact::Overlap);
    }
    let [first, second] = both;
    let found = if second.contains(first.point()) {
        Contact::Inside
    } else if first.contains(second.point()) {
        Contact::Around
    } else {
        return None;
    };
    // Parts of a mesh may lie in another instance, and others of it beside that.
    Some(if first.prototype.components.len() == 1 { found } else { Contact::Overlap })
}

/// True if exact shapes lie apart, or at most twice a limit deep in each other.
pub(super) fn touch_at_most(both: [Solid<'_>; 2], limit: f64) -> bool {
    let inset = |it: Solid<'_>| it.prototype.inset(limit / it.place.least_scale());
    let [Some(own), Some(other)] = both.map(inset) else { return false };
    let [first, second] = [both[0].with_facets(Some(&own)), both[1].with_facets(Some(&other))];
    // At the end of the angles at which tubes cross another surface the least distance is barely above 0.
    first.clearance_of(&second).is_some_and(|least| least > LEAST_CLEARANCE * limit)
}

/// True if a plane across the line between two places keeps them apart, as most neighbours are.
fn are_apart([solid, other]: [Solid<'_>; 2], limit: f64) -> bool {
    let apart = other.place.position - solid.place.position;
    let along = apart.normalize_or_zero();
    let reach = |it: Solid<'_>, along: DVec3| {
        let own = it.place.linear().transpose() * along;
        it.prototype.reach(own)
    };
    along != DVec3::ZERO && reach(solid, along) + reach(other, -along) < along.dot(apart) - limit
}

/// True if the surfaces of two solids in these boxes intersect.
pub(super) fn intersect(both: [Solid<'_>; 2], bounds: [[DVec3; 2]; 2]) -> bool {
    let [solid, other] = both;
    let limit = tolerance(bounds[0], bounds[1]);
    if are_apart(both, limit) || solid.holds(other, limit) || other.holds(solid, limit) {
        return false;
    }
    if let Some(least) = solid.clearance_of(&other) {
        return least <= limit;
    }
    // Convex shapes that share a point cross unless one of them lies in the other.
    let is_convex = solid.is_convex() && other.is_convex();
    if is_convex && solid.leaves_out(other) && other.leaves_out(solid) {
        return true;
    }
    let shared = [bounds[0][0].max(bounds[1][0]) - limit, bounds[0][1].min(bounds[1][1]) + limit];
    if solid.is_crossed_by(other.facets()) || other.is_crossed_by(solid.facets()) {
        return true;
    }
    sure(solid.prototype.error().max(other.prototype.error()), |error| {
        let finer = both.map(|it| error.and_then(|error| it.prototype.finer(error)));
        let [own, there] =
            [solid.with_facets(finer[0].as_ref()), other.with_facets(finer[1].as_ref())];
        let candidates: Vec<[DVec3; 3]> = there
            .facets()
            .filter(|corners| near(bounds_of(corners.iter().copied()), shared, 0.0))
            .collect();
        let error = own.facet_error() + there.facet_error();
        own.any_facet_meets(&candidates, limit + error)
    })
}

/// True if surfaces intersect, with finer and finer facets for shapes until they do not or the facets are
/// as fine as possible; the first facets have the error `of`, m.
fn sure(of: f64, meet: impl Fn(Option<f64>) -> bool) -> bool {
    let errors = [None, Some(of / 16.0), Some(of / 256.0), Some(FINEST.min(of / 4096.0))];
    let kinds = if of == 0.0 { &errors[..1] } else { &errors[..] };
    kinds.iter().all(|error| meet(*error))
}

impl Solid<'_> {
    /// True if it intersects the surface of a body; `bounds`: the box around it.
    pub(super) fn intersects_body(&self, bounds: [DVec3; 2], boxed: &Boxed<'_>) -> bool {
        let body = boxed.body;
        let Some(search) = &body.search else { return false };
        let limit = tolerance(bounds, boxed.bounds);
        let wide = [bounds[0] - limit, bounds[1] + limit];
        let mut candidates = Vec::new();
        search.tree.within(wide, |triangle| {
            let corners = body.surface.corners(triangle as usize);
            if near(bounds_of(corners.into_iter()), wide, 0.0) {
                candidates.push(corners);
            }
        });
        if candidates.is_empty() {
            return false;
        }
        if self.is_crossed_by(candidates.iter().copied()) {
            return true;
        }
        if let Some(least) = self.clearance(&candidates) {
            return least <= limit;
        }
        sure(self.prototype.error(), |error| {
            let finer = error.and_then(|error| self.prototype.finer(error));
            let solid = self.with_facets(finer.as_ref());
            solid.any_facet_meets(&candidates, limit + solid.facet_error())
        })
    }

    /// True if its convex shape holds all of the box around another one in the frame of that, farther from its
    /// surface than a limit, m.
    fn holds(&self, other: Solid<'_>, limit: f64) -> bool {
        let Some(shape) = self.prototype.shape.filter(|shape| shape.is_convex()) else {
            return false;
        };
        let [low, high] = other.prototype.bounds();
        let least = -limit / self.place.least_scale();
        (0..8_u32).all(|corner| {
            let at = |bit: u32, axis: usize| if corner & bit == 0 { low[axis] } else { high[axis] };
            let corner = other.place.world_from_own(DVec3::new(at(1, 0), at(2, 1), at(4, 2)));
            shape.distance_bound(self.place.own_from_world(corner)) < least
        })
    }

    /// True if a point of the surface of another one lies outside it.
    fn leaves_out(&self, other: Solid<'_>) -> bool {
        let outside = |it: &DVec3| !self.contains(other.place.world_from_own(*it));
        other.prototype.vertices.iter().any(outside)
    }

    /// True if corners of one of some triangles lie on both sides of its exact surface: the surfaces intersect for
    /// certain, without fine facets.
    fn is_crossed_by(&self, mut triangles: impl Iterator<Item = [DVec3; 3]>) -> bool {
        self.is_exact()
            && triangles.any(|corners| {
                let inside = corners.map(|it| self.contains(it));
                inside != [inside[0]; 3]
            })
    }

    /// True if a facet comes within `limit` of one of some triangles.
    fn any_facet_meets(&self, others: &[[DVec3; 3]], limit: f64) -> bool {
        let all = bounds_of(others.iter().flatten().copied());
        let boxes: Vec<[DVec3; 2]> =
            others.iter().map(|it| bounds_of(it.iter().copied())).collect();
        let tree = Tree::of_boxes(&boxes);
        self.facets().any(|corners| {
            let bounds = bounds_of(corners.into_iter());
            let mut met = false;
            if near(bounds, all, limit) {
                tree.within([bounds[0] - limit, bounds[1] + limit], |other| {
                    met = met || meet(corners, others[other as usize], limit);
                });
            }
            met
        })
    }
}
