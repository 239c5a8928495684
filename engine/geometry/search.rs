//! Search among the triangles of one object, in f64: who is near a box, is a point inside.

use glam::DVec3;

use super::surface::Surface;
use super::tree::{Query, Tree};

/// A tree over the triangles of a surface, which the methods get once more: its triangles may have
/// been turned over meanwhile.
#[derive(Debug)]
pub(super) struct Search {
    pub(super) tree: Tree,
}

/// Directions without a simple ratio between their parts: rays along them seldom hit the edges of
/// grid-aligned meshes.
const DIRECTIONS: [DVec3; 6] = [
    DVec3::new(0.427_183, 0.611_927, 0.665_731),
    DVec3::new(-0.703_319, 0.329_473, 0.629_941),
    DVec3::new(0.283_661, -0.817_129, 0.501_827),
    DVec3::new(0.561_377, 0.472_193, -0.679_553),
    DVec3::new(-0.391_273, -0.587_651, -0.708_233),
    DVec3::new(0.811_549, -0.230_467, -0.536_917),
];

impl Search {
    pub(super) fn new(surface: &Surface) -> Self {
        Self { tree: Tree::of_triangles(surface) }
    }

    /// Calls `visit` with triangles near `query`, until it returns false. Some of them may be
    /// further away.
    pub(super) fn near(&self, query: &Query, mut visit: impl FnMut(usize) -> bool) {
        self.tree.near(query, |triangle| visit(triangle as usize));
    }

    /// Triangles between `point` and infinity, with +1 where a ray leaves through one and -1 where it
    /// enters: summed over a closed surface, the winding number around the point. `None` if every
    /// direction hit an edge, or the point lies on the surface.
    pub(super) fn crossings(&self, surface: &Surface, point: DVec3) -> Option<Vec<(usize, i32)>> {
        let mut hits = Vec::new();
        DIRECTIONS
            .iter()
            .any(|direction| {
                hits.clear();
                self.shoot(surface, point, *direction, |triangle, sign| {
                    hits.push((triangle, sign));
                })
            })
            .then_some(hits)
    }

    /// Distances at which a ray crosses triangles, ascending, with the winding number behind each relative
    /// to the start: +1 where it enters. `None` if it hits an edge.
    pub(super) fn windings(
        &self,
        surface: &Surface,
        start: DVec3,
        direction: DVec3,
    ) -> Option<Vec<(f64, i32)>> {
        let mut hits = Vec::new();
        let is_clear = self.shoot(surface, start, direction, |triangle, sign| {
            let [a, b, c] = surface.corners(triangle);
            let normal = (b - a).cross(c - a);
            hits.push(((a - start).dot(normal) / direction.dot(normal), -sign));
        });
        hits.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut winding = 0;
        for (_, change) in &mut hits {
            winding += *change;
            *change = winding;
        }
        is_clear.then_some(hits)
    }

    /// True if the crossings of the ray are unambiguous.
    fn shoot(
        &self,
        surface: &Surface,
        point: DVec3,
        direction: DVec3,
        mut hit: impl FnMut(usize, i32),
    ) -> bool {
        self.tree.along(point, direction, |triangle| {
            let triangle = triangle as usize;
            match cross(point, direction, surface.corners(triangle)) {
                LineCrossing::Miss => {}
                LineCrossing::Hit(sign) => hit(triangle, sign),
                LineCrossing::Unclear => return false,
            }
            true
        })
    }
}

enum LineCrossing {
    Miss,
    Hit(i32),
    Unclear,
}

/// Where a ray passes a triangle; unclear within rounding of an edge or of the start.
fn cross(point: DVec3, direction: DVec3, corners: [DVec3; 3]) -> LineCrossing {
    let [a, b, c] = corners.map(|corner| corner - point);
    let sides = [c.cross(b), a.cross(c), b.cross(a)].map(|normal| direction.dot(normal));
    let size = a.length_squared().max(b.length_squared()).max(c.length_squared());
    let doubt = 1e-14 * size;
    if sides.iter().any(|side| *side > doubt) && sides.iter().any(|side| *side < -doubt) {
        return LineCrossing::Miss;
    }
    let normal = (b - a).cross(c - a);
    let (height, slope) = (a.dot(normal), direction.dot(normal));
    if sides.iter().any(|side| side.abs() <= doubt) {
        // An edge that the ray has left behind does not matter.
        let behind = a.dot(direction).max(b.dot(direction)).max(c.dot(direction)) < 0.0;
        return if behind { LineCrossing::Miss } else { LineCrossing::Unclear };
    }
    if height.abs() <= 1e-13 * size.sqrt() * normal.length() {
        return LineCrossing::Unclear;
    }
    match (height > 0.0) == (slope > 0.0) {
        false => LineCrossing::Miss,
        true => LineCrossing::Hit(if slope > 0.0 { 1 } else { -1 }),
    }
}

/// Winding number of triangles around a point by their solid angles: slow, but with no
/// direction to choose. On the surface itself it is about a half, and rounds to either side.
pub(super) fn winding_by_solid_angle(
    surface: &Surface,
    triangles: impl Iterator<Item = usize>,
    point: DVec3,
) -> f64 {
    winding(triangles.map(|triangle| surface.corners(triangle)), point)
}

/// As [`winding_by_solid_angle`], of triangles by their corners.
pub(super) fn winding(triangles: impl Iterator<Item = [DVec3; 3]>, point: DVec3) -> f64 {
    let total: f64 = triangles
        .map(|corners| {
            let [a, b, c] = corners.map(|corner| corner - point);
            let [la, lb, lc] = [a, b, c].map(DVec3::length);
            let below = la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb;
            2.0 * a.dot(b.cross(c)).atan2(below)
        })
        .sum();
    total / (4.0 * std::f64::consts::PI)
}
