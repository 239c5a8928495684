//! Holes of a mesh that is accepted open: closed with flat covers, for booleans.

use std::collections::{BTreeMap, HashMap};

use glam::DVec3;

use super::super::surface::Surface;
use beamlet_core::numbers;

/// The surface with its holes closed, and their number. A hole of three edges gets its triangle, a larger
/// one a fan about the mean of its corners. Closed parts do not change.
pub(super) fn closed(surface: &Surface) -> (Surface, usize) {
    let mut missing = missing_edges(surface);
    let mut whole = Surface::new(surface.vertices.clone(), surface.triangles.clone());
    let mut holes = 0;
    let mut way: Vec<u32> = Vec::new();
    while let Some(start) = missing.keys().next().copied() {
        way.clear();
        way.push(start);
        // Each vertex has equal numbers of incoming and outgoing edges, so the walk returns.
        while let Some(next) = way.last().and_then(|last| take(&mut missing, *last)) {
            match way.iter().position(|it| *it == next) {
                Some(from) => {
                    cover(&mut whole, &way[from..]);
                    holes += 1;
                    way.truncate(from + 1);
                }
                None => way.push(next),
            }
        }
    }
    (whole, holes)
}

/// Edges along which triangles are missing: second vertices by the first.
fn missing_edges(surface: &Surface) -> BTreeMap<u32, Vec<u32>> {
    let mut uses: HashMap<[u32; 2], i32> = HashMap::new();
    for [a, b, c] in &surface.triangles {
        for [from, to] in [[*a, *b], [*b, *c], [*c, *a]] {
            let upwards = from < to;
            *uses.entry([from.min(to), from.max(to)]).or_default() += if upwards { 1 } else { -1 };
        }
    }
    let mut missing: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
    for ([low, high], upwards) in uses {
        let [from, to] = if upwards > 0 { [high, low] } else { [low, high] };
        for _ in 0..upwards.unsigned_abs() {
            missing.entry(from).or_default().push(to);
        }
    }
    missing.values_mut().for_each(|it| it.sort_unstable());
    missing
}

/// Takes an edge from a vertex.
fn take(missing: &mut BTreeMap<u32, Vec<u32>>, from: u32) -> Option<u32> {
    let all = missing.get_mut(&from)?;
    let to = all.pop();
    if all.is_empty() {
        missing.remove(&from);
    }
    to
}

fn cover(surface: &mut Surface, corners: &[u32]) {
    if let [a, b, c] = corners {
        surface.triangles.push([*a, *b, *c]);
        return;
    }
    let sum: DVec3 = corners.iter().map(|it| surface.vertices[*it as usize]).sum();
    let middle = numbers::count(surface.vertices.len());
    surface.vertices.push(sum / corners.len() as f64);
    for (k, corner) in corners.iter().enumerate() {
        surface.triangles.push([*corner, corners[(k + 1) % corners.len()], middle]);
    }
}
