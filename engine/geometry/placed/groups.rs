//! Surroundings of placed surfaces, and intersecting ones.
//!
//! Places that intersect a mesh join the mesh of their object, as their facets, and are cut with it. Exact
//! shapes that cross each other stay exact, as partners; so do places that lie apart or properly in one
//! another.

use std::collections::BTreeSet;

use glam::DVec3;
use rayon::prelude::*;

use super::contact::{Contact, contact, intersect};
use super::resolution::Resolution;
use super::solid::Solid;
use super::union;
use super::{Place, Prototype};
use crate::body::Body;
use crate::search::Search;
use crate::surface::{Surface, bounds_of, corners_of, near};
use crate::tree::Tree;
use beamlet_core::error::{Error, Result};
use beamlet_core::numbers;
use beamlet_core::watch::{LoadStep, Task};

/// Error of the facets of a shape that is cut with others, m, where few enough are as fine.
const JOINED: f64 = 1e-8;

/// All places of one object.
#[derive(Debug)]
pub(crate) struct Group {
    pub(crate) object: u32,
    pub(crate) prototype: Prototype,
    pub(crate) places: Vec<Place>,
    /// They are known to be disjoint.
    pub(crate) apart: bool,
}

impl Group {
    /// Box around all places in the world.
    pub(crate) fn bounds(&self) -> [DVec3; 2] {
        let own = self.prototype.bounds();
        let corners = self.places.iter().flat_map(|place| place.bounds(own));
        bounds_of(corners)
    }

    /// Its surface in a place.
    pub(super) const fn solid<'a>(&'a self, place: &'a Place) -> Solid<'a> {
        Solid { object: self.object, prototype: &self.prototype, place }
    }
}

/// Places of all groups, and their surroundings.
#[derive(Default)]
pub(crate) struct Groups {
    pub(crate) all: Vec<Group>,
    /// Latest object around each place, for each group.
    pub(crate) outside: Vec<Vec<Option<u32>>>,
    /// Number of places that lie wholly in later objects and are left out, for each group.
    pub(crate) covered: Vec<usize>,
    /// Number of places that lie wholly in others and are left out, for each group.
    pub(crate) inner: Vec<usize>,
    /// Of each group: how many have joined the mesh of their object, and how far their facets are off
    /// their surfaces at most, m.
    pub(crate) joined: Vec<(usize, f64)>,
    /// Pairs of objects, earlier and later, of which places cross or the later one covers a place.
    pub(crate) overlaps: BTreeSet<[u32; 2]>,
    /// Pairs of exact shapes whose surfaces cross or touch: group, and number among the standing places.
    pub(crate) crossing: Vec<[[u32; 2]; 2]>,
}

/// A place among all of all groups.
#[derive(Clone, Copy)]
pub(super) struct Member {
    /// Its own number.
    number: u32,
    pub(super) group: u32,
    pub(super) place: u32,
    pub(crate) bounds: [DVec3; 2],
}

/// A body and the box around it.
pub(super) struct Boxed<'a> {
    pub(crate) body: &'a Body,
    /// A point of each of its components.
    pub(super) starts: Vec<DVec3>,
    pub(crate) bounds: [DVec3; 2],
}

impl<'a> Boxed<'a> {
    pub(super) fn of(body: &'a Body) -> Self {
        Self { body, starts: body.first_corners(), bounds: body.bounds() }
    }
}

/// Surfaces that a place intersects.
#[derive(Default)]
struct Met {
    /// Surfaces that it cannot cross as it is: it joins the mesh of its object.
    joins: bool,
    /// Later members of its group.
    contacts: Vec<(u32, Contact)>,
    /// Exact shapes that follow it among the members, where both are exact.
    crosses: Vec<u32>,
}

