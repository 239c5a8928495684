//! CSV tables with a header: rows with the place of each field, for errors that name line and column; and
//! the cells of the lines of other tables.

mod quantities;
mod rigid;

pub use quantities::{Numbered, Quantities};
pub use rigid::{Placement, PlacementTable};

use crate::error::Place;
use crate::{Error, Result, input_file, units};
use csv::{ByteRecord, ReaderBuilder, Trim};
use std::path::Path;

/// Signs between cells; the first that a line holds counts.
const SEPARATORS: [u8; 3] = [b';', b'\t', b','];

/// A kind of table.
#[derive(Debug, Clone, Copy)]
pub struct TableKind {
    /// Key of errors that concern no column.
    pub key: &'static str,
    /// The rows, in words: "positions of instances".
    pub noun: &'static str,
    /// Columns that it may have, for messages.
    pub columns: &'static str,
    /// Greatest number of rows.
    pub most: usize,
}

impl TableKind {
    /// Reads a file: `header` makes columns of its first record, `row` a value of each other one.
    ///
    /// # Errors
    /// [`Error::File`] where it cannot be read; [`Error::Scene`] with line and column where it is no such
    /// table.
    fn read<C, T>(
        &self,
        path: &Path,
        header: impl Fn(&Row<'_>) -> Result<C>,
        row: impl Fn(&Row<'_>, &C) -> Result<T>,
    ) -> Result<Vec<T>> {
        let failed = |e| Error::file(path, format!("cannot read the {}", self.noun), Some(e));
        let bytes = input_file::lines(path).map_err(failed)?;
        self.parse(path, &bytes, header, row)
    }

    /// The values in the bytes of a file.
    fn parse<C, T>(
        &self,
        path: &Path,
        bytes: &[u8],
        header: impl Fn(&Row<'_>) -> Result<C>,
        value: impl Fn(&Row<'_>, &C) -> Result<T>,
    ) -> Result<Vec<T>> {
        let is_comment = |line: &&[u8]| {
            let line = line.trim_ascii();
            line.is_empty() || line.starts_with(b"#")
        };
        let header_line = bytes.split(|byte| *byte == b'\n').find(|line| !is_comment(line));
        let separator = separator(header_line.unwrap_or_default()).unwrap_or(b',');
        let mut reader = ReaderBuilder::new()
            .delimiter(separator)
            .has_headers(false)
            .flexible(true)
            .comment(Some(b'#'))
            .trim(Trim::All)
            .from_reader(bytes);
        let mut record = ByteRecord::new();
        let mut columns = None;
        let mut values = Vec::new();
        loop {
            let is_read = reader.read_byte_record(&mut record);
            let row = Row {
                kind: self,
                path,
                bytes,
                separator,
                end: reader.position().byte(),
                record: &record,
                number: values.len(),
            };
            match is_read {
                Ok(true) => {}
                Ok(false) if values.is_empty() => {
                    let allowed = format!("a header and at least one row; {}", self.columns);
                    return Err(row.error(0, self.key, "no rows", &allowed));
                }
                Ok(false) => return Ok(values),
                // Bytes in memory have no errors of reading, and any bytes are records of some lengths.
                Err(error) => {
                    return Err(row.error(0, self.key, &error.to_string(), self.columns));
                }
            }
            match &columns {
                None => columns = Some((header(&row)?, record.len())),
                Some(_) if values.len() == self.most => {
                    let (found, most) = (format!("more than {} rows", self.most), self.most);
                    return Err(row.error(0, self.key, &found, &format!("up to {most}")));
                }
                Some((columns, count)) => {
                    row.check_length(*count)?;
                    values.push(value(&row, columns)?);
                }
            }
        }
    }
}

/// The sign between the cells of a line, if there is one: the first of semicolon, tab and comma that it
/// holds outside quotes, since a comma may be a decimal one.
fn separator(line: &[u8]) -> Option<u8> {
    let mut quoted = false;
    let mut found = [false; SEPARATORS.len()];
    for byte in line {
        quoted ^= *byte == b'"';
        if let Some(sign) = SEPARATORS.iter().position(|sign| sign == byte).filter(|_| !quoted) {
            found[sign] = true;
        }
    }
    SEPARATORS.into_iter().zip(found).find(|(_, found)| *found).map(|(sign, _)| sign)
}

/// The cells of a line, separated by semicolons, tabs, commas or blanks, without the quotes around them.
/// Empty cells count, except between blanks.
pub fn cells(line: &str) -> Vec<&str> {
    let separator = separator(line.as_bytes()).map(char::from);
    let mut quoted = false;
    let parts = line.split(|sign: char| {
        quoted ^= sign == '"';
        !quoted && separator.map_or(sign.is_whitespace(), |separator| sign == separator)
    });
    parts.filter(|part| separator.is_some() || !part.is_empty()).map(unquoted).collect()
}

/// Place of a column in the cells of a header, in letters of either case.
///
/// # Errors
/// The name as it comes again.
pub fn column<'a>(header: &[&'a str], name: &str) -> std::result::Result<Option<usize>, &'a str> {
    let mut places = (0..header.len()).filter(|place| header[*place].eq_ignore_ascii_case(name));
    let first = places.next();
    places.next().map_or(Ok(first), |again| Err(header[again]))
}

/// A cell without blanks and quotes around it.
fn unquoted(cell: &str) -> &str {
    let cell = cell.trim();
    let inside = cell.strip_prefix('"').and_then(|cell| cell.strip_suffix('"'));
    inside.unwrap_or(cell).trim()
}

/// A record of a file.
struct Row<'a> {
    kind: &'a TableKind,
    path: &'a Path,
    bytes: &'a [u8],
    /// Between fields.
    separator: u8,
    /// Offset behind the record.
    end: u64,
    record: &'a ByteRecord,
    /// Rows before it, without the header.
    number: usize,
}

