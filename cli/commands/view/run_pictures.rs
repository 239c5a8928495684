//! Pictures of a run: frames, retrieved images, profiles, curves, sinograms.

use super::super::pictures::Pictures;
use crate::args::{Show, ViewOfRun};
use crate::failure::Failure;
use crate::picture::colour::Scale;
use crate::picture::curve::{self, CurvePlot};
use crate::picture::image::{self, Words};
use crate::picture::profile::{self, Panel, ProfileLine};
use crate::picture::quantity::Quantity;
use crate::picture::text::short;
use crate::run_reader::{RunReader, row_number};
use beamlet::require_memory;
use beamlet::stack::StackFile;
use clap::ValueEnum;
use ndarray::Array2;
use std::path::Path;

/// Images that are drawn where none are named.
const CONTRASTS: [&str; 3] = ["transmission", "refraction", "dark_field"];

/// Bytes for each pixel of a frame or a sinogram that is drawn: values read, in the unit of the
/// picture, and sorted for its scale; colours.
const OF_PIXEL: u64 = 48;
/// Bytes of a picture itself, which has about the same size whatever it shows.
const DRAWING: u64 = 48 << 20;

/// Draws what is asked of a run.
pub(super) fn of(path: &Path, asked: &ViewOfRun) -> Result<Pictures, Failure> {
    refuse_ignored(asked)?;
    let run = RunReader::open(path)?;
    let [views, _, rows, columns] = run.shape().map(|side| side as u64);
    let largest = columns.saturating_mul(rows.max(views));
    require_memory(OF_PIXEL.saturating_mul(largest).saturating_add(DRAWING), "pictures of a run")?;
    let chosen = Chosen::of(&run, asked)?;
    let wants = |what: Show| asked.show.is_empty() || asked.show.contains(&what);
    let has_maps = run.maps().or(run.beamlets()).is_some();
    let needs_maps = asked.show.contains(&Show::Retrieved) || !asked.maps.is_empty();
    if needs_maps && !has_maps {
        return Err(run.not_retrieved());
    }
    let mut pictures = Pictures::default();
    if wants(Show::Frames) {
        chosen.frames(&mut pictures)?;
    }
    if has_maps && (wants(Show::Retrieved) || !asked.maps.is_empty()) {
        chosen.retrieved(&mut pictures, asked)?;
    }
    if wants(Show::Profiles) {
        chosen.profiles(&mut pictures)?;
    }
    // One step makes no curve.
    let is_asked = asked.show.contains(&Show::Curve) || asked.pixel.is_some();
    if wants(Show::Curve) && (run.shape()[1] > 1 || is_asked) {
        chosen.curve(&mut pictures)?;
    }
    if run.views() > 1 && wants(Show::Sinograms) {
        chosen.sinograms(&mut pictures, asked)?;
    } else if asked.show.contains(&Show::Sinograms) {
        return Err(Failure::Usage("--show sinograms: the run has one view".into()));
    }
    Ok(pictures)
}

/// Refuses options that none of the pictures to be drawn takes.
fn refuse_ignored(asked: &ViewOfRun) -> Result<(), Failure> {
    use Show::{Curve, Frames, Profiles, Retrieved, Sinograms};
    let options: [(&str, bool, &[Show]); 4] = [
        ("--view", asked.view.is_some(), &[Frames, Retrieved, Profiles, Curve]),
        ("--step", asked.step.is_some(), &[Frames, Profiles, Sinograms]),
        ("--row", asked.row.is_some(), &[Profiles, Curve, Sinograms]),
        ("--pixel", asked.pixel.is_some(), &[Profiles, Curve, Sinograms]),
    ];
    for (option, given, takers) in options {
        // Maps that are named are drawn beside what is shown.
        let drawn = |show: &Show| {
            asked.show.contains(show) || (matches!(show, Retrieved) && !asked.maps.is_empty())
        };
        if given && !asked.show.is_empty() && !takers.iter().any(drawn) {
            let names: Vec<String> = takers
                .iter()
                .filter_map(|show| Some(show.to_possible_value()?.get_name().to_owned()))
                .collect();
            let problem = format!("{option} belongs to --show {}", names.join(", "));
            return Err(Failure::Usage(problem));
        }
    }
    Ok(())
}

/// A run, and which of its views, steps, rows and pixels are drawn.
struct Chosen<'a> {
    run: &'a RunReader,
    view: usize,
    step: usize,
    row: usize,
    pixel: [usize; 2],
}

