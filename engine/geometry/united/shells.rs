//! Closed shells of a surface, also where they share edges.

use glam::DVec3;

use crate::geometry::surface::Surface;
use crate::geometry::topology::{Edge, root};
use crate::numbers;

/// Triangles at an edge count as faces that coincide where their third corners, as far from the edge,
/// would be as near as this many times what f32 resolves.
const ALIKE: f64 = 4.0;

/// Shell of each triangle, and the number of shells; shells are numbered by their first triangle.
/// Where more than two triangles share an edge, those belong together that have material between
/// them. `resolved`: the length that f32 resolves, m. `None` where an edge has not as many triangles one way as the other: no shell is closed
/// there.
pub(super) fn shells(surface: &Surface, edges: &[Edge], resolved: f64) -> Option<(Vec<u32>, u32)> {
    let mut parent: Vec<u32> = (0..numbers::count(surface.triangles.len())).collect();
    let mut join = |a: u32, b: u32| {
        let (a, b) = (root(&mut parent, a), root(&mut parent, b));
        parent[a.max(b) as usize] = a.min(b);
    };
    for group in edges.chunk_by(|a, b| a.key == b.key) {
        if 2 * group.iter().filter(|edge| edge.upwards).count() != group.len() {
            return None;
        }
        match group {
            [a, b] => join(a.triangle, b.triangle),
            _ => wedges(surface, group, resolved).into_iter().for_each(|[a, b]| join(a, b)),
        }
    }
    let mut label = vec![u32::MAX; parent.len()];
    let mut count = 0;
    let of = (0..numbers::count(parent.len()))
        .map(|triangle| {
            let leader = root(&mut parent, triangle) as usize;
            if label[leader] == u32::MAX {
                label[leader] = count;
                count += 1;
            }
            label[leader]
        })
        .collect();
    Some((of, count))
}

/// A triangle at an edge.
struct Leaf {
    /// About the edge, counter-clockwise as seen against its direction, rad.
    angle: f64,
    /// What f32 leaves open of it, rad.
    doubt: f64,
    /// Whether the triangle runs along the edge: its material lies clockwise of it.
    upwards: bool,
    triangle: u32,
}

/// Pairs of triangles at an edge with material between them: from each one that runs along it,
/// clockwise, to the next that runs against it and is not taken by one in between.
fn wedges(surface: &Surface, group: &[Edge], resolved: f64) -> Vec<[u32; 2]> {
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
            Leaf { angle, doubt, upwards: edge.upwards, triangle: edge.triangle }
        })
        .collect();
    leaves.sort_by(|a, b| b.angle.total_cmp(&a.angle).then(a.triangle.cmp(&b.triangle)));
    // Begins behind the widest gap, so that no faces that coincide stand at both ends.
    let gap = |at: usize| {
        let before = leaves[(at + leaves.len() - 1) % leaves.len()].angle;
        (before - leaves[at].angle).rem_euclid(std::f64::consts::TAU)
    };
    let start = (0..leaves.len()).max_by(|a, b| gap(*a).total_cmp(&gap(*b))).unwrap_or_default();
    leaves.rotate_left(start);
    // Of faces that coincide those first that end material: it does not lie between them. Of two
    // equal parts the triangles of each come together, for one stands behind the other in the list.
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
    use crate::geometry::topology;

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

    fn shells_of(all: &[[[f64; 3]; 2]]) -> Option<(Vec<u32>, u32)> {
        let all: Vec<[DVec3; 2]> = all.iter().map(|it| it.map(DVec3::from_array)).collect();
        let surface = boxes(&all);
        assert_eq!(surface.triangles.len(), 12 * all.len());
        shells(&surface, &topology::edges(&surface), 1e-9)
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
        assert!(shells(&surface, &topology::edges(&surface), 1e-9).is_none());
    }
}
