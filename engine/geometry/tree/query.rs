//! What looks for members of a tree.

use glam::{DVec3, Vec3};

use super::slab::{self, Slab};
use super::{BoundsNode, NONE, outwards};
use crate::geometry::surface::bounds_of;

/// A triangle, or another set of three points, that looks for what is near.
pub(in crate::geometry) struct Query {
    corners: [DVec3; 3],
    vertices: [u32; 3],
    margin: f64,
    /// Its box, widened by the margin.
    bounds: [DVec3; 2],
    /// The same, rounded outwards.
    low: Vec3,
    high: Vec3,
    /// A long thin triangle, across its longest side.
    band: Option<Slab>,
    /// A triangle, or those of a leaf, along the normal.
    plate: Option<Slab>,
    /// Corners of a leaf: it is its box, not `corners`, that looks. Empty for a triangle.
    leaf: Vec<DVec3>,
}

impl Query {
    /// What comes within `margin` of `corners`. Members that have a vertex in common with
    /// `vertices` are found if the opposite side comes near them, or if theirs comes near the
    /// query: see [`Tree::pairs`].
    pub(in crate::geometry) fn new(
        corners: [DVec3; 3],
        vertices: Option<[u32; 3]>,
        margin: f64,
    ) -> Self {
        let bounds = bounds_of(corners.into_iter());
        let [low, high] = outwards(bounds, margin);
        let slab = |across| Slab::around(across, corners, [low, high], margin);
        let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]).try_normalize();
        Self {
            corners,
            vertices: vertices.unwrap_or([NONE; 3]),
            margin,
            bounds: [bounds[0] - margin, bounds[1] + margin],
            low,
            high,
            band: slab::across(corners).and_then(slab),
            plate: normal.and_then(slab),
            leaf: Vec::new(),
        }
    }

    /// What comes within `margin` of the triangles of a leaf, whose corners are `corners`.
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
            band: None,
            plate: leaf.plate.as_ref().map(|plate| plate.widened(margin)),
            leaf: corners,
        }
    }

    /// Whether its box, with the margin, meets another.
    pub(super) fn meets_box(&self, [low, high]: [DVec3; 2]) -> bool {
        self.bounds[0].cmple(high).all() && low.cmple(self.bounds[1]).all()
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
                let [low, high] = outwards(bounds_of(side.into_iter()), self.margin);
                low.cmple(node.high).all() && node.low.cmple(high).all() && !apart(&side)
            }
        }
    }
}
