//! Placed surfaces as part of a sample.

use glam::DVec3;

use super::groups::{Group, Groups};
use super::{Partners, Placed};
use crate::surface::bounds_of;
use crate::{ObjectSummary, Sample};
use beamlet_core::numbers;

impl Groups {
    /// Adds the placed surfaces to a sample, whose meshes are complete.
    pub(crate) fn add_to(self, sample: &mut Sample) {
        let mut first = vec![0; self.all.len()];
        for (number, group) in self.all.into_iter().enumerate() {
            let object = &mut sample.objects[group.object as usize];
            let left_out = [self.covered[number], self.inner[number]];
            describe(object, &group, &self.outside[number], self.joined[number], left_out);
            if group.places.is_empty() {
                continue;
            }
            let prototype = numbers::count(sample.prototypes.len());
            first[number] = numbers::count(sample.placed.len());
            for (place, outside) in group.places.iter().zip(&self.outside[number]) {
                let component = numbers::count(sample.components.len());
                sample.components.extend(group.solid(place).components(*outside));
                sample.placed.push(Placed { prototype, component, place: *place });
            }
            sample.prototypes.push(group.prototype);
        }
        let at = |[group, place]: [u32; 2]| first[group as usize] + place;
        sample.partners = Partners::of_pairs(self.crossing.iter().map(|pair| pair.map(at)));
    }
}

/// Adds the places of an object to the description of its mesh.
fn describe(
    object: &mut ObjectSummary,
    group: &Group,
    outside: &[Option<u32>],
    (joined, off): (usize, f64),
    [covered, inner]: [usize; 2],
) {
    if joined > 0 {
        let facets = match off {
            0.0 => String::new(),
            _ => format!(" with facets within {:.0} nm of its surface", off * 1e9),
        };
        let which = match group.places.len() + joined + covered + inner {
            1 => format!("it touches or crosses another surface: cut as a mesh{facets}"),
            _ => format!(
                "{joined} of its instances touch other surfaces or overlap: cut and united as meshes{facets}"
            ),
        };
        object.warnings.push(which);
    }
    if covered > 0 {
        object
            .warnings
            .push(format!("{covered} of its instances are covered completely by later objects"));
    }
    if inner > 0 {
        object.warnings.push(format!("{inner} of its instances lie inside others and are ignored"));
    }
    if group.places.len() + joined + covered + inner > 1 {
        object.instances = group.places.len() + joined;
    }
    if group.places.is_empty() {
        return;
    }
    let own: f64 = group.prototype.components.iter().map(|it| it.volume).sum();
    object.triangles += group.prototype.facets();
    object.volume += group.places.iter().map(|place| own * place.volume()).sum::<f64>();
    let corners = |[low, high]: [[f64; 3]; 2]| [DVec3::from_array(low), DVec3::from_array(high)];
    let all = corners(object.bounds).into_iter().chain(group.bounds());
    object.bounds = bounds_of(all).map(Into::into);
    for around in outside {
        if !object.inside.contains(around) {
            object.inside.push(*around);
        }
    }
}
