//! Lists of lengths or angles, and ranges of them.

use super::prelude::*;
use beamlet_core::csv_table::{Numbered, Quantities, TableKind};
use beamlet_core::random::GOLDEN;
use std::path::Path;

keys! { RANGE, "scan.range",
    [Forms(&[&["from"], &["start"]], 0), Forms(&[&["to"], &["stop"]], 0), Forms(&[&["step"], &["count"]], 1)],
    ["end" => "to", "steps" => "count", "num" => "count", "n" => "count", "number" => "count"];
    from => Step, Required, r#""-25 um""#, "First value.";
    to => Step, Required, r#""25 um""#, "Last length; end of the angles, which is excluded.";
    count => Count(1, limits::ANGLES as u64), Required, "11", "Number of values, within the limit of the list.";
    step => Step, Required, r#""5 um""#, "Distance between values; the range is a whole multiple of it.";
    start => Step, Required, r#""-25 um""#, "Another name of `from`.";
    stop => Step, Required, r#""25 um""#, "Another name of `to`.";
    order => Word(ORDERS), Default(r#""even""#), r#""golden""#,
        "Order of angles: ascending, or each advances by the golden section of the range.";
}

/// Order of the angles of a range.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Order {
    Even,
    Golden,
}

words!(Order, ORDERS: "even" => Even, "golden" => Golden);

/// Quantity and greatest length of a series.
fn series_of(kind: &Kind) -> (Dimension, u32) {
    match kind {
        Either(_, Series(dimension, most), _) => (*dimension, *most),
        Either(_, list, _) => series_of(list),
        _ => (Length, limits::MASK_OFFSETS),
    }
}

/// Reads the values of a file with one column of them.
fn read_column(
    item: &ListItem<'_>,
    path: &Path,
    dimension: Dimension,
    most: u32,
) -> Result<Vec<f64>> {
    let (key, noun, columns) = match dimension {
        Angle => ("angle", "angles", "the column angle_deg or angle_rad; view, if any"),
        _ => ("offset", "offsets", "the column offset_UNIT with a unit of length, as offset_um"),
    };
    let kind = TableKind { key, noun, columns, most: most as usize };
    let table = Quantities { kind, name: key, dimension: Some(dimension), columns: Numbered::No };
    let rows = read_file(item, path, |path| table.read(path), vec![vec![0.0]])?;
    Ok(rows.into_iter().flatten().collect())
}

/// Reads a file that an item names, and notes it; `none`: a value in its place where it cannot be read.
pub(super) fn read_file<T>(
    item: &ListItem<'_>,
    path: &Path,
    read: impl FnOnce(&Path) -> Result<T>,
    none: T,
) -> Result<T> {
    match read(&item.directory().join(path)) {
        Ok(value) => {
            item.note_table(path);
            Ok(value)
        }
        Err(error) => item.refuse(placed(item, error), none),
    }
}

/// The error of a file at the key that names it; errors with a line of their own keep that.
fn placed(item: &ListItem<'_>, error: Error) -> Error {
    match error {
        Error::File { .. } => item.error(error.to_string(), "a file that can be read, or a list"),
        other => other,
    }
}

impl Value for Vec<f64> {
    fn read(item: &ListItem<'_>, row: &'static Row) -> Result<Self> {
        let (dimension, most) = series_of(&row.kind);
        if item.is_table() {
            let table = item.table(&RANGE)?;
            let end = |name: &str, other: &str| match table.get(other) {
                Some(item) => item.quantity(dimension),
                None => table.require_as(name, dimension.allowed())?.quantity(dimension),
            };
            let (from, to) = (end("from", "start")?, end("to", "stop")?);
            let count = read_count(&table, [from, to], dimension, most)?;
            return match optional::<Order>(&table, "order")? {
                Some(Order::Golden) if dimension == Angle => Ok(golden_range(from, to, count)),
                Some(Order::Golden) => {
                    let even = spread(dimension)(from, to, count);
                    let item = table.require("order")?;
                    item.refuse(item.error("golden", "even: only angles have another order"), even)
                }
                _ => Ok(spread(dimension)(from, to, count)),
            };
        }
        if let Some(path) = item.as_text()
            && matches!(row.kind, Either(_, _, File(_)))
            // A value that should be in a list is no file.
            && dimension.parse(path).is_err()
        {
            return read_column(item, Path::new(path), dimension, most);
        }
        let allowed = row.allowed();
        let items = item.items(&allowed)?;
        if items.is_empty() || items.len() > most as usize {
            return item.refuse(item.mismatch(allowed), vec![0.0]);
        }
        items.iter().map(|item| item.quantity(dimension)).collect()
    }

