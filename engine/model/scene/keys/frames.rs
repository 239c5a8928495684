//! Values of frames by angle or view and mask step, and errors of a scan.

use super::prelude::*;
use super::series::{RANGE, read_file};
use crate::scene::ScanErrors;
use crate::scene::scan_errors::DrawnErrors;
use beamlet_core::csv_table::{Numbered, Quantities, TableKind};
pub(crate) use std::path::Path;

/// Lists of lengths or numbers by view, or a file of them.
macro_rules! frames {
    ($dimension:expr) => {
        Either("", &Lists($dimension, limits::MASK_OFFSETS), &File("path of a CSV file"))
    };
}
pub(crate) use frames;

/// A list or range of lengths or angles, or a file of them.
macro_rules! series {
    ($dimension:ident, $most:expr) => {
        Either(
            "",
            &Either("", &Series($dimension, $most), &Inner(&RANGE)),
            &File("path of a CSV file"),
        )
    };
}
pub(crate) use series;

keys! { ERRORS, "scan.errors", [], [];
    mask_offsets => frames!(Some(Length)), Without("none"), r#"[["1 um", "-2 um"]]"#,
        "Displacements of the sample mask in addition to its offsets, a list for each view.";
    mask_offsets_z => frames!(Some(Length)), Without("none"), r#"[["1 um", "-2 um"]]"#,
        "Displacements of the sample mask along z, a list for each view; of a mask whose apertures end along z.";
    offset_sigma => Quantity(Length, NOT_NEGATIVE), Default(r#""0 m""#), r#""2 um""#,
        "Standard deviation of independent errors of the mask offsets, along x and, where they have z, along z.";
    offset_walk => Quantity(Length, NOT_NEGATIVE), Default(r#""0 m""#), r#""0.1 um""#,
        "Standard deviation of the steps of a random walk of the mask, from frame to frame.";
    intensities => frames!(None), Without("1"), "[[1.0, 0.97]]",
        "Light of each frame over the nominal one, a list for each view.";
    intensity_sigma => Number("a number", NOT_NEGATIVE), Default("0.0"), "0.01",
        "Standard deviation of independent relative errors of the light.";
    intensity_walk => Number("a number", NOT_NEGATIVE), Default("0.0"), "0.001",
        "Standard deviation of the relative steps of a random walk of the light, from frame to frame.";
    source_x => series!(Length, limits::ANGLES), Without("none"), r#"["0 um", "3 um"]"#,
        "Displacement of the focal spot along +x in each view.";
    source_z => series!(Length, limits::ANGLES), Without("none"), r#"["0 um", "-2 um"]"#,
        "Displacement of the focal spot along +z in each view.";
    source_sigma => Quantity(Length, NOT_NEGATIVE), Default(r#""0 m""#), r#""1 um""#,
        "Standard deviation of independent displacements of the focal spot, along x and along z.";
    source_walk => Quantity(Length, NOT_NEGATIVE), Default(r#""0 m""#), r#""0.5 um""#,
        "Standard deviation of the steps of a random walk of the focal spot, from view to view.";
    seed => Count(0, u64::MAX), Default("1"), "1", "Seed of the drawn errors.";
}

impl Value for ScanErrors {
    fn read(item: &ListItem<'_>, _: &'static Row) -> Result<Self> {
        let table = item.table(&ERRORS)?;
        let number = |key: &str| -> Result<f64> {
            let (Some(item), row) = (table.get(key), table.row(key)?) else { return Ok(0.0) };
            let value = f64::read(&item, row)?;
            match in_range(key, &row.kind, value) {
                Err(_) if !value.is_nan() => {
                    let found = format!("{value:?}");
                    item.refuse(item.error(found, row.kind.range_allowed()), 0.0)
                }
                _ => Ok(value),
            }
        };
        let drawn = DrawnErrors {
            offset_sigma: number("offset_sigma")?,
            offset_walk: number("offset_walk")?,
            intensity_sigma: number("intensity_sigma")?,
            intensity_walk: number("intensity_walk")?,
            source_sigma: number("source_sigma")?,
            source_walk: number("source_walk")?,
            seed: optional(&table, "seed")?.unwrap_or(1),
        };
        let errors = Self {
            mask_offsets: optional(&table, "mask_offsets")?.unwrap_or_default(),
            mask_offsets_z: optional(&table, "mask_offsets_z")?.unwrap_or_default(),
            intensities: optional(&table, "intensities")?.unwrap_or_default(),
            source: source(&table)?,
            drawn: Some(drawn),
        };
        for (list, keys) in [
            ("mask_offsets", ["offset_sigma", "offset_walk"]),
            ("mask_offsets_z", ["offset_sigma", "offset_walk"]),
            ("intensities", ["intensity_sigma", "intensity_walk"]),
            ("source_x", ["source_sigma", "source_walk"]),
            ("source_z", ["source_sigma", "source_walk"]),
        ] {
            let Some(given) = table.get(list) else { continue };
            if let Some(other) = keys.iter().find(|key| table.get(key).is_some()) {
                let found = format!("both {list} and {other}");
                return given.refuse(
                    given.error(found, "either a list, or standard deviations"),
                    Self::default(),
                );
            }
        }
        Ok(errors)
    }

    /// The applied values, drawn or not.
    fn write(&self, _: &Row, base: &Base<'_>) -> Result<Option<String>> {
        let mut keys = Vec::new();
        for (name, lists) in [
            ("mask_offsets", &self.mask_offsets),
            ("mask_offsets_z", &self.mask_offsets_z),
            ("intensities", &self.intensities),
        ] {
            let row = ERRORS.row(name).filter(|_| !lists.is_empty());
            if let Some(text) = row.map(|row| lists.write(row, base)).transpose()?.flatten() {
                keys.push((name, text));
            }
        }
        for (axis, name) in ["source_x", "source_z"].into_iter().enumerate() {
            let places: Vec<f64> = self.source.iter().map(|place| place[axis]).collect();
            let row = ERRORS.row(name).filter(|_| !places.is_empty());
            if let Some(text) = row.map(|row| places.write(row, base)).transpose()?.flatten() {
                keys.push((name, text));
            }
        }
        Ok((!keys.is_empty()).then(|| inline(&keys)))
    }
}

/// Displacements of the source along x and z; an axis that is not given has none.
fn source(table: &Table<'_>) -> Result<Vec<[f64; 2]>> {
    let along = |key: &str| optional::<Vec<f64>>(table, key).map(Option::unwrap_or_default);
    let [x, z] = [along("source_x")?, along("source_z")?];
    let count = x.len().max(z.len());
    if let (Some(given), true) =
        (table.get("source_z"), !x.is_empty() && z.len() != x.len() && !z.is_empty())
    {
        let found = format!("{} displacements", z.len());
        let allowed = format!("{}, the count of source_x", x.len());
        return given.refuse(given.error(found, allowed), Vec::new());
    }
    let at = |values: &[f64], view: usize| values.get(view).copied().unwrap_or(0.0);
    Ok((0..count).map(|view| [at(&x, view), at(&z, view)]).collect())
}

/// Quantity of lists by view.
fn dimension_of(kind: &Kind) -> Option<Dimension> {
    match kind {
        Lists(dimension, _) => *dimension,
        Either(_, lists, _) => dimension_of(lists),
        _ => None,
    }
}

impl Value for Vec<Vec<f64>> {
    fn read(item: &ListItem<'_>, row: &'static Row) -> Result<Self> {
        let dimension = dimension_of(&row.kind);
        let Some(path) = item.as_text() else {
            let value = |item: &ListItem<'_>| match dimension {
                Some(dimension) => item.quantity(dimension),
                None => item.number(),
            };
            let values = |item: &ListItem<'_>| -> Result<Vec<f64>> {
                item.items(&row.allowed())?.iter().map(value).collect()
            };
            return item.items(&row.allowed())?.iter().map(values).collect();
        };
        let (name, noun, columns) = match dimension {
            Some(_) => (
                "offset",
                "mask offsets of views",
                "columns offset_0_UNIT, offset_1_UNIT and so on, one for each mask step, with a unit of \
                 length, as offset_0_um; view, if any",
            ),
            None => (
                "intensity",
                "intensities of views",
                "columns intensity_0, intensity_1 and so on, one for each mask step; view, if any",
            ),
        };
        let kind = TableKind { key: row.name, noun, columns, most: limits::ANGLES as usize };
        let table = Quantities { kind, name, dimension, columns: Numbered::Yes };
        read_file(item, Path::new(path), |path| table.read(path), Self::new())
    }

    fn write(&self, row: &Row, _: &Base<'_>) -> Result<Option<String>> {
        let dimension = dimension_of(&row.kind);
        let of_list = |values: &Vec<f64>| match dimension {
            Some(dimension) => list(values, dimension),
            None => {
                let texts: Vec<String> = values.iter().map(|value| number(*value)).collect();
                format!("[{}]", texts.join(", "))
            }
        };
        let lists: Vec<String> = self.iter().map(of_list).collect();
        Ok(Some(format!("[{}]", lists.join(", "))))
    }
}
