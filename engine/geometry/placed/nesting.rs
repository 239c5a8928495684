//! What placed surfaces stand in, and which of them meet something.
//!
//! Those that meet another surface join the mesh of their object, as their facets, and are cut with
//! it; those that lie apart or properly in one another stay as they are.

use glam::DVec3;
use rayon::prelude::*;

use super::meeting::{meets_body, meets_place};
use super::{Place, Prototype};
use crate::error::{Error, Result};
use crate::geometry::Component;
use crate::geometry::body::{Body, corners_of};
use crate::geometry::overlap::Contact;
use crate::geometry::search::{Search, winding_by_solid_angle};
use crate::geometry::surface::{Surface, bounds_of, in_mm, near};
use crate::geometry::tree::Tree;
use crate::geometry::watch::{LoadStep, Task};
use crate::numbers;

/// Error of the facets of a shape that is cut with others, m, where few enough are as fine.
const JOINED: f64 = 1e-8;
/// All places of one object.
#[derive(Debug)]
pub(in crate::geometry) struct Group {
    pub(in crate::geometry) object: u32,
    pub(in crate::geometry) prototype: Prototype,
    pub(in crate::geometry) places: Vec<Place>,
    /// They are known not to meet each other.
    pub(in crate::geometry) apart: bool,
}

/// Places of all groups, and what is around them.
#[derive(Default)]
pub(in crate::geometry) struct Groups {
    pub(in crate::geometry) all: Vec<Group>,
    /// Of each place of each group: the latest object around it.
    pub(in crate::geometry) outside: Vec<Vec<Option<u32>>>,
    /// Of each group: how many places lie wholly in later objects, and are left out.
    pub(in crate::geometry) covered: Vec<usize>,
    /// Of each group: how many have joined the mesh of their object, and how far their facets are off
    /// their surfaces at most, m.
    pub(in crate::geometry) joined: Vec<(usize, f64)>,
    /// What places that are left out share with later objects, where that is wanted.
    pub(in crate::geometry) overlaps: Vec<Contact>,
}

/// A place among all of all groups.
#[derive(Clone, Copy)]
pub(super) struct Member {
    pub(super) group: u32,
    pub(super) place: u32,
    pub(super) bounds: [DVec3; 2],
}

/// A body and the box around it.
pub(super) struct Boxed<'a> {
    pub(super) body: &'a Body,
    pub(super) bounds: [DVec3; 2],
}

/// What becomes of a place.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Fate {
    /// It meets a surface.
    Joins,
    /// It lies in a later object.
    Covered,
    Stands(Option<u32>),
}

/// Members and the tree over their boxes.
pub(super) struct Field<'a> {
    groups: &'a [Group],
    pub(super) members: Vec<Member>,
    pub(super) tree: Tree,
}

impl Group {
    /// Box around all places in the world.
    pub(in crate::geometry) fn bounds(&self) -> [DVec3; 2] {
        let own = self.prototype.bounds();
        let corners = self.places.iter().flat_map(|place| place.bounds(own));
        bounds_of(corners)
    }

    /// Whether a point of the world lies in the body of a place.
    pub(super) fn contains(&self, place: &Place, point: DVec3) -> bool {
        self.prototype.contains(place.own_from_world(point))
    }

    /// A point of the surface of a place.
    pub(super) fn point(&self, place: &Place) -> DVec3 {
        place.world_from_own(self.prototype.corners(0)[0])
    }

    /// The components of a place.
    pub(in crate::geometry) fn components(
        &self,
        place: &Place,
        outside: Option<u32>,
    ) -> impl Iterator<Item = Component> {
        let areas = self.prototype.areas(place);
        self.prototype.components.iter().zip(areas).map(move |(own, area)| Component {
            object: self.object,
            outside,
            volume: own.volume * place.volume(),
            area,
            bounds: place.bounds(corners_of(own)).map(Into::into),
            lids: own.lids.and_then(|lids| place.lids(lids)),
            ..Component::default()
        })
    }
}

