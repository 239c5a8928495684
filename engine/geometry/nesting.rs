//! Nesting of the objects of a sample.

use std::collections::BTreeSet;

use glam::DVec3;
use rayon::prelude::*;

use super::body::Body;
use super::overlap::{Cuts, Meetings, Parts, pairs};
use super::search::Search;
use beamlet_core::error::Result;
use beamlet_core::reserve;
use beamlet_core::watch::{LoadStep, Task};

/// Bytes per part, for many small pieces: its record, its intersections, its surroundings.
const PER_PART: u64 = 400;

/// Pairs of objects that overlap.
pub(super) type Overlaps = BTreeSet<[u32; 2]>;

/// Cuts away volumes covered by later objects, and fills in `outside` of every component: the latest
/// object that contains it. `defects`: defects of accepted bodies. Returns the later objects that cut
/// each one and, if `wanted`, pairs of objects that overlap.
///
/// # Errors
/// Objects that overlap and cannot be cut; [`beamlet_core::Error::Memory`];
/// [`beamlet_core::Error::Interrupted`].
pub(super) fn nest(
    bodies: &mut [Body],
    names: &[String],
    defects: &[Option<String>],
    wanted: bool,
    task: Task<'_>,
) -> Result<(Vec<Vec<u32>>, Overlaps)> {
    let bounds: Vec<[DVec3; 2]> = bodies.iter().map(Body::bounds).collect();
    let pairs = pairs(&bounds);
    let mut is_near = vec![false; bodies.len()];
    for object in pairs.iter().flat_map(|(a, b)| [*a, *b]) {
        is_near[object] = true;
    }
    let searches: Vec<Option<Search>> = bodies
        .par_iter_mut()
        .zip(&is_near)
        .map(|(body, is_near)| {
            let known = body.search.take();
            is_near.then(|| known.unwrap_or_else(|| Search::new(&body.surface)))
        })
        .collect();
    task.begin(LoadStep::Nesting, pairs.len() as u64)?;
    if pairs.is_empty() {
        return Ok((vec![Vec::new(); bodies.len()], BTreeSet::new()));
    }
    let components = bodies.iter().map(|body| body.components.len() as u64).sum::<u64>();
    reserve::ask(PER_PART * components, "comparing the parts of objects", reserve::REMEDY)?;
    let parts = Parts::of(bodies, defects);
    let meetings = Meetings::find(bodies, &pairs, &parts, &searches, task)?;
    let around = meetings.around(bodies, &parts, &searches);
    let cuts = Cuts::of(bodies, &parts, &meetings, &around);
    drop(searches);
    for (body, outside) in bodies.iter_mut().zip(&cuts.outside) {
        for (component, outside) in body.components.iter_mut().zip(outside) {
            component.outside = *outside;
        }
    }
    let overlaps = cuts.make(bodies, &parts, names, wanted, task)?;
    Ok((cuts.cut_by, overlaps))
}
