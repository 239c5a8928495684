//! Pixels that are kept of frames: columns at a step (masks of several pixels per period), sums of
//! neighbours, and the place of each column.

use super::Input;
use super::correction::LEFT_OUT;
use beamlet_core::{Error, Result, numbers};
use beamlet_model::optics::Optics;
use beamlet_model::scene::Scene;
use ndarray::{Array2, Array3, Axis};
use std::fmt;
use std::ops::Range;
use std::str::FromStr;

/// Difference of a projected period from whole pixels that is rounding, share of the period.
const WHOLE: f64 = 1e-4;

/// Columns of a frame, `START:END:STEP` counted from 0, the end excluded.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub struct Columns {
    /// First column.
    pub start: usize,
    /// Column behind the last; `None`: the end of the frame.
    pub end: Option<usize>,
    /// From column to column, 1 or more.
    pub step: usize,
}

impl Columns {
    /// Reads `START:END:STEP`; omitted parts are 0, the end of the frame, and 1.
    ///
    /// # Errors
    /// [`Error::Argument`] for other words, an end before the start, and a step of 0.
    pub fn parse(text: &str) -> Result<Self> {
        let refused = || {
            let allowed = "START:END:STEP, columns from 0, the end excluded, as 1::2 or 10:300";
            Error::argument("columns", format!("{text:?}"), allowed)
        };
        let words: Vec<&str> = text.split(':').map(str::trim).collect();
        let number = |at: usize| match words.get(at) {
            None | Some(&"") => Ok(None),
            Some(word) => usize::from_str(word).map(Some).map_err(|_| refused()),
        };
        let columns =
            Self { start: number(0)?.unwrap_or(0), end: number(1)?, step: number(2)?.unwrap_or(1) };
        let is_empty = columns.end.is_some_and(|end| end <= columns.start);
        if !(2..=3).contains(&words.len()) || columns.step == 0 || is_empty {
            return Err(refused());
        }
        Ok(columns)
    }
}

impl fmt::Display for Columns {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let end = self.end.map_or(String::new(), |end| end.to_string());
        write!(f, "{}:{end}:{}", self.start, self.step)
    }
}

/// Pixels that are kept of a frame.
#[derive(Debug, Clone)]
pub(super) struct Selection {
    /// Columns that are kept, where not all are.
    columns: Option<Columns>,
    /// Columns and rows that are added to one.
    bin: [usize; 2],
    /// Neighbouring columns whose values are points of one curve.
    group: usize,
    /// Rows and columns of the whole frame.
    whole: [usize; 2],
}

impl Selection {
    /// All pixels of a frame of these rows and columns; groups of columns form curves.
    pub(super) const fn whole(frame: [usize; 2], group: usize) -> Self {
        Self { columns: None, bin: [1, 1], group, whole: frame }
    }

    /// The same pixels of these columns alone.
    pub(super) const fn of_columns(self, columns: Columns) -> Self {
        Self { columns: Some(columns), ..self }
    }

    /// Numbers of the columns that are kept.
    fn chosen(&self) -> impl Iterator<Item = usize> {
        let all = self.whole[1];
        let Columns { start, end, step } =
            self.columns.unwrap_or(Columns { start: 0, end: None, step: 1 });
        (start..end.unwrap_or(all).min(all)).step_by(step)
    }

    /// Rows and columns that are kept.
    pub(super) fn frame(&self) -> [usize; 2] {
        [self.whole[0] / self.bin[1], self.chosen().count() / self.bin[0] / self.group]
    }

    /// True if every pixel is kept.
    const fn is_whole(&self) -> bool {
        self.columns.is_none() && self.bin[0] * self.bin[1] * self.group == 1
    }

    /// Rows of the files for these rows.
    pub(super) fn rows(&self, rows: &Range<u32>) -> Range<u32> {
        let height = numbers::count(self.bin[1]);
        rows.start * height..rows.end * height
    }

