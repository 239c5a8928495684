//! Triangles of one surface that pass through each other.

use std::collections::HashMap;

use glam::DVec3;
use rayon::prelude::*;

use super::Found;
use super::overlap::{Contact, contact};
use super::triangles::width;
use crate::geometry::search::Search;
use crate::geometry::surface::{Surface, bounds_of};

/// Triangles tried between two looks at the count: a soup of triangles would take for ever.
const CHUNK: usize = 1024;
/// Pairs after which counting ends.
const ENOUGH: usize = 100_000;
/// Pairs of one triangle after which it is left alone.
const ENOUGH_OF_ONE: usize = 1000;

/// A pair of triangles and how they meet.
type Met = (u32, u32, Contact);

/// Pairs that pass through, or lie on, each other deeper than `resolved`.
pub(super) fn find(surface: &Surface, resolved: f64) -> Found {
    let search = Search::new(surface);
    let all: Vec<u32> = (0..).take(surface.triangles.len()).collect();
    let mut found = Found::default();
    let mut grazes = HashMap::new();
    for chunk in all.chunks(CHUNK) {
        let met: Vec<Vec<Met>> =
            chunk.par_iter().map(|first| partners(surface, &search, *first, resolved)).collect();
        for (first, second, contact) in met.into_iter().flatten() {
            let place = match contact {
                Contact::Crossing(place) => Some(place),
                Contact::Graze { edge, through, side, place } => {
                    // Alone it is a touch; with the triangle beyond the edge, a crossing.
                    let sides = grazes.entry((edge, through)).or_insert([false; 2]);
                    sides[usize::from(side)] = true;
                    (*sides == [true; 2]).then_some(place)
                }
            };
            if let Some(place) = place {
                found.add(&[first, second].map(|it| surface.number(it)), || Some(place));
            }
        }
        if found.count >= ENOUGH {
            break;
        }
    }
    found
}

/// The later triangles that `first` meets, in their order.
fn partners(surface: &Surface, search: &Search<'_>, first: u32, resolved: f64) -> Vec<Met> {
    let corners = surface.corners(first as usize);
    let mut met = Vec::new();
    // A sliver is a line to the device; whatever crosses it crosses its neighbours as well.
    if width(corners) <= resolved {
        return met;
    }
    let bounds: [DVec3; 2] = bounds_of(corners.into_iter());
    search.near(bounds, resolved, |second| {
        let second = u32::try_from(second).unwrap_or(u32::MAX);
        if second > first
            && let Some(contact) = contact(surface, first, second, resolved)
        {
            met.push((first, second, contact));
        }
        met.len() < ENOUGH_OF_ONE
    });
    met.sort_by_key(|(_, second, _)| *second);
    met
}
