//! A facet as a patch sees it, and how it lies to a rectangle.

use super::polygon::Area;
use glam::DVec3;

/// A facet as a patch sees it.
#[derive(Debug, Clone)]
pub(super) struct PatchFacet {
    /// Coordinates of its corners in the patch.
    pub(crate) corners: [[f64; 2]; 3],
    /// Its edges opposite to each corner: a x + b z + c, positive inside.
    pub(crate) edges: [[f64; 3]; 3],
    /// Unit normal in the beam frame, and the plane's distance from its origin along it, m.
    pub(crate) normal: DVec3,
    pub(crate) plane: f64,
    /// Least and largest y, m.
    pub(crate) depth: [f64; 2],
    pub(crate) component: u32,
    /// Rays enter its object.
    pub(crate) front: bool,
    /// True for each edge, opposite to its corner, that is a silhouette.
    pub(crate) silhouette: [bool; 3],
}

/// How a facet lies to a rectangle.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Overlap {
    None,
    Part,
    /// The facet fills the rectangle.
    All,
}

impl PatchFacet {
    /// One along the beam's axis, of the first component.
    #[cfg(test)]
    pub(super) fn flat(corners: [[f64; 2]; 3]) -> Self {
        Self {
            corners,
            edges: [[0.0; 3]; 3],
            normal: DVec3::Y,
            plane: 0.0,
            depth: [0.0; 2],
            component: 0,
            front: true,
            silhouette: [false; 3],
        }
    }

    /// Finds its edges.
    pub(super) fn set_edges(&mut self) {
        let [p, q, r] = self.corners;
        let twice = (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0]);
        let sign = twice.signum();
        self.edges = [[q, r], [r, p], [p, q]].map(|[from, to]| {
            let [a, b] = [sign * (from[1] - to[1]), sign * (to[0] - from[0])];
            [a, b, -(a * from[0] + b * from[1])]
        });
    }

    /// Its part inside a rectangle of this centre and half size.
    pub(super) fn within(&self, centre: [f64; 2], half: [f64; 2]) -> Area {
        match self.overlap(centre, half) {
            Overlap::None => Area::NONE,
            Overlap::All => Area::of_rectangle(centre, half),
            Overlap::Part => Area::within(&self.corners, centre, half),
        }
    }

    /// How it lies to a rectangle of this centre and half size.
    pub(super) fn overlap(&self, centre: [f64; 2], half: [f64; 2]) -> Overlap {
        for axis in 0..2 {
            let [a, b, c] = self.corners.map(|corner| corner[axis] - centre[axis]);
            if a.min(b).min(c) > half[axis] || a.max(b).max(c) < -half[axis] {
                return Overlap::None;
            }
        }
        let mut overlap = Overlap::All;
        for [a, b, c] in self.edges {
            let middle = a * centre[0] + b * centre[1] + c;
            let reach = a.abs() * half[0] + b.abs() * half[1];
            if middle + reach < 0.0 {
                return Overlap::None;
            }
            if middle - reach < 0.0 {
                overlap = Overlap::Part;
            }
        }
        overlap
    }
}
