//! What is known of a pixel, and which pixels say most.

use super::{Subject, row_number};
use crate::failure::Failure;
use crate::numbers;
use crate::picture::curve::Fit;
use crate::picture::quantity::Quantity;
use crate::picture::text::measured;
use beamlet::stack::Maps;

impl Subject {
    /// The fitted curve of a pixel, of the flat or the sample, where the method fits one.
    pub(crate) fn fit(
        &self,
        of: &str,
        view: usize,
        [column, row]: [usize; 2],
    ) -> Result<Option<Fit>, Failure> {
        let names =
            ["amplitude", "centre", "width", "background"].map(|part| format!("{of}_{part}"));
        if !self.has_fits() || !names.iter().all(|name| self.has(name)) {
            return Ok(None);
        }
        let mut values = [0.0; 4];
        for (value, name) in values.iter_mut().zip(&names) {
            *value = f64::from(self.map(name, view)?[[row, column]]);
        }
        let [amplitude, centre, width, background] = values;
        let masks = self.record().and_then(|record| record.curve.clone());
        let fit = Fit { masks, amplitude, centre, width, background };
        Ok(values.iter().all(|value| value.is_finite()).then_some(fit))
    }

    /// What was retrieved in a pixel, a line each.
    pub(crate) fn words_of_pixel(
        &self,
        view: usize,
        [column, row]: [usize; 2],
    ) -> Result<Vec<String>, Failure> {
        let mut lines = Vec::new();
        let signs = [
            ("transmission", "T"),
            ("refraction", "α"),
            ("refraction_z", "α_z"),
            ("dark_field", "σ_DF²"),
            ("dark_field_z", "σ_zz"),
            ("dark_field_xz", "σ_xz"),
        ];
        for (name, sign) in signs.into_iter().filter(|(name, _)| self.has(name)) {
            let quantity = Quantity::of_map(name);
            let value = |name: &str| -> Result<f64, Failure> {
                Ok(f64::from(self.map(name, view)?[[row, column]]) * quantity.factor)
            };
            let sigma = self.sigma_of(name).map(|sigma| value(&sigma)).transpose()?;
            let text = match measured(value(name)?, sigma) {
                text if text.contains('±')
                    && !quantity.unit.is_empty()
                    && !text.starts_with('(') =>
                {
                    format!("({text})")
                }
                text => text,
            };
            lines.push(format!("{sign} = {text} {}", quantity.unit).trim_end().to_owned());
        }
        let counts = self.record().is_some_and(|record| record.counts);
        if !counts && self.has("residual_sample") {
            let left = f64::from(self.map("residual_sample", view)?[[row, column]]);
            lines.push(format!("misfit (rms residual): {:.2} % of open beam", 100.0 * left));
        }
        if self.has("flags") {
            let flags = numbers::whole::<u32>(f64::from(self.map("flags", view)?[[row, column]]));
            let words = self.flag_words(flags);
            lines.extend(
                words
                    .split("; ")
                    .filter(|word| !word.is_empty())
                    .map(|word| format!("flag: {}", word.split(':').next().unwrap_or_default())),
            );
        }
        Ok(lines)
    }

    /// The mask step at which the flat is brightest, by its middle rows; 0 without frames.
    pub(crate) fn brightest_step(&self) -> Result<usize, Failure> {
        let rows = self.row_count();
        let middle = rows / 2..(rows / 2 + 4).min(rows);
        let flat = match self.frames() {
            Some([flat, _]) => flat.rows(0, middle)?,
            None if self.has_fitted() => self.fitted_rows(None, middle)?,
            None => return Ok(0),
        };
        let sums: Vec<f32> = flat.outer_iter().map(|frame| frame.sum()).collect();
        let best = (0..sums.len()).max_by(|a, b| sums[*a].total_cmp(&sums[*b]));
        Ok(best.unwrap_or(0))
    }

    /// The column of a row that says most: where the sample deflects most among pixels without
    /// flags, or, where nothing is retrieved, where it changes the light most.
    pub(crate) fn striking_column(&self, view: usize, row: usize) -> Result<usize, Failure> {
        let [_, _, _, columns] = self.shape();
        let at = row_number(row)?;
        let mut merit = vec![0.0_f32; columns];
        if self.has("refraction") && view < self.maps().map_or(0, Maps::views) {
            let (angles, flags) = (self.map("refraction", view)?, self.flags(view)?);
            for (column, merit) in merit.iter_mut().enumerate() {
                let good = flags.as_ref().is_none_or(|flags| !flags.flagged[[row, column]]);
                *merit = if good { angles[[row, column]].abs() } else { 0.0 };
            }
        } else if self.has_fitted() {
            let flat = self.fitted_rows(None, at..at + 1)?;
            let sample = self.fitted_rows(Some(view), at..at + 1)?;
            let steps = flat.shape()[0].min(sample.shape()[0]);
            for (column, merit) in merit.iter_mut().enumerate() {
                let change = |s: usize| (flat[[s, 0, column]] - sample[[s, 0, column]]).abs();
                *merit = (0..steps).map(change).sum();
            }
        }
        // The middle, where no column stands out.
        let known = (0..columns).filter(|column| merit[*column] > 0.0);
        Ok(known.max_by(|a, b| merit[*a].total_cmp(&merit[*b])).unwrap_or(columns / 2))
    }
}
