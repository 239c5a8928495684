//! Edges by how many triangles use them, and which way.

use super::found::Defects;
use crate::surface::Surface;
use crate::topology::{Edge, is_manifold};

/// Sorts the edges that are not used exactly twice, once each way, into their kinds.
pub(super) fn sort(surface: &Surface, edges: &[Edge], defects: &mut Defects) {
    let mut faulty: Vec<&[Edge]> =
        edges.chunk_by(|a, b| a.key == b.key).filter(|group| !is_manifold(group)).collect();
    faulty.sort_by_key(|group| group.iter().map(|edge| edge.triangle).min());
    for group in faulty {
        let found = match group {
            [_] => &mut defects.open_edges,
            [_, _] => &mut defects.flipped_edges,
            _ => &mut defects.non_manifold_edges,
        };
        let numbers: Vec<u32> = group.iter().map(|edge| surface.number(edge.triangle)).collect();
        found.add(&numbers, || {
            let [a, b] = group[0].ends().map(|vertex| surface.vertices[vertex as usize]);
            Some(a.midpoint(b))
        });
    }
}
