//! T-junctions: corners of open edges that lie in the middle of an open edge of a neighbour. The neighbour is
//! divided at them where this leaves no gap.

use std::collections::BTreeMap;

use rayon::prelude::*;

use super::joins::{Corners, MOST, UNITS};
use super::surface::Surface;
use super::topology::{Edge, is_balanced};

/// Corners in the middle of each edge of a triangle, from its first corner on.
type EdgeCorners = [Vec<u32>; 3];

/// An open edge as its triangle runs along it.
struct OpenEdge {
    triangle: u32,
    /// Number of the edge in its triangle: the one behind this corner.
    side: usize,
    /// Corners along it, its ends included.
    corners: Vec<u32>,
}

impl OpenEdge {
    /// The edges that it is divided into, each with its direction.
    fn pieces(&self) -> impl Iterator<Item = ([u32; 2], i32)> {
        self.corners.windows(2).map(|ends| match ends[0] < ends[1] {
            true => ([ends[0], ends[1]], 1),
            false => ([ends[1], ends[0]], -1),
        })
    }
}

/// Divides triangles at the corners within a few units of the resolution `step` (m) of their open edges,
/// where each piece of the edge then has a triangle that runs the other way. Returns the number of divided
/// edges; at 0 the surface is unchanged.
pub(super) fn divide_at_junctions(surface: &mut Surface, edges: &[Edge], step: f64) -> usize {
    let tolerance = UNITS * step;
    let corners = Corners::of(surface, edges);
    let is_few = (3..=MOST).contains(&corners.vertices.len());
    if !(is_few && tolerance.is_finite() && tolerance > 0.0) {
        return 0;
    }
    let groups: Vec<&[Edge]> = edges
        .chunk_by(|a, b| a.key == b.key)
        .filter(|group| !is_balanced(group) && group.len() == 1)
        .collect();
    let open: Vec<OpenEdge> =
        groups.par_iter().map(|group| open_edge(surface, &corners, group[0], tolerance)).collect();
    // Triangles along each piece: those that run upwards less those that run downwards.
    let mut balance = BTreeMap::<[u32; 2], i32>::new();
    for (piece, direction) in open.iter().flat_map(OpenEdge::pieces) {
        *balance.entry(piece).or_default() += direction;
    }
    let closes = |edge: &&OpenEdge| {
        edge.corners.len() > 2 && edge.pieces().all(|(piece, _)| balance[&piece] == 0)
    };
    let (mut divided, mut count) = (BTreeMap::<u32, EdgeCorners>::new(), 0);
    for edge in open.iter().filter(closes) {
        let inner = edge.corners[1..edge.corners.len() - 1].to_vec();
        divided.entry(edge.triangle).or_default()[edge.side] = inner;
        count += 1;
    }
    let mut parts = BTreeMap::new();
    for (triangle, inner) in divided {
        let all: &mut Vec<[u32; 3]> = parts.entry(triangle).or_default();
        divide(surface.triangles[triangle as usize], inner, all);
    }
    if count > 0 {
        surface.replace_triangles(&parts);
    }
    count
}

/// An edge with the corners within `tolerance` (m) of it.
fn open_edge(surface: &Surface, corners: &Corners, edge: Edge, tolerance: f64) -> OpenEdge {
    let own = surface.triangles[edge.triangle as usize];
    let ends = edge.ends();
    let runs = |side: &usize| {
        let from_to = [own[*side], own[(side + 1) % 3]];
        from_to == ends || from_to == [ends[1], ends[0]]
    };
    let side = (0..3).find(runs).unwrap_or_default();
    let [from, to] = [own[side], own[(side + 1) % 3]];
    let place = |vertex: u32| corners.vertices.binary_search(&vertex).map(|at| corners.places[at]);
    let (Ok(start), Ok(end)) = (place(from), place(to)) else {
        return OpenEdge { triangle: edge.triangle, side, corners: vec![from, to] };
    };
    let along = end - start;
    let mut inner: Vec<(f64, u32)> = Vec::new();
    corners.tree.within([start.min(end) - tolerance, start.max(end) + tolerance], |at| {
        let vertex = corners.vertices[at as usize];
        let apart = corners.places[at as usize] - start;
        let share = apart.dot(along) / along.length_squared();
        let is_inside = share > 0.0 && share < 1.0 && !own.contains(&vertex);
        if is_inside && apart.distance(share * along) <= tolerance {
            inner.push((share, vertex));
        }
    });
    inner.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let inner = inner.into_iter().map(|(_, vertex)| vertex);
    let corners = std::iter::once(from).chain(inner).chain([to]).collect();
    OpenEdge { triangle: edge.triangle, side, corners }
}