impl Groups {
    /// Finds what is around each place; those that meet a surface join the bodies of their objects.
    /// `wanted`: whether contacts are.
    ///
    /// # Errors
    /// Places of one object that meet each other; [`Error::Interrupted`].
    pub(in crate::geometry) fn settle(
        groups: Vec<Group>,
        bodies: &mut [Body],
        names: &[String],
        wanted: bool,
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
        let boxed: Vec<Boxed<'_>> =
            bodies.iter().map(|body| Boxed { body, bounds: body.bounds() }).collect();
        let fate = |member: &Member| match task.is_cancelled() {
            true => Err(Error::Interrupted),
            false => field.fate(*member, &boxed, names),
        };
        let mut fates: Vec<Result<Fate>> = field.members.par_iter().map(fate).collect();
        field.around_earlier(bodies, &mut fates);
        let mut settled: Vec<Vec<Fate>> =
            groups.iter().map(|group| Vec::with_capacity(group.places.len())).collect();
        for (member, fate) in field.members.iter().zip(fates) {
            settled[member.group as usize].push(fate?);
        }
        let overlaps = if wanted { field.covered(&settled, &boxed) } else { Vec::new() };
        drop(field);
        Ok(Self { overlaps, ..Self::of(groups, settled, bodies) })
    }

    fn of(groups: Vec<Group>, settled: Vec<Vec<Fate>>, bodies: &mut [Body]) -> Self {
        let mut this = Self::default();
        for (mut group, fates) in groups.into_iter().zip(settled) {
            let count = |fate| fates.iter().filter(|it| **it == fate).count();
            this.covered.push(count(Fate::Covered));
            let mut joined = (count(Fate::Joins), 0.0_f64);
            for (place, _) in group.places.iter().zip(&fates).filter(|it| *it.1 == Fate::Joins) {
                let finer = group.prototype.finer(JOINED / place.largest_scale());
                let prototype = finer.as_ref().unwrap_or(&group.prototype);
                joined.1 = joined.1.max(prototype.error() * place.largest_scale());
                let vertices =
                    prototype.vertices.iter().map(|it| place.world_from_own(*it)).collect();
                bodies[group.object as usize].add(
                    Surface::new(vertices, prototype.triangles.clone()),
                    &prototype.triangle_component,
                    group.components(place, None).collect(),
                );
            }
            this.joined.push(joined);
            let stands = |fate: &Fate| match fate {
                Fate::Stands(outside) => Some(*outside),
                _ => None,
            };
            let mut kept = fates.iter().map(|fate| stands(fate).is_some());
            group.places.retain(|_| kept.next().unwrap_or_default());
            this.outside.push(fates.iter().filter_map(stands).collect());
            this.all.push(group);
        }
        this
    }

