//! Pictures of a run or of retrieved images: which are drawn, and of which view, step, row and
//! pixel.

mod corrections;
mod frames;
mod images;
mod lines;

use super::super::pictures::{PictureForm, Pictures};
use crate::args::{Show, ValueRange, ViewOfRun};
use crate::failure::Failure;
use crate::picture::image::Grid;
use crate::picture::quantity::Quantity;
use crate::picture::scale::Scale;
use crate::picture::text::short;
use crate::subject::Subject;
use beamlet::cli_support::require_memory;
use clap::ValueEnum;
use std::path::Path;

/// Bytes for each pixel of a frame or a sinogram that is drawn: values read, in the unit of the
/// picture, their flags and 1 sigma, and sorted for its scale; colours.
const OF_PIXEL: u64 = 96;
/// Bytes of a picture itself, which has about the same size whatever it shows.
const DRAWING: u64 = 48 << 20;

/// Draws the chosen pictures of a run or of retrieved images.
pub(super) fn of(path: &Path, asked: &ViewOfRun, form: PictureForm) -> Result<Pictures, Failure> {
    refuse_ignored(asked)?;
    if asked.slice.is_some() {
        return Err(Failure::Usage("--slice is for reconstructions".into()));
    }
    let run = Subject::open(path, asked.retrieved.as_deref())?;
    let [views, _, rows, columns] = run.shape().map(|side| side as u64);
    let largest = columns.saturating_mul(rows.max(views));
    require_memory(OF_PIXEL.saturating_mul(largest).saturating_add(DRAWING), "pictures of a run")?;
    refuse_unknown(&run, &asked.ranges)?;
    let chosen = Chosen::of(&run, asked)?;
    let wants = |what: Show| asked.show.is_empty() || asked.show.contains(&what);
    let has_maps = run.images().is_some();
    let needs_maps = asked.show.contains(&Show::Retrieved) || !asked.maps.is_empty();
    if needs_maps && !has_maps {
        return Err(run.not_retrieved());
    }
    let mut pictures = Pictures::new(form);
    if wants(Show::Frames) && (run.has_fitted() || asked.show.contains(&Show::Frames)) {
        chosen.draw_frames(&mut pictures)?;
    }
    if has_maps && (wants(Show::Retrieved) || !asked.maps.is_empty()) {
        chosen.draw_retrieved(&mut pictures, asked)?;
    }
    if has_maps && wants(Show::Retrieved) {
        chosen.draw_corrections(&mut pictures)?;
    }
    if wants(Show::Profiles) && (run.has_fitted() || run.maps().is_some()) {
        chosen.draw_profiles(&mut pictures)?;
    }
    // One step makes no curve.
    let is_asked = asked.show.contains(&Show::Curve) || asked.pixel.is_some();
    if wants(Show::Curve) && (run.shape()[1] > 1 && run.has_fitted() || is_asked) {
        chosen.draw_curve(&mut pictures)?;
    }
    if run.views() > 1 && wants(Show::Sinograms) {
        chosen.draw_sinograms(&mut pictures, asked)?;
    } else if asked.show.contains(&Show::Sinograms) {
        let problem = format!("--show sinograms: {} has one view", kind(&run));
        return Err(Failure::Usage(problem));
    }
    Ok(pictures)
}

