//! Symmetric spots from tables: `radius_um,value` is the brightness of a round spot;
//! `position_um,value` the spot's line spread, the same along x and z.
//!
//! Rows ascend from the centre outwards, are joined by straight lines, and beyond the last one
//! there is no light. Cells are separated by commas, semicolons, tabs or blanks; lines that begin
//! with `#` and empty lines are comments.

use super::Spot;
use beamlet_core::csv_table::{cells, column};
use beamlet_core::{Error, Place, Result, input_file, units};
use ndarray::Array2;
use std::path::Path;

const VALUE: &str = "value";
/// Samples of the spot a side, and of each of them.
const SIDE: u32 = 121;
const WITHIN: u32 = 5;

impl Spot {
    /// Reads a symmetric profile.
    ///
    /// # Errors
    /// [`Error::File`] where the file cannot be read; [`Error::Scene`] with the line for other
    /// columns, positions that do not ascend from 0 or above, values below 0, or none above.
    pub(crate) fn read_profile(path: &Path) -> Result<Self> {
        let text = input_file::text(path)
            .map_err(|error| Error::file(path, "cannot read the profile", Some(error)))?;
        let profile = MeasuredProfile::parse(path, &text)?;
        let mut spot = profile.spot()?;
        if let Some(fit) = &mut spot.fit {
            fit.file = path.display().to_string();
        }
        Ok(spot)
    }
}

struct MeasuredProfile {
    /// Position from the centre in um and value.
    rows: Vec<[f64; 2]>,
    round: bool,
}

impl MeasuredProfile {
    fn parse(path: &Path, text: &str) -> Result<Self> {
        let refuse = |line: usize, key: &str, found: &str, allowed: &str| {
            Error::scene_at(Place::of_word(path, line, "", ""), key, found, allowed)
        };
        let columns = "the columns radius_um,value or position_um,value";
        let mut rows: Vec<[f64; 2]> = Vec::new();
        let mut header: Option<(bool, [usize; 2])> = None;
        for (index, line) in text.lines().enumerate() {
            let line = line.trim();
            if line.is_empty() || line.starts_with('#') {
                continue;
            }
            let cells = cells(line);
            let Some((round, order)) = header else {
                let at = |name: &str| {
                    column(&cells, name).map_err(|again| {
                        refuse(index + 1, name, &format!("{again} twice"), "each column once")
                    })
                };
                header = match (at("radius_um")?, at("position_um")?, at(VALUE)?) {
                    (Some(place), None, Some(value)) => Some((true, [place, value])),
                    (None, Some(place), Some(value)) => Some((false, [place, value])),
                    _ => return Err(refuse(index + 1, "header", line, columns)),
                };
                continue;
            };
            let number = |i: usize, allowed: &str| {
                let found = cells.get(order[i]).copied().unwrap_or("nothing");
                let key = [if round { "radius_um" } else { "position_um" }, VALUE][i];
                match units::number(found) {
                    Some(number) if number.is_finite() && number >= 0.0 => Ok(number),
                    _ => Err(refuse(index + 1, key, found, allowed)),
                }
            };
            let outwards = "ascending micrometres from 0 or above: the profile is symmetric";
            let row = [number(0, outwards)?, number(1, "a finite number >= 0")?];
            if rows.last().is_some_and(|last| last[0] >= row[0]) {
                return Err(refuse(index + 1, "radius_um", cells[order[0]], outwards));
            }
            rows.push(row);
        }
        let lines = text.lines().count().max(1);
        let Some((round, _)) = header else {
            return Err(refuse(lines, "header", "no rows", columns));
        };
        let lit = rows.iter().any(|row| row[1] > 0.0);
        if rows.len() < 2 || !lit {
            let found = format!("{} rows, {}", rows.len(), if lit { "lit" } else { "no light" });
            return Err(refuse(lines, VALUE, &found, "two rows or more, some above 0"));
        }
        Ok(Self { rows, round })
    }

    fn at(&self, distance: f64) -> f64 {
        let above = self.rows.partition_point(|row| row[0] < distance);
        match (above.checked_sub(1).map(|i| self.rows[i]), self.rows.get(above)) {
            (None, Some(first)) => first[1],
            (Some(a), Some(b)) => a[1] + (b[1] - a[1]) * (distance - a[0]) / (b[0] - a[0]),
            (_, None) => 0.0,
        }
    }

    /// The spot, sampled up to the last row.
    fn spot(&self) -> Result<Spot> {
        let widest = self.rows.last().map_or(0.0, |row| row[0]);
        let pixel = 2.0 * widest / f64::from(SIDE);
        let places: Vec<f64> = (0..SIDE * WITHIN)
            .map(|i| ((f64::from(i) + 0.5) / f64::from(WITHIN)) * pixel - widest)
            .collect();
        let side = SIDE as usize;
        let within = WITHIN as usize;
        let mut values = Array2::zeros((side, side));
        for (j, z) in places.iter().enumerate() {
            for (i, x) in places.iter().enumerate() {
                let value = if self.round {
                    self.at(libm::hypot(*x, *z))
                } else {
                    self.at(x.abs()) * self.at(z.abs())
                };
                values[[j / within, i / within]] += value;
            }
        }
        Spot::of_image(&values, [1e-6 * pixel; 2])
    }
}
