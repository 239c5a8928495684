//! Defects of the surface of one object: counts, and the first places of each kind.
//!
//! Open, non-manifold and wrongly wound edges (`edges`), vertices shared by separate fans (`vertices`),
//! triangles without area or given twice (`triangles`), and triangles that pass through each other
//! (`crossings`, `overlap`). `found` holds the defects, `words` describes them.

mod crossings;
mod edges;
mod found;
mod overlap;
mod triangles;
mod vertices;
mod words;

pub(crate) use crossings::{CrossingPair, ENOUGH as MOST_PAIRS};
pub use found::{DefectCount, DefectPlace, Defects};
pub(crate) use triangles::{duplicate, width};

use super::search::Search;
use super::surface::Surface;
use super::topology::Edge;
use beamlet_core::error::Result;
use beamlet_core::watch::Task;
use glam::DVec3;

/// Examines a welded surface in the world; `dropped`: triangles without area that were left out. `in_file`
/// and `resolved` are the lengths that its numbers and that f32 resolve in the world, m. With `search` it
/// also gives the pairs of triangles that pass through each other: all of them, or [`MOST_PAIRS`] and
/// more.
///
/// # Errors
/// [`beamlet_core::Error::Interrupted`].
pub(super) fn find(
    surface: &Surface,
    edges: &[Edge],
    dropped: &[(u32, DVec3)],
    [in_file, resolved]: [f64; 2],
    search: Option<&Search>,
    task: Task<'_>,
) -> Result<(Defects, Vec<CrossingPair>)> {
    let ((non_manifold_vertices, duplicate_triangles), self_intersections) = rayon::join(
        || rayon::join(|| vertices::pinched(surface, edges), || duplicate(surface)),
        || search.map(|search| crossings::find(surface, &search.tree, resolved, task)).transpose(),
    );
    let (self_intersections, pairs) = self_intersections?.unwrap_or_default();
    let mut defects = Defects {
        non_manifold_vertices,
        duplicate_triangles,
        self_intersections,
        degenerate_triangles: triangles::degenerate(surface, dropped, in_file),
        ..Defects::default()
    };
    edges::sort(surface, edges, &mut defects);
    for number in &surface.not_finite {
        defects.not_finite.add(&[*number], || None);
    }
    Ok((defects, pairs))
}
