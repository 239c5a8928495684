//! Vertices shared by separate surfaces.

use super::found::DefectCount;
use crate::surface::Surface;
use crate::topology::{Edge, join};

/// Vertices whose triangles are not all connected through edges at that vertex.
pub(super) fn pinched(surface: &Surface, edges: &[Edge]) -> DefectCount {
    // Corners of triangles, three each; corners of one vertex are joined across each edge.
    let mut parent: Vec<u32> = (0..).take(3 * surface.triangles.len()).collect();
    for group in edges.chunk_by(|a, b| a.key == b.key) {
        for pair in group.windows(2) {
            for vertex in pair[0].ends() {
                join(&mut parent, [0, 1].map(|k| surface.corner_of(pair[k].triangle, vertex)));
            }
        }
    }
    // The first corner of a vertex leads its first fan: any other leader is another fan.
    let mut first = vec![u32::MAX; surface.vertices.len()];
    let mut reported = vec![false; surface.vertices.len()];
    let mut found = DefectCount::default();
    for corner in (0..).take(parent.len()) {
        if parent[corner as usize] != corner {
            continue;
        }
        let vertex = surface.triangles[corner as usize / 3][corner as usize % 3] as usize;
        if first[vertex] == u32::MAX {
            first[vertex] = corner;
        } else if !reported[vertex] {
            reported[vertex] = true;
            let numbers = [first[vertex], corner].map(|corner| surface.number(corner / 3));
            found.add(&numbers, || Some(surface.vertices[vertex]));
        }
    }
    found
}
