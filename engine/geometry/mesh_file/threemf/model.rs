//! A model of a 3MF file, from XML.

use std::collections::HashMap;
use std::str::FromStr;

use glam::{DAffine3, DMat3, DVec3};
use quick_xml::NsReader;
use quick_xml::events::{BytesStart, Event};
use quick_xml::name::{QName, ResolveResult};

use super::roles::Role;
use crate::surface::Defect;
use beamlet_core::printed;

/// Lengths of 1.0 by their names, m.
const UNITS: [(&str, f64); 6] = [
    ("micron", 1e-6),
    ("millimeter", 1e-3),
    ("centimeter", 1e-2),
    ("inch", 25.4e-3),
    ("foot", 0.3048),
    ("meter", 1.0),
];

/// Beginning of the name spaces of extensions, whose years follow.
const EXTENSIONS: &str = "http://schemas.microsoft.com/3dmanufacturing/";
/// Extensions that this reader follows, or that leave the geometry as it is.
const FOLLOWED: [&str; 4] = ["production/", "material/", "trianglesets/", "slice/"];
/// Elements of extensions in place of triangles, or beside them.
const SHAPES: [&str; 5] =
    ["beamlattice", "booleanshape", "displacementmesh", "levelset", "volumetricstack"];

#[derive(Debug)]
pub(super) struct Model {
    /// m per unit.
    pub(crate) unit: f64,
    pub(crate) objects: HashMap<u32, Object>,
    /// Names of base materials; `None` for resources of other kinds, colours for one.
    pub(crate) materials: HashMap<u32, Option<Vec<String>>>,
    /// The build list.
    pub(crate) build: Vec<Reference>,
}

#[derive(Debug, Default)]
pub(super) struct Object {
    pub(crate) name: String,
    /// `None`: a part of the model.
    pub(crate) role: Option<Role>,
    /// Shapes of extensions, which are left out.
    pub(super) left_out: Vec<String>,
    pub(crate) material: Option<MaterialOf>,
    pub(super) vertices: Vec<DVec3>,
    pub(super) triangles: Vec<Triangle>,
    pub(super) components: Vec<Reference>,
}

#[derive(Debug)]
pub(super) struct Triangle {
    pub(super) corners: [u32; 3],
    pub(crate) material: Option<MaterialOf>,
}

/// A material by its resource and its number in it.
#[derive(Debug, Clone, Copy)]
pub(super) struct MaterialOf {
    pub(super) resource: u32,
    pub(crate) number: u32,
    /// Line of the model where it is named.
    pub(crate) line: u32,
}

impl MaterialOf {
    /// Its identity, wherever it is named.
    pub(super) const fn key(&self) -> [u32; 2] {
        [self.resource, self.number]
    }
}

/// An object in its place.
#[derive(Debug)]
pub(super) struct Reference {
    pub(crate) object: u32,
    /// Another model of the file that holds it.
    pub(crate) path: Option<String>,
    pub(crate) place: DAffine3,
}

impl Model {
    pub(super) fn read(text: &str) -> Result<Self, Defect> {
        let mut reader = NsReader::from_str(text);
        let mut reading = Reading::default();
        // Lines are counted as far as they are needed.
        let (mut line, mut counted) = (1_u32, 0);
        let mut last_line = |position: u64| {
            let position = usize::try_from(position).unwrap_or(usize::MAX).min(text.len());
            let bytes = &text.as_bytes()[counted..position.max(counted)];
            let ends = bytes.iter().filter(|byte| **byte == b'\n').count();
            line = line.saturating_add(beamlet_core::numbers::at_most(ends));
            counted = position.max(counted);
            line
        };
        loop {
            let event = reader.read_resolved_event();
            let event = event.map(|(space, event)| (reading.is_core(&space), event));
            let position = reader.buffer_position();
            let line = last_line(position);
            // Most programs write a model as one line.
            let place = || format!("line {line}, before byte {position}");
            let at = |problem: String| Defect::new(problem, place());
            let invalid = |error| at(format!("not valid XML: {error}"));
            match event.map_err(invalid)? {
                (_, Event::Eof) => return reading.end(),
                (true, Event::Start(tag) | Event::Empty(tag)) => {
                    reading.begin(&tag, line, &reader).map_err(at)?;
                }
                // Elements of extensions may have the names of others.
                (false, Event::Start(tag)) => {
                    reading.extension(&tag).map_err(at)?;
                    reader.read_to_end(tag.to_end().name()).map_err(invalid)?;
                }
                (false, Event::Empty(tag)) => reading.extension(&tag).map_err(at)?,
                (true, Event::End(tag)) => reading.finish(tag.local_name().into_inner()),
                (_, Event::Text(text)) => reading.text(&text),
                _ => {}
            }
        }
    }
}

