//! Decisions about places: they join a mesh, lie in another place, are covered, or stay.

use std::collections::BTreeSet;

use glam::DVec3;
use rayon::prelude::*;

use super::nesting::{Boxed, Field, Member};
use super::own::touch_at_most;
use crate::body::Body;
use crate::overlap::tolerance;
use crate::surface::{corners_of, near};

/// Fate of a place.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Fate {
    /// It intersects a surface.
    Joins,
    /// It lies in another place of its object.
    Inside,
    /// It lies in this later object.
    Covered(u32),
    Stands(Option<u32>),
}

impl Field<'_> {
    /// Pairs of objects, earlier and later, of which places cross deeper than they touch, or the later one
    /// covers a place. Instances of one object are one solid.
    pub(super) fn overlaps(&self, crossing: &[[u32; 2]], fates: &[Fate]) -> BTreeSet<[u32; 2]> {
        let crosses = |pair: &[u32; 2]| {
            let members = pair.map(|it| self.members[it as usize]);
            let both = members.map(|it| self.of(it));
            let [a, b] = both.map(|it| it.0.object);
            let limit = tolerance(members[0].bounds, members[1].bounds);
            (a != b && !touch_at_most(both, limit)).then_some([a.min(b), a.max(b)])
        };
        let covers = |(member, fate): (&Member, &Fate)| match fate {
            Fate::Covered(by) => Some([self.groups[member.group as usize].object, *by]),
            _ => None,
        };
        let crossed: Vec<[u32; 2]> = crossing.par_iter().filter_map(crosses).collect();
        let covered = self.members.iter().zip(fates).filter_map(covers);
        crossed.into_iter().chain(covered).collect()
    }

    /// Fate of a member that crosses at most its partners, which are exact as it is.
    pub(super) fn stands(&self, member: Member, bodies: &[Boxed<'_>], partners: &[u32]) -> Fate {
        let (group, place) = self.of(member);
        let point = group.point(place);
        let of_bodies = (0..).zip(bodies).filter(|(object, body)| {
            *object != group.object
                && near([point; 2], body.bounds, 0.0)
                && body.body.contains(point)
        });
        let around = of_bodies
            .map(|(object, _)| object)
            .chain(self.around(group.core(place), point, group.object, partners))
            .max();
        match around {
            Some(object) if object > group.object => match self.holds_void(member, bodies) {
                true => Fate::Joins,
                false => Fate::Covered(object),
            },
            around => Fate::Stands(around),
        }
    }

    /// Test for a void, inside a place, of the later objects that cover it: something of the place is left there.
    fn holds_void(&self, member: Member, bodies: &[Boxed<'_>]) -> bool {
        let (group, place) = self.of(member);
        let is_in =
            |start: DVec3| near([start; 2], member.bounds, 0.0) && group.contains(place, start);
        let point = group.point(place);
        let later = (0..).zip(bodies).filter(|(object, _)| *object > group.object);
        let mut found = later.map(|it| it.1).any(|Boxed { body, starts, bounds }| {
            near([point; 2], *bounds, 0.0)
                && starts.iter().any(|start| is_in(*start))
                && body.contains(point)
        });
        self.tree.around(group.core(place), |other| {
            let (outer, there) = self.of(self.members[other as usize]);
            let is_later = outer.object > group.object && outer.prototype.components.len() > 1;
            if !found && is_later && outer.contains(there, point) {
                let mut starts = outer.prototype.starts();
                found = starts.any(|start| is_in(there.world_from_own(start)));
            }
        });
        found
    }

    /// Places around components of earlier objects join the meshes of theirs, which cut those; so do
    /// places around such that join, and around these, and the partners of all that join.
    pub(super) fn around_earlier(
        &self,
        bodies: &[Body],
        fates: &mut [Fate],
        partners: &[Vec<u32>],
    ) {
        let mut joining: Vec<usize> =
            (0..fates.len()).filter(|member| fates[*member] == Fate::Joins).collect();
        let join = |object: u32,
                    (bounds, point): ([DVec3; 2], DVec3),
                    fates: &mut [Fate],
                    joining: &mut Vec<usize>| {
            self.tree.around(bounds, |member| {
                let (group, place) = self.of(self.members[member as usize]);
                if group.object > object
                    && !matches!(fates[member as usize], Fate::Joins | Fate::Inside)
                    && group.contains(place, point)
                {
                    fates[member as usize] = Fate::Joins;
                    joining.push(member as usize);
                }
            });
        };
        for (object, body) in (0_u32..).zip(bodies) {
            for (component, point) in body.components.iter().zip(body.first_corners()) {
                join(object, (corners_of(component), point), fates, &mut joining);
            }
        }
        while let Some(member) = joining.pop() {
            let (group, place) = self.of(self.members[member]);
            for point in group.prototype.starts() {
                let point = place.world_from_own(point);
                join(group.object, ([point; 2], point), fates, &mut joining);
            }
            for partner in &partners[member] {
                let fate = &mut fates[*partner as usize];
                if matches!(fate, Fate::Stands(_)) {
                    *fate = Fate::Joins;
                    joining.push(*partner as usize);
                }
            }
        }
    }
}
