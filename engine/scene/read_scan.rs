//! Mask offsets and angles from the tree.

use super::table::{ListItem, Table};
use super::{Scan, limits};
use crate::Result;
use crate::units::Dimension::{self, Angle, Length};

pub(super) fn read_scan(top: &Table<'_>) -> Result<Scan> {
    let mut scan = Scan::default();
    let Some(item) = top.get("scan") else { return Ok(scan) };
    let table = item.table("scan")?;
    if let Some(item) = table.get("mask_offsets") {
        scan.mask_offsets =
            read_series(&item, Length, limits::MASK_OFFSETS, RangeKind::WithBothEnds)?;
    }
    if let Some(item) = table.get("angles") {
        scan.angles = read_series(&item, Angle, limits::ANGLES, RangeKind::WithoutEnd)?;
    }
    Ok(scan)
}

/// A list, or a range by its ends and the count or the step.
fn read_series(
    item: &ListItem<'_>,
    dimension: Dimension,
    most: u32,
    kind: RangeKind,
) -> Result<Vec<f64>> {
    if item.is_table() {
        let table = item.table("scan.range")?;
        let from = end(&table, "from", "start", dimension)?;
        let to = end(&table, "to", "stop", dimension)?;
        return Ok(kind.values(from, to, read_count(&table, [from, to], dimension, most, kind)?));
    }
    let allowed = format!(
        "a list of 1 to {most} quantities, or {{ from, to, count }} or {{ from, to, step }}"
    );
    let items = item.items(&allowed)?;
    if items.is_empty() || items.len() > most as usize {
        return item.refuse(item.mismatch(allowed), vec![0.0]);
    }
    items.iter().map(|item| item.quantity(dimension)).collect()
}

/// An end of a range, by either of its names.
fn end(table: &Table<'_>, name: &str, other: &str, dimension: Dimension) -> Result<f64> {
    match (table.get(name), table.get(other)) {
        (Some(item), Some(both)) => {
            both.refuse(both.error("the key", format!("either {name} or {other}")), ())?;
            both.quantity(dimension)?;
            item.quantity(dimension)
        }
        (None, Some(item)) => item.quantity(dimension),
        _ => table.quantity(name, dimension),
    }
}

/// The count of a range, given as it is or by the step, which has to fit between the ends.
fn read_count(
    table: &Table<'_>,
    [from, to]: [f64; 2],
    dimension: Dimension,
    most: u32,
    kind: RangeKind,
) -> Result<u32> {
    let Some(item) = table.get("step") else {
        let counts = format!("a whole number from 1 to {most}; or step instead");
        return table.require("count", counts)?.integer(1..=most);
    };
    table.forbid("count", "either count or step")?;
    let step = item.quantity(dimension)?;
    if [from, to, step].iter().any(|value| value.is_nan()) {
        return Ok(1);
    }
    let steps = (to - from) / step;
    let whole = steps.round();
    let count = whole + if kind == RangeKind::WithBothEnds { 1.0 } else { 0.0 };
    // Written decimals miss the whole number by their rounding only.
    if steps.is_finite() && (steps - whole).abs() < 1e-6 && count >= 1.0 && count <= f64::from(most)
    {
        return Ok(crate::numbers::whole(count));
    }
    let span = dimension.format(to - from);
    let found = dimension.format(step);
    let allowed =
        format!("a step of which a whole number, up to {most} values in all, makes {span}");
    item.refuse(item.error(found, allowed), 1)
}

/// Whether a range has its second end.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum RangeKind {
    WithBothEnds,
    WithoutEnd,
}

impl RangeKind {
    fn values(self, from: f64, to: f64, count: u32) -> Vec<f64> {
        match self {
            Self::WithBothEnds => offset_range(from, to, count),
            Self::WithoutEnd => angle_range(from, to, count),
        }
    }
}

/// `count` offsets with both ends included; a single one lies in the middle.
pub(super) fn offset_range(from: f64, to: f64, count: u32) -> Vec<f64> {
    let last = f64::from(count - 1);
    let offset = |index| match index {
        _ if count == 1 => from + (to - from) / 2.0,
        _ if index == count - 1 => to,
        _ => from + (to - from) * (f64::from(index) / last),
    };
    (0..count).map(offset).collect()
}

/// `count` angles with the end excluded.
pub(super) fn angle_range(from: f64, to: f64, count: u32) -> Vec<f64> {
    (0..count).map(|index| from + (to - from) * (f64::from(index) / f64::from(count))).collect()
}
