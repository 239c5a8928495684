//! Edges of a surface: is it closed, and of which connected components does it consist.

use rayon::prelude::*;

use super::surface::{Defect, Surface, in_mm};

/// An edge of a triangle: its vertices in ascending order as one number, then its triangle and
/// whether the triangle runs along it upwards.
type Edge = (u64, u32, bool);

/// Component of each triangle, and the number of components; components are numbered by their
/// first triangle. Triangles belong together when they share an edge, not just a vertex.
///
/// Fails unless every edge is used exactly twice, once in each direction.
pub(super) fn components(surface: &Surface) -> Result<(Vec<u32>, u32), Defect> {
    let mut edges: Vec<Edge> = Vec::with_capacity(3 * surface.triangles.len());
    edges.extend((0_u32..).zip(&surface.triangles).flat_map(|(number, [a, b, c])| {
        [(*a, *b), (*b, *c), (*c, *a)].map(|(from, to)| {
            let key = u64::from(from.min(to)) << 32 | u64::from(from.max(to));
            (key, number, from < to)
        })
    }));
    edges.par_sort_unstable();
    closed(surface, &edges)?;

    let mut parent: Vec<u32> = (0_u32..).take(surface.triangles.len()).collect();
    for pair in edges.chunks_exact(2) {
        let (a, b) = (root(&mut parent, pair[0].1), root(&mut parent, pair[1].1));
        // The lower number leads, so a component is known by its first triangle.
        parent[a.max(b) as usize] = a.min(b);
    }
    drop(edges);
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
    Ok((component, count))
}

fn root(parent: &mut [u32], mut at: u32) -> u32 {
    while parent[at as usize] != at {
        let above = parent[parent[at as usize] as usize];
        parent[at as usize] = above;
        at = above;
    }
    at
}

fn closed(surface: &Surface, edges: &[Edge]) -> Result<(), Defect> {
    let (mut open, mut crowded, mut twisted) = (0_usize, 0_usize, 0_usize);
    let mut first = None;
    for group in edges.chunk_by(|a, b| a.0 == b.0) {
        match group {
            [a, b] if a.2 != b.2 => continue,
            [_] => open += 1,
            [_, _] => twisted += 1,
            _ => crowded += 1,
        }
        first.get_or_insert(group[0].0);
    }
    let Some(key) = first else { return Ok(()) };
    let counts = [
        (open, "used by one triangle only (a hole or a gap)"),
        (crowded, "used by more than two triangles (parts that share an edge or a face)"),
        (twisted, "between triangles that wind opposite ways"),
    ];
    let told: Vec<String> = counts
        .iter()
        .filter(|(count, _)| *count > 0)
        .map(|(count, what)| {
            format!("{count} {} {what}", if *count == 1 { "edge" } else { "edges" })
        })
        .collect();
    let ends = [key >> 32, key & 0xffff_ffff]
        .map(|vertex| in_mm(surface.vertices[usize::try_from(vertex).unwrap_or_default()]));
    Err(Defect::new(
        format!("the surface is not closed: {}", told.join(", ")),
        format!("the first from {} to {}", ends[0], ends[1]),
    ))
}
