//! Keys of the surroundings: a material without end, or one that fills a region.

use super::object::REGION;
use super::record::Record;
use super::shape::{NO_SHAPE, SHAPES};
use super::value::{Base, optional};
use crate::scene::table::Table;
use crate::scene::text::{Text, quoted};
use crate::scene::{Object, Scene, ShapeOrMesh};
use beamlet_core::Result;

/// Words of the shapes that a region may be.
const SHAPES_OF_REGION: [&str; 2] = ["box", "cylinder"];

/// Takes the table [surroundings] into the scene.
pub(crate) fn read_surroundings(table: &Table<'_>, scene: &mut Scene) -> Result<()> {
    if let Some(path) = optional::<String>(table, "path_material")? {
        scene.path_material.clone_from(&path);
        scene.surroundings = path;
    }
    let Some(item) = table.get("region") else {
        if let Some(material) = optional(table, "material")? {
            scene.surroundings = material;
        }
        return Ok(());
    };
    let fills = "name of the material that fills the region";
    let material = table.require_as("material", fills)?.text(fills)?.to_owned();
    let region = item.table(&REGION.spec)?;
    let mut object = Object::begin(&|_| false);
    if let Some((word, shape)) =
        SHAPES_OF_REGION.iter().find_map(|word| Some((word, region.get(word)?)))
    {
        object.geometry = ShapeOrMesh::Shape(SHAPES.read_kind(word, &shape)?);
    } else if region.form("box") != "mesh" {
        let allowed = "one of box, cylinder, mesh, as { box = { size = [...] } }";
        object.geometry = ShapeOrMesh::Shape(item.refuse(item.mismatch(allowed), NO_SHAPE)?);
    }
    REGION.read(&mut object, &region)?;
    scene.fill_region(object.geometry, material);
    let Object { placement, sha256, .. } = object;
    scene.objects[0] = Object { placement, sha256, ..scene.objects[0].clone() };
    Ok(())
}

pub(crate) fn write_surroundings(
    out: &mut Text,
    base: &Base<'_>,
    region: Option<&Object>,
) -> Result<()> {
    let scene = base.scene;
    out.table("[surroundings]");
    out.raw("material", quoted(region.map_or(&scene.surroundings, |region| &region.material)));
    if region.is_some() || scene.path_material != "vacuum" {
        out.raw("path_material", quoted(&scene.path_material));
    }
    let Some(region) = region else { return Ok(()) };
    out.table("[surroundings.region]");
    if let ShapeOrMesh::Shape(shape) = &region.geometry {
        let (word, keys) = SHAPES.write(shape, base)?;
        out.raw(word, keys);
    }
    out.keys(region, &REGION, base)
}
