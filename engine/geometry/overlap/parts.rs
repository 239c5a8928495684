//! Objects in parts: what may be cut apart from the rest of its object.

use glam::DVec3;

use super::super::body::Body;
use super::super::surface::{Surface, bounds_of, corners_of, encloses, in_mm, near};
use beamlet_core::error::Error;
use beamlet_core::numbers;

/// A closed outer surface with the voids in it; all of an object that is accepted with defects.
#[derive(Debug)]
pub(crate) struct Part {
    pub(super) object: usize,
    /// Components of its object, in ascending order.
    pub(crate) components: Vec<u32>,
    pub(crate) bounds: [DVec3; 2],
    /// Defects of the mesh of its object, if it is accepted with defects.
    pub(super) defective: Option<String>,
}

/// Parts of all objects, in the order of these.
#[derive(Debug, Default)]
pub(crate) struct Parts {
    pub(super) all: Vec<Part>,
    /// Part of each component, by object.
    pub(super) of: Vec<Vec<u32>>,
}

impl Parts {
    /// The parts of all bodies; `defects`: defects of the meshes that are accepted with defects.
    pub(crate) fn of(bodies: &[Body], defects: &[Option<String>]) -> Self {
        let mut parts = Self::default();
        for (object, (body, defective)) in bodies.iter().zip(defects).enumerate() {
            let heads = match defective {
                Some(_) => vec![0; body.components.len()],
                None => heads(body),
            };
            let mut of = vec![0; heads.len()];
            let first = parts.all.len();
            for (component, head) in heads.iter().enumerate() {
                if *head == component {
                    of[component] = numbers::count(parts.all.len());
                    parts.all.push(Part {
                        object,
                        components: Vec::new(),
                        bounds: bounds_of(std::iter::empty()),
                        defective: defective.clone(),
                    });
                }
            }
            for (component, head) in heads.iter().enumerate() {
                of[component] = of[*head];
                let part = &mut parts.all[of[component] as usize];
                part.components.push(numbers::count(component));
                let [low, high] = corners_of(&body.components[component]);
                part.bounds = [part.bounds[0].min(low), part.bounds[1].max(high)];
            }
            debug_assert!(parts.all[first..].iter().all(|part| !part.components.is_empty()));
            parts.of.push(of);
        }
        parts
    }

    /// Triangles of each part, by their numbers in its object.
    pub(super) fn members(&self, bodies: &[Body]) -> Vec<Vec<u32>> {
        let mut members = vec![Vec::new(); self.all.len()];
        for (body, of) in bodies.iter().zip(&self.of) {
            for (triangle, component) in (0..).zip(&body.triangle_component) {
                members[of[*component as usize] as usize].push(triangle);
            }
        }
        members
    }

    /// Triangles of several parts; `members`: of all parts.
    pub(super) fn joined(&self, parts: &[u32], members: &[Vec<u32>], bodies: &[Body]) -> Surface {
        let mut whole = Surface::default();
        for part in parts {
            let Body { surface, .. } = &bodies[self.all[*part as usize].object];
            whole.append(surface.part(&members[*part as usize]));
        }
        whole
    }

    /// The error where two parts overlap and the boolean of them fails.
    pub(super) fn failed(&self, pair: [usize; 2], names: &[String], problem: String) -> Error {
        let [first, second] = pair.map(|part| &self.all[part]);
        let low = first.bounds[0].max(second.bounds[0]);
        let high = first.bounds[1].min(second.bounds[1]);
        let defects = first.defective.as_ref().or(second.defective.as_ref());
        let defects = defects.map_or(String::new(), |it| format!(" ({it})"));
        Error::mesh(
            format!("\"{}\" and \"{}\"", names[first.object], names[second.object]),
            format!(
                "they overlap or touch, and the first cannot be cut: {problem}{defects}; repair \
                 their meshes, or leave a gap between them"
            ),
            format!("near {}", in_mm(low.midpoint(high))),
        )
    }

    /// Groups of parts whose boxes lie apart: they can be taken away at once.
    pub(super) fn apart(&self, parts: &[u32]) -> Vec<Vec<u32>> {
        let mut groups: Vec<Vec<u32>> = Vec::new();
        for part in parts {
            let Part { bounds, defective, .. } = &self.all[*part as usize];
            let margin = 1e-9 + 1e-6 * (bounds[1] - bounds[0]).max_element();
            let fits = |group: &&mut Vec<u32>| {
                defective.is_none()
                    && group.iter().all(|other| {
                        let other = &self.all[*other as usize];
                        other.defective.is_none() && !near(*bounds, other.bounds, margin)
                    })
            };
            match groups.iter_mut().find(fits) {
                Some(group) => group.push(*part),
                None => groups.push(vec![*part]),
            }
        }
        groups
    }
}

/// The outer surface that each component belongs to: itself, or the smallest one around a void.
fn heads(body: &Body) -> Vec<usize> {
    let components = &body.components;
    let outers: Vec<usize> =
        (0..components.len()).filter(|it| components[*it].volume > 0.0).collect();
    let outer = |void: usize| {
        outers
            .iter()
            .copied()
            .filter(|it| {
                components[*it].volume > -components[void].volume
                    && encloses(corners_of(&components[*it]), corners_of(&components[void]))
            })
            .min_by(|a, b| components[*a].volume.total_cmp(&components[*b].volume))
    };
    let head = |component: usize| match components[component].volume > 0.0 {
        true => component,
        false => outer(component).unwrap_or(component),
    };
    (0..components.len()).map(head).collect()
}