/// The target of the first relation whose kind ends so.
pub(super) fn target(text: &str, kind: &str) -> Option<String> {
    let mut reader = quick_xml::Reader::from_str(text);
    loop {
        match reader.read_event().ok()? {
            Event::Eof => return None,
            Event::Start(tag) | Event::Empty(tag)
                if tag.local_name().into_inner() == "Relationship" =>
            {
                let attributes = Attributes::of(&tag).ok()?;
                if attributes.text("Type").is_some_and(|it| it.ends_with(kind)) {
                    return attributes.text("Target");
                }
            }
            _ => {}
        }
    }
}

/// The elements read by now; they are identified by their names and by the start of the last object or
/// list of materials.
#[derive(Default)]
struct Reading {
    unit: Option<f64>,
    /// Name space of the element "model", and so of all elements of the core; `None` before it.
    core: Option<String>,
    objects: HashMap<u32, Object>,
    materials: HashMap<u32, Option<Vec<String>>>,
    build: Vec<Reference>,
    object: Option<u32>,
    names: Option<u32>,
    /// Role of the object in work if the text that follows is "True".
    setting: Option<Role>,
}

impl Reading {
    /// Checks whether an element belongs to the core, by its name space: the space of the root, none, or the space
    /// of materials, where some programs write their names.
    fn is_core(&mut self, space: &ResolveResult<'_>) -> bool {
        match space {
            ResolveResult::Unbound => true,
            ResolveResult::Unknown(_) => false,
            ResolveResult::Bound(space) => {
                let space = space.into_inner();
                let core = self.core.get_or_insert_with(|| space.to_owned());
                let extension = || space.strip_prefix(EXTENSIONS);
                core == space || extension().is_some_and(|name| name.starts_with("material/"))
            }
        }
    }

    /// An element that has no meaning in the core: a resource without names of materials, or a shape.
    fn extension(&mut self, tag: &BytesStart<'_>) -> Result<(), String> {
        let name = tag.local_name().into_inner();
        match name {
            "colorgroup" | "texture2dgroup" | "compositematerials" | "multiproperties" => {
                self.materials.insert(Attributes::of(tag)?.number("id")?, None);
            }
            _ if SHAPES.contains(&name) => {
                if let Some(object) = self.object.and_then(|id| self.objects.get_mut(&id)) {
                    object.left_out.push(name.to_owned());
                }
            }
            _ => {}
        }
        Ok(())
    }

    fn text(&mut self, text: &str) {
        if let Some(role) = self.setting
            && text.trim().eq_ignore_ascii_case("true")
            && let Some(object) = self.object.and_then(|id| self.objects.get_mut(&id))
        {
            object.role = Some(role);
        }
    }

    fn finish(&mut self, name: &str) {
        match name {
            "object" => self.object = None,
            "metadata" => self.setting = None,
            _ => {}
        }
    }

