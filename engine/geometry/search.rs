//! Search among the triangles of one object, in f64: who is near a box, is a point inside.

use glam::DVec3;
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::builder::build_bvh2;
use obvhs::{Boundable, BvhBuildParams};

use super::surface::{Surface, bounds_of};

/// A tree of boxes over the triangles of a surface.
pub(super) struct Search<'a> {
    surface: &'a Surface,
    tree: Bvh2,
}

struct Bounds(Aabb);

impl Boundable for Bounds {
    fn aabb(&self) -> Aabb {
        self.0
    }
}

/// A box rounded outwards to f32.
fn rounded([low, high]: [DVec3; 2], margin: f64) -> Aabb {
    let down = (low - margin).as_vec3().to_array().map(f32::next_down);
    let up = (high + margin).as_vec3().to_array().map(f32::next_up);
    Aabb::new(down.into(), up.into())
}

fn widened(corner: [f32; 3]) -> DVec3 {
    DVec3::from_array(corner.map(f64::from))
}

/// Directions without a simple ratio between their parts: rays along them seldom meet the
/// edges of grid-aligned meshes.
const DIRECTIONS: [DVec3; 6] = [
    DVec3::new(0.427_183, 0.611_927, 0.665_731),
    DVec3::new(-0.703_319, 0.329_473, 0.629_941),
    DVec3::new(0.283_661, -0.817_129, 0.501_827),
    DVec3::new(0.561_377, 0.472_193, -0.679_553),
    DVec3::new(-0.391_273, -0.587_651, -0.708_233),
    DVec3::new(0.811_549, -0.230_467, -0.536_917),
];

impl<'a> Search<'a> {
    pub(super) fn new(surface: &'a Surface) -> Self {
        let boxes: Vec<Bounds> = (0..surface.triangles.len())
            .map(|triangle| Bounds(rounded(bounds_of(surface.corners(triangle).into_iter()), 0.0)))
            .collect();
        let params = BvhBuildParams::very_fast_build();
        let tree = build_bvh2(&boxes, params, &mut std::time::Duration::default());
        Self { surface, tree }
    }

    /// Calls `visit` with triangles whose boxes come within `margin` of `bounds`, until it
    /// returns false. Some of the triangles may be further away.
    pub(super) fn near(
        &self,
        bounds: [DVec3; 2],
        margin: f64,
        mut visit: impl FnMut(usize) -> bool,
    ) {
        self.tree.aabb_traverse(rounded(bounds, margin), |tree, node| {
            let node = &tree.nodes[node as usize];
            let first = node.first_index as usize;
            tree.primitive_indices[first..first + node.prim_count as usize]
                .iter()
                .all(|triangle| visit(*triangle as usize))
        });
    }

    /// Triangles between `point` and infinity, with +1 where a ray leaves through one and -1
    /// where it enters: summed over a closed surface, the winding number around the point.
    /// `None` when every direction tried met an edge, or the point lies on the surface.
    pub(super) fn crossings(&self, point: DVec3) -> Option<Vec<(usize, i32)>> {
        let mut hits = Vec::new();
        DIRECTIONS
            .iter()
            .any(|direction| {
                hits.clear();
                self.shoot(point, *direction, |triangle, sign| hits.push((triangle, sign)))
            })
            .then_some(hits)
    }

    /// Whether a point is in the material: outer surfaces around it less voids around it.
    pub(super) fn contains(&self, point: DVec3) -> bool {
        match self.crossings(point) {
            Some(hits) => hits.iter().map(|(_, sign)| sign).sum::<i32>() > 0,
            None => {
                let all = 0..self.surface.triangles.len();
                winding_by_solid_angle(self.surface, all, point) > 0.5
            }
        }
    }

    fn shoot(&self, point: DVec3, direction: DVec3, mut hit: impl FnMut(usize, i32)) -> bool {
        let inverse = direction.recip();
        let mut stack = vec![0_u32];
        while let Some(node) = stack.pop().and_then(|node| self.tree.nodes.get(node as usize)) {
            let bounds = node.aabb();
            let a = (widened(bounds.min.to_array()) - point) * inverse;
            let b = (widened(bounds.max.to_array()) - point) * inverse;
            let (enter, leave) = (a.min(b).max_element(), a.max(b).min_element());
            if leave < 0.0 || enter > leave * (1.0 + 1e-12) {
                continue;
            }
            let first = node.first_index;
            if !node.is_leaf() {
                stack.extend([first, first + 1]);
                continue;
            }
            for &triangle in
                &self.tree.primitive_indices[first as usize..(first + node.prim_count) as usize]
            {
                let triangle = triangle as usize;
                match cross(point, direction, self.surface.corners(triangle)) {
                    Crossing::Miss => {}
                    Crossing::Hit(sign) => hit(triangle, sign),
                    Crossing::Unclear => return false,
                }
            }
        }
        true
    }
}

enum Crossing {
    Miss,
    Hit(i32),
    Unclear,
}

/// Where a ray passes a triangle; unclear within rounding of an edge or of the start.
fn cross(point: DVec3, direction: DVec3, corners: [DVec3; 3]) -> Crossing {
    let [a, b, c] = corners.map(|corner| corner - point);
    let sides = [c.cross(b), a.cross(c), b.cross(a)].map(|normal| direction.dot(normal));
    let size = a.length_squared().max(b.length_squared()).max(c.length_squared());
    let doubt = 1e-14 * size;
    if sides.iter().any(|side| *side > doubt) && sides.iter().any(|side| *side < -doubt) {
        return Crossing::Miss;
    }
    let normal = (b - a).cross(c - a);
    let (height, slope) = (a.dot(normal), direction.dot(normal));
    if sides.iter().any(|side| side.abs() <= doubt) {
        // An edge that the ray has left behind does not matter.
        let behind = a.dot(direction).max(b.dot(direction)).max(c.dot(direction)) < 0.0;
        return if behind { Crossing::Miss } else { Crossing::Unclear };
    }
    if height.abs() <= 1e-13 * size.sqrt() * normal.length() {
        return Crossing::Unclear;
    }
    match (height > 0.0) == (slope > 0.0) {
        false => Crossing::Miss,
        true => Crossing::Hit(if slope > 0.0 { 1 } else { -1 }),
    }
}

/// Winding number of triangles around a point by their solid angles: slow, but with no
/// direction to choose. On the surface itself it is about a half, and rounds to either side.
pub(super) fn winding_by_solid_angle(
    surface: &Surface,
    triangles: impl Iterator<Item = usize>,
    point: DVec3,
) -> f64 {
    let total: f64 = triangles
        .map(|triangle| {
            let [a, b, c] = surface.corners(triangle).map(|corner| corner - point);
            let [la, lb, lc] = [a, b, c].map(DVec3::length);
            let below = la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb;
            2.0 * a.dot(b.cross(c)).atan2(below)
        })
        .sum();
    total / (4.0 * std::f64::consts::PI)
}