/// Partners of each member, for a number of members.
fn partners_of(count: usize, crossing: &[[u32; 2]]) -> Vec<Vec<u32>> {
    let mut partners = vec![Vec::new(); count];
    for [a, b] in crossing {
        partners[*a as usize].push(*b);
        partners[*b as usize].push(*a);
    }
    partners
}

/// Members and the tree over their boxes.
pub(super) struct Field<'a> {
    pub(crate) groups: &'a [Group],
    pub(super) members: Vec<Member>,
    pub(super) tree: Tree,
}

impl Groups {
    /// Finds the surroundings of each place; places that intersect a surface join the bodies of their
    /// objects. `defects`: defects of accepted meshes.
    ///
    /// # Errors
    /// Places of one object that overlap and cannot be united; [`Error::Interrupted`].
    pub(crate) fn settle(
        groups: Vec<Group>,
        bodies: &mut [Body],
        names: &[String],
        defects: &[Option<String>],
        task: Task<'_>,
    ) -> Result<Self> {
        task.begin(LoadStep::Nesting, 0)?;
        let field = Field::new(&groups);
        let all = field.members.iter().fold(bounds_of(std::iter::empty()), |all, it| {
            [all[0].min(it.bounds[0]), all[1].max(it.bounds[1])]
        });
        bodies.par_iter_mut().for_each(|body| {
            let is_near = !body.components.is_empty() && near(body.bounds(), all, 1e-6);
            if is_near && body.search.is_none() {
                body.search = Some(Search::new(&body.surface));
            }
        });
        let boxed: Vec<Boxed<'_>> = bodies.iter().map(Boxed::of).collect();
        let met = |member: &Member| match task.is_cancelled() {
            true => Err(Error::Interrupted),
            false => Ok(field.met_by(*member, &boxed)),
        };
        let found: Vec<Met> = field.members.par_iter().map(met).collect::<Result<_>>()?;
        let contacts: Vec<([u32; 2], Contact)> = (0..)
            .zip(&found)
            .flat_map(|(member, met)| {
                met.contacts.iter().map(move |(other, contact)| ([member, *other], *contact))
            })
            .collect();
        let crossing: Vec<[u32; 2]> = (0..)
            .zip(&found)
            .flat_map(|(member, met)| met.crosses.iter().map(move |other| [member, *other]))
            .collect();
        let partners = partners_of(found.len(), &crossing);
        let resolution = |(member, met): (&Member, &Met)| match met.joins {
            true => Resolution::Meshed,
            false => field.resolve(*member, &boxed, &partners[member.number as usize]),
        };
        let mut resolutions: Vec<Resolution> =
            field.members.par_iter().zip(&found).map(resolution).collect();
        let mut overlapping = union::settle(&contacts, &mut resolutions);
        field.around_earlier(bodies, &mut resolutions, &partners);
        let resolution_of = |member: u32| resolutions[member as usize];
        overlapping.extend(crossing.iter().filter(|pair| {
            let [a, b] = pair.map(|it| field.members[it as usize].group);
            a == b && pair.map(resolution_of) == [Resolution::Meshed; 2]
        }));
        let standing = |pair: &&[u32; 2]| {
            pair.iter().all(|it| matches!(resolution_of(*it), Resolution::Kept(_)))
        };
        let crossing: Vec<[u32; 2]> = crossing.iter().filter(standing).copied().collect();
        let overlaps = field.overlaps(&crossing, &resolutions);
        let numbers = field.numbers_of_standing(&resolutions);
        let mut settled: Vec<Vec<Resolution>> =
            groups.iter().map(|group| Vec::with_capacity(group.places.len())).collect();
        for (member, resolution) in field.members.iter().zip(resolutions) {
            settled[member.group as usize].push(resolution);
        }
        drop(field);
        let crossing = crossing.iter().map(|pair| pair.map(|it| numbers[it as usize])).collect();
        let mut this = Self { overlaps, crossing, ..Self::default() };
        let mut first = 0;
        for (group, resolutions) in groups.into_iter().zip(settled) {
            let count = numbers::count(resolutions.len());
            let pairs: Vec<[u32; 2]> = overlapping
                .iter()
                .filter(|pair| (first..first + count).contains(&pair[0]))
                .map(|pair| pair.map(|it| it - first))
                .collect();
            first += count;
            let clean = defects[group.object as usize].is_none();
            let name = &names[group.object as usize];
            let body = &mut bodies[group.object as usize];
            this.add(group, &resolutions, body, &pairs, (clean, name), task)?;
        }
        Ok(this)
    }

