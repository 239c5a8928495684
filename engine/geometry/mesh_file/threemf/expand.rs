//! Objects that a 3MF file builds, with their components, each in its place.

use std::collections::HashMap;

use glam::{DAffine3, DVec3};

use super::super::file::MeshFile;
use super::super::names::{Label, Names};
use super::model::{MaterialOf, Model, Object, Reference};
use super::roles::Roles;
use crate::surface::{Defect, PEAK_PER_TRIANGLE, SIMPLIFY, Surface};
use beamlet_core::{printed, reserve};

type Models = HashMap<String, Model>;

/// Contents that a message lists.
const MOST_LEFT_OUT: usize = 12;

/// The triangles that the model `root` builds, in its unit, but for those with `roles`.
pub(super) fn expand(models: &Models, root: &str, roles: &Roles) -> Result<MeshFile, Defect> {
    let Some(model) = models.get(root) else {
        return Err(Defect::new(
            format!("not a 3MF file: it holds no model \"{}\"", printed::line(root)),
            "3D/3dmodel.model is the usual one",
        ));
    };
    if model.build.is_empty() {
        return Err(Defect::new(
            "there is nothing to build: the element \"build\" has no items",
            "build",
        ));
    }
    let mut counts = HashMap::new();
    let triangles = model.build.iter().try_fold(0_u64, |sum, item| {
        Ok(sum.saturating_add(count(models, root, item, &mut counts)?))
    })?;
    if u32::try_from(triangles).is_err() {
        let problem = format!("its objects are {triangles} triangles, more than 32 bits can count");
        return Err(Defect::new(problem, "components and build"));
    }
    reserve::ask(PEAK_PER_TRIANGLE.saturating_mul(triangles), "its objects", SIMPLIFY)
        .map_err(|error| Defect::new(error.to_string(), ""))?;
    let mut made = Made {
        models,
        root,
        roles,
        counts: &counts,
        left_out: Vec::new(),
        unit: model.unit,
        surface: Surface::default(),
        names: Names::default(),
    };
    for item in &model.build {
        made.add(root, item, DAffine3::IDENTITY, &mut Vec::new())?;
    }
    let (surface, names, left_out) = (made.surface, made.names, made.left_out.join("; "));
    if names.of_triangles().is_empty() && !left_out.is_empty() {
        return Err(Defect::new(format!("nothing is left of its objects: {left_out}"), "build"));
    }
    let warnings = match left_out.is_empty() {
        true => Vec::new(),
        false => vec![format!("left out of the file: {left_out}")],
    };
    Ok(MeshFile { surface, names, unit: Some(model.unit), warnings })
}

/// Triangles by model and object; `None` while they are counted.
type Counts<'a> = HashMap<(&'a str, u32), Option<u64>>;

/// An object and its model.
fn found<'a>(
    models: &'a Models,
    here: &'a str,
    reference: &Reference,
) -> Result<(&'a str, &'a Object), Defect> {
    let key = reference.path.as_deref().map_or_else(|| here.to_owned(), super::key);
    let object = models
        .get_key_value(&key)
        .and_then(|(key, model)| Some((key.as_str(), model.objects.get(&reference.object)?)));
    object.ok_or_else(|| {
        let problem = format!("no object has the id {}", reference.object);
        Defect::new(problem, printed::line(&key))
    })
}

fn count<'a>(
    models: &'a Models,
    here: &'a str,
    reference: &Reference,
    counts: &mut Counts<'a>,
) -> Result<u64, Defect> {
    let (model, object) = found(models, here, reference)?;
    let key = (model, reference.object);
    match counts.get(&key) {
        Some(Some(known)) => return Ok(*known),
        Some(None) => {
            let problem = format!("the object {} is a component of itself", reference.object);
            return Err(Defect::new(problem, printed::line(model)));
        }
        None => {}
    }
    // Those in work are the way from the build to here.
    if counts.values().filter(|it| it.is_none()).count() >= DEEPEST {
        let problem = format!("components are nested more than {DEEPEST} deep");
        return Err(Defect::new(problem, printed::line(model)));
    }
    counts.insert(key, None);
    let mut sum = object.triangles.len() as u64;
    for component in &object.components {
        sum = sum.saturating_add(count(models, model, component, counts)?);
    }
    counts.insert(key, Some(sum));
    Ok(sum)
}

/// Components of components.
const DEEPEST: usize = 64;

struct Made<'a> {
    models: &'a Models,
    /// Name of the first model.
    root: &'a str,
    roles: &'a Roles,
    /// Contents that are no parts of the model, in words.
    left_out: Vec<String>,
    counts: &'a Counts<'a>,
    /// Unit of the root, m.
    unit: f64,
    surface: Surface,
    names: Names,
}