    /// Values of the pixels that are kept, `[step][row][column]` from rows of the files: sums of counts,
    /// means of intensities. One that is left out or has no value leaves its sum out, or without one. Columns of
    /// a group are steps, each step of the files followed by the next.
    pub(super) fn of(&self, data: Array3<f32>, counts: bool) -> Array3<f32> {
        if self.is_whole() {
            return data;
        }
        if self.group > 1 {
            let (steps, rows, columns) = data.dim();
            let group = self.group;
            let shape = (steps * group, rows, columns / group);
            return Array3::from_shape_fn(shape, |(step, row, column)| {
                data[[step / group, row, column * group + step % group]]
            });
        }
        let [across, down] = self.bin;
        let columns: Vec<usize> = self.chosen().collect();
        let (steps, rows, _) = data.dim();
        let share = if counts { 1.0 } else { 1.0 / (across * down) as f64 };
        let shape = (steps, rows / down, columns.len() / across);
        Array3::from_shape_fn(shape, |(step, row, column)| {
            let mut sum = 0.0;
            for row in row * down..(row + 1) * down {
                for column in &columns[column * across..(column + 1) * across] {
                    let value = data[[step, row, *column]];
                    if value >= LEFT_OUT {
                        return LEFT_OUT;
                    }
                    sum += f64::from(value);
                }
            }
            numbers::single(share * sum)
        })
    }

    /// Pixels that are kept of which one is set.
    pub(super) fn of_mask(&self, mask: &Array2<bool>) -> Array2<bool> {
        let values = mask.mapv(|set| f32::from(u8::from(set))).insert_axis(Axis(0));
        self.of(values, true).sum_axis(Axis(0)).mapv(|count| count > 0.0)
    }

    /// Places of the columns that are kept, from those of the frame, each with the width of its light: sums
    /// lie at the centre of their light.
    fn places(&self, all: &[[f64; 2]]) -> Vec<f64> {
        let chosen: Vec<[f64; 2]> = self.chosen().filter_map(|at| all.get(at).copied()).collect();
        chosen.chunks_exact(self.bin[0] * self.group).map(centre_of_lights).collect()
    }
}

/// Centre of the light of columns, from the place of each and the width of its light.
#[must_use]
pub fn centre_of_lights(lights: &[[f64; 2]]) -> f64 {
    if let [[place, _]] = lights {
        return *place;
    }
    let width: f64 = lights.iter().map(|[_, width]| width).sum();
    match width > 0.0 {
        true => lights.iter().map(|[place, share]| place * share).sum::<f64>() / width,
        false => lights.iter().map(|[place, _]| place).sum::<f64>() / lights.len() as f64,
    }
}

/// Columns behind the apertures of masks with one aperture every few pixels (skipped masks): where both masks are
/// so, and the others lie behind bars. `None` where every column has light, or apertures lie otherwise.
pub(super) fn lit_columns(scene: &Scene) -> Option<Columns> {
    let optics = Optics::of(scene);
    let (first, second) = (optics.sample_mask.as_ref()?, optics.detector_mask.as_ref()?);
    let periods =
        [first, second].map(|mask| mask.openings_in_columns(&optics.detector, 0.0).period[0]);
    let step = periods[0].round();
    let is_whole = periods.iter().all(|period| (period - step).abs() < WHOLE * step);
    if step < 2.0 || !is_whole || scene.group() > 1 {
        return None;
    }
    let step = numbers::whole::<usize>(step);
    let lights = optics.column_lights();
    let start = lights.iter().position(|[_, width]| *width > 0.0)?;
    let expected = |at: usize| at >= start && (at - start).is_multiple_of(step);
    let fits = lights.iter().enumerate().all(|(at, [_, width])| (*width > 0.0) == expected(at));
    fits.then_some(Columns { start, end: None, step })
}

/// Columns of a frame of a scene by column of its images: groups of them behind masks with shifts, those behind
/// slits of skipped masks, else each alone. Beamlets have columns of their own.
#[must_use]
pub fn columns_of_images(scene: &Scene) -> Vec<Vec<usize>> {
    let frame = scene.detector.pixels.map(|count| count as usize);
    let mut selection = Selection::whole([frame[1], frame[0]], scene.group());
    if let Some(columns) = lit_columns(scene) {
        selection = selection.of_columns(columns);
    }
    let chosen: Vec<usize> = selection.chosen().collect();
    chosen.chunks_exact(selection.group).map(<[usize]>::to_vec).collect()
}

