//! Edges of a surface, and the connected components that they make.

use crate::numbers;
use rayon::prelude::*;

use super::surface::Surface;

/// An edge as one triangle uses it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Edge {
    /// Its vertices in ascending order as one number.
    pub(super) key: u64,
    /// The triangle.
    pub(super) triangle: u32,
    /// Whether the triangle runs along it from the lower vertex to the higher.
    pub(super) upwards: bool,
}

impl Edge {
    /// Its two vertices.
    pub(super) fn ends(&self) -> [u32; 2] {
        [self.key >> 32, self.key & 0xffff_ffff].map(|it| u32::try_from(it).unwrap_or(0))
    }
}

/// All edges of all triangles; those between the same vertices stand together.
pub(super) fn edges(surface: &Surface) -> Vec<Edge> {
    let each: Vec<[Edge; 3]> = surface
        .triangles
        .par_iter()
        .zip(0_u32..numbers::count(surface.triangles.len()))
        .map(|([a, b, c], triangle)| {
            [(*a, *b), (*b, *c), (*c, *a)].map(|(from, to)| {
                let key = u64::from(from.min(to)) << 32 | u64::from(from.max(to));
                Edge { key, triangle, upwards: from < to }
            })
        })
        .collect();
    let mut edges = each.into_flattened();
    edges.par_sort_unstable();
    edges
}

/// Component of each triangle, and the number of components; components are numbered by their
/// first triangle. Triangles belong together when they share an edge, not just a vertex.
pub(super) fn components(surface: &Surface, edges: &[Edge]) -> (Vec<u32>, u32) {
    let mut parent: Vec<u32> = (0_u32..).take(surface.triangles.len()).collect();
    for pair in edges.windows(2).filter(|pair| pair[0].key == pair[1].key) {
        let (a, b) = (root(&mut parent, pair[0].triangle), root(&mut parent, pair[1].triangle));
        // The lower number leads, so a component is known by its first triangle.
        parent[a.max(b) as usize] = a.min(b);
    }
    let mut label = vec![u32::MAX; parent.len()];
    let mut count = 0;
    let component = (0_u32..)
        .take(parent.len())
        .map(|triangle| {
            let leader = root(&mut parent, triangle) as usize;
            if label[leader] == u32::MAX {
                label[leader] = count;
                count += 1;
            }
            label[leader]
        })
        .collect();
    (component, count)
}

/// The leader of `at` in a forest of parents, shortening the way to it.
pub(super) fn root(parent: &mut [u32], mut at: u32) -> u32 {
    while parent[at as usize] != at {
        let above = parent[parent[at as usize] as usize];
        parent[at as usize] = above;
        at = above;
    }
    at
}
