//! Triangles of one surface that pass through each other.

use std::collections::HashMap;

use arrayvec::ArrayVec;
use glam::DVec3;
use rayon::prelude::*;

use super::found::DefectCount;
use super::overlap::{Facet, TriangleContact, contact};
use crate::surface::Surface;
use crate::tree::{LEAF, Tree};
use beamlet_core::watch::{LoadStep, Task};
use beamlet_core::{Error, Result};

/// Leaves tried between two looks at the count: a soup of triangles would take for ever.
const CHUNK: usize = 1024;
/// Leaves whose search begins together.
const TOGETHER: usize = 32;
/// Pairs after which counting ends.
pub(crate) const ENOUGH: usize = 100_000;
/// Pairs of one leaf after which it is left alone.
const ENOUGH_OF_ONE: usize = 1000;

/// A pair of triangles that pass through or lie on each other, in their order.
#[derive(Debug, Clone, Copy)]
pub(crate) struct CrossingPair {
    pub(crate) triangles: [u32; 2],
    /// A place of both, where they lie in one plane.
    pub(crate) fold: Option<DVec3>,
}

/// A pair of triangles, in their order, and their intersection.
type MeetingPair = (u32, u32, TriangleContact);

/// Pairs that pass through, or lie on, each other deeper than `resolved`: the defect, and the
/// triangles themselves.
///
/// # Errors
/// [`Error::Interrupted`].
pub(super) fn find(
    surface: &Surface,
    tree: &Tree,
    resolved: f64,
    task: Task<'_>,
) -> Result<(DefectCount, Vec<CrossingPair>)> {
    let mut met: Vec<MeetingPair> = Vec::new();
    let mut passed = 0;
    let leaves = tree.leaves();
    task.begin(LoadStep::Checking, leaves.len() as u64)?;
    for (number, chunk) in leaves.chunks(CHUNK).enumerate() {
        if task.is_cancelled() {
            return Err(Error::Interrupted);
        }
        task.reach((number * CHUNK) as u64);
        let partners = |leaves: &[u32]| partners(surface, tree, leaves, resolved);
        let chunk: Vec<MeetingPair> = chunk.par_chunks(TOGETHER).flat_map_iter(partners).collect();
        passed += chunk.iter().filter(|it| !matches!(it.2, TriangleContact::Graze { .. })).count();
        met.extend(chunk);
        // Some pairs are found twice.
        if passed >= 2 * ENOUGH {
            break;
        }
    }
    met.sort_by_key(|(first, second, _)| (*first, *second));
    met.dedup_by_key(|(first, second, _)| (*first, *second));
    let (mut found, mut pairs) = (DefectCount::default(), Vec::new());
    let mut grazes = HashMap::new();
    for (first, second, contact) in met {
        let place = match contact {
            TriangleContact::Crossing(place) => Some((place, None)),
            TriangleContact::Coplanar(place) => Some((place, Some(place))),
            TriangleContact::Graze { edge, through, side, place } => {
                // Alone it is a touch; with the triangle beyond the edge, a crossing.
                let sides = grazes.entry((edge, through)).or_insert([false; 2]);
                sides[usize::from(side)] = true;
                (*sides == [true; 2]).then_some((place, None))
            }
        };
        if let Some((place, fold)) = place {
            let triangles = [first, second];
            found.add(&triangles.map(|it| surface.number(it)), || Some(place));
            pairs.push(CrossingPair { triangles, fold });
        }
    }
    Ok((found, pairs))
}