impl Input {
    /// Keeps these columns of the frames, then adds `bin` columns and rows of them to one: sums of
    /// counts, means of intensities. Columns at the end that fill no bin are left out.
    ///
    /// # Errors
    /// [`Error::Argument`] where nothing is left, and where rows do not fill their bins.
    pub fn with_selection(
        mut self,
        columns: Option<Columns>,
        bin: Option<[usize; 2]>,
    ) -> Result<Self> {
        let [rows, all] = self.whole_frame();
        let group = self.selection.group;
        if group > 1 && (columns.is_some() || bin.is_some()) {
            let name = if columns.is_some() { "columns" } else { "bin" };
            let allowed = format!("every pixel: masks with shifts make groups of {group} columns");
            return Err(Error::argument(name, "a part of the pixels", allowed));
        }
        if columns.is_none() && bin.is_none() {
            return Ok(self);
        }
        self.selection =
            Selection { columns, bin: bin.unwrap_or([1, 1]), group, whole: [rows, all] };
        let [across, down] = self.selection.bin;
        if let Some(found) = columns
            && (found.start >= all || found.end.is_some_and(|end| end > all))
        {
            let allowed = format!("columns from 0 to {all}, the end excluded");
            return Err(Error::argument("columns", found.to_string(), allowed));
        }
        let kept = self.selection.chosen().count();
        if across == 0 || down == 0 || across > kept || down > rows {
            let allowed = format!("1 to {kept} columns and 1 to {rows} rows");
            return Err(Error::argument("bin", format!("{across},{down}"), allowed));
        }
        if !rows.is_multiple_of(down) {
            let allowed = format!("a number that divides {rows} rows");
            return Err(Error::argument("bin", format!("{down} rows"), allowed));
        }
        if !kept.is_multiple_of(across) {
            log::info!("{} columns at the end fill no bin and are left out", kept % across);
        }
        Ok(self)
    }

    /// Columns that are kept, and those and rows that are added to one, where not all pixels are kept.
    pub(crate) fn selection(&self) -> (Option<Columns>, Option<[usize; 2]>) {
        let bin = self.selection.bin;
        (self.selection.columns, (bin != [1, 1]).then_some(bin))
    }

    /// All pixels of the frames, each with values of its own.
    #[must_use]
    pub const fn whole(mut self) -> Self {
        self.selection = Selection::whole(self.whole_frame(), 1);
        self
    }

    /// Columns that are kept; `None`: all.
    #[must_use]
    pub const fn kept_columns(&self) -> Option<Columns> {
        self.selection.columns
    }

    /// Neighbouring columns whose values are points of one curve: 1 without shifts of the masks.
    #[must_use]
    pub const fn group(&self) -> usize {
        self.selection.group
    }

    /// Pixels whose values are added.
    pub(crate) const fn added(&self) -> usize {
        if self.counts { self.selection.bin[0] * self.selection.bin[1] } else { 1 }
    }

    /// Places of the columns, x from the optical axis on the detector, m, from the scene's columns.
    pub(in crate::retrieve) fn columns_m(&self) -> Vec<f64> {
        self.selection.places(&Optics::of(&self.scene).column_lights())
    }

    /// The scene with the rows of the images.
    pub(in crate::retrieve) fn image_scene(&self) -> Scene {
        let mut scene = self.scene.clone();
        let down = self.selection.bin[1];
        scene.detector.pixels[1] /= numbers::count(down);
        scene.detector.pitch[1] *= down as f64;
        scene
    }

    /// Size of a pixel of the images, x and z, m.
    #[must_use]
    pub fn pitch(&self) -> [f64; 2] {
        let [across, down] = self.selection.bin;
        let step = self.selection.columns.map_or(1, |columns| columns.step);
        let [x, z] = self.scene.detector.pitch;
        [x * (step * across * self.selection.group) as f64, z * down as f64]
    }
}
