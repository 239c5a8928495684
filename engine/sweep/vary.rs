//! Values of the varied keys of a scene, and the designs that they make.

use super::Load;
use beamlet_core::csv_table::cells;
use beamlet_core::printed::with_unit;
use beamlet_core::units::number;
use beamlet_core::{Error, Result, input_file, numbers};
use serde::Serialize;
use std::path::Path;

/// Most designs of a sweep.
const MOST: usize = 100_000;
/// Decimals, relative to the larger end, that values of a range are rounded to.
const DIGITS: i32 = 12;

/// A key of the scene that is varied.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct VariedKey {
    /// Path in the scene, as for `--set`.
    pub path: String,
    /// Unit of the values; "" where they are numbers, words or lists.
    pub unit: String,
}

/// Keys that change together, and their values.
#[derive(Debug, Clone, PartialEq)]
struct Axis {
    /// The option or file, for messages.
    name: String,
    keys: Vec<VariedKey>,
    /// Values without their unit, a list of one for each key.
    rows: Vec<Vec<String>>,
}

/// All combinations of the values of keys; the values of the last keys change first.
#[derive(Debug, Clone, PartialEq)]
pub struct Designs {
    axes: Vec<Axis>,
    count: usize,
}

impl Designs {
    /// Designs by texts: `key=from:to:count unit`, `key=value, value unit`, or the path of a CSV table with a header of
    /// keys, `key` or `key [unit]`, and a design a row.
    ///
    /// # Errors
    /// [`Error::Argument`] for texts that are wrong, a key twice, and too many designs; [`Error::File`] for a table.
    pub fn of(texts: &[String]) -> Result<Self> {
        if texts.is_empty() {
            return Err(Error::argument("vary", "nothing to vary", "key=values, or a table"));
        }
        let axis = |text: &String| match text.split_once('=') {
            Some((key, values)) => Axis::of_key(key.trim(), values.trim()),
            None => Axis::of_table(Path::new(text)),
        };
        let axes = texts.iter().map(axis).collect::<Result<Vec<_>>>()?;
        let mut known: Vec<&str> = Vec::new();
        for key in axes.iter().flat_map(|axis| &axis.keys) {
            if known.contains(&key.path.as_str()) {
                return Err(Error::argument(
                    "vary",
                    format!("{} twice", key.path),
                    "each key once",
                ));
            }
            known.push(&key.path);
        }
        let product = axes.iter().map(|axis| axis.rows.len() as f64).product::<f64>();
        if product > MOST as f64 {
            let found = format!("{product:.0} designs");
            return Err(Error::argument("vary", found, format!("up to {MOST} designs")));
        }
        let count = axes.iter().map(|axis| axis.rows.len()).product();
        Ok(Self { axes, count })
    }

    /// Number of designs.
    #[must_use]
    pub const fn count(&self) -> usize {
        self.count
    }

    /// The varied keys.
    pub fn keys(&self) -> impl Iterator<Item = &VariedKey> {
        self.axes.iter().flat_map(|axis| &axis.keys)
    }

    /// Number of values along each axis: a key, or the rows of a table.
    #[must_use]
    pub fn shape(&self) -> Vec<usize> {
        self.axes.iter().map(|axis| axis.rows.len()).collect()
    }

    /// Label of an axis, and its values: numbers of its key, of a table those of the first key with different ones; else the
    /// numbers of the rows from 1.
    #[must_use]
    pub fn axis(&self, axis: usize) -> (String, Vec<f64>) {
        let Axis { name, keys, rows } = &self.axes[axis];
        let differ = |values: &Vec<f64>| {
            let mut sorted = values.clone();
            sorted.sort_by(f64::total_cmp);
            sorted.windows(2).all(|pair| pair[0] < pair[1])
        };
        let of_key = |(column, key): (usize, &VariedKey)| {
            let values: Option<Vec<f64>> = rows.iter().map(|row| number(&row[column])).collect();
            let values = values.filter(|values| keys.len() == 1 || differ(values))?;
            Some((with_unit(&key.path, &key.unit), values))
        };
        let by_rows = || (format!("{name}, row"), (1..=rows.len()).map(|row| row as f64).collect());
        keys.iter().enumerate().find_map(of_key).unwrap_or_else(by_rows)
    }

    /// Keys of a range of three values or more of which a design has the least or the greatest.
    pub(super) fn best_ends(&self, design: usize) -> Vec<String> {
        let values = self.values(design);
        let mut first = 0;
        let mut found = Vec::new();
        for axis in &self.axes {
            let own = values.get(first).and_then(|value| number(value));
            first += axis.keys.len();
            let all: Option<Vec<f64>> = axis.rows.iter().map(|row| number(&row[0])).collect();
            let (Some(own), Some(all), [key]) = (own, all, &axis.keys[..]) else { continue };
            let is_within = all.iter().any(|it| *it < own) && all.iter().any(|it| *it > own);
            if all.len() > 2 && !is_within {
                found.push(key.path.clone());
            }
        }
        found
    }

