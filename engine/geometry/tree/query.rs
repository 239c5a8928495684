//! What looks for members of a tree.

use glam::{DVec3, Vec3};

use super::slab::{self, ROUNDING, Slab};
use super::{BoundsNode, NONE, outwards};
use crate::surface::bounds_of;

/// Where a slab has more than this share of a line, it is as good as all of it.
const MOST_OF_IT: f64 = 0.9;

/// A long thin triangle: points `start + t along + u across`, t and u from 0 to 1.
struct ThickLine {
    start: DVec3,
    along: DVec3,
    across: DVec3,
}

impl ThickLine {
    /// The triangle; `across`: unit vector in its plane across its longest side.
    fn of(corners: [DVec3; 3], across: DVec3) -> Self {
        let side = |k: usize| corners[(k + 1) % 3] - corners[k];
        let longer =
            |a: &usize, b: &usize| side(*a).length_squared().total_cmp(&side(*b).length_squared());
        let k = (0..3).max_by(longer).unwrap_or(0);
        let start = corners[k];
        Self { start, along: side(k), across: across * (corners[(k + 2) % 3] - start).dot(across) }
    }

    /// True if its part within a slab lies outside a box. Planes of walls around an axis intersect there,
    /// far from the walls: a slab alone excludes no line from there.
    fn misses(&self, slab: &Slab, [low, high]: [Vec3; 2], margin: f64) -> bool {
        let slab = slab.widened(margin);
        let [a, b] = slab.along(self.start, self.along);
        let [c, d] = slab.along(self.start + self.across, self.along);
        let from = a.min(b).min(c).min(d).max(0.0);
        let to = a.max(b).max(c).max(d).min(1.0);
        // Along the slab none of them is a number. What lies outside it is none of this.
        let known = ![a, b, c, d].iter().any(|t| t.is_nan()) && from < to;
        if !known || to - from > MOST_OF_IT {
            return false;
        }
        let [first, last] = [from, to].map(|t| self.start + t * self.along);
        let beside = self.across.abs() + margin + ROUNDING * first.abs().max(last.abs());
        let (least, most) = (first.min(last) - beside, first.max(last) + beside);
        least.cmpgt(high.as_dvec3()).any() || most.cmplt(low.as_dvec3()).any()
    }
}

/// A triangle, or another set of three points, that searches its neighbourhood.
pub(crate) struct Query {
    corners: [DVec3; 3],
    vertices: [u32; 3],
    margin: f64,
    /// Its box, widened by the margin.
    bounds: [DVec3; 2],
    /// The same, rounded outwards.
    low: Vec3,
    high: Vec3,
    /// The same of the side that lies opposite to each corner.
    opposite: [[Vec3; 2]; 3],
    /// A long thin triangle, across its longest side.
    band: Option<Slab>,
    /// The same triangle, along its longest side.
    line: Option<ThickLine>,
    /// Extent along the normal, of a triangle or of a leaf.
    plate: Option<Slab>,
    /// Corners of a leaf: it is its box, not `corners`, that looks. Empty for a triangle.
    leaf: Vec<DVec3>,
}

