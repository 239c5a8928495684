//! Profiles along a row, and the illumination curves of a pixel.

use super::Chosen;
use crate::commands::pictures::Pictures;
use crate::failure::Failure;
use crate::picture::curve::{self, CurvePlot};
use crate::picture::profile::{self, Panel, ProfileLine};
use crate::picture::quantity::{CONTRASTS, Quantity};
use crate::picture::text::joined;
use crate::subject::row_number;

impl Chosen<'_> {
    pub(super) fn draw_profiles(&self, pictures: &mut Pictures) -> Result<(), Failure> {
        let [_, _, _, columns] = self.run.shape();
        let row = row_number(self.row)?;
        let mut panels = Vec::new();
        // Numbers of the detector where the contrasts below come from these.
        let counts = self.run.record().is_some_and(|record| record.counts);
        let frames = self.run.frames().filter(|_| !counts);
        if self.run.has_fitted() {
            let line = |name: &str, view: Option<usize>| -> Result<ProfileLine, Failure> {
                let values = match (frames, view) {
                    (Some([flat, _]), None) => flat.frame(0, self.step, row..row + 1)?,
                    (Some([_, sample]), Some(view)) => {
                        sample.frame(view, self.step, row..row + 1)?
                    }
                    (None, view) => {
                        let rows = self.run.fitted_rows(view, row..row + 1)?;
                        let step = self.step.min(rows.shape()[0] - 1);
                        rows.index_axis_move(ndarray::Axis(0), step)
                    }
                };
                let values = values.iter().map(|value| f64::from(*value)).collect();
                Ok(ProfileLine { name: name.into(), values, sigma: None })
            };
            let label = match frames {
                Some(_) => "intensity".into(),
                None => self.run.fitted_quantity().label,
            };
            panels.push(Panel {
                label,
                lines: vec![line("flat", None)?, line("with the sample", Some(self.view))?],
                zero: false,
                flagged: Vec::new(),
                band: String::new(),
            });
        }
        panels.extend(self.contrast_panels()?);
        let (x, label) = self.grid.across(columns);
        let title = joined(&[format!("Row {}", self.row), self.at_view(), self.run.title()]);
        let words = if self.run.maps().is_some() { self.run.method_words() } else { String::new() };
        let step = if self.run.has_fitted() { self.at_step() } else { String::new() };
        let note = joined(&[step, words]);
        let drawing = profile::draw([&title, &note], &x, label, &panels);
        let (view, row) = (self.view, self.row);
        pictures.add(format!("profile_view_{view:04}_row_{row:04}"), &drawing)
    }

    /// A panel for each contrast of the row.
    fn contrast_panels(&self) -> Result<Vec<Panel>, Failure> {
        let flags = match self.run.maps() {
            Some(_) => self.run.flags(self.view)?,
            None => None,
        };
        let flagged = flags.map_or(Vec::new(), |flags| flags.flagged.row(self.row).to_vec());
        let mut panels = Vec::new();
        for name in CONTRASTS.iter().filter(|name| self.run.has(name)) {
            let quantity = Quantity::of_map(name);
            let along = |name: &str| -> Result<Vec<f64>, Failure> {
                let map = self.run.map(name, self.view)?;
                Ok(map.row(self.row).iter().map(|v| f64::from(*v) * quantity.factor).collect())
            };
            let sigma = self.run.sigma_of(name).map(|sigma| along(&sigma)).transpose()?;
            let sigma_there = sigma.is_some();
            panels.push(Panel {
                label: quantity.words(),
                lines: vec![ProfileLine { name: String::new(), values: along(name)?, sigma }],
                zero: *name != "transmission",
                flagged: flagged.clone(),
                band: if sigma_there { "± 1σ".into() } else { String::new() },
            });
        }
        Ok(panels)
    }

    pub(super) fn draw_curve(&self, pictures: &mut Pictures) -> Result<(), Failure> {
        let [column, row] = self.pixel;
        let at = row_number(row)?;
        let offsets = self.run.curve_offsets();
        let values = |view: Option<usize>| -> Result<Vec<f64>, Failure> {
            let rows = self.run.fitted_rows(view, at..at + 1)?;
            Ok(rows.outer_iter().map(|frame| f64::from(frame[[0, column]])).collect())
        };
        let fit = |of: &str| self.run.fit(of, self.view, self.pixel);
        let curves = [
            CurvePlot { name: "flat".into(), values: values(None)?, fit: fit("flat")? },
            CurvePlot {
                name: "with the sample".into(),
                values: values(Some(self.view))?,
                fit: fit("sample")?,
            },
        ];
        let mut notes = self.run.words_of_pixel(self.view, self.pixel)?;
        notes.extend(
            self.run.method_words().split(" · ").filter(|w| !w.is_empty()).map(str::to_owned),
        );
        if self.run.beamlets().is_some() {
            notes.push("no fit: retrieved per beamlet".into());
        } else if self.run.maps().is_none() {
            notes.push("no fit: the run is not retrieved yet".into());
            notes.push("(beamlet retrieve)".into());
        }
        let title = format!("Illumination curves of column {column}, row {row}");
        let title = joined(&[title, self.at_view()]);
        let label = self.run.fitted_quantity().label;
        let drawing = curve::draw([&title, &self.run.title(), &label], &offsets, &curves, &notes);
        let view = self.view;
        pictures.add(format!("curve_view_{view:04}_column_{column:04}_row_{row:04}"), &drawing)
    }
}
