//! Which triangles share edges.

use super::Sample;
use beamlet_core::numbers;

/// Triangles across the edges of each triangle, opposite to its first, second and third corner:
/// those that run along the edge the other way. `u32::MAX` at an open edge.
#[must_use]
pub fn across_edges(sample: &Sample) -> Vec<[u32; 3]> {
    across(sample.vertices.len(), &sample.triangles)
}

/// As [`across_edges`], of triangles over `vertices` vertices.
pub(super) fn across(vertices: usize, triangles: &[[u32; 3]]) -> Vec<[u32; 3]> {
    let edge = |slot: u32| {
        let corners = triangles[slot as usize / 3];
        [corners[(slot as usize + 1) % 3], corners[(slot as usize + 2) % 3]].map(|v| v as usize)
    };
    let slots = 0..3 * numbers::count(triangles.len());
    // Edges by their start vertex: the edges of v end before ends[v].
    let mut ends = vec![0_u32; vertices + 1];
    slots.clone().for_each(|slot| ends[edge(slot)[0] + 1] += 1);
    for v in 1..ends.len() {
        ends[v] += ends[v - 1];
    }
    let mut leaving = vec![0_u32; slots.len()];
    for slot in slots.clone() {
        let end = &mut ends[edge(slot)[0]];
        leaving[*end as usize] = slot;
        *end += 1;
    }
    let of =
        |v: usize| &leaving[v.checked_sub(1).map_or(0, |v| ends[v] as usize)..ends[v] as usize];
    let mut all = vec![[u32::MAX; 3]; triangles.len()];
    for slot in slots {
        let [from, to] = edge(slot);
        // From the end of fewer edges: a fan has thousands at its apex.
        let side = [slot as usize / 3, slot as usize % 3];
        if all[side[0]][side[1]] != u32::MAX || of(to).len() > of(from).len() {
            continue;
        }
        let free =
            |s: &&u32| edge(**s)[1] == from && all[**s as usize / 3][**s as usize % 3] == u32::MAX;
        if let Some(&other) = of(to).iter().find(free) {
            all[side[0]][side[1]] = other / 3;
            all[other as usize / 3][other as usize % 3] = slot / 3;
        }
    }
    all
}