/// Triangles in place of one whose edges have corners in their middle.
fn divide(triangle: [u32; 3], mut inner: EdgeCorners, parts: &mut Vec<[u32; 3]>) {
    let Some(side) = inner.iter().position(|corners| !corners.is_empty()) else {
        parts.push(triangle);
        return;
    };
    let [from, to, apex] = [0, 1, 2].map(|corner| triangle[(side + corner) % 3]);
    let [along, behind, before] =
        [0, 1, 2].map(|edge| std::mem::take(&mut inner[(side + edge) % 3]));
    let last = along.len();
    let corners: Vec<u32> = std::iter::once(from).chain(along).chain([to]).collect();
    let (mut before, mut behind) = (Some(before), Some(behind));
    for (piece, ends) in corners.windows(2).enumerate() {
        let first = before.take_if(|_| piece == 0).unwrap_or_default();
        let end = behind.take_if(|_| piece == last).unwrap_or_default();
        divide([ends[0], ends[1], apex], [Vec::new(), end, first], parts);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::topology;
    use beamlet_core::numbers;
    use glam::DVec3;

    /// A tetrahedron whose triangles have corners at these shares of their edges, on one side of an edge or on
    /// both; corners are apart from their edge by up to `noise`.
    fn tetrahedron(junctions: &[(usize, usize, f64)], noise: f64) -> Surface {
        let corners = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
        let mut surface = Surface::default();
        for (number, triangle) in [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]].iter().enumerate() {
            let mut inner = EdgeCorners::default();
            let mut places: Vec<DVec3> = triangle.iter().map(|it| corners[*it]).collect();
            for (of, side, share) in junctions.iter().filter(|it| it.0 == number) {
                let [a, b] = [places[*side], places[(side + 1) % 3]];
                let shift = noise * DVec3::new(1.0, -1.0, 1.0) * (*of + 1) as f64;
                inner[*side].push(numbers::count(places.len()));
                places.push(a.lerp(b, *share) + shift);
            }
            let mut parts = Vec::new();
            divide([0, 1, 2], inner, &mut parts);
            for part in parts {
                let corners = part.map(|it| places[it as usize].as_vec3().as_dvec3());
                surface.push_triangle(corners).unwrap();
            }
        }
        surface.weld();
        surface
    }

    fn volume(surface: &Surface) -> f64 {
        let of = |triangle| {
            let [a, b, c] = surface.corners(triangle);
            a.dot(b.cross(c)) / 6.0
        };
        (0..surface.triangles.len()).map(of).sum()
    }

    #[test]
    fn neighbours_are_divided_where_this_closes_the_surface() {
        let step = f64::from(f32::EPSILON);
        let third = 1.0 / 3.0;
        for (junctions, noise, divided) in [
            (&[(2, 0, 0.5)][..], 0.0, 1),
            (&[(2, 0, third), (2, 0, 0.7)], 0.0, 1),
            (&[(2, 0, third), (2, 1, 0.7), (2, 2, 0.1)], 0.0, 3),
            // Corners on both sides of an edge, at other places.
            (&[(2, 0, 0.6), (0, 1, 0.7)], 0.0, 2),
            (&[(2, 0, 0.5)], 0.5 * step, 1),
            (&[(2, 0, 0.5)], 10.0 * step, 0),
            (&[], 0.0, 0),
        ] {
            let mut surface = tetrahedron(junctions, noise);
            let before = surface.triangles.len();
            let edges = topology::edges(&surface);
            assert_eq!(divide_at_junctions(&mut surface, &edges, step), divided, "{junctions:?}");
            let edges = topology::edges(&surface);
            let closed = edges.chunk_by(|a, b| a.key == b.key).all(topology::is_manifold);
            assert_eq!(closed, divided > 0 || junctions.is_empty(), "{junctions:?}, {noise}");
            assert!((volume(&surface) * 6.0 - 1.0).abs() < 20.0 * step, "{junctions:?}");
            assert!(surface.triangles.len() >= before);
            let numbers: Vec<u32> =
                (0..numbers::count(surface.triangles.len())).map(|it| surface.number(it)).collect();
            assert!(numbers.is_sorted(), "{numbers:?}");
        }
    }
}