impl<'a> Made<'a> {
    /// Adds an object in its place; `above`: names of those that it is a component of.
    fn add(
        &mut self,
        here: &'a str,
        reference: &Reference,
        around: DAffine3,
        above: &mut Vec<String>,
    ) -> Result<(), Defect> {
        let (model, object) = found(self.models, here, reference)?;
        let name = printed::line(&object.name);
        if let Some(role) = object.role {
            self.leave_out(&format!("\"{name}\""), role.reason());
            return Ok(());
        }
        for shape in &object.left_out {
            let what = format!("{} of \"{name}\"", printed::line(shape));
            self.leave_out(&what, "an extension: only triangles are read");
        }
        // Objects without triangles may contain each other without end.
        if self.counts.get(&(model, reference.object)) == Some(&Some(0)) {
            return Ok(());
        }
        let place = around * reference.place;
        above.push(object.name.clone());
        let id = (model == self.root).then_some(reference.object);
        let marked = id.map_or_else(Vec::new, |id| self.roles.marked(id, object.triangles.len()));
        let roles = self.roles;
        for ([first, last], role) in id.map_or(&[][..], |id| roles.of_triangles(id)) {
            let what = format!("triangles {first} to {last} of \"{name}\"");
            self.leave_out(&what, role.reason());
        }
        self.add_mesh(model, (object, &marked), place, above)?;
        for component in &object.components {
            let role = id.and_then(|id| self.roles.of_component(id, component.object));
            match role {
                Some(role) => {
                    let what = format!("component {} of \"{name}\"", component.object);
                    self.leave_out(&what, role.reason());
                }
                None => self.add(model, component, place, above)?,
            }
        }
        above.pop();
        Ok(())
    }

    fn leave_out(&mut self, what: &str, reason: &str) {
        let words = format!("{what} ({reason})");
        match self.left_out.len() {
            MOST_LEFT_OUT => self.left_out.push("and more".to_owned()),
            count if count < MOST_LEFT_OUT && !self.left_out.contains(&words) => {
                self.left_out.push(words);
            }
            _ => {}
        }
    }

    /// Adds the triangles of an object that are not marked.
    fn add_mesh(
        &mut self,
        model: &str,
        (object, marked): (&Object, &[bool]),
        place: DAffine3,
        objects: &[String],
    ) -> Result<(), Defect> {
        let in_model = &self.models[model];
        let scale = in_model.unit / self.unit;
        let vertices: Vec<DVec3> =
            object.vertices.iter().map(|it| place.transform_point3(*it * scale)).collect();
        // A mirror turns triangles round.
        let mirrored = place.matrix3.determinant() < 0.0;
        let mut label: Option<(Option<[u32; 2]>, u32)> = None;
        for (triangle, number) in object.triangles.iter().zip(1_usize..) {
            if marked.get(number - 1) == Some(&true) {
                continue;
            }
            let key = triangle.material.as_ref().map(MaterialOf::key);
            let label = match label {
                Some((last, label)) if last == key => label,
                _ => {
                    let material = triangle.material.map(|it| material(in_model, model, it));
                    let names = Label {
                        objects: objects.to_vec(),
                        groups: Vec::new(),
                        material: material.transpose()?.flatten(),
                    };
                    let found = self.names.number(&names);
                    label = Some((key, found));
                    found
                }
            };
            let [a, mut b, mut c] = triangle.corners.map(|corner| vertices[corner as usize]);
            if mirrored {
                (b, c) = (c, b);
            }
            let failed = |problem| Defect::new(problem, format!("triangle {number} of an object"));
            self.surface.push_triangle([a, b, c]).map_err(failed)?;
            self.names.push(label);
        }
        Ok(())
    }
}

/// The name of a material; `None` without one, colours count as one.
fn material(model: &Model, name: &str, of: MaterialOf) -> Result<Option<String>, Defect> {
    let place = || format!("{}, line {}", printed::line(name), of.line);
    match model.materials.get(&of.resource) {
        None => {
            let mut there: Vec<u32> = model.materials.keys().copied().collect();
            there.sort_unstable();
            let there = there.iter().map(u32::to_string).collect::<Vec<_>>().join(", ");
            let has = if there.is_empty() { "none".to_owned() } else { there };
            let problem = format!(
                "a material of the list {} is used; the file has the lists: {has}",
                of.resource
            );
            Err(Defect::new(problem, place()))
        }
        Some(None) => Ok(None),
        Some(Some(names)) => match names.get(of.number as usize) {
            Some(name) => Ok(Some(name.clone())),
            None => {
                let problem = format!(
                    "the material {} of the list {} is used; the list has {}, counted from 0",
                    of.number,
                    of.resource,
                    names.len()
                );
                Err(Defect::new(problem, place()))
            }
        },
    }
}
