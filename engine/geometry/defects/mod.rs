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

pub(super) use crossings::ENOUGH as MOST_PAIRS;
pub use found::{DefectCount, DefectPlace, Defects};

use super::search::Search;
use super::surface::{Surface, Welded};
use super::topology::Edge;
use super::watch::Task;
use crate::error::Result;

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
