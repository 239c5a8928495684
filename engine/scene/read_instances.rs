//! Instances of an object from the tree.

use std::path::PathBuf;

use super::table::{ListItem, Table};
use super::{Instances, Packing, PackingAmount, PackingKind, PackingRegion, limits};
use crate::Result;
use crate::units::Dimension::Length;

const ALLOWED: &str =
    "path of a CSV file, or a packing { packing = \"spheres\", region = { ... }, fill = 0.3 }";

pub(super) fn read_instances(item: &ListItem<'_>) -> Result<Instances> {
    if !item.is_table() {
        return Ok(Instances::File(PathBuf::from(item.text(ALLOWED)?)));
    }
    let table = item.table("object.instances")?;
    let kinds = [PackingKind::ParallelFibres, PackingKind::RandomFibres, PackingKind::Spheres];
    let words = kinds.map(|kind| (kind.word(), kind));
    let kind = "\"parallel-fibres\", \"random-fibres\" or \"spheres\"";
    let region = "a region, such as { cylinder = { radius = \"1 mm\", height = \"2 mm\" } }";
    let mut packing = Packing::new(
        table.require("packing", kind)?.choice(&words)?,
        read_region(&table.require("region", region)?)?,
        read_amount(&table)?,
    );
    if let Some(item) = table.get("diameter_spread") {
        packing.diameter_spread = item.number()?;
    }
    packing.gap = table.optional_quantity("gap", Length)?.unwrap_or(packing.gap);
    if let Some(item) = table.get("seed") {
        packing.seed = item.integer(0..=u64::MAX)?;
    }
    Ok(Instances::Packing(packing))
}

fn read_amount(table: &Table<'_>) -> Result<PackingAmount> {
    let either = "either fill or count";
    if let Some(item) = table.get("count") {
        table.forbid("fill", either)?;
        return Ok(PackingAmount::Count(item.integer(1..=limits::INSTANCES)?));
    }
    Ok(PackingAmount::Fill(table.require("fill", either)?.number()?))
}

fn read_region(item: &ListItem<'_>) -> Result<PackingRegion> {
    let allowed = "one of box, cylinder, sphere, as { sphere = { radius = \"1 mm\" } }";
    let table = item.table("object.instances.region")?;
    let mut kinds = ["box", "cylinder", "sphere"]
        .into_iter()
        .filter_map(|kind| table.get(kind).map(|item| (kind, item)));
    let Some((kind, item)) = kinds.next() else {
        return item.refuse(item.mismatch(allowed), PackingRegion::Sphere { radius: f64::NAN });
    };
    for (_, other) in kinds {
        other.refuse(other.error("a second region", allowed), ())?;
    }
    let region = item.table(&format!("object.instances.region.{kind}"))?;
    let radius = || region.quantity("radius", Length);
    Ok(match kind {
        "box" => {
            let allowed = "edge lengths along x, y and z, such as [\"1 mm\", \"1 mm\", \"1 mm\"]";
            let size = region.require("size", allowed)?;
            PackingRegion::Box { size: size.array(allowed, |item| item.quantity(Length))? }
        }
        "sphere" => PackingRegion::Sphere { radius: radius()? },
        _ => PackingRegion::Cylinder {
            radius: radius()?,
            height: region.quantity("height", Length)?,
        },
    })
}
