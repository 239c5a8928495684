//! Closed shells of a surface, also where they share edges.

use glam::DVec3;

use crate::surface::Surface;
use crate::topology::{Edge, is_balanced, join, labels, root};
use beamlet_core::numbers;
use std::collections::HashMap;

/// Triangles at an edge count as faces that coincide where their third corners, as far from the edge,
/// would be as near as this many times what f32 resolves.
const ALIKE: f64 = 4.0;

/// Closed shells of a surface.
pub(super) struct Shells {
    /// Shell of each triangle; shells are numbered by their first triangle.
    pub(super) of: Vec<u32>,
    pub(super) count: u32,
    /// Edges of more than two triangles, with the pairs of triangles that their shells connect there.
    shared: Vec<([u32; 2], [u32; 2])>,
}

/// The shells of a surface. Triangles at an edge of more than two are paired with material between them.
/// `resolved`: the resolution of f32, m. `None` if an edge has unequal numbers of triangles in both
/// directions: no shell is closed there.
pub(super) fn shells(surface: &Surface, edges: &[Edge], resolved: f64) -> Option<Shells> {
    let mut parent: Vec<u32> = (0..numbers::count(surface.triangles.len())).collect();
    let mut shared = Vec::new();
    for group in edges.chunk_by(|a, b| a.key == b.key) {
        if !is_balanced(group) {
            return None;
        }
        match group {
            [a, b] => join(&mut parent, [a.triangle, b.triangle]),
            _ => shared.push(group),
        }
    }
    let mut pairs = Vec::new();
    for group in shared {
        let of_edge = wedges(surface, group, resolved, |triangle| root(&mut parent, triangle));
        pairs.extend(of_edge.into_iter().map(|pair| (group[0].ends(), pair)));
    }
    pairs.iter().for_each(|(_, pair)| join(&mut parent, *pair));
    let (of, count) = labels(&mut parent);
    Some(Shells { of, count, shared: pairs })
}

impl Shells {
    /// The surface with a vertex of its own for each fan of triangles of a shell around an end of a shared
    /// edge.
    pub(super) fn split(&self, surface: &Surface, edges: &[Edge]) -> Surface {
        let mut split = Surface::new(surface.vertices.clone(), surface.triangles.clone());
        let mut is_shared = vec![false; surface.vertices.len()];
        self.shared.iter().flat_map(|it| it.0).for_each(|it| is_shared[it as usize] = true);
        // Corners of triangles, three each; those that triangles connect around a vertex are joined.
        let mut parent: Vec<u32> = (0..3 * numbers::count(surface.triangles.len())).collect();
        let manifold = edges.chunk_by(|a, b| a.key == b.key).filter_map(|group| match group {
            [a, b] => Some((a.ends(), [a.triangle, b.triangle])),
            _ => None,
        });
        for (ends, pair) in manifold.chain(self.shared.iter().copied()) {
            for vertex in ends.into_iter().filter(|it| is_shared[*it as usize]) {
                join(&mut parent, pair.map(|triangle| surface.corner_of(triangle, vertex)));
            }
        }
        // Another shell keeps the vertex, too: shells are taken apart.
        let mut owner: HashMap<(u32, u32), u32> = HashMap::new();
        let mut own: HashMap<u32, u32> = HashMap::new();
        for corner in 0..numbers::count(parent.len()) {
            let [triangle, side] = [corner as usize / 3, corner as usize % 3];
            let vertex = surface.triangles[triangle][side];
            if !is_shared[vertex as usize] {
                continue;
            }
            let fan = root(&mut parent, corner);
            if *owner.entry((vertex, self.of[triangle])).or_insert(fan) != fan {
                split.triangles[triangle][side] = *own.entry(fan).or_insert_with(|| {
                    split.vertices.push(surface.vertices[vertex as usize]);
                    numbers::count(split.vertices.len() - 1)
                });
            }
        }
        split
    }
}

/// A triangle at an edge.
struct Leaf {
    /// About the edge, counter-clockwise as seen against its direction, rad.
    angle: f64,
    /// Uncertainty of the angle from rounding to f32, rad.
    doubt: f64,
    /// True if the triangle runs along the edge: its material lies clockwise of it.
    upwards: bool,
    triangle: u32,
    /// The triangles connected to it by other edges.
    sheet: u32,
}

