//! Edges of a surface, and the connected components that they make.

use beamlet_core::numbers;
use rayon::prelude::*;

use super::surface::Surface;

/// An edge as one triangle uses it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Edge {
    /// Its vertices in ascending order as one number.
    pub(super) key: u64,
    /// The triangle.
    pub(super) triangle: u32,
    /// True if the triangle runs along it from the lower vertex to the higher.
    pub(super) upwards: bool,
}

impl Edge {
    /// Its two vertices.
    pub(super) fn ends(&self) -> [u32; 2] {
        [self.key >> 32, self.key & 0xffff_ffff].map(|it| u32::try_from(it).unwrap_or(0))
    }
}

/// All edges of all triangles; edges between the same vertices are adjacent.
pub(super) fn edges(surface: &Surface) -> Vec<Edge> {
    let each: Vec<[Edge; 3]> = (0..numbers::count(surface.triangles.len()))
        .into_par_iter()
        .map(|triangle| edges_of(surface, triangle))
        .collect();
    let mut edges = each.into_flattened();
    edges.par_sort_unstable();
    edges
}

/// The three edges of a triangle.
pub(super) fn edges_of(surface: &Surface, triangle: u32) -> [Edge; 3] {
    let [a, b, c] = surface.triangles[triangle as usize];
    [[a, b], [b, c], [c, a]].map(|[from, to]| {
        let key = u64::from(from.min(to)) << 32 | u64::from(from.max(to));
        Edge { key, triangle, upwards: from < to }
    })
}

/// Component of each triangle, and the number of components; components are numbered by their
/// first triangle. Triangles belong together when they share an edge, not just a vertex. All pieces with
/// open edges are one component: the volume of one of them says nothing about its orientation.
pub(super) fn components(surface: &Surface, edges: &[Edge]) -> (Vec<u32>, u32) {
    let mut parent: Vec<u32> = (0_u32..).take(surface.triangles.len()).collect();
    for pair in edges.windows(2).filter(|pair| pair[0].key == pair[1].key) {
        join(&mut parent, [pair[0].triangle, pair[1].triangle]);
    }
    let mut open = edges.chunk_by(|a, b| a.key == b.key).filter(|edge| !is_balanced(edge));
    if let Some(first) = open.next() {
        open.for_each(|edge| join(&mut parent, [first[0].triangle, edge[0].triangle]));
    }
    labels(&mut parent)
}

/// True if equal numbers of triangles run along an edge in both directions.
pub(super) fn is_balanced(edge: &[Edge]) -> bool {
    2 * edge.iter().filter(|it| it.upwards).count() == edge.len()
}

/// True if the triangles at one edge are two that run along it in opposite directions.
pub(super) fn is_manifold(edge: &[Edge]) -> bool {
    matches!(edge, [a, b] if a.upwards != b.upwards)
}

/// Joins the sets of two members of a forest of parents. The lower number leads, so a set is known
/// by its first member.
pub(super) fn join(parent: &mut [u32], pair: [u32; 2]) {
    let [a, b] = pair.map(|member| root(parent, member));
    parent[a.max(b) as usize] = a.min(b);
}

/// Set of each member of a forest of parents, and the number of sets; they are numbered by their
/// first members.
pub(super) fn labels(parent: &mut [u32]) -> (Vec<u32>, u32) {
    let mut label = vec![u32::MAX; parent.len()];
    let mut count = 0;
    let of = (0..numbers::count(parent.len()))
        .map(|member| {
            let leader = root(parent, member) as usize;
            if label[leader] == u32::MAX {
                label[leader] = count;
                count += 1;
            }
            label[leader]
        })
        .collect();
    (of, count)
}

/// Members of each set, in ascending order, from [`labels`].
pub(super) fn members((of, count): (&[u32], u32)) -> Vec<Vec<u32>> {
    let mut members = vec![Vec::new(); count as usize];
    for (member, set) in (0..).zip(of) {
        members[*set as usize].push(member);
    }
    members
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
