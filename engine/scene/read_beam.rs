//! The beam from the tree: `energy`, or `spectrum` as a file name or a table.

use std::path::PathBuf;

use super::beam::ANODE_ANGLE;
use super::table::{ListItem, Table};
use super::{Anode, Beam, Filter, SpectrumOrigin, SpectrumSpec, limits};
use crate::Result;
use crate::units::Dimension::{Angle, Energy, Length, Voltage};

const FILE: &str = "path of a file with the columns energy_keV and weight";
const FORMS: &str = "path of a file, { file = ... } or { anode = ..., kvp = ... }";

pub(super) fn read_beam(source: &Table<'_>) -> Result<Beam> {
    match (source.get("energy"), source.get("spectrum")) {
        (Some(energy), None) => Ok(Beam::Energy(energy.quantity(Energy)?)),
        (None, Some(spectrum)) => Ok(Beam::Spectrum(read_spectrum(&spectrum)?)),
        (Some(energy), Some(both)) => {
            both.refuse(both.error("both energy and spectrum", "one of them"), ())?;
            energy.quantity(Energy)?;
            Ok(Beam::Spectrum(read_spectrum(&both)?))
        }
        (None, None) => {
            let allowed = format!("{}; or spectrum instead", Energy.allowed());
            Ok(Beam::Energy(source.require("energy", allowed)?.quantity(Energy)?))
        }
    }
}

fn read_spectrum(item: &ListItem<'_>) -> Result<SpectrumSpec> {
    if !item.is_table() {
        let path = PathBuf::from(item.text(FORMS)?);
        let origin = SpectrumOrigin::File { path };
        return Ok(SpectrumSpec { origin, filters: Vec::new(), nodes: None });
    }
    let table = item.table("source.spectrum")?;
    let nodes = |item: ListItem<'_>| item.integer(1..=limits::NODES);
    Ok(SpectrumSpec {
        origin: read_origin(item, &table)?,
        filters: read_filters(&table, "filters")?,
        nodes: table.get("nodes").map(nodes).transpose()?,
    })
}

fn read_origin(item: &ListItem<'_>, table: &Table<'_>) -> Result<SpectrumOrigin> {
    if let Some(file) = table.get("file") {
        for key in ["anode", "kvp", "anode_angle", "inherent_filters"] {
            table.forbid(key, "either file, or anode and kvp")?;
        }
        return Ok(SpectrumOrigin::File { path: PathBuf::from(file.text(FILE)?) });
    }
    if table.get("anode").is_none() && table.get("kvp").is_none() {
        let file = SpectrumOrigin::File { path: PathBuf::new() };
        return item.refuse(item.error("neither file nor anode", FORMS), file);
    }
    let anode = table.require("anode", "\"tungsten\" or \"molybdenum\"")?;
    Ok(SpectrumOrigin::Tube {
        anode: anode.choice(&Anode::ALL)?,
        kvp: table.quantity("kvp", Voltage)?,
        anode_angle: table.optional_quantity("anode_angle", Angle)?.unwrap_or(ANODE_ANGLE),
        inherent_filters: read_filters(table, "inherent_filters")?,
    })
}

fn read_filters(table: &Table<'_>, key: &str) -> Result<Vec<Filter>> {
    let Some(item) = table.get(key) else { return Ok(Vec::new()) };
    let filters = "a list of { material = \"Al\", thickness = \"1 mm\" }";
    item.items(filters)?.iter().map(read_filter).collect()
}

fn read_filter(item: &ListItem<'_>) -> Result<Filter> {
    let table = item.table("source.spectrum.filter")?;
    let (material, thickness) = read_layer(&table)?;
    Ok(Filter { material, thickness })
}

/// The material of a layer and its thickness, m.
pub(super) fn read_layer(table: &Table<'_>) -> Result<(String, f64)> {
    let material = "name of a material";
    let name = table.require("material", material)?.text(material)?.to_owned();
    Ok((name, table.quantity("thickness", Length)?))
}