    /// Components of bodies that stand in a place of a later object than the one around them so
    /// far: that is the one around them.
    pub(in crate::geometry) fn surround(&self, bodies: &mut [Body]) {
        if self.all.iter().all(|group| group.places.is_empty()) {
            return;
        }
        let field = Field::new(&self.all);
        for (object, body) in (0..).zip(bodies.iter_mut()) {
            let points = body.first_corners();
            let around =
                body.components.iter().zip(points).map(|(component, point)| {
                    field.around(corners_of(component), point, object).max()
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
        let members: Vec<Member> = (0..)
            .zip(groups)
            .flat_map(|(number, group)| {
                let own = group.prototype.bounds();
                (0..).zip(&group.places).map(move |(place, it)| Member {
                    group: number,
                    place,
                    bounds: it.bounds(own),
                })
            })
            .collect();
        let boxes: Vec<[DVec3; 2]> = members.iter().map(|it| it.bounds).collect();
        let tree = Tree::of_boxes(&boxes);
        Self { groups, members, tree }
    }

    pub(super) fn of(&self, member: Member) -> (&'a Group, &'a Place) {
        let group = &self.groups[member.group as usize];
        (group, &group.places[member.place as usize])
    }

    /// Objects whose places are around a body of these bounds, of which this is a point.
    fn around(&self, bounds: [DVec3; 2], point: DVec3, object: u32) -> impl Iterator<Item = u32> {
        let mut objects = Vec::new();
        self.tree.around(bounds, |other| {
            let (group, place) = self.of(self.members[other as usize]);
            if group.object != object && group.contains(place, point) {
                objects.push(group.object);
            }
        });
        objects.into_iter()
    }

    fn fate(&self, member: Member, bodies: &[Boxed<'_>], names: &[String]) -> Result<Fate> {
        let (group, place) = self.of(member);
        for (object, body) in (0..).zip(bodies) {
            let is_near = near(member.bounds, body.bounds, 0.0);
            if object != group.object && is_near && meets_body(group, place, member.bounds, body) {
                return Ok(Fate::Joins);
            }
        }
        let mut joins = false;
        let mut clash = None;
        // Boxes of long parallel fibres in a direction of their own overlap by the thousands.
        let alone = group.apart && self.groups.len() == 1;
        let bounds = if alone { bounds_of(std::iter::empty()) } else { member.bounds };
        self.tree.within(bounds, |other| {
            let it = self.members[other as usize];
            let same = it.group == member.group;
            let known = same && (group.apart || it.place <= member.place);
            if known || joins || clash.is_some() || !near(it.bounds, member.bounds, 0.0) {
                return;
            }
            let (others, there) = self.of(it);
            let within = || {
                group.contains(place, others.point(there))
                    || others.contains(there, group.point(place))
            };
            let meets = meets_place((group, place), (others, there), [member.bounds, it.bounds]);
            if same && (meets || within()) {
                clash = Some(it);
            }
            joins = joins || (meets && !same);
        });
        if let Some(other) = clash {
            return Err(Error::mesh(
                format!("\"{}\"", names[group.object as usize]),
                format!(
                    "instances {} and {} touch, or one lies in the other",
                    member.place + 1,
                    other.place + 1
                ),
                format!("near {}", in_mm(member.bounds[0].midpoint(member.bounds[1]))),
            ));
        }
        if joins {
            return Ok(Fate::Joins);
        }
        let point = group.point(place);
        let of_bodies = (0..).zip(bodies).filter(|(object, body)| {
            *object != group.object
                && near([point; 2], body.bounds, 0.0)
                && body.body.contains(point)
        });
        let around = of_bodies
            .map(|(object, _)| object)
            .chain(self.around(member.bounds, point, group.object))
            .max();
        Ok(match around {
            Some(object) if object > group.object => Fate::Covered,
            around => Fate::Stands(around),
        })
    }

    /// Places around components of earlier objects join the meshes of theirs, which cut those; so do
    /// places around such that join, and around these.
    fn around_earlier(&self, bodies: &[Body], fates: &mut [Result<Fate>]) {
        let mut joining: Vec<usize> =
            (0..fates.len()).filter(|member| matches!(fates[*member], Ok(Fate::Joins))).collect();
        let mut join = |object: u32, bounds: [DVec3; 2], point: DVec3, joining: &mut Vec<usize>| {
            self.tree.around(bounds, |member| {
                let (group, place) = self.of(self.members[member as usize]);
                if group.object > object
                    && let Ok(fate) = &mut fates[member as usize]
                    && *fate != Fate::Joins
                    && group.contains(place, point)
                {
                    *fate = Fate::Joins;
                    joining.push(member as usize);
                }
            });
        };
        for (object, body) in (0_u32..).zip(bodies) {
            for (component, point) in body.components.iter().zip(body.first_corners()) {
                join(object, corners_of(component), point, &mut joining);
            }
        }
        while let Some(member) = joining.pop() {
            let (group, place) = self.of(self.members[member]);
            for (component, point) in group.prototype.starts() {
                let bounds = place.bounds(corners_of(component));
                join(group.object, bounds, place.world_from_own(point), &mut joining);
            }
        }
    }
}

impl Body {
    /// Whether a point off its surface lies in its material; its search exists.
    pub(super) fn contains(&self, point: DVec3) -> bool {
        let Some(search) = &self.search else { return false };
        match search.crossings(&self.surface, point) {
            Some(hits) => hits.iter().map(|(_, sign)| sign).sum::<i32>() > 0,
            None => {
                winding_by_solid_angle(&self.surface, 0..self.surface.triangles.len(), point) > 0.5
            }
        }
    }

    /// Adds components: a closed surface, and the component of each of its triangles.
    fn add(&mut self, surface: Surface, of: &[u32], components: Vec<Component>) {
        let vertex = numbers::count(self.surface.vertices.len());
        let first = numbers::count(self.components.len());
        self.surface.append(surface, vertex);
        self.triangle_component.extend(of.iter().map(|it| it + first));
        self.components.extend(components);
        self.search = None;
    }
}
