//! Spectrum files: rows of energy in keV and weight in photons, separated by commas, semicolons,
//! tabs or blanks.
//!
//! Lines that begin with `#` and empty lines are comments. A first line of words is a header: it
//! has to name the columns `energy_keV` and `weight`, in any order; without one they are the
//! two columns of the file. SpekPy's text export (a commented header, then energy, photons per keV, and
//! the part of the lines) is such a file as it is: its rows are equally wide.

use std::path::Path;

use super::Spectrum;
use beamlet_core::csv_table::{self, cells};
use beamlet_core::error::{Error, Place, Result};
use beamlet_core::{input_file, units};

/// Least sum of weights: with less, products of weights lose their digits.
const LEAST: f64 = 1e-300;
/// Most rows of a file.
const ROWS: usize = 1_000_000;
/// Most rows of a spectrum: 4 eV each for one up to 60 keV.
const JOINED: usize = 16_384;
const COLUMNS: [&str; 2] = ["energy_keV", "weight"];
/// Comment in the exports of SpekPy, whose columns are known.
const SPEKPY: &str = "# spekpy version";

pub(super) fn read(path: &Path) -> Result<Spectrum> {
    let text = input_file::text(path)
        .map_err(|error| Error::file(path, "cannot read the spectrum", Some(error)))?;
    let mut spectrum = Spectrum { energies_kev: Vec::new(), weights: Vec::new() };
    let mut order = None;
    for (index, line) in text.lines().enumerate() {
        let row = Row { path, number: index + 1, line };
        let fields = row.fields();
        if fields.is_empty() || fields[0].starts_with('#') {
            continue;
        }
        let [energy, weight] = match order {
            Some(order) => order,
            None if units::number(fields[0]).is_some() => {
                if fields.len() > COLUMNS.len() && !text.contains(SPEKPY) {
                    let found = format!("{} columns without names", fields.len());
                    let allowed = "two columns, or a header with energy_keV (the middle of each bin) and weight";
                    return Err(row.error("header", &found, allowed));
                }
                *order.insert([0, 1])
            }
            None => {
                order = Some(row.header(&fields)?);
                continue;
            }
        };
        let energy = row.number(&fields, energy, COLUMNS[0], "an energy above 0 in keV")?;
        let weight = row.number(&fields, weight, COLUMNS[1], "a number of photons, 0 or more")?;
        if energy <= 0.0 {
            return Err(row.error(COLUMNS[0], fields[0], "an energy above 0 in keV"));
        }
        if spectrum.energies_kev.last().is_some_and(|last| *last >= energy) {
            return Err(row.error(COLUMNS[0], fields[0], "energies in ascending order"));
        }
        if spectrum.weights.len() == ROWS {
            let found = format!("more than {ROWS} rows");
            return Err(row.error("spectrum", &found, "up to a million rows"));
        }
        spectrum.energies_kev.push(energy);
        spectrum.weights.push(weight);
    }
    let end = Row { path, number: text.lines().count().max(1), line: "" };
    if spectrum.energies_kev.is_empty() {
        return Err(end.error("spectrum", "no rows", "at least one row: energy_keV, weight"));
    }
    let total = spectrum.total();
    if total <= LEAST || !total.is_finite() {
        let found = format!("weights that sum to {total:?}");
        return Err(end.error(COLUMNS[1], &found, "a finite sum above 1e-300"));
    }
    Ok(joined(spectrum))
}

/// Neighbouring rows of a long table as one, of their photons at their mean energy: constants
/// change less over some electronvolts than tables resolve.
fn joined(spectrum: Spectrum) -> Spectrum {
    let group = spectrum.weights.len().div_ceil(JOINED);
    if group <= 1 {
        return spectrum;
    }
    let groups = spectrum.energies_kev.chunks(group).zip(spectrum.weights.chunks(group));
    let join = |(energies, weights): (&[f64], &[f64])| {
        let sum: f64 = weights.iter().sum();
        let mean = energies.iter().zip(weights).map(|(e, w)| e * (w / sum)).sum();
        let middle = energies[energies.len() / 2];
        (if sum > 0.0 { mean } else { middle }, sum)
    };
    let (energies_kev, weights) = groups.map(join).unzip();
    Spectrum { energies_kev, weights }
}

/// A line of the file.
struct Row<'a> {
    path: &'a Path,
    number: usize,
    line: &'a str,
}

impl<'a> Row<'a> {
    /// Cells; empty ones count with separators other than a blank.
    fn fields(&self) -> Vec<&'a str> {
        match self.line.trim() {
            line if line.starts_with('#') => Vec::new(),
            line => cells(line),
        }
    }

    /// Position of each of `COLUMNS`.
    fn header(&self, fields: &[&str]) -> Result<[usize; 2]> {
        let mut order = [0; 2];
        for (slot, column) in order.iter_mut().zip(COLUMNS) {
            let found = csv_table::column(fields, column).map_err(|again| {
                self.error(column, &format!("{again} twice"), "each column once")
            })?;
            *slot = found.ok_or_else(|| {
                self.error(column, fields[0], "numbers, or a header with energy_keV and weight")
            })?;
        }
        Ok(order)
    }

    /// A number that is finite and not negative.
    fn number(&self, fields: &[&str], index: usize, key: &str, allowed: &str) -> Result<f64> {
        let field = fields.get(index).copied().unwrap_or("nothing");
        match units::number(field) {
            Some(number) if number.is_finite() && number >= 0.0 => Ok(number),
            _ => Err(self.error(key, field, allowed)),
        }
    }

    fn error(&self, key: &str, found: &str, allowed: &str) -> Error {
        let place = Place::of_word(self.path, self.number, self.line, found);
        Error::scene_at(place, key, found, allowed)
    }
}
