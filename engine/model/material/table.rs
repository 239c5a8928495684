//! Material tables: CSV with the columns `energy_keV,mu_per_cm,delta`. An energy that comes twice is an
//! absorption edge: the first row holds below it, the second from it on.

use std::path::{Path, PathBuf};

use super::{Constants, within};
use beamlet_core::csv_table::cells;
use beamlet_core::error::{Error, Place, Result};
use beamlet_core::interpolation::log_log;
use beamlet_core::{input_file, units};

const COLUMNS: [&str; 3] = ["energy_keV", "mu_per_cm", "delta"];

/// Rows of (energy keV, mu 1/cm, delta), energies ascending, each at most twice; everything above 0.
pub(super) struct ConstantsTable {
    path: PathBuf,
    rows: Vec<[f64; 3]>,
}

impl ConstantsTable {
    pub(super) fn read(path: &Path) -> Result<Self> {
        let text = input_file::text(path)
            .map_err(|e| Error::file(path, "cannot read the material table", Some(e)))?;
        let mut rows: Vec<[f64; 3]> = Vec::new();
        let mut order = None;
        for (index, line) in text.lines().enumerate() {
            let at = TableLine { path, number: index + 1, text: line };
            let line = line.trim();
            if line.is_empty() || line.starts_with('#') {
                continue;
            }
            let fields = cells(line);
            let Some(order) = order else {
                order = Some(header(&at, &fields)?);
                continue;
            };
            let row = row(&at, &fields, order)?;
            let before = rows.len().checked_sub(2).map(|index| rows[index][0]);
            if rows.last().is_some_and(|last| last[0] > row[0])
                || before.is_some_and(|e| e >= row[0])
            {
                let allowed =
                    "energies in ascending order, each once, or twice at an absorption edge";
                return Err(at.error(COLUMNS[0], fields[order[0]], allowed));
            }
            rows.push(row);
        }
        if rows.is_empty() {
            let at = TableLine { path, number: text.lines().count().max(1), text: "" };
            return Err(at.error("table", "no rows", "a header and at least one row of numbers"));
        }
        Ok(Self { path: path.to_owned(), rows })
    }

    /// Constants at `energy` keV, interpolated linearly in the logarithms. `outside` makes the error of
    /// an energy beyond the table, from found and allowed values.
    pub(super) fn at(
        &self,
        name: &str,
        energy: f64,
        outside: impl Fn(String, String) -> Error,
    ) -> Result<Constants> {
        let (first, last) = (self.rows[0], self.rows[self.rows.len() - 1]);
        let Some(energy) = within([first[0], last[0]], energy) else {
            return Err(outside(
                format!("{energy} keV"),
                format!(
                    "{} keV to {} keV, the range of {} for \"{name}\"",
                    first[0],
                    last[0],
                    self.path.display()
                ),
            ));
        };
        // The last row at the energy or below it, and the next: an edge belongs to the energies above it.
        let above = self.rows.partition_point(|row| row[0] <= energy);
        let (a, b) = (self.rows[above - 1], self.rows[above.min(self.rows.len() - 1)]);
        let between = |column: usize| log_log(energy, [a[0], a[column]], [b[0], b[column]]);
        Ok(Constants { mu: between(1) * 100.0, delta: between(2), ..Constants::default() })
    }
}

impl ConstantsTable {
    /// Least and greatest energy, keV.
    pub(super) fn range(&self) -> [f64; 2] {
        [self.rows[0][0], self.rows[self.rows.len() - 1][0]]
    }

    /// Energies, keV, between rows across which mu rises: only an edge does that. Of an energy that comes
    /// twice, that energy.
    pub(super) fn edges(&self) -> Vec<f64> {
        let rises = |pair: &&[[f64; 3]]| pair[1][1] > pair[0][1];
        let between = |pair: &[[f64; 3]]| (pair[0][0] * pair[1][0]).sqrt();
        self.rows.windows(2).filter(rises).map(between).collect()
    }
}

/// Position of each of `COLUMNS` in the file.
fn header(at: &TableLine<'_>, fields: &[&str]) -> Result<[usize; 3]> {
    let mut order = [0; 3];
    for (slot, column) in order.iter_mut().zip(COLUMNS) {
        *slot = fields.iter().position(|field| *field == column).ok_or_else(|| {
            at.error(
                column,
                &fields.join(","),
                &format!("a header line with the columns {}", COLUMNS.join(",")),
            )
        })?;
    }
    Ok(order)
}

fn row(at: &TableLine<'_>, fields: &[&str], order: [usize; 3]) -> Result<[f64; 3]> {
    let mut row = [0.0; 3];
    for ((value, index), column) in row.iter_mut().zip(order).zip(COLUMNS) {
        let field = fields.get(index).copied().unwrap_or("nothing");
        *value = match units::number(field) {
            Some(number) if number.is_finite() && number > 0.0 => number,
            _ => return Err(at.error(column, field, "a number above 0")),
        };
    }
    Ok(row)
}

/// A line of the file, for messages.
struct TableLine<'a> {
    path: &'a Path,
    number: usize,
    text: &'a str,
}

impl TableLine<'_> {
    fn error(&self, key: &str, found: &str, allowed: &str) -> Error {
        let place = Place::of_word(self.path, self.number, self.text, found);
        Error::scene_at(place, key, found, allowed)
    }
}
