//! Triangles given twice, where the surface is closed without one of them.

use std::collections::HashMap;

use super::surface::Surface;
use super::topology::{Edge, edges_of, is_balanced, join, labels, members};
use beamlet_core::numbers;

/// A triangle that has the corners of another one.
struct Copy {
    triangle: u32,
    /// Equal for copies that may go together: the number of earlier copies of the same orientation, and the
    /// orientation.
    layer: [u32; 2],
}

/// Removes triangles with the corners of another one whose removal leaves fewer edges with unequal numbers
/// of triangles in both directions; returns their number. A closed part that is given twice stays.
pub(super) fn remove_repeated(surface: &mut Surface, edges: &[Edge]) -> usize {
    if edges.chunk_by(|a, b| a.key == b.key).all(is_balanced) {
        return 0;
    }
    let [first, later] = copies(surface);
    // Triangles along each edge one way less those the other way.
    let way = |edge: &Edge| if edge.upwards { 1 } else { -1 };
    let mut balance: HashMap<u64, i32> = HashMap::new();
    for copy in first.iter().chain(&later) {
        for edge in edges_of(surface, copy.triangle) {
            let begin = edges.partition_point(|it| it.key < edge.key);
            let same = edges[begin..].iter().take_while(|it| it.key == edge.key);
            balance.entry(edge.key).or_insert_with(|| same.map(way).sum());
        }
    }
    let mut gone = vec![false; surface.triangles.len()];
    // The first one where it is that one which is turned round.
    for copies in [later, first] {
        for patch in patches(surface, &copies) {
            let mut without: HashMap<u64, i32> = HashMap::new();
            for edge in patch.iter().flat_map(|triangle| edges_of(surface, *triangle)) {
                *without.entry(edge.key).or_insert(balance[&edge.key]) -= way(&edge);
            }
            let before: u32 = without.keys().map(|key| balance[key].unsigned_abs()).sum();
            let after: u32 = without.values().map(|it| it.unsigned_abs()).sum();
            if after < before {
                balance.extend(without);
                patch.iter().for_each(|triangle| gone[*triangle as usize] = true);
            }
        }
    }
    let removed = gone.iter().filter(|gone| **gone).count();
    if removed > 0 {
        surface.keep(|triangle| !gone[triangle]);
    }
    removed
}

/// Triangles with equal corners: the first of each, and the later ones.
fn copies(surface: &Surface) -> [Vec<Copy>; 2] {
    let mut sorted: Vec<([u32; 3], u32, bool)> = (0..numbers::count(surface.triangles.len()))
        .map(|triangle| {
            let [a, b, c] = surface.triangles[triangle as usize];
            let mut corners = [a, b, c];
            corners.sort_unstable();
            (corners, triangle, (a < b) ^ (b < c) ^ (c < a))
        })
        .collect();
    sorted.sort_unstable();
    let [mut first, mut later] = [Vec::new(), Vec::new()];
    for group in sorted.chunk_by(|a, b| a.0 == b.0).filter(|group| group.len() > 1) {
        for (at, (_, triangle, turned)) in group.iter().enumerate() {
            let earlier = group[..at].iter().filter(|it| it.2 == *turned).count();
            let layer = [numbers::count(earlier), u32::from(*turned != group[0].2)];
            let list = if at == 0 { &mut first } else { &mut later };
            list.push(Copy { triangle: *triangle, layer });
        }
    }
    [first, later]
}

/// Copies that share edges with others of their layer, together.
fn patches(surface: &Surface, copies: &[Copy]) -> Vec<Vec<u32>> {
    let mut parent: Vec<u32> = (0..numbers::count(copies.len())).collect();
    let mut known: HashMap<([u32; 2], u64), u32> = HashMap::new();
    for (number, copy) in (0..).zip(copies) {
        for edge in edges_of(surface, copy.triangle) {
            let other = *known.entry((copy.layer, edge.key)).or_insert(number);
            join(&mut parent, [number, other]);
        }
    }
    let (of, count) = labels(&mut parent);
    let triangles = |set: Vec<u32>| set.iter().map(|at| copies[*at as usize].triangle).collect();
    members((&of, count)).into_iter().map(triangles).collect()
}