    /// Values of a design without their units, in the order of the keys.
    #[must_use]
    pub fn values(&self, design: usize) -> Vec<&str> {
        let mut rest = design;
        let mut rows = Vec::new();
        for axis in self.axes.iter().rev() {
            rows.push(&axis.rows[rest % axis.rows.len()]);
            rest /= axis.rows.len();
        }
        rows.into_iter().rev().flatten().map(String::as_str).collect()
    }

    /// The overrides of a design, `key=value` each.
    #[must_use]
    pub fn sets(&self, design: usize) -> Vec<String> {
        let values = self.values(design);
        self.keys().zip(values).map(|(key, value)| key.set(value)).collect()
    }

    /// The overrides of each value of each key, `key=value` each.
    pub(super) fn sets_of_keys(&self) -> impl Iterator<Item = String> {
        self.axes.iter().flat_map(|axis| {
            let of_row = |row: &Vec<String>| {
                axis.keys.iter().zip(row).map(|(key, value)| key.set(value)).collect::<Vec<_>>()
            };
            axis.rows.iter().flat_map(of_row)
        })
    }

    /// Refuses keys that no scene has.
    ///
    /// # Errors
    /// The error of the scene at the key.
    pub(super) fn check_keys(&self, load: &Load<'_>) -> Result<()> {
        for axis in &self.axes {
            for (key, value) in axis.keys.iter().zip(&axis.rows[0]) {
                let Err(error) = load(&[key.set(value)]) else { continue };
                let is_astray = |error: &Error| match error {
                    Error::Scene { found, .. } => {
                        let begin = ["an unknown key", "no path of keys", "index ", "the key `"];
                        begin.iter().any(|begin| found.starts_with(begin))
                    }
                    _ => false,
                };
                if error.each().iter().any(is_astray) {
                    return Err(error);
                }
            }
        }
        Ok(())
    }
}

impl VariedKey {
    /// A key of the header of a table, `key`, `key [unit]` or `key[unit]`; brackets of other texts are part of the key.
    fn of_cell(cell: &str) -> Self {
        let (path, unit) = match cell.strip_suffix(']').and_then(|cell| cell.rsplit_once('[')) {
            Some((path, unit)) if path.ends_with(' ') || is_unit(unit.trim()) => (path, unit),
            _ => (cell, ""),
        };
        Self { path: path.trim().to_owned(), unit: unit.trim().to_owned() }
    }

    fn set(&self, value: &str) -> String {
        let Self { path, unit } = self;
        match unit.is_empty() {
            true => format!("{path}={value}"),
            false => format!("{path}={value} {unit}"),
        }
    }
}

impl Axis {
    fn of_key(key: &str, values: &str) -> Result<Self> {
        let allowed = "key=from:to:count unit, as in 'sample_mask.aperture=10:40:16 um', or key=value, value unit";
        let wrong =
            |found: String| Error::argument("vary", format!("{key}={values}: {found}"), allowed);
        if key.is_empty() {
            return Err(wrong("no key".into()));
        }
        let listed = separate(values);
        let pieces: Vec<&str> = values.split(':').map(str::trim).collect();
        let is_range =
            listed.len() == 1 && pieces.len() == 3 && number(quantity(pieces[0]).0).is_some();
        let items = match is_range {
            true => range([pieces[0], pieces[1], pieces[2]]).map_err(&wrong)?,
            false => listed.iter().map(|item| (*item).to_owned()).collect(),
        };
        if items.iter().any(String::is_empty) {
            return Err(wrong("an empty value".into()));
        }
        let (unit, values) = common_unit(&items).map_err(wrong)?;
        let keys = vec![VariedKey { path: key.to_owned(), unit }];
        let rows = values.into_iter().map(|value| vec![value]).collect();
        Ok(Self { name: key.to_owned(), keys, rows })
    }

