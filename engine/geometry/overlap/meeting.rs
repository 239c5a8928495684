//! Parts of objects that intersect, and parts that contain others.

use glam::DVec3;
use rayon::prelude::*;
use std::collections::BTreeSet;
use std::sync::{Mutex, PoisonError};

use super::super::body::Body;
use super::super::distance::meet;
use super::super::search::{Search, winding_by_solid_angle};
use super::super::surface::{bounds_of, near};
use super::super::tree::Query;
use super::parts::Parts;
use beamlet_core::error::{Error, Result};
use beamlet_core::watch::Task;

/// Parts of other objects around each component of each object, by the number of the part.
pub(crate) type Around = Vec<Vec<Vec<u32>>>;

/// Pairs of parts whose surfaces cross, touch or come within the tolerance of each other.
#[derive(Debug, Default)]
pub(crate) struct Meetings {
    /// For each part: intersecting parts of other objects, in ascending order.
    of: Vec<Vec<u32>>,
}

impl Meetings {
    /// Looks at pairs of objects.
    ///
    /// # Errors
    /// [`Error::Interrupted`].
    pub(crate) fn find(
        bodies: &[Body],
        pairs: &[(usize, usize)],
        parts: &Parts,
        searches: &[Option<Search>],
        task: Task<'_>,
    ) -> Result<Self> {
        let mut of = vec![Vec::new(); parts.all.len()];
        for (number, (a, b)) in pairs.iter().enumerate() {
            if task.is_cancelled() {
                return Err(Error::Interrupted);
            }
            task.reach(number as u64);
            for [first, second] in between(bodies, [*a, *b], parts, searches) {
                of[first as usize].push(second);
                of[second as usize].push(first);
            }
        }
        of.iter_mut().for_each(|met: &mut Vec<u32>| met.sort_unstable());
        Ok(Self { of })
    }

    /// Parts that intersect a part.
    pub(super) fn of(&self, part: usize) -> &[u32] {
        &self.of[part]
    }

    /// The surroundings of each component. A body that intersects a part of an object is inside none of
    /// its parts.
    pub(crate) fn around(
        &self,
        bodies: &[Body],
        parts: &Parts,
        searches: &[Option<Search>],
    ) -> Around {
        let bounds: Vec<[DVec3; 2]> = bodies.iter().map(Body::bounds).collect();
        let of_component = |object: usize, component: usize, point: DVec3| {
            let part = parts.of[object][component];
            let mut around = Vec::new();
            for (other, search) in searches.iter().enumerate() {
                let Some(search) = search.as_ref().filter(|_| other != object) else { continue };
                let met =
                    self.of[part as usize].iter().any(|it| parts.all[*it as usize].object == other);
                if !met && near([point; 2], bounds[other], 0.0) {
                    around.extend(container(&bodies[other], search, &parts.of[other], point));
                }
            }
            around
        };
        bodies
            .par_iter()
            .enumerate()
            .map(|(object, body)| {
                let starts = body.first_corners();
                starts
                    .par_iter()
                    .enumerate()
                    .map(|(component, point)| of_component(object, component, *point))
                    .collect()
            })
            .collect()
    }
}

/// The part of a body that a point off its surface is in.
fn container(body: &Body, search: &Search, of: &[u32], point: DVec3) -> Option<u32> {
    let part_of = |triangle: usize| of[body.triangle_component[triangle] as usize];
    let mut parts: Vec<(u32, f64)> = match search.crossings(&body.surface, point) {
        Some(hits) => {
            hits.into_iter().map(|(triangle, sign)| (part_of(triangle), sign.into())).collect()
        }
        None => {
            let all = of.iter().copied().collect::<BTreeSet<u32>>();
            let winding = |part: u32| {
                let members = (0..body.surface.triangles.len()).filter(|it| part_of(*it) == part);
                winding_by_solid_angle(&body.surface, members, point)
            };
            all.into_iter().map(|part| (part, winding(part))).collect()
        }
    };
    parts.sort_unstable_by_key(|(part, _)| *part);
    let winding = |group: &&[(u32, f64)]| group.iter().map(|(_, sign)| sign).sum::<f64>() > 0.5;
    parts.chunk_by(|a, b| a.0 == b.0).find(winding).map(|group| group[0].0)
}

/// Surfaces closer than this count as touching: a nanometre or, far from the origin, the resolution of
/// f32 on the device; less for samples of micrometres.
pub(crate) fn tolerance(a: [DVec3; 2], b: [DVec3; 2]) -> f64 {
    let size = |[low, high]: [DVec3; 2]| (high - low).max_element();
    let reach = |[low, high]: [DVec3; 2]| low.abs().max(high.abs()).max_element();
    let resolved = f64::from(f32::EPSILON) * reach(a).max(reach(b));
    (1e-4 * size(a).min(size(b))).min(1e-9).max(resolved)
}

/// Intersecting pairs of parts, of the first object and the second.
fn between(
    bodies: &[Body],
    [a, b]: [usize; 2],
    parts: &Parts,
    searches: &[Option<Search>],
) -> BTreeSet<[u32; 2]> {
    let limit = tolerance(bodies[a].bounds(), bodies[b].bounds());
    // Fewer triangles ask, more are asked.
    let turned = bodies[a].surface.triangles.len() > bodies[b].surface.triangles.len();
    let [few, many] = if turned { [b, a] } else { [a, b] };
    let Some(search) = searches[many].as_ref() else { return BTreeSet::new() };
    let part_of = |object: usize, triangle: usize| {
        parts.of[object][bodies[object].triangle_component[triangle] as usize]
    };
    let alone = parts.of[many].iter().all(|part| *part == parts.of[many][0]);
    let (all, found) = (bodies[many].bounds(), Mutex::new(BTreeSet::new()));
    (0..bodies[few].surface.triangles.len()).into_par_iter().with_min_len(256).for_each(
        |triangle| {
            let corners = bodies[few].surface.corners(triangle);
            if !near(bounds_of(corners.into_iter()), all, limit) {
                return;
            }
            let part = part_of(few, triangle);
            let locked = || found.lock().unwrap_or_else(PoisonError::into_inner);
            if alone && locked().contains(&[part, parts.of[many][0]]) {
                return;
            }
            search.near(&Query::new(corners, None, limit), |other| {
                let pair = [part, part_of(many, other)];
                if locked().contains(&pair) {
                    return !alone;
                }
                let meets = meet(corners, bodies[many].surface.corners(other), limit);
                if meets {
                    locked().insert(pair);
                }
                !(meets && alone)
            });
        },
    );
    found.into_inner().unwrap_or_else(PoisonError::into_inner)
}

/// Pairs of objects whose boxes come near each other.
pub(crate) fn pairs(bounds: &[[DVec3; 2]]) -> Vec<(usize, usize)> {
    (0..bounds.len())
        .flat_map(|a| (a + 1..bounds.len()).map(move |b| (a, b)))
        .filter(|(a, b)| near(bounds[*a], bounds[*b], tolerance(bounds[*a], bounds[*b])))
        .collect()
}