    fn begin(
        &mut self,
        tag: &BytesStart<'_>,
        line: u32,
        reader: &NsReader<&[u8]>,
    ) -> Result<(), String> {
        let name = tag.local_name().into_inner();
        match name {
            "vertex" => {
                let attributes = Attributes::of(tag)?;
                let vertex = DVec3::new(
                    attributes.number("x")?,
                    attributes.number("y")?,
                    attributes.number("z")?,
                );
                self.object(name)?.vertices.push(vertex);
            }
            "triangle" => {
                let attributes = Attributes::of(tag)?;
                let corners =
                    [attributes.number("v1")?, attributes.number("v2")?, attributes.number("v3")?];
                let object = self.object(name)?;
                let there = object.vertices.len();
                if let Some(corner) = corners.iter().find(|it| **it as usize >= there) {
                    return Err(format!(
                        "{corner} is not a vertex: there are {there}, counted from 0"
                    ));
                }
                let material = attributes.material("p1", object.material, line)?;
                object.triangles.push(Triangle { corners, material });
            }
            "object" => self.begin_object(&Attributes::of(tag)?, line)?,
            "component" => {
                let reference = Attributes::of(tag)?.reference()?;
                self.object(name)?.components.push(reference);
            }
            "item" => self.build.push(Attributes::of(tag)?.reference()?),
            "metadata" if self.object.is_some() => {
                self.setting = Attributes::of(tag)?.get("name").and_then(Role::of_setting);
            }
            "model" => {
                let attributes = Attributes::of(tag)?;
                attributes.check_extensions(reader)?;
                self.unit = Some(attributes.unit()?);
            }
            "basematerials" => {
                let id = Attributes::of(tag)?.number("id")?;
                self.materials.insert(id, Some(Vec::new()));
                self.names = Some(id);
            }
            "base" => {
                let name = Attributes::of(tag)?.text("name").unwrap_or_default();
                let names = self.names.and_then(|id| self.materials.get_mut(&id)?.as_mut());
                names.ok_or("a base material outside of \"basematerials\"")?.push(name);
            }
            _ => self.extension(tag)?,
        }
        Ok(())
    }

    fn begin_object(&mut self, attributes: &Attributes<'_>, line: u32) -> Result<(), String> {
        let id: u32 = attributes.number("id")?;
        // Slices are finer than the triangles then.
        if attributes.in_extension("meshresolution") == Some("lowres") {
            let problem = "has slices in place of a fine mesh (meshresolution \"lowres\")";
            return Err(format!("the object {id} {problem}; allowed: \"fullres\""));
        }
        let named = ["name", "partnumber"].into_iter().find_map(|key| attributes.text(key));
        let object = Object {
            role: attributes.get("type").map_or(Ok(None), Role::of_type)?,
            name: named.filter(|it| !it.trim().is_empty()).unwrap_or_else(|| id.to_string()),
            material: attributes.material("pindex", None, line)?,
            ..Object::default()
        };
        if self.objects.insert(id, object).is_some() {
            return Err(format!("two objects have the id {id}"));
        }
        self.object = Some(id);
        Ok(())
    }

    /// The object in work.
    fn object(&mut self, what: &str) -> Result<&mut Object, String> {
        let object = self.object.and_then(|id| self.objects.get_mut(&id));
        object.ok_or_else(|| format!("a {what} outside of an object"))
    }

    fn end(self) -> Result<Model, Defect> {
        let no_model = || Defect::new("there is no element \"model\"", "");
        let unit = self.unit.ok_or_else(no_model)?;
        Ok(Model { unit, objects: self.objects, materials: self.materials, build: self.build })
    }
}

/// Attributes of an element: whether they have a prefix, their local names, and their values.
struct Attributes<'a>(Vec<(bool, &'a str, String)>);

impl<'a> Attributes<'a> {
    fn of(tag: &'a BytesStart<'_>) -> Result<Self, String> {
        let bad = |error: &dyn std::fmt::Display| format!("not valid XML: {error}");
        let mut found = Vec::new();
        for attribute in tag.attributes() {
            let attribute = attribute.map_err(|error| bad(&error))?;
            let value = attribute
                .normalized_value(quick_xml::XmlVersion::Implicit1_0)
                .map_err(|error| bad(&error))?
                .into_owned();
            let (name, prefix) = attribute.key.decompose();
            found.push((prefix.is_some(), name.into_inner(), value));
        }
        Ok(Self(found))
    }