/// Pairs of triangles at an edge with material between them, of those that other edges connect
/// (`sheet_of`) first: parts that pass through each other at the edge stay apart.
fn wedges(
    surface: &Surface,
    group: &[Edge],
    resolved: f64,
    sheet_of: impl FnMut(u32) -> u32,
) -> Vec<[u32; 2]> {
    let leaves = leaves(surface, group, resolved, sheet_of);
    let ways = |sheet: u32| {
        let own = leaves.iter().filter(|leaf| leaf.sheet == sheet);
        own.map(|leaf| if leaf.upwards { 1 } else { -1 }).sum::<i32>()
    };
    let whole: Vec<bool> = leaves.iter().map(|leaf| ways(leaf.sheet) == 0).collect();
    let mut sheets: Vec<u32> =
        leaves.iter().zip(&whole).filter(|it| *it.1).map(|it| it.0.sheet).collect();
    sheets.sort_unstable();
    sheets.dedup();
    let mut pairs: Vec<[u32; 2]> = sheets
        .into_iter()
        .flat_map(|sheet| matched(leaves.iter().filter(|leaf| leaf.sheet == sheet)))
        .collect();
    let others = leaves.iter().zip(&whole).filter(|it| !*it.1).map(|it| it.0);
    pairs.extend(matched(others));
    pairs
}

/// Triangles at an edge, clockwise; of faces that coincide those first that end material, for it does
/// not lie between them.
fn leaves(
    surface: &Surface,
    group: &[Edge],
    resolved: f64,
    mut sheet_of: impl FnMut(u32) -> u32,
) -> Vec<Leaf> {
    let [low, high] = group[0].ends();
    let [from, to] = [low, high].map(|vertex| surface.vertices[vertex as usize]);
    let along = (to - from).normalize_or_zero();
    let out = |edge: &Edge| {
        let corners = surface.triangles[edge.triangle as usize];
        let third = corners.into_iter().find(|it| *it != low && *it != high).unwrap_or(low);
        (surface.vertices[third as usize] - from).reject_from(along)
    };
    let first: DVec3 = out(&group[0]);
    let across = along.cross(first);
    let mut leaves: Vec<Leaf> = group
        .iter()
        .map(|edge| {
            let out = out(edge);
            let angle = libm::atan2(out.dot(across), out.dot(first));
            let doubt = ALIKE * resolved / out.length().max(resolved);
            let (upwards, triangle) = (edge.upwards, edge.triangle);
            Leaf { angle, doubt, upwards, triangle, sheet: sheet_of(triangle) }
        })
        .collect();
    leaves.sort_by(|a, b| b.angle.total_cmp(&a.angle).then(a.triangle.cmp(&b.triangle)));
    // Begins behind the widest gap, so that coinciding faces are not split between both ends.
    let gap = |at: usize| {
        let before = leaves[(at + leaves.len() - 1) % leaves.len()].angle;
        (before - leaves[at].angle).rem_euclid(std::f64::consts::TAU)
    };
    let start = (0..leaves.len()).max_by(|a, b| gap(*a).total_cmp(&gap(*b))).unwrap_or_default();
    leaves.rotate_left(start);
    // Of two equal parts the triangles of each come together, since one follows the other in the list.
    let near = |a: &Leaf, b: &Leaf| {
        let apart = (a.angle - b.angle).rem_euclid(std::f64::consts::TAU);
        apart.min(std::f64::consts::TAU - apart) < a.doubt.max(b.doubt)
    };
    for alike in leaves.chunk_by_mut(near) {
        alike.sort_by_key(|leaf| {
            let turn = if leaf.upwards { leaf.triangle } else { u32::MAX - leaf.triangle };
            (leaf.upwards, turn)
        });
    }
    leaves
}

