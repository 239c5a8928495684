//! Lists of rectangular apertures, and how masks of them and others are turned.

use super::prelude::*;
use super::shape::read_arrays;
use crate::scene::{MaskSpec, Rectangle};
use beamlet_core::csv_table::{Numbered, Quantities, TableKind};
use std::path::Path;

/// Columns of a file of rectangles.
const COLUMNS: &str =
    "the columns x_UNIT, z_UNIT, width_UNIT and height_UNIT with a unit of length, as x_um";

/// A list, or a file.
impl Value for Vec<Rectangle> {
    fn read(item: &ListItem<'_>, row: &'static Row) -> Result<Self> {
        let of =
            |[x, z, width, height]: [f64; 4]| Rectangle { centre: [x, z], size: [width, height] };
        if let Some(path) = item.as_text() {
            let most = limits::SLITS as usize;
            let kind = TableKind { key: "rectangle", noun: "rectangles", columns: COLUMNS, most };
            let columns = Numbered::Named(&["x", "z", "width", "height"]);
            let table = Quantities { kind, name: "rectangle", dimension: Some(Length), columns };
            return Ok(read_arrays(item, Path::new(path), table)?.into_iter().map(of).collect());
        }
        let allowed = "x, z, width and height, such as [\"5 um\", \"0 um\", \"10 um\", \"20 um\"]";
        let one = |item: &ListItem<'_>| item.array(allowed, |item| item.quantity(Length));
        let items = item.items(&row.allowed())?;
        if items.is_empty() || items.len() > limits::SLITS as usize {
            return item.refuse(item.mismatch(row.allowed()), Self::new());
        }
        items.iter().map(|item| one(item).map(of)).collect()
    }

    fn write(&self, _: &Row, _: &Base<'_>) -> Result<Option<String>> {
        let of = |it: &Rectangle| list(&[it.centre, it.size].concat(), Length);
        Ok(Some(format!("[{}]", self.iter().map(of).collect::<Vec<_>>().join(", "))))
    }
}

/// Turns a mask by its key `rotation`.
pub(super) fn turn(mask: MaskSpec, table: &Table<'_>) -> Result<MaskSpec> {
    let Some(angle) = optional::<f64>(table, "rotation")? else { return Ok(mask) };
    // Masks that are wrong keep the lengths that errors name.
    let is_wrong = |[length, period]: [f64; 2]| !(length > 0.0 && length <= period);
    let along_z = mask.heights().unwrap_or([1.0; 2]);
    if [[mask.aperture, mask.period], along_z].into_iter().any(is_wrong) || !angle.is_finite() {
        return Ok(mask);
    }
    match mask.rotated(angle) {
        Ok(turned) => Ok(turned),
        Err(error) => {
            let (Some(item), Error::Scene { found, allowed, .. }) = (table.get("rotation"), error)
            else {
                return Ok(mask);
            };
            item.refuse(item.error(found, allowed), mask)
        }
    }
}
