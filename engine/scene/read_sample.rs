//! Materials and objects from the tree.

use std::collections::BTreeMap;
use std::path::PathBuf;

use super::read_instances::read_instances;
use super::read_shape::{NO_SHAPE, read_shape};
use super::table::{ListItem, Table};
use super::{MaterialSpec, Mesh, MeshFormat, Normals, Object, Placement, ShapeOrMesh};
use crate::Result;
use crate::units::Dimension::{Angle, Attenuation, Density, Length};

pub(super) const MATERIAL: &str = "name of a material";
const NORMALS: [(&str, Normals); 2] = [("facets", Normals::Facets), ("smooth", Normals::Smooth)];
const FILE: &str = "path of a file";

pub(super) fn read_materials(top: &Table<'_>) -> Result<BTreeMap<String, MaterialSpec>> {
    let Some(item) = top.get("materials") else { return Ok(BTreeMap::new()) };
    let named = item.named()?;
    let entry = |(name, item): &(&str, ListItem<'_>)| {
        let nothing = MaterialSpec::Constants { mu: f64::NAN, delta: f64::NAN };
        Ok(((*name).to_owned(), item.or_instead(read_material(item), nothing)?))
    };
    named.iter().map(entry).collect()
}

fn read_material(item: &ListItem<'_>) -> Result<MaterialSpec> {
    let table = item.table("materials.NAME")?;
    let one = "one of: formula and density; mixture and density; mu and delta; table";
    // Two ways at once make no material: what else is missing of either is no error of its own.
    let only = |wanted: &[&str]| {
        let others = ["formula", "mixture", "density", "mu", "delta", "table"];
        let mut others = others.iter().filter(|key| !wanted.contains(key));
        let other = others.find_map(|key| table.get(key));
        other.map_or(Ok(()), |item| Err(item.error("the key", one)))
    };
    if let Some(item) = table.get("table") {
        only(&["table"])?;
        return Ok(MaterialSpec::Table { path: PathBuf::from(item.text(FILE)?) });
    }
    if let Some(item) = table.get("formula") {
        only(&["formula", "density"])?;
        let formula = item.text("a chemical formula, such as \"H2O\"")?.to_owned();
        return Ok(MaterialSpec::Formula { formula, density: table.quantity("density", Density)? });
    }
    if let Some(item) = table.get("mixture") {
        only(&["mixture", "density"])?;
        let part = |(name, item): &(&str, ListItem<'_>)| Ok(((*name).to_owned(), item.number()?));
        let parts = item.named()?.iter().map(part).collect::<Result<_>>()?;
        return Ok(MaterialSpec::Mixture { parts, density: table.quantity("density", Density)? });
    }
    if table.get("mu").is_some() || table.get("delta").is_some() {
        only(&["mu", "delta"])?;
        let delta = table.require("delta", "a number without a unit")?.number()?;
        return Ok(MaterialSpec::Constants { mu: table.quantity("mu", Attenuation)?, delta });
    }
    Err(table.missing("formula", one))
}

pub(super) fn read_objects(top: &Table<'_>) -> Result<Vec<Object>> {
    let Some(item) = top.get("object") else { return Ok(Vec::new()) };
    let object = |item: &ListItem<'_>| {
        let nothing = Object::new("", NO_SHAPE, "");
        item.or_instead(read_object(item), nothing)
    };
    item.items("tables [[object]]")?.iter().map(object).collect()
}

fn read_object(item: &ListItem<'_>) -> Result<Object> {
    let table = item.table("object")?;
    let name = "a name of its own";
    Ok(Object {
        name: table.require("name", name)?.text(name)?.to_owned(),
        geometry: read_geometry(&table)?,
        material: table.require("material", MATERIAL)?.text(MATERIAL)?.to_owned(),
        placement: read_placement(&table)?,
        sha256: table.get("sha256").map(|item| read_hash(&item)).transpose()?,
        allow_defects: table.get("allow_defects").map_or(Ok(false), |item| item.boolean())?,
        instances: table.get("instances").map(|item| read_instances(&item)).transpose()?,
        normals: table.get("normals").map_or(Ok(Normals::Facets), |item| item.choice(&NORMALS))?,
        roughness: table.get("roughness").map_or(Ok(0.0), |item| item.number())?,
    })
}