impl<'a> Chosen<'a> {
    fn of(run: &'a RunReader, asked: &ViewOfRun) -> Result<Self, Failure> {
        let [_, steps, rows, columns] = run.shape();
        let within = |key: &str, found: Option<u32>, count: usize, what: &str| match found {
            Some(number) if number as usize >= count => Err(Failure::Usage(format!(
                "{key} {number}: the run has {count} {what}, 0 to {}",
                count - 1
            ))),
            found => Ok(found.map(|number| number as usize)),
        };
        let view = within("--view", asked.view, run.views(), "committed views")?.unwrap_or(0);
        let step = within("--step", asked.step, steps, "mask steps")?;
        let row = within("--row", asked.row, rows, "rows")?;
        let pixel = match asked.pixel {
            None => None,
            Some([column, row]) => {
                let name = format!("--pixel {column},{row}: column");
                let at = within(&name, Some(column), columns, "columns")?.unwrap_or(0);
                let name = format!("--pixel {column},{row}: row");
                Some([at, within(&name, Some(row), rows, "rows")?.unwrap_or(0)])
            }
        };
        let row = row.unwrap_or_else(|| pixel.map_or(rows / 2, |[_, row]| row));
        let step = match step {
            Some(step) => step,
            None => run.brightest_step()?,
        };
        let pixel = match pixel {
            Some(pixel) => pixel,
            None => [run.striking_column(view, row)?, row],
        };
        Ok(Self { run, view, step, row, pixel })
    }

    /// Mask offset of the chosen step, in words.
    fn at_step(&self) -> String {
        let offset = 1e6 * self.run.scene().scan.mask_offsets[self.step];
        format!("mask step {} (offset {} µm)", self.step, short(round_off(offset)))
    }

    fn at_view(&self) -> String {
        let angle = self.run.scene().scan.angles[self.view].to_degrees();
        match self.run.scene().scan.angles.len() {
            1 => String::new(),
            _ => format!("view {} ({}°)", self.view, short(round_off(angle))),
        }
    }

    fn frames(&self, pictures: &mut Pictures) -> Result<(), Failure> {
        let counts = (self.run.counts_flat()?, self.run.counts_sample()?);
        let pairs = [
            ("", Some(self.run.flat()), Some(self.run.sample()), Quantity::intensity()),
            ("counts_", counts.0.as_ref(), counts.1.as_ref(), Quantity::counts()),
        ];
        for (prefix, flat, sample, quantity) in pairs {
            let (Some(flat), Some(sample)) = (flat, sample) else { continue };
            let flat = self.frame(flat, 0)?;
            let sample = self.frame(sample, self.view)?;
            // One scale, so that the two can be compared.
            let scale = Scale::of(quantity.map, flat.iter().chain(&sample).copied());
            let step = self.step;
            let name = match prefix {
                "" => "",
                _ => "detector numbers, ",
            };
            let words = Words {
                title: format!("Flat {name}").trim_end().trim_end_matches(',').into(),
                note: self.at_step(),
            };
            let drawing = image::draw(self.run.scene(), flat.view(), &quantity, &scale, &words);
            pictures.add(format!("{prefix}flat_step_{step:03}.png"), &drawing)?;
            let note = joined(&[self.at_view(), self.at_step()]);
            let title = match prefix {
                "" => "With the sample",
                _ => "With the sample, detector numbers",
            };
            let words = Words { title: title.into(), note };
            let drawing = image::draw(self.run.scene(), sample.view(), &quantity, &scale, &words);
            let view = self.view;
            pictures.add(format!("{prefix}sample_view_{view:04}_step_{step:03}.png"), &drawing)?;
        }
        Ok(())
    }

    fn frame(&self, stack: &StackFile, view: usize) -> Result<Array2<f64>, Failure> {
        let rows = stack.row_count();
        Ok(stack.frame(view, self.step, 0..rows)?.mapv(f64::from))
    }

    fn retrieved(&self, pictures: &mut Pictures, asked: &ViewOfRun) -> Result<(), Failure> {
        for name in self.names(asked) {
            let quantity = Quantity::of_map(&name);
            let values = self.run.image(&name, self.view)?.mapv(|v| f64::from(v) * quantity.factor);
            let scale = Scale::of(quantity.map, values.iter().copied());
            let note = joined(&[self.at_view(), self.run.method_words(), clipped(&scale)]);
            let words = Words { title: capital(&quantity.label), note };
            let draw = match self.run.beamlets() {
                Some(_) => image::of_beamlets,
                None => image::draw,
            };
            let drawing = draw(self.run.scene(), values.view(), &quantity, &scale, &words);
            pictures.add(format!("{name}_view_{:04}.png", self.view), &drawing)?;
        }
        Ok(())
    }

    /// Names of the images to draw.
    fn names(&self, asked: &ViewOfRun) -> Vec<String> {
        if !asked.maps.is_empty() {
            return asked.maps.clone();
        }
        let maps = self.run.maps().or(self.run.beamlets());
        let there: Vec<&str> = maps.map_or(Vec::new(), |maps| maps.names().collect());
        let contrasts = CONTRASTS.iter().filter(|name| there.contains(name));
        contrasts.map(|name| (*name).to_owned()).collect()
    }

