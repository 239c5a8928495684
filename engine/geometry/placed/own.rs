//! Instances of one object that touch or overlap: they are one solid.
//!
//! Exact shapes that touch or overlap stay exact. Meshes that overlap are united, and instances wholly
//! inside another one are left out.

use glam::DVec3;

use super::Place;
use super::distance::Standing;
use super::fate::Fate;
use super::group::Group;
use super::meeting::{are_apart, meets_place};
use crate::overlap::{ClosedMesh, snap, tolerance};
use crate::surface::{Surface, in_mm};
use crate::topology::{self, join, labels};
use beamlet_core::error::{Error, Result};
use beamlet_core::numbers;
use beamlet_core::watch::Task;

/// Most facets of the overlapping instances of an object, where these stand for exact shapes.
const MOST_UNITED: u64 = 4_000_000;
/// More of them are refused.
const TOO_MANY: u64 = 4 * MOST_UNITED;

/// Share of the limit below which the distance of shapes is nothing but rounding.
const LEAST_CLEARANCE: f64 = 1e-3;

/// Contact of two instances of one object.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Clash {
    Overlap,
    /// The first one lies in the other.
    Inside,
    /// The other way round.
    Around,
}

/// Contact of two places of a group; `None` if they are disjoint, or touch and can stay.
pub(super) fn clash(
    group: &Group,
    [place, there]: [&Place; 2],
    bounds: [[DVec3; 2]; 2],
) -> Option<Clash> {
    let limit = tolerance(bounds[0], bounds[1]);
    if are_apart((group, place), (group, there), limit)
        || touch_at_most([(group, place), (group, there)], limit)
    {
        return None;
    }
    if meets_place((group, place), (group, there), bounds) {
        return Some(Clash::Overlap);
    }
    let found = if group.contains(there, group.point(place)) {
        Clash::Inside
    } else if group.contains(place, group.point(there)) {
        Clash::Around
    } else {
        return None;
    };
    // Parts of a mesh may lie in another instance, and others of it beside that.
    Some(if group.prototype.components.len() == 1 { found } else { Clash::Overlap })
}

/// Test of exact shapes that lie apart, or at most twice a limit deep in each other.
pub(super) fn touch_at_most(both: [(&Group, &Place); 2], limit: f64) -> bool {
    let inset =
        |(group, place): (&Group, &Place)| group.prototype.inset(limit / place.least_scale());
    let [Some(own), Some(other)] = both.map(inset) else { return false };
    let [first, second] = [(&own, both[0].1), (&other, both[1].1)]
        .map(|(prototype, place)| Standing { prototype, place });
    // At the end of the angles at which tubes cross another surface the least distance is barely above 0.
    first.clearance_of(&second).is_some_and(|least| least > LEAST_CLEARANCE * limit)
}

/// Decides about members that clash, by their numbers; gives the pairs that overlap.
pub(super) fn settle(clashes: &[([u32; 2], Clash)], fates: &mut [Fate]) -> Vec<[u32; 2]> {
    for ([first, second], clash) in clashes {
        match clash {
            Clash::Inside => fates[*first as usize] = Fate::Inside,
            Clash::Around => fates[*second as usize] = Fate::Inside,
            Clash::Overlap => {}
        }
    }
    let gone = |it: &u32| matches!(fates[*it as usize], Fate::Inside | Fate::Covered(_));
    let pairs: Vec<[u32; 2]> = clashes
        .iter()
        .filter(|(pair, clash)| *clash == Clash::Overlap && !pair.iter().any(gone))
        .map(|it| it.0)
        .collect();
    for member in pairs.iter().flatten() {
        fates[*member as usize] = Fate::Joins;
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
