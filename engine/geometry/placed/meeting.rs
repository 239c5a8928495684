//! Whether the surface of a place intersects another.

use glam::DVec3;

use super::distance::Standing;
use super::group::Group;
use super::nesting::Boxed;
use super::{Place, Prototype};
use crate::analytic::AnalyticShape;
use crate::distance::meet;
use crate::overlap::tolerance;
use crate::surface::{bounds_of, near};
use crate::tree::Tree;

/// Error of the finest facets of a shape that nearly touches another surface, m.
const FINEST: f64 = 1e-9;

impl Group {
    /// True if the convex shape of a place holds all of a box of another place's own frame, farther from
    /// its surface than a limit, m.
    fn holds(&self, place: &Place, [low, high]: [DVec3; 2], there: &Place, limit: f64) -> bool {
        let Some(shape) = self.prototype.shape.filter(|shape| shape.is_convex()) else {
            return false;
        };
        let least = -limit / place.least_scale();
        (0..8_u32).all(|corner| {
            let at = |bit: u32, axis: usize| if corner & bit == 0 { low[axis] } else { high[axis] };
            let corner = there.world_from_own(DVec3::new(at(1, 0), at(2, 1), at(4, 2)));
            shape.distance_bound(place.own_from_world(corner)) < least
        })
    }

    fn is_convex(&self) -> bool {
        self.prototype.shape.is_some_and(AnalyticShape::is_convex)
    }

    /// True if a point of the surface of another place lies outside a place.
    fn leaves_out(&self, place: &Place, others: &Self, there: &Place) -> bool {
        let outside = |it: &DVec3| !self.contains(place, there.world_from_own(*it));
        others.prototype.vertices.iter().any(outside)
    }

    /// True if corners of one of some triangles lie on both sides of the exact surface of a place: the
    /// surfaces intersect for certain, without fine facets.
    fn is_crossed_by(&self, place: &Place, triangles: &[[DVec3; 3]]) -> bool {
        self.prototype.shape.is_some()
            && triangles.iter().any(|corners| {
                let inside = corners.map(|it| self.contains(place, it));
                inside != [inside[0]; 3]
            })
    }
}

fn standing<'a>(group: &'a Group, place: &'a Place) -> Standing<'a> {
    Standing { prototype: &group.prototype, place }
}

/// True if a place intersects the surface of a body.
pub(super) fn meets_body(
    group: &Group,
    place: &Place,
    bounds: [DVec3; 2],
    boxed: &Boxed<'_>,
) -> bool {
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
    if group.is_crossed_by(place, &candidates) {
        return true;
    }
    if let Some(least) = standing(group, place).clearance(&candidates) {
        return least <= limit;
    }
    sure(group.prototype.error(), |error| {
        let finer = error.and_then(|error| group.prototype.finer(error));
        let prototype = finer.as_ref().unwrap_or(&group.prototype);
        let limit = limit + prototype.error() * place.largest_scale();
        any_facet_meets(prototype, place, &candidates, limit)
    })
}

/// True if surfaces intersect, with finer and finer facets for shapes until they do not or the facets are
/// as fine as possible; the first facets have the error `of`, m.
fn sure(of: f64, meet: impl Fn(Option<f64>) -> bool) -> bool {
    let errors = [None, Some(of / 16.0), Some(of / 256.0), Some(FINEST.min(of / 4096.0))];
    let kinds = if of == 0.0 { &errors[..1] } else { &errors[..] };
    kinds.iter().all(|error| meet(*error))
}

/// True if a plane across the line between two places keeps them apart, as most neighbours are.
pub(super) fn are_apart(
    (group, place): (&Group, &Place),
    (others, there): (&Group, &Place),
    limit: f64,
) -> bool {
    let apart = there.position - place.position;
    let along = apart.normalize_or_zero();
    let reach = |group: &Group, place: &Place, along: DVec3| {
        let own = place.linear().transpose() * along;
        group.prototype.reach(own)
    };
    along != DVec3::ZERO
        && reach(group, place, along) + reach(others, there, -along) < along.dot(apart) - limit
}

/// True if the surfaces of two places intersect.
pub(super) fn meets_place(
    (group, place): (&Group, &Place),
    (others, there): (&Group, &Place),
    bounds: [[DVec3; 2]; 2],
) -> bool {
    let limit = tolerance(bounds[0], bounds[1]);
    if are_apart((group, place), (others, there), limit)
        || group.holds(place, others.prototype.bounds(), there, limit)
        || others.holds(there, group.prototype.bounds(), place, limit)
    {
        return false;
    }
    let least = standing(group, place).clearance_of(&standing(others, there));
    if let Some(least) = least {
        return least <= limit;
    }
    // Convex shapes that share a point cross unless one of them lies in the other.
    if group.is_convex()
        && others.is_convex()
        && group.leaves_out(place, others, there)
        && others.leaves_out(there, group, place)
    {
        return true;
    }
    let shared = [bounds[0][0].max(bounds[1][0]) - limit, bounds[0][1].min(bounds[1][1]) + limit];
    let corners = |group: &Group, place: &Place| -> Vec<[DVec3; 3]> {
        let all = 0..group.prototype.triangles.len();
        all.map(|it| group.prototype.corners(it).map(|it| place.world_from_own(it))).collect()
    };
    if group.is_crossed_by(place, &corners(others, there))
        || others.is_crossed_by(there, &corners(group, place))
    {
        return true;
    }
    sure(group.prototype.error().max(others.prototype.error()), |error| {
        let finer = |group: &Group| error.and_then(|error| group.prototype.finer(error));
        let (own, other) = (finer(group), finer(others));
        let own = own.as_ref().unwrap_or(&group.prototype);
        let other = other.as_ref().unwrap_or(&others.prototype);
        let candidates: Vec<[DVec3; 3]> = (0..other.triangles.len())
            .map(|triangle| other.corners(triangle).map(|it| there.world_from_own(it)))
            .filter(|corners| near(bounds_of(corners.iter().copied()), shared, 0.0))
            .collect();
        let error = own.error() * place.largest_scale() + other.error() * there.largest_scale();
        any_facet_meets(own, place, &candidates, limit + error)
    })
}

fn any_facet_meets(
    prototype: &Prototype,
    place: &Place,
    others: &[[DVec3; 3]],
    limit: f64,
) -> bool {
    let all = bounds_of(others.iter().flatten().copied());
    let boxes: Vec<[DVec3; 2]> = others.iter().map(|it| bounds_of(it.iter().copied())).collect();
    let tree = Tree::of_boxes(&boxes);
    (0..prototype.triangles.len()).any(|triangle| {
        let corners = prototype.corners(triangle).map(|it| place.world_from_own(it));
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