    fn profiles(&self, pictures: &mut Pictures) -> Result<(), Failure> {
        let [_, _, _, columns] = self.run.shape();
        let row = row_number(self.row)?;
        let line = |stack: &StackFile, view: usize| -> Result<Vec<f64>, Failure> {
            let frame = stack.frame(view, self.step, row..row + 1)?;
            Ok(frame.iter().map(|value| f64::from(*value)).collect())
        };
        let named = |name: &str, values| ProfileLine { name: name.into(), values, sigma: None };
        let mut panels = vec![Panel {
            label: "intensity".into(),
            lines: vec![
                named("flat", line(self.run.flat(), 0)?),
                named("with the sample", line(self.run.sample(), self.view)?),
            ],
            zero: false,
        }];
        let there: Vec<&str> = self.run.maps().map_or(Vec::new(), |maps| maps.names().collect());
        for name in CONTRASTS.iter().filter(|name| there.contains(name)) {
            let quantity = Quantity::of_map(name);
            let along = |name: &str| -> Result<Vec<f64>, Failure> {
                let map = self.run.map(name, self.view)?;
                Ok(map.row(self.row).iter().map(|v| f64::from(*v) * quantity.factor).collect())
            };
            let sigma = format!("{name}_sigma");
            let sigma = match there.contains(&sigma.as_str()) {
                true => Some(along(&sigma)?),
                false => None,
            };
            panels.push(Panel {
                label: quantity.words(),
                lines: vec![ProfileLine { name: String::new(), values: along(name)?, sigma }],
                zero: *name != "transmission",
            });
        }
        let [low, high] = image::mm(self.run.scene(), 0);
        let step = (high - low) / columns as f64;
        let x: Vec<f64> = (0..columns).map(|c| low + step * (c as f64 + 0.5)).collect();
        let title = format!("Row {}", self.row);
        let title = joined(&[title, self.at_view(), self.at_step()]);
        let drawing = profile::draw(&title, &x, "x on the detector [mm]", &panels);
        let (view, row) = (self.view, self.row);
        pictures.add(format!("profile_view_{view:04}_row_{row:04}.png"), &drawing)
    }

    fn curve(&self, pictures: &mut Pictures) -> Result<(), Failure> {
        let [column, row] = self.pixel;
        let at = row_number(row)?;
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
        if self.run.beamlets().is_some() {
            notes.push("no fit: retrieved per beamlet".into());
        } else if self.run.maps().is_none() {
            notes.push("no fit: the run is not retrieved yet".into());
            notes.push("(beamlet retrieve)".into());
        }
        let title = format!("Illumination curves of column {column}, row {row}");
        let title = joined(&[title, self.at_view()]);
        let label = self.run.fitted_quantity().label;
        let offsets = &self.run.scene().scan.mask_offsets;
        let drawing = curve::draw([&title, &label], offsets, &curves, &notes);
        let view = self.view;
        let name = format!("curve_view_{view:04}_column_{column:04}_row_{row:04}.png");
        pictures.add(name, &drawing)
    }

    fn sinograms(&self, pictures: &mut Pictures, asked: &ViewOfRun) -> Result<(), Failure> {
        let [_, _, _, columns] = self.run.shape();
        let views = self.run.views();
        // Rows of pixels; beamlets have none.
        let names = match self.run.maps() {
            Some(_) => self.names(asked),
            None => Vec::new(),
        };
        let row = row_number(self.row)?;
        if names.is_empty() {
            let mut values = Array2::zeros((views, columns));
            for (view, mut line) in values.outer_iter_mut().enumerate() {
                let frame = self.run.sample().frame(view, self.step, row..row + 1)?;
                line.assign(&frame.row(0).mapv(f64::from));
            }
            let words = (format!("Sinogram of row {row}"), self.at_step());
            return self.sinogram(pictures, "intensity", &Quantity::intensity(), &values, words);
        }
        for name in names {
            let quantity = Quantity::of_map(&name);
            let mut values = Array2::zeros((views, columns));
            for (view, mut line) in values.outer_iter_mut().enumerate() {
                let map = self.run.map(&name, view)?;
                line.assign(&map.row(self.row).mapv(|v| f64::from(v) * quantity.factor));
            }
            let words = (format!("Sinogram of row {row}: {}", quantity.label), String::new());
            self.sinogram(pictures, &name, &quantity, &values, words)?;
        }
        Ok(())
    }

    fn sinogram(
        &self,
        pictures: &mut Pictures,
        name: &str,
        quantity: &Quantity,
        values: &Array2<f64>,
        (title, note): (String, String),
    ) -> Result<(), Failure> {
        let scale = Scale::of(quantity.map, values.iter().copied());
        let words = Words { title, note: joined(&[note, clipped(&scale)]) };
        let scene = self.run.scene();
        let drawing = image::sinogram(scene, values.view(), quantity, &scale, &words);
        pictures.add(format!("sinogram_{name}_row_{:04}.png", self.row), &drawing)
    }
}

/// What was cut off the scale, in words.
fn clipped(scale: &Scale) -> String {
    match scale.beyond.contains(&true) {
        true => "outermost 2 % beyond the colours".into(),
        false => String::new(),
    }
}

fn joined(parts: &[String]) -> String {
    let parts: Vec<&str> =
        parts.iter().map(String::as_str).filter(|part| !part.is_empty()).collect();
    parts.join(" · ")
}

fn capital(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
}

/// Takes the rounding of units off a number.
fn round_off(value: f64) -> f64 {
    (value * 1e6).round() / 1e6
}
