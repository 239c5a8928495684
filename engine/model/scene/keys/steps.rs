//! Steps of the sample mask: lengths along x, or pairs of lengths along x and z.

use super::prelude::*;
use super::record::Field;
use super::series::read_file;
use crate::scene::Scan;
use beamlet_core::csv_table::{Numbered, Quantities, TableKind};
use std::path::Path;

/// Columns of a file of steps.
const COLUMNS: &str = "the column offset_UNIT with a unit of length, as offset_um; or offset_x_UNIT and offset_z_UNIT";
/// A step along x and z.
const PAIR: &str = "a pair of lengths along x and z, such as [\"10 um\", \"0 um\"]";

/// The place of the mask steps in a scan.
#[derive(Debug)]
pub(super) struct MaskSteps;

impl Field<Scan> for MaskSteps {
    fn holds(&self, _: &Scan) -> bool {
        true
    }

    fn read(&self, scan: &mut Scan, item: &ListItem<'_>, row: &'static Row) -> Result<()> {
        let steps = match item.as_text() {
            // A length that should be in a list is no file.
            Some(path) if Length.parse(path).is_err() => Some(read_rows(item, Path::new(path))?),
            _ => read_pairs(item, row)?,
        };
        let Some(steps) = steps else {
            scan.mask_offsets = Vec::read(item, row)?;
            return Ok(());
        };
        let along = |axis: usize| steps.iter().filter_map(|step| step.get(axis)).copied().collect();
        (scan.mask_offsets, scan.mask_offsets_z) = (along(0), along(1));
        // A mask that rests along z has steps along x alone.
        if scan.mask_offsets_z.iter().all(|offset| *offset == 0.0) {
            scan.mask_offsets_z.clear();
        }
        Ok(())
    }

    fn write(&self, scan: &Scan, row: &Row, base: &Base<'_>) -> Result<Option<String>> {
        if scan.mask_offsets_z.is_empty() {
            return scan.mask_offsets.write(row, base);
        }
        let pairs = scan.mask_offsets.iter().zip(&scan.mask_offsets_z);
        let pairs: Vec<String> = pairs.map(|(x, z)| list(&[*x, *z], Length)).collect();
        Ok(Some(format!("[{}]", pairs.join(", "))))
    }

    fn check(&self, scan: &Scan, key: &str, row: &Row, faults: &mut Faults) {
        scan.mask_offsets.check(key, row, faults);
        if !scan.mask_offsets_z.is_empty() {
            scan.mask_offsets_z.check(key, row, faults);
        }
    }
}

/// Pairs of a list that has one at least, or nothing.
fn read_pairs(item: &ListItem<'_>, row: &'static Row) -> Result<Option<Vec<Vec<f64>>>> {
    if !item.is_list() {
        return Ok(None);
    }
    let items = item.items(&row.allowed())?;
    let Some(pair) = items.iter().position(ListItem::is_list) else { return Ok(None) };
    if items.len() > limits::MASK_OFFSETS as usize {
        return item.refuse(item.mismatch(row.allowed()), Some(vec![vec![0.0; 2]]));
    }
    let of = |item: &ListItem<'_>| match item.is_list() {
        true => Ok(item.array::<f64, 2>(PAIR, |item| item.quantity(Length))?.to_vec()),
        false => {
            let allowed = format!("{PAIR}, as entry {pair} is");
            item.refuse(item.mismatch(allowed), vec![f64::NAN; 2])
        }
    };
    items.iter().map(of).collect::<Result<_>>().map(Some)
}

/// Steps of a file, one row each.
fn read_rows(item: &ListItem<'_>, path: &Path) -> Result<Vec<Vec<f64>>> {
    let most = limits::MASK_OFFSETS as usize;
    let kind = TableKind { key: "offset", noun: "offsets", columns: COLUMNS, most };
    let columns = Numbered::OneOr(&["offset_x", "offset_z"]);
    let table = Quantities { kind, name: "offset", dimension: Some(Length), columns };
    read_file(item, path, |path| table.read(path), vec![vec![0.0]])
}
