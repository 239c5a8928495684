//! Gaps between placed surfaces, and between them and meshes: for whoever checks an assembly.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicU64, Ordering};

use glam::{DQuat, DVec3};
use rayon::prelude::*;

use super::Place;
use super::distance::{Distance, Standing};
use super::nesting::{Boxed, Group, Groups};
use crate::error::{Error, Result};
use crate::geometry::body::Body;
use crate::geometry::overlap::{Contact, ContactKind, THIN, arc, tolerance};
use crate::geometry::search::Search;
use crate::geometry::surface::{Surface, bounds_of, near};
use crate::geometry::tree::Tree;
use crate::geometry::watch::{LoadStep, Task};

/// Gaps between two objects, or between the instances of one.
#[derive(Debug, Clone, Copy)]
struct Narrow {
    pairs: u64,
    least: Distance,
}

/// By the objects, in their order.
type Found = BTreeMap<[u32; 2], Narrow>;

/// A group, ready for search.
struct Field<'a> {
    group: &'a Group,
    /// Over the triangles of a mesh.
    triangles: Option<Tree>,
    is_hull: bool,
    /// From the world to the frame of its first place: in it parallel fibres have boxes that fit.
    turn: DQuat,
    /// Over the boxes of its places in that frame, which `boxes` are.
    tree: Tree,
    boxes: Vec<[DVec3; 2]>,
    bounds: [DVec3; 2],
    /// Wider gaps are not listed, m, but for those that facets of the other surface allow.
    limit: f64,
}

impl<'a> Field<'a> {
    fn new(group: &'a Group) -> Self {
        let prototype = &group.prototype;
        let is_mesh = prototype.shape.is_none();
        let triangles = is_mesh.then(|| {
            let corners = (0..prototype.triangles.len()).map(|it| prototype.corners(it));
            let boxes: Vec<_> = corners.map(|it| bounds_of(it.into_iter())).collect();
            Tree::of_boxes(&boxes)
        });
        let scale = group.places.iter().map(Place::largest_scale).fold(0.0, f64::max);
        let arc = if is_mesh {
            let surface = Surface::new(prototype.vertices.clone(), prototype.triangles.clone());
            arc(&surface) * scale
        } else {
            0.0
        };
        let turn = group.places.first().map_or(DQuat::IDENTITY, |it| it.rotation.inverse());
        let boxes: Vec<_> = group
            .places
            .par_iter()
            .map(|place| turned(place, turn).bounds(prototype.bounds()))
            .collect();
        let tree = Tree::of_boxes(&boxes);
        let bounds = group.bounds();
        let is_hull = is_mesh && prototype.is_hull();
        Self { group, triangles, is_hull, turn, tree, boxes, bounds, limit: THIN.max(arc) }
    }

    fn standing(&self, place: usize) -> Standing<'_> {
        let Group { prototype, places, .. } = self.group;
        let (place, tree) = (&places[place], self.triangles.as_ref());
        Standing { prototype, place, tree, is_hull: self.is_hull }
    }

    /// Gaps between one of its places and the later places of the group itself, or all of another.
    fn of_place(&self, number: usize, other: Option<&Self>, found: &mut Found) {
        let own = self.standing(number);
        let field = other.unwrap_or(self);
        let limit = self.limit.max(field.limit);
        let [low, high] = turned(own.place, field.turn).bounds(own.prototype.bounds());
        let wide = [low - limit, high + limit];
        let objects = [self.group.object, field.group.object];
        field.tree.within(wide, |member| {
            let member = member as usize;
            let known = other.is_none() && member <= number;
            if known || !near(field.boxes[member], wide, 0.0) {
                return;
            }
            let there = field.standing(member);
            // Places that touch are one solid, or exact shapes listed as in contact.
            let is_contact = |gap: f64| gap <= tolerance(own.bounds(), there.bounds());
            let gap = own.distance(&there, limit).filter(|gap| !is_contact(gap.0)).filter(|_| {
                let within = |outer: &Group, place: &Place, point: DVec3| {
                    outer.prototype.shape.is_none() && outer.contains(place, point)
                };
                !within(self.group, own.place, middle(&there))
                    && !within(field.group, there.place, middle(&own))
            });
            gap.into_iter().for_each(|least| add(found, objects, Narrow { pairs: 1, least }));
        });
    }

    /// Gap between one of its places and a mesh; the search of its body exists.
    fn to_body(&self, number: usize, (object, boxed): (u32, &Boxed<'_>), limit: f64) -> Found {
        let mut found = Found::new();
        let own = self.standing(number);
        let bounds = own.bounds();
        let Some(search) = boxed.body.search.as_ref().filter(|_| near(bounds, boxed.bounds, limit))
        else {
            return found;
        };
        let wide = [bounds[0] - limit, bounds[1] + limit];
        let mut triangles = Vec::new();
        search.tree.within(wide, |triangle| {
            let corners = boxed.body.surface.corners(triangle as usize);
            if near(bounds_of(corners.into_iter()), wide, 0.0) {
                triangles.push(corners);
            }
        });
        let gap = own.gap_to_triangles(&triangles, limit).filter(|gap| {
            // The triangle of the gap may belong to a part inside the place.
            let contains = own.prototype.shape.is_none() && self.group.contains(own.place, gap.1);
            !contains && !boxed.body.contains(middle(&own))
        });
        let objects = [self.group.object, object];
        gap.into_iter().for_each(|least| add(&mut found, objects, Narrow { pairs: 1, least }));
        found
    }
}