impl Row<'_> {
    /// An error at a field.
    fn error(&self, field: usize, key: &str, found: &str, allowed: &str) -> Error {
        let end =
            usize::try_from(self.end).map_or(self.bytes.len(), |end| end.min(self.bytes.len()));
        let before = self.bytes[..end].trim_ascii_end();
        let newlines = before.iter().filter(|byte| **byte == b'\n').count();
        let line = before.rsplit(|byte| *byte == b'\n').next().unwrap_or_default();
        let line = String::from_utf8_lossy(line);
        // A field in quotes may hold separators: the reported column is then an earlier one.
        let fields = || line.split(char::from(self.separator));
        let skipped: usize = fields().take(field).map(|text| text.chars().count() + 1).sum();
        let text = fields().nth(field).unwrap_or_default();
        let spaces = text.chars().take_while(|c| c.is_whitespace()).count();
        let place = Place {
            file: Some(self.path.to_owned()),
            line_column: Some((newlines + 1, skipped + spaces + 1)),
            excerpt: None,
        };
        Error::scene_at(place, key, found, allowed)
    }

    /// A field as text.
    fn field(&self, index: usize) -> Option<&str> {
        std::str::from_utf8(self.record.get(index)?).ok()
    }

    /// A field for a message.
    fn shown(&self, index: usize) -> String {
        let text = String::from_utf8_lossy(self.record.get(index).unwrap_or_default());
        let short: String = text.chars().take(60).collect();
        format!("{short:?}{}", if short.len() < text.len() { "..." } else { "" })
    }

    fn check_length(&self, columns: usize) -> Result<()> {
        if self.record.len() == columns {
            return Ok(());
        }
        let found = format!("{} fields", self.record.len());
        let allowed = format!("{columns}, one for each column of the header");
        let last = self.record.len().min(columns).saturating_sub(1);
        Err(self.error(last, self.kind.key, &found, &allowed))
    }

    /// A finite number.
    fn number(&self, index: usize, key: &str) -> Result<f64> {
        match self.field(index).map(units::number) {
            Some(Some(number)) if number.is_finite() => Ok(number),
            _ => Err(self.error(index, key, &self.shown(index), "a finite number")),
        }
    }

    /// Checks a field of the column `view`, which numbers the rows from 0.
    fn check_view(&self, index: usize) -> Result<()> {
        if self.field(index).and_then(|text| text.parse().ok()) == Some(self.number) {
            return Ok(());
        }
        let allowed =
            format!("{}: views are numbered from 0, without gaps and repeats", self.number);
        Err(self.error(index, "view", &self.shown(index), &allowed))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_are_split_outside_quotes() {
        for (line, wanted) in [
            ("a,b", ["a", "b"]),
            ("\"a\",\"b\"", ["a", "b"]),
            (" \"a\" ; \"b, c\" ", ["a", "b, c"]),
            ("\"a;b\",1,5", ["a;b", "1"]),
            ("\"a b\" c", ["a b", "c"]),
            ("\"a\"\t", ["a", ""]),
            ("  1   2 ", ["1", "2"]),
            ("1\" ,2", ["1\" ,2", ""]),
        ] {
            let mut found = cells(line);
            found.resize(2, "");
            assert_eq!(found, wanted, "{line:?}");
        }
    }
}