    fn get(&self, key: &str) -> Option<&str> {
        self.0.iter().find(|(extends, found, _)| !extends && *found == key).map(|it| it.2.as_str())
    }

    /// An attribute with a prefix.
    fn in_extension(&self, key: &str) -> Option<&str> {
        self.0.iter().find(|(extends, found, _)| *extends && *found == key).map(|it| it.2.as_str())
    }

    /// Refuses extensions that a file requires and that change its geometry.
    fn check_extensions(&self, reader: &NsReader<&[u8]>) -> Result<(), String> {
        for prefix in self.get("requiredextensions").unwrap_or_default().split_whitespace() {
            let name = format!("{prefix}:x");
            let (space, _) = reader.resolver().resolve_element(QName(&name));
            let space = match space {
                ResolveResult::Bound(space) => space.into_inner().to_owned(),
                _ => format!("the prefix \"{prefix}\", which has no name space"),
            };
            let is_followed = space
                .strip_prefix(EXTENSIONS)
                .is_some_and(|rest| FOLLOWED.iter().any(|known| rest.starts_with(known)));
            if !is_followed {
                let known = FOLLOWED.map(|known| known.trim_end_matches('/')).join(", ");
                let space = printed::line(&space);
                return Err(format!(
                    "requires the extension {space}; allowed: {known}. Export it as triangles alone"
                ));
            }
        }
        Ok(())
    }

    fn text(&self, key: &str) -> Option<String> {
        self.get(key).map(str::to_owned)
    }

    fn number<T: FromStr>(&self, key: &str) -> Result<T, String> {
        let text = self.get(key).ok_or_else(|| format!("the attribute {key} is missing"))?;
        let bad = |_| format!("{key} is \"{}\"; allowed: a number", printed::line(text));
        text.trim().parse().map_err(bad)
    }

    /// The material of a triangle or object; `default`: where it names none of its own.
    fn material(
        &self,
        key: &str,
        default: Option<MaterialOf>,
        line: u32,
    ) -> Result<Option<MaterialOf>, String> {
        match (self.get("pid"), self.get(key)) {
            (None, None) => Ok(default),
            (resource, number) => Ok(Some(MaterialOf {
                resource: match (resource, default) {
                    (None, Some(default)) => default.resource,
                    _ => self.number("pid")?,
                },
                number: match number {
                    Some(_) => self.number(key)?,
                    None => 0,
                },
                line,
            })),
        }
    }

    fn reference(&self) -> Result<Reference, String> {
        Ok(Reference {
            object: self.number("objectid")?,
            path: self.in_extension("path").map(str::to_owned),
            place: self.get("transform").map_or(Ok(DAffine3::IDENTITY), place)?,
        })
    }

    fn unit(&self) -> Result<f64, String> {
        let unit = self.get("unit").unwrap_or("millimeter");
        let known = UNITS.iter().find(|(name, _)| *name == unit).map(|(_, length)| *length);
        known.ok_or_else(|| {
            let names = UNITS.map(|(name, _)| name).join(", ");
            format!("unit is \"{}\"; allowed: {names}", printed::line(unit))
        })
    }
}

/// A transformation of rows: x, y and z of the images of the axes, then of the origin.
fn place(text: &str) -> Result<DAffine3, String> {
    let numbers: Option<Vec<f64>> =
        text.split_ascii_whitespace().map(|word| word.parse().ok()).collect();
    let numbers = numbers.filter(|it| it.len() == 12 && it.iter().all(|it| it.is_finite()));
    let Some(numbers) = numbers else {
        let text: String = printed::line(text).chars().take(100).collect();
        return Err(format!("transform is \"{text}\"; allowed: twelve numbers"));
    };
    let row = |at: usize| DVec3::from_slice(&numbers[3 * at..]);
    let linear = DMat3::from_cols(row(0), row(1), row(2));
    Ok(DAffine3::from_mat3_translation(linear, row(3)))
}
