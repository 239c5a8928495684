//! Corners of open edges that are apart by no more than numbers are rounded.

use std::fmt::{self, Display, Formatter};

use glam::DVec3;
use rayon::prelude::*;

use super::defects::width;
use super::surface::{Surface, bounds_of, rounded};
use super::topology::{Edge, is_balanced, join, labels, members};
use super::tree::Tree;
use beamlet_core::numbers;

/// Distance over which corners are joined, units of the last place of f32 at the size of the surface.
pub(super) const UNITS: f64 = 4.0;
/// Share of the shortest edge at a corner within which it is joined to another.
const OF_EDGE: f64 = 0.25;
/// Growth of the distance within which a nearest corner is searched.
const GROWTH: f64 = 4.0;
/// Corners at open edges above which the nearest are not searched.
pub(super) const MOST: usize = 200_000;

/// Joined corners of a surface.
#[derive(Debug)]
pub(super) struct Joined {
    /// Number of corners that were joined to others.
    pub(super) corners: usize,
    /// Largest distance of two joined corners, m.
    pub(super) farthest: f64,
    /// Triangles that are left out because two corners became one: number, and a corner.
    pub(super) dropped: Vec<(u32, DVec3)>,
}

/// The joined corners in words.
impl Display for Joined {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let (corners, farthest) = (self.corners, rounded(self.farthest));
        let s = if corners == 1 { "" } else { "s" };
        write!(f, "{corners} corner{s} up to {farthest} apart were joined: its numbers are rounded")
    }
}

/// Joins corners at open edges within a few units of the resolution `step` (m), and within a quarter of
/// the shortest edge at either. The order of the triangles does not matter. `None`: nothing was joined,
/// and the surface did not change.
pub(super) fn join_corners(surface: &mut Surface, edges: &[Edge], step: f64) -> Option<Joined> {
    let tolerance = UNITS * step;
    let open = Corners::of(surface, edges);
    if open.vertices.len() < 2 || !(tolerance.is_finite() && tolerance > 0.0) {
        return None;
    }
    let limits = open.limits(surface, step);
    let near = |at: u32| {
        let own = limits[at as usize];
        open.within(at, own)
            .filter(|(other, distance)| {
                at < *other && *distance <= own.min(limits[*other as usize])
            })
            .map(|(other, _)| [at, other])
            .collect::<Vec<_>>()
    };
    let pairs: Vec<[u32; 2]> =
        (0..numbers::count(limits.len())).into_par_iter().flat_map_iter(near).collect();
    let mut parent: Vec<u32> = (0..numbers::count(limits.len())).collect();
    pairs.into_iter().for_each(|pair| join(&mut parent, pair));
    let (of, count) = labels(&mut parent);
    let mut to: Vec<u32> = (0..numbers::count(surface.vertices.len())).collect();
    let (mut corners, mut farthest) = (0, 0.0_f64);
    for mut set in members((&of, count)).into_iter().filter(|set| set.len() > 1) {
        let place = |at: &u32| open.places[*at as usize];
        let [low, high] = bounds_of(set.iter().map(place));
        let extent = low.distance(high);
        // A chain of corners may reach farther than each of its links.
        if extent > tolerance {
            continue;
        }
        set.sort_by(|a, b| in_order(place(a), place(b)));
        let leader = open.vertices[set[0] as usize];
        set.iter().for_each(|at| to[open.vertices[*at as usize] as usize] = leader);
        corners += set.len() - 1;
        farthest = farthest.max(extent);
    }
    (corners > 0).then(|| Joined { corners, farthest, dropped: surface.replace_vertices(&to) })
}

/// Least distance of two corners at open edges that no edge joins, m; `step`: the resolution, m.
pub(super) fn nearest_corners(surface: &Surface, edges: &[Edge], step: f64) -> Option<f64> {
    let open = Corners::of(surface, edges);
    let [low, high] = bounds_of(open.places.iter().copied());
    let size = low.distance(high);
    if !((2..=MOST).contains(&open.vertices.len()) && step > 0.0 && size.is_finite()) {
        return None;
    }
    let has_edge = |a: u32, b: u32| {
        let [a, b] = [a, b].map(|at| u64::from(open.vertices[at as usize]));
        let key = a.min(b) << 32 | a.max(b);
        edges.binary_search_by_key(&key, |edge| edge.key).is_ok()
    };
    let mut reach = GROWTH * UNITS * step;
    while reach < GROWTH * size {
        let nearest = |at: u32| {
            open.within(at, reach)
                .filter(|(other, distance)| {
                    at < *other && *distance <= reach && !has_edge(at, *other)
                })
                .map(|(_, distance)| distance)
                .fold(f64::INFINITY, f64::min)
        };
        let all = (0..numbers::count(open.vertices.len())).into_par_iter().map(nearest);
        let least = all.reduce(|| f64::INFINITY, f64::min);
        if least.is_finite() {
            return Some(least);
        }
        reach *= GROWTH;
    }
    None
}