    /// Adds later objects with crossing shapes to the objects that cut an earlier one.
    pub(crate) fn add_cutters(&self, cut_by: &mut [Vec<u32>]) {
        for pair in &self.crossing {
            let [a, b] = pair.map(|[group, _]| self.all[group as usize].object);
            if a != b {
                cut_by[a.min(b) as usize].push(a.max(b));
            }
        }
        for objects in cut_by {
            objects.sort_unstable();
            objects.dedup();
        }
    }

    /// Adds a group whose places have these resolutions; `pairs` of them overlap.
    fn add(
        &mut self,
        mut group: Group,
        resolutions: &[Resolution],
        body: &mut Body,
        pairs: &[[u32; 2]],
        (clean, name): (bool, &str),
        task: Task<'_>,
    ) -> Result<()> {
        let count = |is: fn(&&Resolution) -> bool| resolutions.iter().filter(is).count();
        self.covered.push(count(|it| matches!(it, Resolution::Covered(_))));
        self.inner.push(count(|it| **it == Resolution::Redundant));
        let joins: Vec<u32> = (0..)
            .zip(resolutions)
            .filter(|it| *it.1 == Resolution::Meshed)
            .map(|it| it.0)
            .collect();
        let clusters = union::clusters(&joins, pairs);
        let united = clusters.iter().filter(|it| it.len() > 1).map(Vec::len).sum();
        let most = union::most_facets(&group, united, name)?;
        let mut off = 0.0_f64;
        for cluster in clusters {
            let mut surfaces = Vec::with_capacity(cluster.len());
            for place in cluster.iter().map(|it| &group.places[*it as usize]) {
                let error = JOINED / place.largest_scale();
                let finer = match cluster.len() {
                    1 => group.prototype.finer(error),
                    _ => group.prototype.finer_of(error, most),
                };
                let prototype = finer.as_ref().unwrap_or(&group.prototype);
                off = off.max(prototype.error() * place.largest_scale());
                let vertices =
                    prototype.vertices.iter().map(|it| place.world_from_own(*it)).collect();
                let surface = Surface::new(vertices, prototype.triangles.clone());
                if cluster.len() == 1 {
                    let components = group.solid(place).components(None).collect();
                    body.add(surface, &prototype.triangle_component, components);
                } else {
                    surfaces.push(surface);
                }
            }
            if !surfaces.is_empty() {
                let whole = union::united(surfaces, clean, name, task)?;
                let kept = vec![false; body.components.len()];
                body.replace(&kept, std::iter::once((whole, None)), group.object);
            }
        }
        self.joined.push((joins.len(), off));
        let stands = |it: &Resolution| match it {
            Resolution::Kept(outside) => Some(*outside),
            _ => None,
        };
        let mut kept = resolutions.iter().map(|it| stands(it).is_some());
        group.places.retain(|_| kept.next().unwrap_or_default());
        self.outside.push(resolutions.iter().filter_map(stands).collect());
        self.all.push(group);
        Ok(())
    }

