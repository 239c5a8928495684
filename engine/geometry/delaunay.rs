//! Triangles of a large polygon: the inside of a constrained Delaunay triangulation.
//!
//! Cutting ears one by one takes quadratic time for corners on lines or in long teeth; a constrained
//! triangulation does not.

use glam::DVec2;
use spade::handles::DirectedEdgeHandle;
use spade::{ConstrainedDelaunayTriangulation, Point2, Triangulation};
use std::collections::HashMap;

type Edges = ConstrainedDelaunayTriangulation<Point2<f64>>;

/// Triangles of a polygon, by its corners; nothing where it crosses itself. It may touch itself: corners at one
/// place are one, and what lies behind an even number of edges lies outside.
pub(super) fn inside(flat: &[DVec2]) -> Option<Vec<[usize; 3]>> {
    // Zeros of either sign are one place.
    let place = |point: &DVec2| (*point + 0.0).to_array().map(f64::to_bits);
    let mut numbers = HashMap::new();
    let mut corners = Vec::with_capacity(flat.len());
    let mut ring = Vec::with_capacity(flat.len());
    for (corner, point) in flat.iter().enumerate() {
        let next = corners.len();
        let number = *numbers.entry(place(point)).or_insert(next);
        if number == next {
            corners.push(corner);
        }
        ring.push(number);
    }
    let mut times: HashMap<[usize; 2], usize> = HashMap::with_capacity(ring.len());
    let mut edges = Vec::with_capacity(ring.len());
    for (index, from) in ring.iter().enumerate() {
        let to = ring[(index + 1) % ring.len()];
        if to != *from {
            let edge = [to.min(*from), to.max(*from)];
            let count = times.entry(edge).or_default();
            if *count == 0 {
                edges.push(edge);
            }
            *count += 1;
        }
    }
    let points = corners.iter().map(|corner| Point2::new(flat[*corner].x, flat[*corner].y));
    let mut crosses = false;
    let all = Edges::try_bulk_load_cdt(points.collect(), edges, |_| crosses = true).ok()?;
    if crosses || all.num_vertices() != corners.len() {
        return None;
    }
    // An edge through a corner is several, each of them one side of the polygon.
    let divides = |edge: &DirectedEdgeHandle<'_, _, _, _, _>| {
        let ends = edge.vertices().map(|vertex| vertex.index());
        let ends = [ends[0].min(ends[1]), ends[0].max(ends[1])];
        edge.is_constraint_edge() && times.get(&ends).is_none_or(|count| count % 2 == 1)
    };
    let mut seen = vec![false; all.num_all_faces()];
    let mut triangles = Vec::with_capacity(flat.len());
    let mut waiting: Vec<_> = all.convex_hull().map(|edge| (edge.rev(), divides(&edge))).collect();
    while let Some((edge, is_inside)) = waiting.pop() {
        let Some(face) = edge.face().as_inner() else { continue };
        if std::mem::replace(&mut seen[face.index()], true) {
            continue;
        }
        if is_inside {
            triangles.push(face.vertices().map(|vertex| corners[vertex.index()]));
        }
        let around = face.adjacent_edges().into_iter();
        waiting.extend(around.map(|edge| (edge.rev(), is_inside != divides(&edge))));
    }
    Some(triangles)
}