impl Groups {
    /// Gaps between places that stay, and between them and bodies.
    ///
    /// # Errors
    /// [`Error::Interrupted`].
    pub(in crate::geometry) fn gaps(
        &self,
        bodies: &mut [Body],
        task: Task<'_>,
    ) -> Result<Vec<Contact>> {
        let groups = self.all.iter().filter(|group| !group.places.is_empty());
        let fields: Vec<Field<'_>> = groups.map(Field::new).collect();
        if fields.is_empty() {
            return Ok(Vec::new());
        }
        let places = fields.iter().map(|it| it.boxes.len() as u64).sum();
        task.begin(LoadStep::Comparing, places)?;
        let of_bodies = limits_of(bodies, &fields);
        let boxed: Vec<Boxed<'_>> = bodies.iter().map(Boxed::of).collect();
        let reach = fields.iter().map(|it| it.limit).fold(THIN, f64::max);
        let boxes: Vec<_> = fields.iter().map(|it| it.bounds).collect();
        let tree = Tree::of_boxes(&boxes);
        let done = AtomicU64::new(0);
        let mut found = Found::new();
        for (number, field) in fields.iter().enumerate() {
            let mut others = Vec::new();
            tree.within([field.bounds[0] - reach, field.bounds[1] + reach], |other| {
                if other as usize > number {
                    others.push(&fields[other as usize]);
                }
            });
            let near_bodies: Vec<_> = (0..)
                .zip(boxed.iter().zip(&of_bodies))
                .filter_map(|(object, (body, of_body))| {
                    let limit = of_body.as_ref()?.max(field.limit);
                    near(field.bounds, body.bounds, limit).then_some((object, body, limit))
                })
                .collect();
            let of_place = |mut found: Found, place: usize| {
                if task.is_cancelled() {
                    return found;
                }
                field.of_place(place, None, &mut found);
                others.iter().for_each(|other| field.of_place(place, Some(*other), &mut found));
                for (object, body, limit) in &near_bodies {
                    let of_body = field.to_body(place, (*object, body), *limit);
                    of_body.into_iter().for_each(|(objects, it)| add(&mut found, objects, it));
                }
                task.reach(done.fetch_add(1, Ordering::Relaxed) + 1);
                found
            };
            let all = (0..field.boxes.len()).into_par_iter().fold(Found::new, of_place);
            let all = all.reduce(Found::new, joined);
            if task.is_cancelled() {
                return Err(Error::Interrupted);
            }
            found = joined(found, all);
        }
        Ok(found.into_iter().map(|(objects, it)| it.contact(objects)).collect())
    }
}

impl Narrow {
    fn contact(self, objects: [u32; 2]) -> Contact {
        let (width, place) = self.least;
        let kind = ContactKind::Gap { width };
        Contact { objects, kind, place: place.to_array(), pairs: self.pairs }
    }
}

/// Of each body that comes near a field, the limit that its facets allow; it has its search then.
fn limits_of(bodies: &mut [Body], fields: &[Field<'_>]) -> Vec<Option<f64>> {
    let limit_of = |body: &mut Body| {
        let is_near = |margin: f64, bounds: [DVec3; 2]| {
            fields.iter().any(|it| near(it.bounds, bounds, margin.max(it.limit)))
        };
        if body.components.is_empty() {
            return None;
        }
        let bounds = body.bounds();
        let most = crate::geometry::overlap::most_arc(bounds);
        if !is_near(THIN.max(most), bounds) {
            return None;
        }
        let limit = THIN.max(arc(&body.surface));
        if body.search.is_none() && is_near(limit, bounds) {
            body.search = Some(Search::new(&body.surface));
        }
        Some(limit)
    };
    bodies.par_iter_mut().map(limit_of).collect()
}

fn add(found: &mut Found, objects: [u32; 2], more: Narrow) {
    let [a, b] = objects;
    let known = found.entry([a.min(b), a.max(b)]).or_insert(Narrow { pairs: 0, ..more });
    known.pairs += more.pairs;
    if is_before(more.least, known.least) {
        known.least = more.least;
    }
}

/// Whether a distance is less than another; equal ones go by their places, so that the order of
/// threads does not show.
fn is_before(a: Distance, b: Distance) -> bool {
    let order = |it: Distance| [it.0, it.1.x, it.1.y, it.1.z];
    order(a) < order(b)
}

fn joined(mut found: Found, more: Found) -> Found {
    more.into_iter().for_each(|(objects, it)| add(&mut found, objects, it));
    found
}

/// A place in another frame.
fn turned(place: &Place, turn: DQuat) -> Place {
    Place { rotation: turn * place.rotation, position: turn * place.position, ..*place }
}

/// A point in the material of a convex shape, or on the surface of a mesh.
fn middle(standing: &Standing<'_>) -> DVec3 {
    let Standing { prototype, place, .. } = standing;
    match prototype.shape {
        Some(shape) => place.world_from_own(shape.inner_point()),
        None => place.world_from_own(prototype.corners(0)[0]),
    }
}
