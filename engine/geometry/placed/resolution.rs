//! Resolution of places: they join a mesh, lie in another place, are covered, or stay.

use std::collections::BTreeSet;

use glam::DVec3;
use rayon::prelude::*;

use super::contact::touch_at_most;
use super::groups::{Boxed, Field, Member};
use crate::body::Body;
use crate::overlap::tolerance;
use crate::surface::{corners_of, near};

/// What becomes of a place.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Resolution {
    /// Its facets join the mesh of its object: it intersects a surface.
    Meshed,
    /// It lies in another place of its object.
    Redundant,
    /// It lies in this later object.
    Covered(u32),
    /// It stays as it is, in this object.
    Kept(Option<u32>),
}

impl Field<'_> {
    /// Pairs of objects, earlier and later, of which places cross deeper than they touch, or the later one
    /// covers a place. Instances of one object are one solid.
    pub(super) fn overlaps(
        &self,
        crossing: &[[u32; 2]],
        resolutions: &[Resolution],
    ) -> BTreeSet<[u32; 2]> {
        let crosses = |pair: &[u32; 2]| {
            let members = pair.map(|it| self.members[it as usize]);
            let both = members.map(|it| self.solid(it));
            let [a, b] = both.map(|it| it.object);
            let limit = tolerance(members[0].bounds, members[1].bounds);
            (a != b && !touch_at_most(both, limit)).then_some([a.min(b), a.max(b)])
        };
        let covers = |(member, resolution): (&Member, &Resolution)| match resolution {
            Resolution::Covered(by) => Some([self.groups[member.group as usize].object, *by]),
            _ => None,
        };
        let crossed: Vec<[u32; 2]> = crossing.par_iter().filter_map(crosses).collect();
        let covered = self.members.iter().zip(resolutions).filter_map(covers);
        crossed.into_iter().chain(covered).collect()
    }

    /// Resolution of a member that crosses at most its partners, which are exact as it is.
    pub(super) fn resolve(
        &self,
        member: Member,
        bodies: &[Boxed<'_>],
        partners: &[u32],
    ) -> Resolution {
        let solid = self.solid(member);
        let point = solid.point();
        let of_bodies = (0..).zip(bodies).filter(|(object, body)| {
            *object != solid.object
                && near([point; 2], body.bounds, 0.0)
                && body.body.contains(point)
        });
        let around = of_bodies
            .map(|(object, _)| object)
            .chain(self.around(solid.core(), point, solid.object, partners))
            .max();
        match around {
            Some(object) if object > solid.object => match self.holds_void(member, bodies) {
                true => Resolution::Meshed,
                false => Resolution::Covered(object),
            },
            around => Resolution::Kept(around),
        }
    }

    /// Test for a void, inside a place, of the later objects that cover it: something of the place is left there.
    fn holds_void(&self, member: Member, bodies: &[Boxed<'_>]) -> bool {
        let solid = self.solid(member);
        let is_in = |start: DVec3| near([start; 2], member.bounds, 0.0) && solid.contains(start);
        let point = solid.point();
        let later = (0..).zip(bodies).filter(|(object, _)| *object > solid.object);
        let mut found = later.map(|it| it.1).any(|Boxed { body, starts, bounds }| {
            near([point; 2], *bounds, 0.0)
                && starts.iter().any(|start| is_in(*start))
                && body.contains(point)
        });
        self.tree.around(solid.core(), |other| {
            let outer = self.solid(self.members[other as usize]);
            let is_later = outer.object > solid.object && outer.prototype.components.len() > 1;
            if !found && is_later && outer.contains(point) {
                found = outer.starts().any(is_in);
            }
        });
        found
    }

    /// Places around components of earlier objects join the meshes of theirs, which cut those; so do
    /// places around such that join, and around these, and the partners of all that join.
    pub(super) fn around_earlier(
        &self,
        bodies: &[Body],
        resolutions: &mut [Resolution],
        partners: &[Vec<u32>],
    ) {
        let mut joining: Vec<usize> = (0..resolutions.len())
            .filter(|member| resolutions[*member] == Resolution::Meshed)
            .collect();
        let join = |object: u32,
                    (bounds, point): ([DVec3; 2], DVec3),
                    resolutions: &mut [Resolution],
                    joining: &mut Vec<usize>| {
            self.tree.around(bounds, |member| {
                let solid = self.solid(self.members[member as usize]);
                if solid.object > object
                    && !matches!(
                        resolutions[member as usize],
                        Resolution::Meshed | Resolution::Redundant
                    )
                    && solid.contains(point)
                {
                    resolutions[member as usize] = Resolution::Meshed;
                    joining.push(member as usize);
                }
            });
        };
        for (object, body) in (0_u32..).zip(bodies) {
            for (component, point) in body.components.iter().zip(body.first_corners()) {
                join(object, (corners_of(component), point), resolutions, &mut joining);
            }
        }
        while let Some(member) = joining.pop() {
            let solid = self.solid(self.members[member]);
            for point in solid.starts() {
                join(solid.object, ([point; 2], point), resolutions, &mut joining);
            }
            for partner in &partners[member] {
                let resolution = &mut resolutions[*partner as usize];
                if matches!(resolution, Resolution::Kept(_)) {
                    *resolution = Resolution::Meshed;
                    joining.push(*partner as usize);
                }
            }
        }
    }
}
