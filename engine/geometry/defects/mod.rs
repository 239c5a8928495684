//! What is wrong with the surface of one object: counts, and the first places of each kind.
//!
//! Open, non-manifold and wrongly wound edges (`edges`), vertices where fans of triangles meet
//! in a point (`vertices`), triangles without area or given twice (`triangles`), and
//! triangles that pass through each other (`crossings`, `overlap`). `words` describes it.

mod crossings;
mod edges;
mod overlap;
mod triangles;
mod vertices;
mod words;

use glam::DVec3;
use serde::Serialize;

pub(super) use crossings::ENOUGH as MOST_PAIRS;

use super::search::Search;
use super::surface::{Surface, Welded};
use super::topology::Edge;
use super::watch::Task;
use crate::error::Result;

/// Most places that are kept of each kind of defect.
pub const MAX_DEFECT_PLACES: usize = 10;

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
    /// Vertices where triangles meet that share no edge around it.
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
    fn add(&mut self, triangles: &[u32], position: impl FnOnce() -> Option<DVec3>) {
        self.count += 1;
        if self.places.len() < MAX_DEFECT_PLACES {
            let position_mm = position().map(|metres| (metres * 1e3).to_array());
            self.places.push(DefectPlace { triangles: triangles.to_vec(), position_mm });
        }
    }
}

impl Defects {
    /// Whether a mesh with these is refused unless its object allows defects: it is open, its
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

/// Examines a welded surface in the world. `resolved` is the length that f32 resolves of it, m;
/// with `search` also for triangles that pass through each other, whose pairs it gives, too: all of
/// them, or [`MOST_PAIRS`] and more.
///
/// # Errors
/// [`crate::Error::Interrupted`].
pub(super) fn find(
    surface: &Surface,
    edges: &[Edge],
    welded: &Welded,
    resolved: f64,
    search: Option<&Search>,
    task: Task<'_>,
) -> Result<(Defects, Vec<[u32; 2]>)> {
    let ((non_manifold_vertices, duplicate_triangles), self_intersections) = rayon::join(
        || rayon::join(|| vertices::pinched(surface, edges), || triangles::duplicate(surface)),
        || search.map(|search| crossings::find(surface, &search.tree, resolved, task)).transpose(),
    );
    let (self_intersections, pairs) = self_intersections?.unwrap_or_default();
    let mut defects = Defects {
        non_manifold_vertices,
        duplicate_triangles,
        self_intersections,
        degenerate_triangles: triangles::degenerate(surface, welded, resolved),
        ..Defects::default()
    };
    edges::sort(surface, edges, &mut defects);
    for number in &surface.not_finite {
        defects.not_finite.add(&[*number], || None);
    }
    Ok((defects, pairs))
}
