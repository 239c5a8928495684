//! Nesting of the objects of a sample.

use glam::DVec3;
use rayon::prelude::*;

use super::body::Body;
use super::overlap::{Assembly, Contact, Cuts, Meetings, Parts, pairs, pairs_to_compare};
use super::search::Search;
use super::watch::{LoadStep, Task};
use crate::error::Result;
use crate::reserve;

/// Bytes per part, for many small pieces: its record, its intersections, its surroundings.
const PER_PART: u64 = 400;

/// Cuts away volumes covered by later objects, and fills in `outside` of every component: the latest
/// object that contains it. `defects`: defects of accepted bodies. Returns the later objects that cut
/// each one and, if `wanted`, the contacts.
///
/// # Errors
/// Objects that overlap and cannot be cut; [`crate::Error::Memory`];
/// [`crate::Error::Interrupted`].
pub(super) fn nest(
    bodies: &mut [Body],
    names: &[String],
    defects: &[Option<String>],
    wanted: bool,
    task: Task<'_>,
) -> Result<(Vec<Vec<u32>>, Vec<Contact>)> {
    let bounds: Vec<[DVec3; 2]> = bodies.iter().map(Body::bounds).collect();
    let pairs = pairs(&bounds);
    let compared = if wanted { pairs_to_compare(bodies)? } else { Vec::new() };
    let mut is_near = vec![false; bodies.len()];
    let meeting = pairs.iter().map(|(a, b)| [*a, *b]);
    for object in meeting.chain(compared.iter().map(|pair| pair.objects)).flatten() {
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
    if pairs.is_empty() && compared.is_empty() {
        return Ok((vec![Vec::new(); bodies.len()], Vec::new()));
    }
    let components = bodies.iter().map(|body| body.components.len() as u64).sum::<u64>();
    reserve::ask(PER_PART * components, "comparing the parts of objects", reserve::REMEDY)?;
    let parts = Parts::of(bodies, defects);
    let meetings = Meetings::find(bodies, &pairs, &parts, &searches, task)?;
    let around = meetings.around(bodies, &parts, &searches);
    let cuts = Cuts::of(bodies, &parts, &meetings, &around);
    let assembly = Assembly {
        bodies,
        parts: &parts,
        searches: &searches,
        meetings: &meetings,
        around: &around,
        names,
    };
    let contacts = assembly.contacts(&compared, task)?;
    drop(searches);
    for (body, outside) in bodies.iter_mut().zip(&cuts.outside) {
        for (component, outside) in body.components.iter_mut().zip(outside) {
            component.outside = *outside;
        }
    }
    cuts.make(bodies, &parts, names, task)?;
    Ok((cuts.cut_by, contacts))
}