/// Refuses options that none of the pictures to be drawn takes.
fn refuse_ignored(asked: &ViewOfRun) -> Result<(), Failure> {
    use Show::{Curve, Frames, Profiles, Retrieved, Sinograms};
    let options: [(&str, bool, &[Show]); 5] = [
        ("--view", asked.view.is_some(), &[Frames, Retrieved, Profiles, Curve]),
        ("--step", asked.step.is_some(), &[Frames, Profiles, Sinograms]),
        ("--row", asked.row.is_some(), &[Profiles, Curve, Sinograms]),
        ("--pixel", asked.pixel.is_some(), &[Profiles, Curve, Sinograms]),
        ("--range", !asked.ranges.is_empty(), &[Frames, Retrieved, Sinograms]),
    ];
    for (option, given, takers) in options {
        // Named maps are drawn beside the chosen pictures.
        let drawn = |show: &Show| {
            asked.show.contains(show) || (matches!(show, Retrieved) && !asked.maps.is_empty())
        };
        if given && !asked.show.is_empty() && !takers.iter().any(drawn) {
            let names: Vec<String> = takers
                .iter()
                .filter_map(|show| Some(show.to_possible_value()?.get_name().to_owned()))
                .collect();
            let problem = format!("{option} needs --show {}", names.join(", "));
            return Err(Failure::Usage(problem));
        }
    }
    Ok(())
}

/// Refuses ranges of what there is not.
fn refuse_unknown(run: &Subject, ranges: &[ValueRange]) -> Result<(), Failure> {
    let of_frames = ["intensity", "counts"];
    let names: Vec<&str> = of_frames
        .into_iter()
        .chain(run.images().into_iter().flat_map(|maps| maps.names()))
        .collect();
    match ranges.iter().find(|range| !names.contains(&range.name.as_str())) {
        Some(ValueRange { name, .. }) => {
            let problem = format!("--range {name}: allowed: {}", names.join(", "));
            Err(Failure::Usage(problem))
        }
        None => Ok(()),
    }
}

/// Its name in a message.
fn kind(run: &Subject) -> &'static str {
    if run.run().is_some() { "the run" } else { "the retrieval" }
}

/// A run, and which of its views, steps, rows and pixels are drawn.
struct Chosen<'a> {
    run: &'a Subject,
    ranges: &'a [ValueRange],
    grid: Grid,
    view: usize,
    step: usize,
    row: usize,
    pixel: [usize; 2],
}

impl<'a> Chosen<'a> {
    fn of(run: &'a Subject, asked: &'a ViewOfRun) -> Result<Self, Failure> {
        let [_, steps, rows, columns] = run.shape();
        let what_has = kind(run);
        let within = |key: &str, found: Option<u32>, count: usize, what: &str| match found {
            Some(number) if number as usize >= count => Err(Failure::Usage(format!(
                "{key} {number}: {what_has} has {count} {what}, 0 to {}",
                count.saturating_sub(1)
            ))),
            found => Ok(found.map(|number| number as usize)),
        };
        let views = if run.run().is_some() { "committed views" } else { "views" };
        let view = within("--view", asked.view, run.views(), views)?.unwrap_or(0);
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
        let grid = run.grid();
        Ok(Self { run, ranges: &asked.ranges, grid, view, step, row, pixel })
    }

    /// The scale of the options, or else the picture's own.
    fn scale<'v>(
        &self,
        name: &str,
        quantity: &Quantity,
        values: impl Iterator<Item = &'v f64>,
        own: impl FnOnce() -> Scale,
    ) -> Scale {
        // The last one given counts.
        let range = self.ranges.iter().rev().find(|range| range.name == name);
        match range {
            Some(range) => Scale::between(quantity.map, range.ends, values.copied()),
            None => own(),
        }
    }

    /// Mask offset of the chosen step, in words.
    fn at_step(&self) -> String {
        match self.run.offsets().get(self.step) {
            Some(offset) => {
                let offset = short(round_off(1e6 * offset));
                format!("mask step {} (offset {offset} µm)", self.step)
            }
            None => format!("mask step {}", self.step),
        }
    }

    fn at_view(&self) -> String {
        match (self.run.views(), &self.run.angles()[..]) {
            (1, [] | [_]) => String::new(),
            (_, []) => format!("view {}", self.view),
            (_, angles) => {
                let angle = angles.get(self.view).map_or(0.0, |angle| angle.to_degrees());
                format!("view {} ({}°)", self.view, short(round_off(angle)))
            }
        }
    }
}

/// Takes the rounding of units off a number.
fn round_off(value: f64) -> f64 {
    (value * 1e6).round() / 1e6
}
