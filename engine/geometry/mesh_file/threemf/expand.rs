//! Objects that a 3MF file builds, with their components, each in its place.

use std::collections::HashMap;

use glam::{DAffine3, DVec3};

use super::super::file::MeshFile;
use super::super::names::{Label, Names};
use super::model::{MaterialOf, Model, Object, Reference};
use crate::geometry::surface::{Defect, PEAK_PER_TRIANGLE, SIMPLIFY, Surface};
use crate::{printed, reserve};

type Models = HashMap<String, Model>;

/// The triangles that the model `root` builds, in its unit.
pub(super) fn expand(models: &Models, root: &str) -> Result<MeshFile, Defect> {
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
        counts: &counts,
        unit: model.unit,
        surface: Surface::default(),
        names: Names::default(),
    };
    for item in &model.build {
        made.add(root, item, DAffine3::IDENTITY, &mut Vec::new())?;
    }
    let (surface, names) = (made.surface, made.names);
    Ok(MeshFile { surface, names, unit: Some(model.unit), warnings: Vec::new() })
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
    counts: &'a Counts<'a>,
    /// Of the root, m.
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
        // Objects without triangles may contain each other without end.
        if self.counts.get(&(model, reference.object)) == Some(&Some(0)) {
            return Ok(());
        }
        let place = around * reference.place;
        above.push(object.name.clone());
        self.add_mesh(model, object, place, above)?;
        for component in &object.components {
            self.add(model, component, place, above)?;
        }
        above.pop();
        Ok(())
    }

    fn add_mesh(
        &mut self,
        model: &str,
        object: &Object,
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
        for (triangle, number) in object.triangles.iter().zip(1_u64..) {
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
