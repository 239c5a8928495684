//! Overlaps of places that lie wholly in later objects: for whoever checks an assembly.

use std::collections::BTreeMap;

use glam::DVec3;

use super::nesting::{Boxed, Fate, Field, Group, Member};
use super::{Place, Prototype};
use crate::geometry::analytic::Form;
use crate::geometry::body::Body;
use crate::geometry::overlap::{Contact, ContactKind, SOUNDINGS, distance_of};
use crate::geometry::search::Search;
use crate::geometry::surface::{Surface, near};

/// A covered place, and what covers it.
struct Cover<'a> {
    group: &'a Group,
    place: &'a Place,
    by: By<'a>,
}

enum By<'a> {
    Body(&'a Body),
    Place(&'a Group, &'a Place),
}

impl Field<'_> {
    /// Whether what covers a place has a void in it, where something of it is left.
    pub(super) fn holds_void(&self, member: Member, bodies: &[Boxed<'_>]) -> bool {
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

    /// What covered places share with the later objects that they lie in; `settled`: of each place of
    /// each group.
    pub(super) fn covered<'b>(
        &'b self,
        settled: &[Vec<Fate>],
        bodies: &'b [Boxed<'b>],
    ) -> Vec<Contact> {
        let mut found: BTreeMap<[u32; 2], Vec<Cover<'b>>> = BTreeMap::new();
        let is_covered =
            |it: &&Member| settled[it.group as usize][it.place as usize] == Fate::Covered;
        for member in self.members.iter().filter(is_covered) {
            let (group, place) = self.of(*member);
            let point = group.point(place);
            let mut take = |object: u32, by: By<'b>| {
                let covers = found.entry([group.object, object]).or_default();
                covers.push(Cover { group, place, by });
            };
            for (object, Boxed { body, bounds, .. }) in (0..).zip(bodies) {
                let later = object > group.object && near([point; 2], *bounds, 0.0);
                if later && body.contains(point) {
                    take(object, By::Body(body));
                }
            }
            self.tree.around(group.core(place), |other| {
                let (outer, there) = self.of(self.members[other as usize]);
                if outer.object > group.object && outer.contains(there, point) {
                    take(outer.object, By::Place(outer, there));
                }
            });
        }
        found.into_iter().map(|(objects, covers)| overlap(objects, &covers)).collect()
    }
}

fn overlap(objects: [u32; 2], covers: &[Cover<'_>]) -> Contact {
    let own =
        |it: &Cover<'_>| it.group.prototype.components.iter().map(|it| it.volume).sum::<f64>();
    let volume = covers.iter().map(|it| own(it) * it.place.volume()).sum();
    let points: usize = covers.iter().map(|it| it.group.prototype.vertices.len()).sum();
    let every = points.div_ceil(SOUNDINGS).max(1);
    let (mut depth, mut place, mut next) = (0.0, DVec3::ZERO, 0);
    for cover in covers {
        let vertices = &cover.group.prototype.vertices;
        let outer = Outer::new(&cover.by);
        while let Some(vertex) = vertices.get(next) {
            let point = cover.place.world_from_own(*vertex);
            let found = outer.depth(point);
            (depth, place) = if found > depth { (found, point) } else { (depth, place) };
            next += every;
        }
        next -= vertices.len();
    }
    let kind = ContactKind::Overlap { volume, depth };
    Contact { objects, kind, place: place.to_array(), pairs: covers.len() as u64 }
}

/// What covers, ready for search.
pub(super) enum Outer<'a> {
    Body(&'a Body),
    Exact(&'a Prototype, &'a Place),
    Facets(Surface, Search, &'a Place),
}

impl<'a> Outer<'a> {
    fn new(by: &By<'a>) -> Self {
        match by {
            By::Body(body) => Self::Body(body),
            By::Place(group, place) => Self::of_place(group, place),
        }
    }

    pub(super) fn of_place(group: &'a Group, place: &'a Place) -> Self {
        let shape = group.prototype.shape;
        let even = place.stretch.to_bits() == 1.0_f64.to_bits();
        match shape {
            Some(shape) if even && !matches!(shape.form(), Form::Ellipsoid(_)) => {
                Self::Exact(&group.prototype, place)
            }
            _ => {
                let Prototype { vertices, triangles, .. } = &group.prototype;
                let surface = Surface::new(vertices.clone(), triangles.clone());
                let search = Search::new(&surface);
                Self::Facets(surface, search, place)
            }
        }
    }

    /// How deep a point lies in it, m.
    pub(super) fn depth(&self, point: DVec3) -> f64 {
        match self {
            Self::Body(body) => {
                let search = body.search.as_ref();
                search.map_or(0.0, |search| distance_of(point, &body.surface, search))
            }
            Self::Exact(prototype, place) => {
                let of = |shape: crate::geometry::AnalyticShape| {
                    -shape.distance_bound(place.own_from_world(point)) * place.scale
                };
                prototype.shape.map_or(0.0, of)
            }
            Self::Facets(surface, search, place) => {
                distance_of(place.own_from_world(point), surface, search) * place.scale
            }
        }
    }
}
