//! What is around the objects, from the tree.

use super::read_sample::{MATERIAL, read_hash, read_mesh, read_placement};
use super::read_shape::{NO_SHAPE, read_kind};
use super::table::{ListItem, Table};
use super::{Scene, ShapeOrMesh};
use crate::Result;

/// Takes the table [surroundings] into the scene.
pub(super) fn read_surroundings(table: &Table<'_>, scene: &mut Scene) -> Result<()> {
    let text = |key: &str| table.get(key).map(|item| item.text(MATERIAL)).transpose();
    if let Some(path) = text("path_material")? {
        path.clone_into(&mut scene.path_material);
        path.clone_into(&mut scene.surroundings);
    }
    let Some(item) = table.get("region") else {
        if let Some(material) = text("material")? {
            material.clone_into(&mut scene.surroundings);
        }
        return Ok(());
    };
    let material = table.require("material", "name of the material that fills the region")?;
    let region = item.table("surroundings.region")?;
    scene.fill_region(read_region(&item, &region)?, material.text(MATERIAL)?);
    let object = &mut scene.objects[0];
    object.placement = read_placement(&region)?;
    object.sha256 = region.get("sha256").map(|item| read_hash(&item)).transpose()?;
    Ok(())
}

fn read_region(item: &ListItem<'_>, table: &Table<'_>) -> Result<ShapeOrMesh> {
    let allowed = "one of box, cylinder, mesh, as { box = { size = [...] } }";
    let mut kinds = ["box", "cylinder", "mesh"]
        .into_iter()
        .filter_map(|kind| table.get(kind).map(|item| (kind, item)));
    let Some((kind, found)) = kinds.next() else {
        return item.refuse(item.mismatch(allowed), ShapeOrMesh::Shape(NO_SHAPE));
    };
    for (_, other) in kinds {
        other.refuse(other.error("a second region", allowed), ())?;
    }
    if kind == "mesh" {
        return read_mesh(table);
    }
    for key in ["unit", "group", "sha256"] {
        table.forbid(key, "it is of a mesh: a shape has no file")?;
    }
    Ok(ShapeOrMesh::Shape(read_kind(kind, &found, "surroundings.region")?))
}