/// Pairs of adjacent triangles about an edge: from each one that runs along it to the next that runs
/// against it and is not paired in between.
fn matched<'a>(leaves: impl Iterator<Item = &'a Leaf>) -> Vec<[u32; 2]> {
    let leaves: Vec<&Leaf> = leaves.collect();
    let mut open = Vec::new();
    let mut pairs = Vec::with_capacity(leaves.len() / 2);
    let mut taken = vec![false; leaves.len()];
    // Twice around: material may lie across the start.
    for (at, leaf) in leaves.iter().enumerate().chain(leaves.iter().enumerate()) {
        if taken[at] {
            continue;
        }
        if leaf.upwards {
            if !open.contains(&at) {
                open.push(at);
            }
        } else if let Some(begin) = open.pop() {
            (taken[begin], taken[at]) = (true, true);
            pairs.push([leaves[begin].triangle, leaf.triangle]);
        }
    }
    pairs
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::topology;
    use glam::DMat3;

    /// Corners of boxes, equal ones joined, as triangles turned outwards.
    fn boxes(all: &[[DVec3; 2]]) -> Surface {
        let mut surface = Surface::default();
        for [low, high] in all {
            let corner = |k: u32| {
                let pick = |bit: u32, low: f64, high: f64| if k & bit == 0 { low } else { high };
                DVec3::new(pick(1, low.x, high.x), pick(2, low.y, high.y), pick(4, low.z, high.z))
            };
            for [a, b, c, d] in
                [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]]
            {
                surface.push_triangle([a, b, c].map(corner)).unwrap();
                surface.push_triangle([a, c, d].map(corner)).unwrap();
            }
        }
        surface.weld();
        surface
    }

    fn of_and_count(surface: &Surface) -> Option<(Vec<u32>, u32)> {
        let Shells { of, count, .. } = shells(surface, &topology::edges(surface), 1e-9)?;
        Some((of, count))
    }

    fn shells_of(all: &[[[f64; 3]; 2]]) -> Option<(Vec<u32>, u32)> {
        let all: Vec<[DVec3; 2]> = all.iter().map(|it| it.map(DVec3::from_array)).collect();
        let surface = boxes(&all);
        assert_eq!(surface.triangles.len(), 12 * all.len());
        of_and_count(&surface)
    }

    #[test]
    fn boxes_that_share_an_edge_a_face_or_more_come_apart() {
        let one = [[0.0; 3], [1.0; 3]];
        let in_order = |count: u32| (0..count).flat_map(|it| [it; 12]).collect::<Vec<u32>>();
        for others in [
            // An edge, a face, half of a face, an edge from the same side.
            vec![[[1.0, 1.0, 0.0], [2.0, 2.0, 1.0]]],
            vec![[[0.0, 0.0, 1.0], [1.0, 1.0, 3.0]]],
            vec![[[0.0, 0.0, 1.0], [1.0, 0.5, 3.0]]],
            // Four around one edge.
            vec![
                [[1.0, 1.0, 0.0], [2.0, 2.0, 1.0]],
                [[1.0, 0.0, 0.0], [2.0, 1.0, 1.0]],
                [[0.0, 1.0, 0.0], [1.0, 2.0, 1.0]],
            ],
            // A stack.
            (1..6).map(|k| [[0.0, 0.0, f64::from(k)], [1.0, 1.0, f64::from(k + 1)]]).collect(),
        ] {
            let all: Vec<_> = std::iter::once(one).chain(others).collect();
            let (of, count) = shells_of(&all).unwrap();
            assert_eq!(count as usize, all.len(), "{all:?}");
            assert_eq!(of, in_order(count), "{all:?}");
        }
    }

    #[test]
    fn boxes_that_pass_through_each_other_at_a_common_edge_stay_apart() {
        // Corners of faces share an edge inside both; about it their triangles alternate.
        let one = boxes(&[[DVec3::ZERO, DVec3::ONE]]);
        let turn = DMat3::from_rotation_z(0.3);
        let mut surface = one.clone();
        let first = u32::try_from(surface.vertices.len()).unwrap();
        surface.vertices.extend(one.vertices.iter().map(|it| turn * *it));
        surface.triangles.extend(one.triangles.iter().map(|it| it.map(|corner| corner + first)));
        surface.weld();
        let edges = topology::edges(&surface);
        assert!(edges.chunk_by(|a, b| a.key == b.key).any(|group| group.len() == 4));
        let (of, count) = of_and_count(&surface).unwrap();
        assert_eq!((count, of), (2, [[0; 12], [1; 12]].concat()));
    }

    #[test]
    fn boxes_that_overlap_on_a_common_edge_are_closed_shells_all_the_same() {
        let all = [[[0.0; 3], [1.0; 3]], [[0.0; 3], [0.5, 2.0, 1.0]]];
        let (of, count) = shells_of(&all).unwrap();
        assert!(count == 2, "{of:?}");
    }

    #[test]
    fn a_box_that_is_there_twice_is_two_shells() {
        let one = [[0.0; 3], [1.0; 3]];
        let (of, count) = shells_of(&[one, one]).unwrap();
        assert_eq!((count, of), (2, [[0; 12], [1; 12]].concat()));
    }

    #[test]
    fn an_open_surface_has_no_shells() {
        let mut surface = boxes(&[[DVec3::ZERO, DVec3::ONE]]);
        surface.triangles.pop();
        assert!(of_and_count(&surface).is_none());
    }
}