fn in_order(a: DVec3, b: DVec3) -> std::cmp::Ordering {
    let parts = a.to_array().into_iter().zip(b.to_array()).map(|(a, b)| a.total_cmp(&b));
    parts.fold(std::cmp::Ordering::Equal, std::cmp::Ordering::then)
}

/// Vertices at edges that have more triangles one way than the other.
pub(super) struct Corners {
    /// Ascending.
    pub(super) vertices: Vec<u32>,
    /// About the middle of them all.
    pub(super) places: Vec<DVec3>,
    pub(super) tree: Tree,
}

impl Corners {
    pub(super) fn of(surface: &Surface, edges: &[Edge]) -> Self {
        let mut vertices: Vec<u32> = edges
            .chunk_by(|a, b| a.key == b.key)
            .filter(|edge| !is_balanced(edge))
            .flat_map(|edge| edge[0].ends())
            .collect();
        vertices.sort_unstable();
        vertices.dedup();
        let place = |vertex: &u32| surface.vertices[*vertex as usize];
        // Nodes of the tree are f32.
        let [low, high] = bounds_of(vertices.iter().map(place));
        let places: Vec<DVec3> = vertices.iter().map(|it| place(it) - low.midpoint(high)).collect();
        let boxes: Vec<[DVec3; 2]> = places.iter().map(|it| [*it; 2]).collect();
        Self { vertices, places, tree: Tree::of_boxes(&boxes) }
    }

    /// Distance within which each is joined to others, as far as its edges allow. Edges of triangles
    /// without width do not count: they may be gaps themselves.
    fn limits(&self, surface: &Surface, step: f64) -> Vec<f64> {
        let mut limits = vec![UNITS * step; self.vertices.len()];
        for (triangle, corners) in surface.triangles.iter().enumerate() {
            let at = corners.map(|vertex| self.vertices.binary_search(&vertex));
            if at.iter().all(Result::is_err) || width(surface.corners(triangle)) <= step {
                continue;
            }
            let places = surface.corners(triangle);
            for k in 0..3 {
                let length = OF_EDGE * places[k].distance(places[(k + 1) % 3]);
                for place in [at[k], at[(k + 1) % 3]].into_iter().flatten() {
                    limits[place] = limits[place].min(length);
                }
            }
        }
        limits
    }

    /// Others near one of them, with their distances; some are farther away than `reach`.
    fn within(&self, at: u32, reach: f64) -> impl Iterator<Item = (u32, f64)> {
        let place = self.places[at as usize];
        let mut found = Vec::new();
        self.tree.within([place - reach, place + reach], |other| {
            if other != at {
                found.push((other, place.distance(self.places[other as usize])));
            }
        });
        found.into_iter()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::topology;

    /// A tetrahedron, each triangle with corners of its own, every second of them displaced by `noise`.
    fn soup(size: f64, noise: f64) -> Surface {
        let corners = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z].map(|it| it * size);
        let mut surface = Surface::default();
        let triangles = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]];
        for (number, triangle) in triangles.into_iter().enumerate() {
            let shift = noise * (number % 2) as f64;
            surface.push_triangle(triangle.map(|it: usize| corners[it] + shift)).unwrap();
        }
        surface.weld();
        surface
    }

    /// Edges of ten units: corners 1.7 units apart are joined, corners 2.7 units apart are not.
    #[test]
    fn corners_are_not_joined_over_a_quarter_of_an_edge() {
        for (noise, joins) in [(1e-7, true), (1.6e-7, false)] {
            let mut surface = soup(1e-6, noise);
            let edges = topology::edges(&surface);
            assert_eq!(join_corners(&mut surface, &edges, 1e-7).is_some(), joins, "{noise}");
        }
    }
}