    /// A range where one reads back to the same bits, or else the list.
    fn write(&self, row: &Row, _: &Base<'_>) -> Result<Option<String>> {
        let (dimension, _) = series_of(&row.kind);
        let count = u32::try_from(self.len()).unwrap_or(0);
        let from = self.first().copied().unwrap_or(0.0);
        let same = |end: &&f64| {
            let bits = |values: &[f64]| values.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
            count > 2 && bits(&spread(dimension)(from, **end, count)) == bits(self)
        };
        Ok(Some(match ends(self, dimension).iter().find(same) {
            Some(end) => {
                let (from, to) = (quantity(from, dimension), quantity(*end, dimension));
                format!("{{ from = {from}, to = {to}, count = {count} }}")
            }
            None => list(self, dimension),
        }))
    }

    fn check(&self, key: &str, row: &Row, faults: &mut Faults) {
        let (dimension, most) = series_of(&row.kind);
        if self.is_empty() && matches!(row.need, Without(_)) {
            return;
        }
        if self.is_empty() || self.len() > most as usize {
            let found = format!("{} of them", self.len());
            faults.add(Error::scene(key, found, format!("1 to {most} of them")));
        } else if let Some(value) = self.iter().find(|value| !value.is_finite()) {
            faults.add(Error::scene(key, dimension.rounded(*value), "a finite value"));
        } else if let Some(value) = self.iter().find(|value| !limits::is_length(**value))
            && dimension == Length
        {
            faults.add(Error::scene(key, dimension.rounded(*value), too_long()));
        }
    }
}

/// The count of a range, given as it is or by the step, which has to fit between the ends.
fn read_count(
    table: &Table<'_>,
    [from, to]: [f64; 2],
    dimension: Dimension,
    most: u32,
) -> Result<u32> {
    let Some(item) = table.get("step") else {
        let counts = format!("a whole number from 1 to {most}; or step instead");
        let count = table.require_as("count", counts)?.integer(1..=u64::from(most))?;
        return Ok(u32::try_from(count).unwrap_or(most));
    };
    let step = item.quantity(dimension)?;
    if [from, to, step].iter().any(|value| value.is_nan()) {
        return Ok(1);
    }
    let steps = (to - from) / step;
    let whole = steps.round();
    // Offsets have both ends.
    let count = whole + if dimension == Length { 1.0 } else { 0.0 };
    // Written decimals miss the whole number by their rounding only.
    if steps.is_finite() && (steps - whole).abs() < 1e-6 && count >= 1.0 && count <= f64::from(most)
    {
        return Ok(beamlet_core::numbers::whole(count));
    }
    let span = dimension.rounded(to - from);
    let found = dimension.rounded(step);
    let allowed = format!(
        "a step that divides {span} into a whole number of parts, at most {most} values in all"
    );
    item.refuse(item.error(found, allowed), 1)
}

/// Values of a range by its ends and their count.
fn spread(dimension: Dimension) -> fn(f64, f64, u32) -> Vec<f64> {
    if dimension == Length { offset_range } else { angle_range }
}

/// `count` offsets with both ends included; a single one lies in the middle.
fn offset_range(from: f64, to: f64, count: u32) -> Vec<f64> {
    let last = f64::from(count - 1);
    let offset = |index| match index {
        _ if count == 1 => from + (to - from) / 2.0,
        _ if index == count - 1 => to,
        _ => from + (to - from) * (f64::from(index) / last),
    };
    (0..count).map(offset).collect()
}

/// `count` angles with the end excluded.
fn angle_range(from: f64, to: f64, count: u32) -> Vec<f64> {
    (0..count).map(|index| from + (to - from) * (f64::from(index) / f64::from(count))).collect()
}

/// `count` angles, each behind the one before by the golden section of the range, less the range where
/// that is beyond its end.
fn golden_range(from: f64, to: f64, count: u32) -> Vec<f64> {
    (0..count).map(|index| from + (to - from) * (f64::from(index) * GOLDEN).fract()).collect()
}

/// Candidates for the end of a range: of offsets the last; of angles, whose end is excluded, its round
/// degrees and as computed.
fn ends(values: &[f64], dimension: Dimension) -> Vec<f64> {
    if dimension == Length {
        return vec![values.last().copied().unwrap_or(0.0)];
    }
    let [first, second, ..] = values else { return Vec::new() };
    let end = first + (second - first) * values.len() as f64;
    let degrees = (end.to_degrees() * 1e6).round() / 1e6;
    vec![degrees.to_radians(), end]
}
