//! Instances of one object that touch or overlap: they are one solid.
//!
//! Exact shapes that touch or overlap stay exact. Meshes that overlap are united, and instances wholly
//! inside another one are left out.

use super::contact::Contact;
use super::groups::Group;
use super::resolution::Resolution;
use crate::overlap::{ClosedMesh, snap};
use crate::surface::{Surface, in_mm};
use crate::topology::{self, join, labels};
use beamlet_core::error::{Error, Result};
use beamlet_core::numbers;
use beamlet_core::watch::Task;

/// Most facets of the overlapping instances of an object, where these stand for exact shapes.
const MOST_UNITED: u64 = 4_000_000;
/// More of them are refused.
const TOO_MANY: u64 = 4 * MOST_UNITED;

/// Resolves contacts of members, by their numbers; gives the pairs that overlap.
pub(super) fn settle(
    contacts: &[([u32; 2], Contact)],
    resolutions: &mut [Resolution],
) -> Vec<[u32; 2]> {
    for ([first, second], contact) in contacts {
        match contact {
            Contact::Inside => resolutions[*first as usize] = Resolution::Redundant,
            Contact::Around => resolutions[*second as usize] = Resolution::Redundant,
            Contact::Overlap => {}
        }
    }
    let gone = |it: &u32| {
        matches!(resolutions[*it as usize], Resolution::Redundant | Resolution::Covered(_))
    };
    let pairs: Vec<[u32; 2]> = contacts
        .iter()
        .filter(|(pair, contact)| *contact == Contact::Overlap && !pair.iter().any(gone))
        .map(|it| it.0)
        .collect();
    for member in pairs.iter().flatten() {
        resolutions[*member as usize] = Resolution::Meshed;
    }
    pairs
}

/// Clusters of overlapping members; members and pairs by their numbers.
pub(super) fn clusters(members: &[u32], pairs: &[[u32; 2]]) -> Vec<Vec<u32>> {
    let mut parent: Vec<u32> = (0..numbers::count(members.len())).collect();
    let at = |member: u32| members.binary_search(&member).ok().map(numbers::count);
    for [first, second] in pairs {
        if let (Some(first), Some(second)) = (at(*first), at(*second)) {
            join(&mut parent, [first, second]);
        }
    }
    let (of, count) = labels(&mut parent);
    let sets = topology::members((&of, count));
    let named = |set: Vec<u32>| set.into_iter().map(|it| members[it as usize]).collect();
    sets.into_iter().map(named).collect()
}

/// Most facets of each of `count` united instances.
///
/// # Errors
/// More than fit.
pub(super) fn most_facets(group: &Group, count: usize, name: &str) -> Result<u64> {
    let count = count.max(1) as u64;
    let facets = group.prototype.triangles.len() as u64 * count;
    if facets > TOO_MANY {
        return Err(Error::mesh(
            format!("\"{name}\""),
            format!(
                "{count} of its instances overlap: united as meshes they have {} million facets, \
                 more than {} million; leave gaps between them, or give the shape fewer `sides`",
                facets / 1_000_000,
                TOO_MANY / 1_000_000
            ),
            format!("the first near {}", in_mm(group.places[0].position)),
        ));
    }
    Ok((MOST_UNITED / count).max(1))
}

/// Overlapping surfaces as one; `clean`: none passes through itself.
///
/// # Errors
/// Failures of the boolean; [`Error::Memory`]; [`Error::Interrupted`].
pub(super) fn united(
    mut surfaces: Vec<Surface>,
    clean: bool,
    name: &str,
    task: Task<'_>,
) -> Result<Surface> {
    snap(&mut surfaces);
    let first = surfaces.iter().find_map(|it| it.vertices.first().copied());
    let failed = |problem: String| {
        let problem = format!("instances of it overlap, and cannot be united: {problem}");
        let near = first.map_or(String::new(), |it| format!("near {}", in_mm(it)));
        Error::mesh(format!("\"{name}\""), problem, near)
    };
    ClosedMesh::united(&surfaces, clean, task, &failed)
}
