//! Patterns of masks: open and closed pixels on a grid, and the openings that they make.

use super::MaskSpec;
use beamlet_core::{Error, Place, Result, csv_table, image, input_file};
use ndarray::Array2;
use std::path::Path;

/// Part of a period of a mask along z: between its ends light passes the openings along x.
#[derive(Debug, Clone, PartialEq)]
pub struct Strip {
    /// Ends along z from the centre of the period, m.
    pub z: [f64; 2],
    /// Ends along x from the centre of the period, ascending, m.
    pub x: Vec<[f64; 2]>,
    /// Middle of its aperture along z from the centre of the period, m: from there to either end its strips are
    /// narrower.
    pub middle: f64,
}

impl Strip {
    /// A strip of which its aperture has no other.
    pub(super) const fn between(z: [f64; 2], x: Vec<[f64; 2]>) -> Self {
        Self { z, x, middle: f64::midpoint(z[0], z[1]) }
    }
}

/// Open and closed pixels of a period of a mask, `[row][column]`: row 0 on top (largest z), column 0 at the least x.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Pattern {
    open: Array2<bool>,
}

impl Pattern {
    /// A pattern of pixels that are open where `open` is true.
    #[must_use]
    pub const fn new(open: Array2<bool>) -> Self {
        Self { open }
    }

    /// Reads an image of two values, of which the larger one is open, or a table of 0 and 1.
    ///
    /// # Errors
    /// [`Error::File`] where the file cannot be read or an image has other values; [`Error::Scene`] with line and
    /// column of a table.
    pub(super) fn read(path: &Path) -> Result<Self> {
        let is_table = path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("csv"));
        if is_table { read_table(path) } else { read_image(path) }
    }

    /// Rows as texts of 0 and 1.
    pub(super) fn texts(&self) -> Vec<String> {
        let text = |row: ndarray::ArrayView1<'_, bool>| {
            row.iter().map(|open| if *open { '1' } else { '0' }).collect()
        };
        self.open.rows().into_iter().map(text).collect()
    }

    /// The pattern of rows of 0 and 1; the index of a row that is none or has another length.
    pub(super) fn of_texts(rows: &[&str]) -> std::result::Result<Self, usize> {
        let columns = rows.first().map_or(0, |row| row.len());
        let is_row = |row: &str| {
            row.len() == columns && columns > 0 && row.bytes().all(|it| matches!(it, b'0' | b'1'))
        };
        if let Some(wrong) = rows.iter().position(|row| !is_row(row)) {
            return Err(wrong);
        }
        let open = rows.iter().flat_map(|row| row.bytes().map(|it| it == b'1')).collect();
        Array2::from_shape_vec((rows.len(), columns), open).map(Self::new).map_err(|_| 0)
    }

    /// Number of rows and columns.
    pub(crate) fn size(&self) -> [usize; 2] {
        [self.open.nrows(), self.open.ncols()]
    }

    /// Share of the pixels that are open.
    pub(crate) fn open_share(&self) -> f64 {
        self.open.iter().filter(|open| **open).count() as f64 / self.open.len() as f64
    }

    /// Rows as columns and columns as rows.
    pub(super) fn transposed(&self) -> Self {
        Self::new(self.open.t().to_owned())
    }

    /// The pattern after this number of quarter turns, clockwise as the source sees it.
    pub(super) fn turned(&self, quarters: usize) -> Self {
        let quarter = |open: Array2<bool>| open.t().slice(ndarray::s![.., ..;-1]).to_owned();
        Self::new((0..quarters).fold(self.open.clone(), |open, _| quarter(open)))
    }

    /// Strips of a period whose pixels have this size, ascending along z. Equal rows above each other are one.
    pub(super) fn strips(&self, pixel: [f64; 2]) -> Vec<Strip> {
        let [rows, columns] = self.size();
        let above = |row: usize| (row + rows - 1) % rows;
        let begins = |row: &usize| self.open.row(*row) != self.open.row(above(*row));
        let mut first: Vec<usize> = (0..rows).filter(begins).collect();
        if first.is_empty() {
            first.push(0);
        }
        let behind = first.iter().skip(1).copied().chain([first[0] + rows]);
        let z = |row: usize| (rows as f64 / 2.0 - row as f64) * pixel[1];
        let x = |column: usize| (column as f64 - columns as f64 / 2.0) * pixel[0];
        let strip = |(from, to): (&usize, usize)| {
            let openings = runs(self.open.row(*from)).into_iter().map(|run| run.map(x));
            Strip::between([z(to), z(*from)], openings.collect())
        };
        let mut strips: Vec<Strip> = first.iter().zip(behind).map(strip).collect();
        strips.retain(|strip| !strip.x.is_empty());
        strips.reverse();
        strips
    }
}