    fn of_table(path: &Path) -> Result<Self> {
        let failed = |problem: &str| Error::file(path, problem, None);
        let text = input_file::text(path)
            .map_err(|error| Error::file(path, "cannot read the table of designs", Some(error)))?;
        // Blanks separate no cells: a header may have units behind its keys.
        let cells = |line: &'_ str| -> Vec<String> {
            match line.contains([';', '\t', ',']) {
                true => cells(line).into_iter().map(str::to_owned).collect(),
                false => vec![line.trim().to_owned()],
            }
        };
        let lines = text.lines().enumerate();
        let mut lines =
            lines.filter(|(_, line)| !(line.trim().is_empty() || line.starts_with('#')));
        let (_, header) = lines.next().ok_or_else(|| failed("no header of keys"))?;
        let keys: Vec<VariedKey> = without_empty_end(cells(header), 0)
            .iter()
            .map(|cell| VariedKey::of_cell(cell))
            .collect();
        if let Some(column) = keys.iter().position(|key| key.path.is_empty()) {
            return Err(failed(&format!(
                "column {} has no name; allowed: keys of the scene",
                column + 1
            )));
        }
        let mut rows = Vec::new();
        for (index, line) in lines {
            let row = without_empty_end(cells(line), keys.len());
            let refused = |found: String| {
                let allowed = format!("{}, one for each key", keys.len());
                failed(&format!("line {}: {found}; allowed: {allowed}", index + 1))
            };
            if row.len() != keys.len() {
                return Err(refused(format!("{} values", row.len())));
            }
            if let Some(column) = row.iter().position(String::is_empty) {
                return Err(refused(format!("an empty cell of {}", keys[column].path)));
            }
            rows.push(row);
        }
        match rows.is_empty() {
            true => Err(failed("a header of keys and a design a row are needed")),
            false => Ok(Self { name: path.display().to_string(), keys, rows }),
        }
    }
}

/// Cells without the empty ones at their end, beyond the first `least`.
fn without_empty_end(mut cells: Vec<String>, least: usize) -> Vec<String> {
    let end = cells.iter().rposition(|cell| !cell.is_empty()).map_or(0, |last| last + 1);
    cells.truncate(end.max(least));
    cells
}

/// True for the units of keys.
fn is_unit(text: &str) -> bool {
    use beamlet_core::units::Dimension::*;
    let dimensions =
        [Length, Energy, Density, Angle, Attenuation, Voltage, Current, Time, Dose, Scattering];
    dimensions.iter().flat_map(|dimension| dimension.units()).any(|unit| unit == text)
}

/// The items of a list; commas within brackets or quotes do not separate.
pub(super) fn separate(text: &str) -> Vec<&str> {
    let (mut depth, mut is_quoted, mut from) = (0_i32, false, 0);
    let mut items = Vec::new();
    for (at, sign) in text.char_indices() {
        is_quoted ^= sign == '"' && !text[..at].ends_with('\\');
        if !is_quoted {
            depth += i32::from(matches!(sign, '[' | '{')) - i32::from(matches!(sign, ']' | '}'));
        }
        if sign == ',' && depth == 0 && !is_quoted {
            items.push(text[from..at].trim());
            from = at + 1;
        }
    }
    items.push(text[from..].trim());
    items
}

/// Number and unit of a text; "" is no unit, and the number of a text without one is the whole text.
fn quantity(text: &str) -> (&str, &str) {
    let end =
        text.find(|sign: char| sign.is_alphabetic() && !matches!(sign, 'e' | 'E') || sign == '°');
    let Some(end) = end else { return (text, "") };
    let (value, unit) = text.split_at(end);
    match number(value) {
        Some(_) => (value.trim(), unit.trim()),
        None => (text, ""),
    }
}

/// Values of a range by its ends and the number of values; the unit may stand behind any of them.
fn range([from, to, count]: [&str; 3]) -> std::result::Result<Vec<String>, String> {
    let [from, to, count] = [from, to, count].map(quantity);
    let units: Vec<&str> =
        [from.1, to.1, count.1].into_iter().filter(|it| !it.is_empty()).collect();
    if units.windows(2).any(|pair| pair[0] != pair[1]) {
        return Err("a range with two units".into());
    }
    let unit = units.first().copied().unwrap_or_default();
    let (Some(low), Some(high)) = (number(from.0), number(to.0)) else {
        return Err("ends that are no numbers".into());
    };
    let count = count.0.parse::<u32>().map_err(|_| format!("the count {:?}", count.0))?;
    let is_empty = count == 0 || (count > 1 && low.to_bits() == high.to_bits());
    if is_empty || !(low.is_finite() && high.is_finite()) {
        return Err("an empty range".into());
    }
    if count as usize > MOST {
        return Err(format!("{count} values, more than the {MOST} designs of a sweep"));
    }
    let decimals = DIGITS - numbers::whole::<i32>(low.abs().max(high.abs()).log10().floor());
    let unit_of_rounding = 10_f64.powi(decimals);
    let value = |index: u32| {
        let part = f64::from(index) / f64::from(count.max(2) - 1);
        let value = low + (high - low) * part;
        let value = (value * unit_of_rounding).round() / unit_of_rounding;
        format!("{value} {unit}").trim().to_owned()
    };
    Ok((0..count).map(value).collect())
}

