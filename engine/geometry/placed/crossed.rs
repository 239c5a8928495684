//! Overlaps and contacts of exact shapes that stay exact: for whoever checks an assembly.

use rayon::prelude::*;

use super::nesting::{Field, Group};
use super::shared::{Solid, depth, shared_volume};
use super::{Place, Prototype};
use crate::error::{Error, Result};
use crate::geometry::body::Body;
use crate::geometry::nesting::nest;
use crate::geometry::overlap::{Contact, ContactKind, tolerance};
use crate::geometry::surface::Surface;
use crate::geometry::watch::Task;

/// Error of the facets that stand for a shape where it touches another, m, where few enough are as fine.
const TOUCHING: f64 = 1e-8;

impl Field<'_> {
    /// What pairs of members share that cross or touch.
    ///
    /// # Errors
    /// [`Error::Interrupted`]; shapes that touch and whose facets cannot be compared.
    pub(super) fn crossings(
        &self,
        pairs: &[[u32; 2]],
        names: &[String],
        task: Task<'_>,
    ) -> Result<Vec<Contact>> {
        let contact = |pair: &[u32; 2]| {
            if task.is_cancelled() {
                return Err(Error::Interrupted);
            }
            let mut both = pair.map(|it| self.of(self.members[it as usize]));
            if both[0].0.object == both[1].0.object {
                // Instances of one object are one solid.
                return Ok(None);
            }
            both.sort_by_key(|it| it.0.object);
            let bounds = pair.map(|it| self.members[it as usize].bounds);
            let limit = tolerance(bounds[0], bounds[1]);
            match overlap(both, limit) {
                Some(contact) => Ok(Some(contact)),
                None => touch(both, names, task),
            }
        };
        let found: Vec<Option<Contact>> = pairs.par_iter().map(contact).collect::<Result<_>>()?;
        Ok(found.into_iter().flatten().collect())
    }
}

/// What two shapes share; `None` where that is nothing but rounding.
fn overlap(both: [(&Group, &Place); 2], limit: f64) -> Option<Contact> {
    let [Some(first), Some(second)] = both.map(|(group, place)| Solid::of(group, place)) else {
        return None;
    };
    let volume = shared_volume(first, second);
    let area = |(group, place): (&Group, &Place)| group.prototype.areas(place).iter().sum();
    let least = f64::min(area(both[0]), area(both[1]));
    let (depth, place) = depth(both)?;
    if volume <= 2.0 * limit * least && depth <= 2.0 * limit {
        return None;
    }
    let objects = both.map(|it| it.0.object);
    let kind = ContactKind::Overlap { volume, depth };
    Some(Contact { objects, kind, place: place.to_array(), pairs: 1 })
}

/// Where two shapes touch, by their facets.
fn touch(both: [(&Group, &Place); 2], names: &[String], task: Task<'_>) -> Result<Option<Contact>> {
    let objects = both.map(|it| it.0.object);
    let body = |(number, (group, place)): (u32, (&Group, &Place))| {
        let finer = group.prototype.finer(TOUCHING / place.largest_scale());
        let prototype: &Prototype = finer.as_ref().unwrap_or(&group.prototype);
        let vertices = prototype.vertices.iter().map(|it| place.world_from_own(*it)).collect();
        let surface = Surface::new(vertices, prototype.triangles.clone());
        let mut components: Vec<_> = group.components(place, None).collect();
        components.iter_mut().for_each(|it| it.object = number);
        let mut body = Body::empty();
        body.add(surface, &prototype.triangle_component, components);
        body
    };
    let mut bodies: Vec<Body> = (0..).zip(both).map(body).collect();
    let names = objects.map(|it| names[it as usize].clone());
    let (_, contacts) = nest(&mut bodies, &names, &[None, None], true, task)?;
    // Facets of shapes that touch may lie apart, or share a volume; the shapes do neither.
    let area_of = |it: &Contact| match it.kind {
        ContactKind::Touch { area } => area,
        _ => 0.0,
    };
    let widest = contacts.iter().max_by(|a, b| area_of(a).total_cmp(&area_of(b)));
    let nowhere = (0.0, both[0].1.position.to_array());
    let (area, place) = widest.map_or(nowhere, |it| (area_of(it), it.place));
    Ok(Some(Contact { objects, kind: ContactKind::Touch { area }, place, pairs: 1 }))
}