/// Runs of open places, ascending: the first, and the one behind the last.
fn runs<'a>(open: impl IntoIterator<Item = &'a bool>) -> Vec<[usize; 2]> {
    let mut all: Vec<[usize; 2]> = Vec::new();
    for (place, _) in open.into_iter().enumerate().filter(|(_, open)| **open) {
        match all.last_mut() {
            Some(run) if run[1] == place => run[1] += 1,
            _ => all.push([place, place + 1]),
        }
    }
    all
}

fn read_image(path: &Path) -> Result<Pattern> {
    let values = image::read(path)?;
    let low = values.iter().copied().fold(f64::INFINITY, f64::min);
    let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let other = values.indexed_iter().find(|(_, value)| **value > low && **value < high);
    if let Some(((row, column), value)) = other {
        let problem = format!(
            "is no pattern: row {row}, column {column} has {value} beside {low} and {high}; allowed: two values"
        );
        return Err(Error::file(path, problem, None));
    }
    Ok(Pattern::new(values.mapv(|value| value >= high && low < high)))
}

fn read_table(path: &Path) -> Result<Pattern> {
    let failed = |error| Error::file(path, "cannot read the pattern", Some(error));
    let text = input_file::text(path).map_err(failed)?;
    let wrong = |line: usize, found: String, allowed: &str| {
        let line_column = Some((line + 1, 1));
        let place = Place { file: Some(path.to_owned()), line_column, excerpt: None };
        Error::scene_at(place, "pattern", found, allowed)
    };
    let (mut open, mut columns, mut rows) = (Vec::new(), None, 0);
    for (number, line) in text.lines().enumerate() {
        if line.trim().is_empty() || line.trim_start().starts_with('#') {
            continue;
        }
        let cells = csv_table::cells(line);
        if let Some(other) = cells.iter().find(|cell| !matches!(**cell, "0" | "1")) {
            return Err(wrong(number, format!("{other:?}"), "0 or 1 in each cell"));
        }
        let before = *columns.get_or_insert(cells.len());
        if cells.len() != before {
            let allowed = format!("{before} cells, as in the first row");
            return Err(wrong(number, format!("{} cells", cells.len()), &allowed));
        }
        open.extend(cells.iter().map(|cell| *cell == "1"));
        rows += 1;
    }
    let holds_none = || Error::file(path, "holds no pattern", None);
    let columns = columns.ok_or_else(holds_none)?;
    Array2::from_shape_vec((rows, columns), open).map(Pattern::new).map_err(|_| holds_none())
}

impl MaskSpec {
    /// The mask with a pattern, whose pixels have this size along x and z in its plane, m.
    #[must_use]
    pub fn with_pattern(mut self, pattern: Pattern, pixel: [f64; 2]) -> Self {
        let [rows, columns] = pattern.size();
        self.rectangles.clear();
        self.period = columns as f64 * pixel[0];
        self.period_z = Some(rows as f64 * pixel[1]);
        self.pattern = Some(pattern);
        self.pattern_pixel = Some(pixel);
        self.take_widths();
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pattern(rows: &[&str]) -> Pattern {
        Pattern::of_texts(rows).unwrap()
    }

    /// Row 0 is on top, column 0 at the least x; equal rows are one strip.
    #[test]
    fn strips_are_rows_from_below() {
        let strips = pattern(&["1001", "0110", "0110", "0000"]).strips([2.0, 3.0]);
        let want = [
            Strip { z: [-3.0, 3.0], x: vec![[-2.0, 2.0]], middle: 0.0 },
            Strip { z: [3.0, 6.0], x: vec![[-4.0, -2.0], [2.0, 4.0]], middle: 4.5 },
        ];
        assert_eq!(strips, want);
    }

    #[test]
    fn strips_keep_the_open_area() {
        let pattern = pattern(&["1011", "1101", "0010", "1011"]);
        let of = |strip: &Strip| {
            let width: f64 = strip.x.iter().map(|[low, high]| high - low).sum();
            width * (strip.z[1] - strip.z[0])
        };
        let area: f64 = pattern.strips([1.0, 1.0]).iter().map(of).sum();
        assert!((area / 16.0 - pattern.open_share()).abs() < 1e-12);
    }

    #[test]
    fn texts_of_other_lengths_and_signs_are_refused_by_row() {
        assert_eq!(Pattern::of_texts(&["01", "011"]), Err(1));
        assert_eq!(Pattern::of_texts(&["02"]), Err(0));
        assert_eq!(pattern(&["01", "10"]).texts(), ["01", "10"]);
    }
}