/// The unit of values, and the values without it; "" where they have none or several. The unit of the last value holds
/// for numbers without one.
fn common_unit(items: &[String]) -> std::result::Result<(String, Vec<String>), String> {
    let parts: Vec<(&str, &str)> = items.iter().map(|item| quantity(item)).collect();
    let unit = parts.last().map_or("", |part| part.1);
    let is_common =
        |(value, own): &(&str, &str)| number(value).is_some() && (own.is_empty() || *own == unit);
    match unit.is_empty() {
        false if parts.iter().all(is_common) => {
            Ok((unit.to_owned(), parts.iter().map(|part| part.0.to_owned()).collect()))
        }
        _ => Ok((String::new(), items.to_vec())),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sets(vary: &[&str]) -> Vec<String> {
        let designs = Designs::of(&vary.iter().map(|text| (*text).to_owned()).collect::<Vec<_>>());
        let designs = designs.unwrap();
        (0..designs.count()).map(|design| designs.sets(design).join(" & ")).collect()
    }

    #[test]
    fn ranges_and_lists_become_overrides() {
        assert_eq!(sets(&["a.b=10:40:3 um"]), ["a.b=10 um", "a.b=25 um", "a.b=40 um"]);
        assert_eq!(sets(&["a=0.1:0.3:3 mm"]), ["a=0.1 mm", "a=0.2 mm", "a=0.3 mm"]);
        assert_eq!(sets(&["a=1 um:2um:2"]), ["a=1 um", "a=2 um"]);
        assert_eq!(sets(&["n=5:11:4"]), ["n=5", "n=7", "n=9", "n=11"]);
        assert_eq!(sets(&["n=1e3:1e4:2"]), ["n=1000", "n=10000"]);
        assert_eq!(
            sets(&["a=5, 7 um", "b=x,y"]),
            ["a=5 um & b=x", "a=5 um & b=y", "a=7 um & b=x", "a=7 um & b=y"]
        );
        assert_eq!(sets(&["p=[64,64],[32, 8]"]), ["p=[64,64]", "p=[32, 8]"]);
        assert_eq!(sets(&["d=1 mm, 90 um"]), ["d=1 mm", "d=90 um"]);
    }

    #[test]
    fn tables_have_keys_with_units_and_a_design_a_row() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("designs.csv");
        std::fs::write(&path, "# two\na.f[0].b [um],c\n5,x\n7, y\n").unwrap();
        let vary = [path.to_str().unwrap(), "d=1,2"];
        assert_eq!(
            sets(&vary),
            [
                "a.f[0].b=5 um & c=x & d=1",
                "a.f[0].b=5 um & c=x & d=2",
                "a.f[0].b=7 um & c=y & d=1",
                "a.f[0].b=7 um & c=y & d=2"
            ]
        );
        let designs = Designs::of(&vary.map(str::to_owned)).unwrap();
        assert_eq!(designs.axis(0), ("a.f[0].b [um]".to_owned(), vec![5.0, 7.0]));
        for text in ["a.f[0].b [um]\n5\n", "a.f[0].b[um],,\n5,,\n"] {
            std::fs::write(&path, text).unwrap();
            assert_eq!(sets(&vary[..1]), ["a.f[0].b=5 um"]);
        }
        std::fs::write(&path, "a,p[1]\n5,7\n").unwrap();
        assert_eq!(sets(&vary[..1]), ["a=5 & p[1]=7"]);
        for (text, words) in
            [("a,b\n5,\n", "line 2: an empty cell of b"), (",a\n0,5\n", "column 1 has no name")]
        {
            std::fs::write(&path, text).unwrap();
            let error = Designs::of(&vary.map(str::to_owned)).unwrap_err().to_string();
            assert!(error.contains(words), "{text}: {error}");
        }
    }

    #[test]
    fn wrong_texts_are_refused_with_their_key() {
        for (vary, words) in [
            ("a=1:2:0 um", "empty range"),
            ("a=1:1:3 um", "empty range"),
            ("a=1 um:2 mm:3", "two units"),
            ("a=1:2:x", "the count"),
            ("a=1:2:1000000000", "more than the 100000 designs"),
            ("a=1,,2", "an empty value"),
            ("=1,2", "no key"),
        ] {
            let error = Designs::of(&[vary.to_owned()]).unwrap_err().to_string();
            assert!(error.contains(words), "{vary}: {error}");
        }
        let vary = ["a=1:1000:1000", "b=1:1000:1000", "c=1:1000:1000"].map(str::to_owned);
        let error = Designs::of(&vary).unwrap_err().to_string();
        assert!(error.contains("1000000000 designs"), "{error}");
    }
}
