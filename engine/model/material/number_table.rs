//! CSV tables of numbers: a header line with names of columns in any order, then rows.

use std::path::Path;

use beamlet_core::csv_table::cells;
use beamlet_core::error::{Error, Place, Result};
use beamlet_core::{input_file, units};

/// A kind of table.
pub(crate) struct NumberTable<const N: usize> {
    /// In words: "material table".
    pub(crate) noun: &'static str,
    /// Names of its columns, each with whether it may hold 0; numbers below are refused.
    pub(crate) columns: [(&'static str, bool); N],
}

/// What a row of a table must be, where it is not: index of the column and the allowed form.
pub(crate) type Fault = Option<(usize, &'static str)>;

impl<const N: usize> NumberTable<N> {
    /// Reads a file. `follows`: fault of a row behind those before it; `ends`: fault of the last one of all rows.
    ///
    /// # Errors
    /// [`Error::File`] where it cannot be read; [`Error::Scene`] with line and column where it is no such table.
    pub(crate) fn read(
        &self,
        path: &Path,
        follows: impl Fn(&[[f64; N]], &[f64; N]) -> Fault,
        ends: impl Fn(&[[f64; N]]) -> Fault,
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
            let refuse = |(column, allowed): (usize, &str)| {
                at.error(self.columns[column].0, fields[order[column]], allowed)
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
        for (slot, (column, _)) in order.iter_mut().zip(self.columns) {
            *slot = fields.iter().position(|field| *field == column).ok_or_else(|| {
                let columns = self.columns.map(|(name, _)| name).join(",");
                let allowed = format!("a header line with the columns {columns}");
                at.error(column, &fields.join(","), &allowed)
            })?;
        }
        Ok(order)
    }

    fn row(&self, at: &TableLine<'_>, fields: &[&str], order: [usize; N]) -> Result<[f64; N]> {
        let mut row = [0.0; N];
        for ((value, index), (column, zero)) in row.iter_mut().zip(order).zip(self.columns) {
            let field = fields.get(index).copied().unwrap_or("nothing");
            *value = match units::number(field) {
                Some(number) if number.is_finite() && (number > 0.0 || zero && number == 0.0) => {
                    number
                }
                _ if zero => return Err(at.error(column, field, "a number >= 0")),
                _ => return Err(at.error(column, field, "a number above 0")),
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
