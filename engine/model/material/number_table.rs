//! CSV tables of numbers: a header line with names of columns in any order, then rows.

use std::path::Path;

use beamlet_core::csv_table::{cells, column};
use beamlet_core::error::{Error, Place, Result};
use beamlet_core::{input_file, units};

/// A kind of table.
pub(crate) struct NumberTable<const N: usize> {
    /// In words: "material table".
    pub(crate) noun: &'static str,
    pub(crate) columns: [Column; N],
}

/// Column of a table.
#[derive(Clone, Copy)]
pub(crate) struct Column {
    pub(crate) name: &'static str,
    /// True if it may hold 0; numbers below are refused.
    pub(crate) may_be_zero: bool,
}

/// Fault of a row of a table.
pub(crate) struct Fault {
    /// Index of the column.
    pub(crate) column: usize,
    /// The allowed form.
    pub(crate) allowed: &'static str,
}

impl<const N: usize> NumberTable<N> {
    /// Reads a file. `follows`: fault of a row behind those before it; `ends`: fault of the last one of all rows.
    ///
    /// # Errors
    /// [`Error::File`] where it cannot be read; [`Error::Scene`] with line and column where it is no such table.
    pub(crate) fn read(
        &self,
        path: &Path,
        follows: impl Fn(&[[f64; N]], &[f64; N]) -> Option<Fault>,
        ends: impl Fn(&[[f64; N]]) -> Option<Fault>,
    ) -> Result<Vec<[f64; N]>> {
        let text = input_file::text(path)
            .map_err(|e| Error::file(path, format!("cannot read the {}", self.noun), Some(e)))?;
        let mut rows: Vec<[f64; N]> = Vec::new();
        let mut order = None;
        let mut last = None;
        for (index, line) in text.lines().enumerate() {
            let at = TableLine { path, number: index + 1, text: line };
            let line = line.trim();
            if line.is_empty() || line.starts_with('#') {
                continue;
            }
            let fields = cells(line);
            let Some(order) = order else {
                order = Some(self.header(&at, &fields)?);
                continue;
            };
            let row = self.row(&at, &fields, order)?;
            let refuse = |Fault { column, allowed }: Fault| {
                at.error(self.columns[column].name, fields[order[column]], allowed)
            };
            if let Some(fault) = follows(&rows, &row) {
                return Err(refuse(fault));
            }
            rows.push(row);
            last = ends(&rows).map(refuse);
        }
        if rows.is_empty() {
            let at = TableLine { path, number: text.lines().count().max(1), text: "" };
            return Err(at.error("table", "no rows", "a header and at least one row of numbers"));
        }
        last.map_or(Ok(rows), Err)
    }

    /// Position of each column in the file.
    fn header(&self, at: &TableLine<'_>, fields: &[&str]) -> Result<[usize; N]> {
        let mut order = [0; N];
        for (slot, Column { name, .. }) in order.iter_mut().zip(self.columns) {
            let found = column(fields, name)
                .map_err(|again| at.error(name, &format!("{again} twice"), "each column once"))?;
            *slot = found.ok_or_else(|| {
                let columns = self.columns.map(|it| it.name).join(",");
                let allowed = format!("a header line with the columns {columns}");
                at.error(name, &fields.join(","), &allowed)
            })?;
        }
        Ok(order)
    }

    fn row(&self, at: &TableLine<'_>, fields: &[&str], order: [usize; N]) -> Result<[f64; N]> {
        let mut row = [0.0; N];
        for ((value, index), column) in row.iter_mut().zip(order).zip(self.columns) {
            let Column { name, may_be_zero: zero } = column;
            let field = fields.get(index).copied().unwrap_or("nothing");
            *value = match units::number(field) {
                Some(number) if number.is_finite() && (number > 0.0 || zero && number == 0.0) => {
                    number
                }
                _ if zero => return Err(at.error(name, field, "a number >= 0")),
                _ => return Err(at.error(name, field, "a number above 0")),
            };
        }
        Ok(row)
    }
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
