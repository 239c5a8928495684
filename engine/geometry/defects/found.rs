//! Defects of a surface: counts, and the first places of each kind.

use glam::DVec3;
use serde::Serialize;

/// Most places that are kept of each kind of defect.
const MAX_DEFECT_PLACES: usize = 10;

/// Defects of the surface of one object after welding.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Defects {
    /// Edges of one triangle only: a hole or a gap.
    pub open_edges: DefectCount,
    /// Edges of more than two triangles.
    pub non_manifold_edges: DefectCount,
    /// Edges between two triangles that wind opposite ways.
    pub flipped_edges: DefectCount,
    /// Vertices shared by triangles that are not connected around it by edges.
    pub non_manifold_vertices: DefectCount,
    /// Pairs of triangles that pass through or lie on each other by more than f32 resolves.
    /// Counted to 100 000, from there on at least that many.
    pub self_intersections: DefectCount,
    /// Triangles without area. Those with two equal corners are left out.
    pub degenerate_triangles: DefectCount,
    /// Triangles with the same corners as an earlier one.
    pub duplicate_triangles: DefectCount,
    /// Triangles with a coordinate that is NaN or infinite. They are left out.
    pub not_finite: DefectCount,
}

/// One kind of defect: how often it was found, and the first places.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
#[non_exhaustive]
pub struct DefectCount {
    /// How many there are.
    pub count: usize,
    /// The first ten places, in the order of the triangles.
    pub places: Vec<DefectPlace>,
}

/// Where a defect is.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct DefectPlace {
    /// The triangles, counted from 1 in the order of the file.
    pub triangles: Vec<u32>,
    /// Position after placement, mm; `None` where it is not finite.
    pub position_mm: Option<[f64; 3]>,
}

impl DefectCount {
    /// Counts one; the first of them keep triangles and position (m).
    pub(super) fn add(&mut self, triangles: &[u32], position: impl FnOnce() -> Option<DVec3>) {
        self.count += 1;
        if self.places.len() < MAX_DEFECT_PLACES {
            let position_mm = position().map(|metres| (metres * 1e3).to_array());
            self.places.push(DefectPlace { triangles: triangles.to_vec(), position_mm });
        }
    }
}

impl Defects {
    /// True if a mesh with these is refused unless its object allows defects: it is open, its
    /// triangles disagree about which side is out, or it passes through itself.
    #[must_use]
    pub const fn refused(&self) -> bool {
        self.open_edges.count
            + self.non_manifold_edges.count
            + self.flipped_edges.count
            + self.self_intersections.count
            > 0
    }
}