/// Pairs of triangles of adjacent leaves and others, in their order.
fn partners(surface: &Surface, tree: &Tree, leaves: &[u32], resolved: f64) -> Vec<MeetingPair> {
    let mut met = Vec::new();
    let margin = 2.0 * resolved;
    let start = tree.start(leaves, margin);
    for leaf in leaves {
        let before = met.len();
        let own: ArrayVec<Facet, LEAF> =
            tree.triangles(*leaf).iter().map(|one| Facet::new(surface, *one)).collect();
        tree.pairs(surface, *leaf, &start, margin, |one, other| {
            let other = Facet::new(surface, other);
            let of_leaf = own.iter().find(|facet| facet.number() == one);
            if let Some(one) = of_leaf
                && let Some(contact) = contact(one, &other, resolved)
            {
                let (first, second) = (one.number(), other.number());
                met.push((first.min(second), first.max(second), contact));
            }
            met.len() - before < ENOUGH_OF_ONE
        });
    }
    met
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::polygon;
    use crate::tree::Tree;
    use glam::{DMat3, DVec2};

    fn is_crossing(contact: Option<TriangleContact>) -> bool {
        contact.is_some_and(|it| !matches!(it, TriangleContact::Graze { .. }))
    }

    /// Triangles from one vertex to points around it; `mixed` of them change their places.
    fn fan(count: u32, mixed: usize, tilt: f64) -> Surface {
        let turn = DMat3::from_rotation_y(tilt) * DMat3::from_rotation_x(0.7 * tilt);
        let mut vertices = vec![DVec3::ZERO];
        for k in 0..count {
            let (sine, cosine) = (3.0 * f64::from(k) / f64::from(count)).sin_cos();
            // Not all in one plane, so that some pass through and some lie on one another.
            let height = if k % 5 == 0 { 0.01 } else { 0.0 };
            vertices.push(turn * DVec3::new(cosine, sine, height));
        }
        for k in 0..mixed {
            let length = vertices.len() - 1;
            vertices.swap(1 + 37 * k % length, 1 + 101 * (k + 1) % length);
        }
        Surface::new(vertices, (1..count).map(|k| [0, k, k + 1]).collect())
    }

    #[test]
    fn pairs_of_a_fan_match_all_pairs() {
        for (mixed, tilt) in [(0, 0.0), (0, 0.5), (3, 0.5), (20, 0.0), (40, 1.1)] {
            // A second sheet crosses the fan without a common vertex.
            let mut surface = fan(300, mixed, tilt);
            let first = u32::try_from(surface.vertices.len()).unwrap();
            let corners = [[0.2, 0.1, -1.0], [0.3, 0.4, -1.0], [0.25, 0.2, 1.0]];
            surface.vertices.extend(corners.map(DVec3::from_array));
            surface.triangles.push([first, first + 1, first + 2]);
            let resolved = 1e-9;
            let tree = Tree::of_triangles(&surface);
            let found = find(&surface, &tree, resolved, Task::unwatched()).unwrap().0;
            let count = u32::try_from(surface.triangles.len()).unwrap();
            let all = (0..count).flat_map(|a| (a + 1..count).map(move |b| (a, b)));
            let met = |&(a, b): &(u32, u32)| {
                let [a, b] = [a, b].map(|it| Facet::new(&surface, it));
                is_crossing(contact(&a, &b, resolved))
            };
            let want: Vec<_> = all.filter(met).take(100_000).collect();
            assert_eq!(found.count, want.len(), "{mixed} {tilt}");
            assert!(want.len() > mixed * mixed / 20, "{mixed} {tilt}: {}", want.len());
            for (spot, (a, b)) in found.places.iter().zip(&want) {
                assert_eq!(spot.triangles, [a + 1, b + 1]);
            }
        }
    }

    /// A prism of height 1 whose outline has `count` corners, every second of them a tooth of this
    /// depth, round or along a line. Round ones with a hub have fans for caps.
    fn teeth(count: u32, depth: f64, [round, hub]: [bool; 2], tilt: f64) -> Surface {
        let corner = |k: u32| {
            let out = if k.is_multiple_of(2) { 1.0 } else { 1.0 - depth };
            let (share, length) = (f64::from(k) / f64::from(count), std::f64::consts::TAU);
            match (round, k + 2 >= count) {
                (true, _) => DVec2::from_angle(length * share) * out,
                (false, true) => DVec2::new(if k + 1 == count { 0.0 } else { 1.0 }, 2.0),
                (false, false) => DVec2::new(share, 1.0 - out),
            }
        };
        let outline: Vec<DVec3> = (0..count).map(|k| corner(k).extend(0.0)).collect();
        let mut triangles = Vec::new();
        let hubs = [2 * count, 2 * count + 1];
        for k in (0..count).filter(|_| hub) {
            let next = (k + 1) % count;
            triangles.extend([[hubs[0], next, k], [hubs[1], k + count, next + count]]);
        }
        let cap = if hub { Vec::new() } else { polygon::triangles(&outline).unwrap() };
        for [a, b, c] in cap.into_iter().map(|it| it.map(|k| u32::try_from(k).unwrap())) {
            triangles.extend([[a, c, b], [a + count, b + count, c + count]]);
        }
        for k in 0..count {
            let next = (k + 1) % count;
            triangles.extend([[k, next, next + count], [k, next + count, k + count]]);
        }
        let turn = DMat3::from_rotation_z(tilt) * DMat3::from_rotation_x(0.3 * tilt);
        let above = outline.iter().map(|it| *it + DVec3::Z);
        let hubs = [DVec3::ZERO, DVec3::Z].into_iter().filter(|_| hub);
        let vertices =
            outline.iter().copied().chain(above).chain(hubs).map(|it| turn * it).collect();
        Surface::new(vertices, triangles)
    }

    #[test]
    fn pairs_of_teeth_match_all_pairs() {
        let (round, fan, line) = ([true, false], [true, true], [false, false]);
        let cases = [
            (0.05, round, 0.0),
            (0.5, round, 0.6),
            (0.3, line, 0.6),
            (0.4, fan, 0.0),
            (0.7, fan, 0.6),
        ];
        for (depth, form, tilt) in cases {
            for bent in [0, 3] {
                let mut surface = teeth(150, depth, form, tilt);
                let (resolved, length) = (1e-9, surface.vertices.len());
                for k in 0..bent {
                    let to = surface.vertices[(41 * k + 9) % length];
                    let from = &mut surface.vertices[(97 * k + 20) % length];
                    *from = from.lerp(to, 0.3);
                }
                let tree = Tree::of_triangles(&surface);
                let found = find(&surface, &tree, resolved, Task::unwatched()).unwrap().0;
                let count = u32::try_from(surface.triangles.len()).unwrap();
                let all = (0..count).flat_map(|a| (a + 1..count).map(move |b| (a, b)));
                let met = |&(a, b): &(u32, u32)| {
                    let [a, b] = [a, b].map(|it| Facet::new(&surface, it));
                    is_crossing(contact(&a, &b, resolved))
                };
                let want = all.filter(met).count();
                // Edges that graze count besides, in the order of the triangles.
                assert!(found.count >= want, "{depth} {form:?} {bent}: {} {want}", found.count);
                assert_eq!(want > 0, bent > 0, "{depth} {form:?} {bent}");
                assert_eq!(found.count > 0, bent > 0, "{depth} {form:?} {bent}");
            }
        }
    }

    #[test]
    fn pairs_tested_grow_linearly_with_the_teeth() {
        let (round, fan, line) = ([true, false], [true, true], [false, false]);
        for (depth, form) in [(0.05, round), (0.5, round), (0.3, line), (0.4, fan), (0.8, fan)] {
            // Were all pairs tested, each would have thousands.
            let surface = teeth(6_000, depth, form, 0.6);
            let tree = Tree::of_triangles(&surface);
            let mut looked_at = 0;
            for leaf in tree.leaves() {
                tree.pairs(&surface, leaf, &tree.start(&[leaf], 1e-9), 1e-9, |_, _| {
                    looked_at += 1;
                    true
                });
            }
            let each = looked_at / surface.triangles.len();
            assert!(each < 400, "{depth} {form:?}: {each}");
        }
    }
}