    /// Components of bodies inside a place of a later object than the one around them so far: that place
    /// is then around them.
    pub(crate) fn surround(&self, bodies: &mut [Body]) {
        if self.all.iter().all(|group| group.places.is_empty()) {
            return;
        }
        let field = Field::new(&self.all);
        for (object, body) in (0..).zip(bodies.iter_mut()) {
            let points = body.first_corners();
            let around = body.components.iter().zip(points).map(|(component, point)| {
                field.around(corners_of(component), point, object, &[]).max()
            });
            let around: Vec<Option<u32>> = around.collect();
            for (component, around) in body.components.iter_mut().zip(around) {
                component.outside = component.outside.max(around);
            }
        }
    }
}

impl<'a> Field<'a> {
    fn new(groups: &'a [Group]) -> Self {
        let mut members = Vec::with_capacity(groups.iter().map(|it| it.places.len()).sum());
        for (number, group) in (0..).zip(groups) {
            let own = group.prototype.bounds();
            for (place, it) in (0..).zip(&group.places) {
                let (at, bounds) = (numbers::count(members.len()), it.bounds(own));
                members.push(Member { number: at, group: number, place, bounds });
            }
        }
        let boxes: Vec<[DVec3; 2]> = members.iter().map(|it| it.bounds).collect();
        let tree = Tree::of_boxes(&boxes);
        Self { groups, members, tree }
    }

    pub(super) fn solid(&self, member: Member) -> Solid<'a> {
        let group = &self.groups[member.group as usize];
        group.solid(&group.places[member.place as usize])
    }

    /// Objects whose places are around a body, of which this is a point, and which holds these bounds; `except`
    /// for some members.
    pub(super) fn around(
        &self,
        bounds: [DVec3; 2],
        point: DVec3,
        object: u32,
        except: &[u32],
    ) -> impl Iterator<Item = u32> {
        let mut objects = Vec::new();
        self.tree.around(bounds, |other| {
            let solid = self.solid(self.members[other as usize]);
            if solid.object != object && !except.contains(&other) && solid.contains(point) {
                objects.push(solid.object);
            }
        });
        objects.into_iter()
    }

    /// Surfaces that a member intersects.
    fn met_by(&self, member: Member, bodies: &[Boxed<'_>]) -> Met {
        let solid = self.solid(member);
        let joins = (0..).zip(bodies).any(|(object, body)| {
            let is_near = near(member.bounds, body.bounds, 0.0);
            object != solid.object && is_near && solid.intersects_body(member.bounds, body)
        });
        let mut met = Met { joins, ..Met::default() };
        // Boxes of long parallel fibres in a direction of their own overlap by the thousands.
        let apart = self.groups[member.group as usize].apart;
        let alone = apart && self.groups.len() == 1;
        let bounds = if alone { bounds_of(std::iter::empty()) } else { member.bounds };
        self.tree.within(bounds, |other| {
            let it = self.members[other as usize];
            let same = it.group == member.group;
            let both = [solid, self.solid(it)];
            let exact = both.iter().all(Solid::is_exact);
            let known = match (same, exact) {
                (true, _) => apart || it.place <= member.place,
                (false, true) => it.number <= member.number,
                (false, false) => met.joins,
            };
            if known || !near(it.bounds, member.bounds, 0.0) {
                return;
            }
            let bounds = [member.bounds, it.bounds];
            if same {
                match contact(both, bounds) {
                    Some(Contact::Overlap) if exact => met.crosses.push(other),
                    found => met.contacts.extend(found.map(|it| (other, it))),
                }
            } else if intersect(both, bounds) {
                if exact { met.crosses.push(other) } else { met.joins = true }
            }
        });
        met
    }

    /// Group of each member, and its number among the kept places of the group.
    fn numbers_of_standing(&self, resolutions: &[Resolution]) -> Vec<[u32; 2]> {
        let mut next = vec![0; self.groups.len()];
        let number = |(member, resolution): (&Member, &Resolution)| {
            let next = &mut next[member.group as usize];
            let number = *next;
            *next += u32::from(matches!(resolution, Resolution::Kept(_)));
            [member.group, number]
        };
        self.members.iter().zip(resolutions).map(number).collect()
    }
}
