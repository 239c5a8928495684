//! Columns of quantities of one kind, such as angles, with the unit in the name of the column.

use super::{Row, TableKind};
use crate::Result;
use crate::units::Dimension;
use std::path::Path;

/// How many columns of quantities a table has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Numbered {
    /// One, `NAME_UNIT`.
    No,
    /// One or more, `NAME_0_UNIT`, `NAME_1_UNIT` and so on.
    Yes,
    /// One of each of these names in this order, `NAME_UNIT`.
    Named(&'static [&'static str]),
    /// One, `NAME_UNIT`, or one of each of these names where the table has the first of them.
    OneOr(&'static [&'static str]),
}

/// A table of quantities; a column `view` may number its rows.
#[derive(Debug, Clone, Copy)]
pub struct Quantities {
    /// Its name in messages.
    pub kind: TableKind,
    /// Name of the columns, without unit.
    pub name: &'static str,
    /// `None`: numbers without a unit, columns `NAME` or `NAME_0` and so on.
    pub dimension: Option<Dimension>,
    /// How many columns it may have.
    pub columns: Numbered,
}

/// A column: its unit; none of `view`.
type Column = Option<String>;

impl Quantities {
    /// Reads the rows of a file, each with the values of its columns in the base unit.
    ///
    /// # Errors
    /// As `TableKind::read`.
    pub fn read(&self, path: &Path) -> Result<Vec<Vec<f64>>> {
        self.kind.read(path, |row| self.header(row), |row, columns| self.row(row, columns))
    }

    fn header(&self, row: &Row<'_>) -> Result<Vec<Column>> {
        let mut columns: Vec<Column> = Vec::new();
        let mut has_view = false;
        let starts = |names: &[&str]| {
            let has =
                |index| without_case(row.field(index).unwrap_or_default(), names[0]).is_some();
            (0..row.record.len()).any(has)
        };
        let count = match self.columns {
            Numbered::OneOr(names) if starts(names) => Numbered::Named(names),
            Numbered::OneOr(_) => Numbered::No,
            count => count,
        };
        for index in 0..row.record.len() {
            let name = row.field(index).unwrap_or_default();
            if name.eq_ignore_ascii_case("view") && !has_view {
                has_view = true;
                columns.push(None);
                continue;
            }
            let number = columns.iter().flatten().count();
            let stem = match count {
                Numbered::No | Numbered::OneOr(_) => self.name.to_owned(),
                Numbered::Yes => format!("{}_{number}", self.name),
                Numbered::Named(names) => (*names.get(number).unwrap_or(&"")).to_owned(),
            };
            let rest = without_case(name, &stem);
            let unit = match self.dimension {
                Some(_) => rest.and_then(|rest| rest.strip_prefix('_')),
                None => rest,
            };
            // A header in capitals has its units in capitals.
            let unit = unit.and_then(|unit| match self.dimension {
                Some(dimension) => [unit.to_owned(), unit.to_lowercase()]
                    .into_iter()
                    .find(|unit| dimension.units().any(|known| known == *unit)),
                None => unit.is_empty().then(String::new),
            });
            match unit.filter(|_| number == 0 || count != Numbered::No) {
                Some(unit) => columns.push(Some(unit)),
                None => {
                    let found = format!("the column {}", row.shown(index));
                    return Err(row.error(index, "header", &found, self.kind.columns));
                }
            }
        }
        let missing = match count {
            Numbered::Named(names) => names.get(columns.iter().flatten().count()).copied(),
            _ => columns.iter().flatten().next().is_none().then_some("values"),
        };
        if let Some(missing) = missing {
            let found = format!("no column of {missing}");
            return Err(row.error(0, self.kind.key, &found, self.kind.columns));
        }
        Ok(columns)
    }

    fn row(&self, row: &Row<'_>, columns: &[Column]) -> Result<Vec<f64>> {
        let mut values = Vec::new();
        for (index, column) in columns.iter().enumerate() {
            let Some(unit) = column else {
                row.check_view(index)?;
                continue;
            };
            let Some(dimension) = self.dimension else {
                values.push(row.number(index, self.name)?);
                continue;
            };
            let text = row.field(index).unwrap_or_default();
            match dimension.parse(&format!("{text} {unit}")) {
                Ok(value) => values.push(value),
                Err(_) => {
                    let found = row.shown(index);
                    return Err(row.error(index, self.name, &found, "a finite number"));
                }
            }
        }
        Ok(values)
    }
}

/// The text behind a beginning in letters of either case.
fn without_case<'a>(text: &'a str, begin: &str) -> Option<&'a str> {
    let (head, rest) = text.split_at_checked(begin.len())?;
    head.eq_ignore_ascii_case(begin).then_some(rest)
}
