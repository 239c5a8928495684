//! Triangles without area, and triangles given twice.

use glam::DVec3;
use rayon::prelude::*;

use super::found::DefectCount;
use crate::surface::{Surface, bounds_of};
use beamlet_core::numbers;

/// Triangles that joining corners left out, and those that are no wider than `resolved`.
pub(super) fn degenerate(
    surface: &Surface,
    dropped: &[(u32, DVec3)],
    resolved: f64,
) -> DefectCount {
    let thin = |triangle: &u32| width(surface.corners(*triangle as usize)) <= resolved;
    let mut all: Vec<_> = (0..numbers::count(surface.triangles.len()))
        .into_par_iter()
        .filter(thin)
        .map(|triangle| {
            let [low, high] = bounds_of(surface.corners(triangle as usize).into_iter());
            (surface.number(triangle), low.midpoint(high))
        })
        .collect();
    all.extend(dropped);
    all.sort_by_key(|(number, _)| *number);
    let mut found = DefectCount::default();
    for (number, place) in all {
        found.add(&[number], || Some(place));
    }
    found
}

/// Least height of a triangle, m.
pub(crate) fn width([a, b, c]: [DVec3; 3]) -> f64 {
    let longest = (b - a).length().max((c - b).length()).max((a - c).length());
    (b - a).cross(c - a).length() / longest
}

/// Triangles with the corners of an earlier one, in whatever order.
pub(crate) fn duplicate(surface: &Surface) -> DefectCount {
    let mut sorted: Vec<([u32; 3], u32)> = surface
        .triangles
        .par_iter()
        .zip(0..numbers::count(surface.triangles.len()))
        .map(|(corners, triangle)| {
            let mut corners = *corners;
            corners.sort_unstable();
            (corners, triangle)
        })
        .collect();
    sorted.par_sort_unstable();
    let mut again: Vec<[u32; 2]> = sorted
        .chunk_by(|a, b| a.0 == b.0)
        .flat_map(|group| group[1..].iter().map(|later| [later.1, group[0].1]))
        .collect();
    again.sort_unstable();
    let mut found = DefectCount::default();
    for [later, first] in again {
        found.add(&[first, later].map(|triangle| surface.number(triangle)), || {
            let [a, b, c] = surface.corners(later as usize);
            Some((a + b + c) / 3.0)
        });
    }
    found
}