fn read_geometry(table: &Table<'_>) -> Result<ShapeOrMesh> {
    let either = "either mesh or shape";
    if let Some(item) = table.get("shape") {
        table.forbid("mesh", either)?;
        table.forbid("unit", "no unit: the lengths of a shape carry theirs")?;
        table.forbid("group", "no group: a shape has no file")?;
        table.forbid("sha256", "no hash: a shape has no file")?;
        return Ok(ShapeOrMesh::Shape(read_shape(&item)?));
    }
    read_mesh(table)
}

/// The mesh of a table with the keys mesh, unit and group.
pub(super) fn read_mesh(table: &Table<'_>) -> Result<ShapeOrMesh> {
    let either = "either mesh or shape";
    let mesh = table.require("mesh", either)?;
    let path = PathBuf::from(mesh.text(FILE)?);
    let format = MeshFormat::of(&path);
    let group = match table.get("group") {
        Some(item) if format.is_some_and(|it| !it.has_groups()) => {
            let allowed = "no group: STL and PLY files name no parts, OBJ and 3MF do";
            item.refuse(item.mismatch(allowed), None)?
        }
        Some(item) => {
            Some(item.text("name of an object, group or material of the file")?.to_owned())
        }
        None => None,
    };
    if format.is_some_and(MeshFormat::has_unit) {
        table.forbid(
            "unit",
            "no unit: a 3MF file tells its own; `scale` is for one that is wrong",
        )?;
        return Ok(ShapeOrMesh::Mesh(Mesh::File { path, unit: None, group }));
    }
    let units = "the length of 1.0 in the mesh file, such as \"mm\" or \"25.4 mm\"";
    let item = table.require("unit", units)?;
    let unit = match Length.parse_unit(item.text(units)?) {
        Ok(unit) => unit,
        Err(error) => item.refuse(item.quantity_error(error), f64::NAN)?,
    };
    Ok(ShapeOrMesh::Mesh(Mesh::File { path, unit: Some(unit), group }))
}

pub(super) fn read_hash(item: &ListItem<'_>) -> Result<String> {
    let allowed = "the SHA-256 of the file, 64 hexadecimal digits";
    let text = item.text(allowed)?;
    if text.len() != 64 || !text.bytes().all(|byte| byte.is_ascii_hexdigit()) {
        return item.refuse(item.mismatch(allowed), String::new());
    }
    Ok(text.to_ascii_lowercase())
}

pub(super) fn read_placement(table: &Table<'_>) -> Result<Placement> {
    let mut placement = Placement::default();
    if let Some(item) = table.get("center") {
        placement.center = item.boolean()?;
    }
    if let Some(item) = table.get("scale") {
        placement.scale = item.number()?;
    }
    if let Some(item) = table.get("rotate") {
        let turns = item.items("a list of { axis = [x, y, z], angle = \"30 deg\" }")?;
        placement.rotate = turns.iter().map(read_turn).collect::<Result<_>>()?;
    }
    if let Some(item) = table.get("position") {
        let allowed = "three lengths, such as [\"0 mm\", \"0 mm\", \"1 mm\"]";
        placement.position = item.array(allowed, |item| item.quantity(Length))?;
    }
    Ok(placement)
}

fn read_turn(item: &ListItem<'_>) -> Result<([f64; 3], f64)> {
    let table = item.table("object.rotate")?;
    let allowed = "a direction, such as [0, 0, 1]";
    let axis = table.require("axis", allowed)?.array(allowed, ListItem::number)?;
    Ok((axis, table.quantity("angle", Angle)?))
}
