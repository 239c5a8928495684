//! From the bodies of objects to a sample.

use glam::DVec3;

use super::body::Body;
use super::defects::Defects;
use super::placed::Groups;
use super::{ObjectSummary, Sample};
use beamlet_core::error::{Error, Result};
use beamlet_core::numbers;

/// Properties of an object beside its surface.
pub(super) struct Note {
    /// Bounding box of its mesh.
    pub(crate) bounds: [DVec3; 2],
    pub(crate) hash: String,
    pub(crate) defects: Defects,
    pub(crate) cut_by: Vec<u32>,
}

/// Puts the bodies of all objects together.
///
/// # Errors
/// More triangles than 32 bits can count.
pub(super) fn assemble(
    bodies: Vec<Body>,
    groups: Groups,
    names: Vec<String>,
    notes: Vec<Note>,
) -> Result<Sample> {
    let count = |of: fn(&Body) -> usize| bodies.iter().map(of).sum::<usize>();
    let (vertices, triangles) =
        (count(|body| body.surface.vertices.len()), count(|body| body.surface.triangles.len()));
    if u32::try_from(vertices.max(triangles)).is_err() {
        return Err(Error::mesh(
            "the sample",
            format!("{triangles} triangles are more than 32 bits can count"),
            "all objects together",
        ));
    }
    let mut sample = Sample::default();
    for ((mut body, name), note) in bodies.into_iter().zip(names).zip(notes) {
        // Of an object that vanishes, where it was.
        let vanished = body.components.is_empty();
        let bounds = if vanished { note.bounds } else { body.bounds() };
        let mut inside = Vec::new();
        for component in body.components.iter().filter(|component| component.volume > 0.0) {
            if !inside.contains(&component.outside) {
                inside.push(component.outside);
            }
        }
        sample.objects.push(ObjectSummary {
            name,
            triangles: body.surface.triangles.len(),
            instances: 0,
            volume: body.components.iter().map(|component| component.volume).sum(),
            bounds: bounds.map(Into::into),
            inside,
            cut_by: note.cut_by,
            hash: note.hash,
            defects: note.defects,
            warnings: std::mem::take(&mut body.warnings),
        });
        sample.add_body(body);
    }
    sample.find_lids();
    groups.add_to(&mut sample);
    Ok(sample)
}

impl Sample {
    /// Adds the surface and the components of a body.
    pub(super) fn add_body(&mut self, body: Body) {
        let component = numbers::count(self.components.len());
        let Body { surface, triangle_component, components, .. } = body;
        self.components.extend(components);
        self.add_surface(surface.vertices, &surface.triangles, &triangle_component, component);
    }

    /// Adds a surface; `of`: the component of each triangle, counted from `component`.
    pub(super) fn add_surface(
        &mut self,
        vertices: impl IntoIterator<Item = DVec3>,
        triangles: &[[u32; 3]],
        of: &[u32],
        component: u32,
    ) {
        let vertex = numbers::count(self.vertices.len());
        self.vertices.extend(vertices.into_iter().map(|vertex| vertex.to_array()));
        self.triangles.extend(triangles.iter().map(|corners| corners.map(|it| it + vertex)));
        self.triangle_component.extend(of.iter().map(|it| it + component));
    }
}