impl Query {
    /// Query for members within `margin` of `corners`. Members that have a vertex in common with
    /// `vertices` are found if the opposite side comes near them, or if theirs comes near the
    /// query: see [`Tree::pairs`].
    pub(crate) fn new(corners: [DVec3; 3], vertices: Option<[u32; 3]>, margin: f64) -> Self {
        let bounds = bounds_of(corners.into_iter());
        let [low, high] = outwards(bounds, margin);
        let slab = |across| Slab::around(across, corners, [low, high], margin);
        let opposite = |k: usize| {
            let side = [corners[(k + 1) % 3], corners[(k + 2) % 3]];
            outwards(bounds_of(side.into_iter()), margin)
        };
        let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]).try_normalize();
        Self {
            corners,
            vertices: vertices.unwrap_or([NONE; 3]),
            margin,
            bounds: [bounds[0] - margin, bounds[1] + margin],
            low,
            high,
            opposite: [0, 1, 2].map(opposite),
            line: slab::across(corners).map(|across| ThickLine::of(corners, across)),
            band: slab::across(corners).and_then(slab),
            plate: normal.and_then(slab),
            leaf: Vec::new(),
        }
    }

    /// Query for members within `margin` of the triangles of a leaf, whose corners are `corners`.
    pub(super) fn of_leaf(leaf: &BoundsNode, corners: Vec<DVec3>, margin: f64) -> Self {
        let bounds = [leaf.low.as_dvec3(), leaf.high.as_dvec3()];
        let [low, high] = outwards(bounds, margin);
        Self {
            corners: [bounds[0].midpoint(bounds[1]); 3],
            vertices: [NONE; 3],
            margin,
            bounds: [bounds[0] - margin, bounds[1] + margin],
            low,
            high,
            opposite: [[low, high]; 3],
            band: None,
            line: None,
            plate: leaf.plate.as_ref().map(|plate| plate.widened(margin)),
            leaf: corners,
        }
    }

    /// True if its box, with the margin, overlaps another.
    pub(super) fn meets_box(&self, [low, high]: [DVec3; 2]) -> bool {
        self.bounds[0].cmple(high).all() && low.cmple(self.bounds[1]).all()
    }

    /// True if points lie on one side of its plane, or of its longest side, beyond the margin.
    pub(super) fn is_apart(&self, points: &[DVec3]) -> bool {
        [&self.plate, &self.band].into_iter().flatten().any(|slab| slab.misses(points, 0.0))
    }

    pub(super) fn reaches(&self, node: &BoundsNode) -> bool {
        if !(self.low.cmple(node.high).all() && node.low.cmple(self.high).all()) {
            return false;
        }
        let bounds = [node.low, node.high];
        if [&self.band, &self.plate].into_iter().flatten().any(|slab| slab.misses_box(bounds)) {
            return false;
        }
        let points = if self.leaf.is_empty() { &self.corners[..] } else { &self.leaf };
        if node.plate.as_ref().is_some_and(|plate| plate.misses(points, self.margin)) {
            return false;
        }
        if let Some(line) = &self.line
            && node.plate.as_ref().is_some_and(|plate| line.misses(plate, bounds, self.margin))
        {
            return false;
        }
        let Some(band) = &node.band else { return true };
        if !self.leaf.is_empty() {
            return !band.slab.misses(points, self.margin);
        }
        let common = |vertex: &u32| *vertex != NONE && band.shared.contains(vertex);
        let apart = |points: &[DVec3]| band.slab.misses(points, self.margin);
        match self.vertices.iter().position(common) {
            None => !apart(&self.corners),
            Some(k) => {
                let side = [self.corners[(k + 1) % 3], self.corners[(k + 2) % 3]];
                let [low, high] = self.opposite[k];
                low.cmple(node.high).all() && node.low.cmple(high).all() && !apart(&side)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::surface::Surface;
    use crate::tree::Tree;

    #[test]
    fn a_triangle_from_the_axis_reaches_few_of_the_walls_that_stand_around_it() {
        // Walls of height 1 between radii of 2.4 and 4: all of their planes pass near the axis.
        let count: u32 = 4000;
        let radius = |k: u32| if k.is_multiple_of(2) { 4.0 } else { 2.4 };
        let corner = |k: u32| {
            let angle = std::f64::consts::TAU * f64::from(k) / f64::from(count);
            DVec3::new(angle.cos(), angle.sin(), 0.0) * radius(k)
        };
        let bottom: Vec<DVec3> = (0..count).map(corner).collect();
        let vertices = bottom.iter().copied().chain(bottom.iter().map(|it| *it + DVec3::Z));
        let wall = |k: u32| {
            let next = (k + 1) % count;
            [[k, next, next + count], [k, next + count, k + count]]
        };
        let triangles: Vec<[u32; 3]> = (0..count).flat_map(wall).collect();
        let tree = Tree::of_triangles(&Surface::new(vertices.collect(), triangles));
        for k in (0..count - 1).step_by(37) {
            let corners = [DVec3::ZERO, corner(k), corner(k + 1)];
            let query = Query::new(corners, None, 1e-9);
            let leaves = tree.leaves();
            let reached =
                leaves.iter().filter(|leaf| query.reaches(&tree.nodes[**leaf as usize])).count();
            assert!((1..12).contains(&reached), "{k}: {reached} of {}", leaves.len());
        }
    }
}
