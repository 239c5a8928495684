//! A run directory as pictures and reports see it: frames, retrieved images where there are
//! some, and what they say of a pixel.

use crate::failure::Failure;
use crate::numbers;
use crate::picture::curve::Fit;
use crate::picture::quantity::Quantity;
use crate::picture::text::{rough, short};
use beamlet::retrieve::{Input, Method, Record};
use beamlet::scene::Scene;
use beamlet::stack::{Maps, OpenRun, StackFile};
use ndarray::{Array2, Array3};
use std::ops::Range;
use std::path::Path;

/// Directory of the retrieved images in a run.
const RETRIEVED: &str = "retrieved";

/// A run with its retrieved images.
#[derive(Debug)]
pub(crate) struct RunReader {
    run: OpenRun,
    flat: StackFile,
    sample: StackFile,
    maps: Option<Maps>,
    /// Images with a column per beamlet, which stand on no pixels.
    beamlets: Option<Maps>,
    /// retrieved.json.
    record: Option<Record>,
    /// What was retrieved from, or would be.
    fitted: Input,
}

impl RunReader {
    /// Opens a run. Retrieved images that are there must be whole and fit the run.
    pub(crate) fn open(path: &Path) -> Result<Self, Failure> {
        let run = OpenRun::open(path)?;
        let (flat, sample) = (run.flat()?, run.sample()?);
        let directory = path.join(RETRIEVED);
        let (mut record, mut maps, mut beamlets) = (None, None, None);
        if directory.is_dir() {
            let found = Maps::open(&directory)?;
            let stored = Record::read(&directory.join("retrieved.json"))?;
            let first = found.names().next().map(str::to_owned).unwrap_or_default();
            let (rows, columns) = found.map(&first, 0)?.dim();
            let [_, _, run_rows, run_columns] = sample.shape();
            let of_beamlets = stored.method == Method::Beamlet.name();
            let differs = (rows, columns) != (run_rows, run_columns);
            if differs && !of_beamlets || found.views() > sample.shape()[0] {
                return Err(Failure::File {
                    path: directory,
                    problem: format!(
                        "holds {} views of {columns} x {rows} pixels; the run has {} of \
                         {run_columns} x {run_rows}",
                        found.views(),
                        sample.shape()[0]
                    ),
                });
            }
            *(if of_beamlets { &mut beamlets } else { &mut maps }) = Some(found);
            record = Some(stored);
        }
        let counts = record.as_ref().is_some_and(|record: &Record| record.counts);
        let fitted = Input::of_run(&run, counts)?;
        Ok(Self { run, flat, sample, maps, beamlets, record, fitted })
    }

    pub(crate) const fn run(&self) -> &OpenRun {
        &self.run
    }

    pub(crate) const fn scene(&self) -> &Scene {
        self.run.scene()
    }

    pub(crate) const fn flat(&self) -> &StackFile {
        &self.flat
    }

    pub(crate) const fn sample(&self) -> &StackFile {
        &self.sample
    }

    pub(crate) fn counts_flat(&self) -> Result<Option<StackFile>, Failure> {
        Ok(self.run.counts_flat()?)
    }

    pub(crate) fn counts_sample(&self) -> Result<Option<StackFile>, Failure> {
        Ok(self.run.counts_sample()?)
    }

    pub(crate) const fn maps(&self) -> Option<&Maps> {
        self.maps.as_ref()
    }

    /// retrieved.json.
    pub(crate) const fn record(&self) -> Option<&Record> {
        self.record.as_ref()
    }

    /// Committed views, steps, rows, columns.
    pub(crate) const fn shape(&self) -> [usize; 4] {
        self.sample.shape()
    }

    /// Rows of the frames.
    pub(crate) fn row_count(&self) -> u32 {
        self.sample.row_count()
    }

    pub(crate) const fn views(&self) -> usize {
        self.sample.shape()[0]
    }

    /// What to do where there are no retrieved images.
    pub(crate) fn not_retrieved(&self) -> Failure {
        let problem = match &self.record {
            Some(_) => "holds images of beamlets, which are not drawn on pixels".to_owned(),
            None => {
                format!(
                    "is not there; `beamlet retrieve {}` makes it",
                    beamlet::printed::path(self.run.path())
                )
            }
        };
        Failure::File { path: self.run.path().join(RETRIEVED), problem }
    }

    /// A retrieved image of a view, in the file's unit.
    pub(crate) fn map(&self, name: &str, view: usize) -> Result<Array2<f32>, Failure> {
        self.map_of(self.maps.as_ref(), name, view)
    }

    /// As [`RunReader::map`], of pixels or of beamlets, whichever there are.
    pub(crate) fn image(&self, name: &str, view: usize) -> Result<Array2<f32>, Failure> {
        self.map_of(self.maps.as_ref().or(self.beamlets.as_ref()), name, view)
    }

    /// Images with a column per beamlet.
    pub(crate) const fn beamlets(&self) -> Option<&Maps> {
        self.beamlets.as_ref()
    }

    fn map_of(&self, maps: Option<&Maps>, name: &str, view: usize) -> Result<Array2<f32>, Failure> {
        let maps = maps.ok_or_else(|| self.not_retrieved())?;
        if view >= maps.views() {
            return Err(Failure::File {
                path: self.run.path().join(RETRIEVED),
                problem: format!(
                    "has {} views, and view {view} is requested; retrieve the run again",
                    maps.views()
                ),
            });
        }
        Ok(maps.map(name, view)?)
    }

    fn has(&self, name: &str) -> bool {
        self.maps.as_ref().is_some_and(|maps| maps.names().any(|found| found == name))
    }

    /// How the images were retrieved, in words.
    pub(crate) fn method_words(&self) -> String {
        match &self.record {
            Some(record) => format!("method {}", record.method),
            None => String::new(),
        }
    }

    /// What the values of [`RunReader::fitted_rows`] are.
    pub(crate) fn fitted_quantity(&self) -> Quantity {
        match self.fitted.counts() {
            true => Quantity { label: "detector number less dark".into(), ..Quantity::counts() },
            false => Quantity::intensity(),
        }
    }

    /// Rows of the flat (`None`) or of a view, `[step][row][column]`, as they were fitted:
    /// intensities, or detector numbers less the dark.
    pub(crate) fn fitted_rows(
        &self,
        view: Option<usize>,
        rows: Range<u32>,
    ) -> Result<Array3<f32>, Failure> {
        Ok(match view {
            Some(view) => self.fitted.sample_rows(view, rows)?,
            None => self.fitted.flat_rows(rows)?,
        })
    }

    /// Whether the images hold Gaussians that were fitted to the curves.
    pub(crate) fn has_gaussians(&self) -> bool {
        let gaussian = [Method::Gaussian, Method::ThreeStep, Method::TwoStep];
        let method = self.record.as_ref().map(|record| record.method.as_str());
        self.maps.is_some() && gaussian.iter().any(|known| method == Some(known.name()))
    }

    /// What the bits of a flag say, separated by semicolons; empty where there are none.
    pub(crate) fn flag_words(&self, flags: u32) -> String {
        let meanings = self.record.iter().flat_map(|record| &record.flags);
        let set = meanings.filter(|(bit, _)| flags & **bit != 0);
        set.map(|(_, meaning)| meaning.as_str()).collect::<Vec<_>>().join("; ")
    }

    /// The fitted curve of a pixel, of the flat or the sample, where the method fits one.
    pub(crate) fn fit(
        &self,
        of: &str,
        view: usize,
        [column, row]: [usize; 2],
    ) -> Result<Option<Fit>, Failure> {
        let names =
            ["amplitude", "centre", "width", "background"].map(|part| format!("{of}_{part}"));
        if !self.has_gaussians() || !names.iter().all(|name| self.has(name)) {
            return Ok(None);
        }
        let mut values = [0.0; 4];
        for (value, name) in values.iter_mut().zip(&names) {
            *value = f64::from(self.map(name, view)?[[row, column]]);
        }
        let [amplitude, centre, width, background] = values;
        let fit = Fit { amplitude, centre, width, background };
        Ok(values.iter().all(|value| value.is_finite()).then_some(fit))
    }

    /// What was retrieved in a pixel, a line each.
    pub(crate) fn words_of_pixel(
        &self,
        view: usize,
        [column, row]: [usize; 2],
    ) -> Result<Vec<String>, Failure> {
        let mut lines = Vec::new();
        let signs = [("transmission", "T"), ("refraction", "α"), ("dark_field", "σ²")];
        for (name, sign) in signs.into_iter().filter(|(name, _)| self.has(name)) {
            let quantity = Quantity::of_map(name);
            let value = |name: &str| -> Result<f64, Failure> {
                Ok(f64::from(self.map(name, view)?[[row, column]]) * quantity.factor)
            };
            let sigma = format!("{name}_sigma");
            let spread = match self.has(&sigma) {
                true => format!(" ± {}", rough(value(&sigma)?)),
                false => String::new(),
            };
            lines.push(
                format!("{sign} = {}{spread} {}", short(value(name)?), quantity.unit)
                    .trim_end()
                    .to_owned(),
            );
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

    /// The mask step at which the flat is brightest, by its middle rows.
    pub(crate) fn brightest_step(&self) -> Result<usize, Failure> {
        let rows = self.flat.row_count();
        let middle = self.flat.rows(0, rows / 2..(rows / 2 + 4).min(rows))?;
        let sums: Vec<f32> = middle.outer_iter().map(|frame| frame.sum()).collect();
        let best = (0..sums.len()).max_by(|a, b| sums[*a].total_cmp(&sums[*b]));
        Ok(best.unwrap_or(0))
    }

    /// The column of a row that says most: where the sample deflects most among pixels without
    /// flags, or, where nothing is retrieved, where it changes the light most.
    pub(crate) fn striking_column(&self, view: usize, row: usize) -> Result<usize, Failure> {
        let [_, _, _, columns] = self.shape();
        let at = row_number(row)?;
        let mut merit = vec![0.0_f32; columns];
        if self.has("refraction") && view < self.maps.as_ref().map_or(0, Maps::views) {
            let (angles, flags) = (self.map("refraction", view)?, self.has("flags"));
            let flags = if flags { Some(self.map("flags", view)?) } else { None };
            for (column, merit) in merit.iter_mut().enumerate() {
                let good = flags.as_ref().is_none_or(|flags| flags[[row, column]] == 0.0);
                *merit = if good { angles[[row, column]].abs() } else { 0.0 };
            }
        } else {
            let flat = self.flat.rows(0, at..at + 1)?;
            let sample = self.sample.rows(view, at..at + 1)?;
            for (column, merit) in merit.iter_mut().enumerate() {
                let steps = 0..flat.shape()[0];
                *merit = steps.map(|s| (flat[[s, 0, column]] - sample[[s, 0, column]]).abs()).sum();
            }
        }
        // The middle, where no column stands out.
        let known = (0..columns).filter(|column| merit[*column] > 0.0);
        Ok(known.max_by(|a, b| merit[*a].total_cmp(&merit[*b])).unwrap_or(columns / 2))
    }
}

/// A row as stacks count them.
pub(crate) fn row_number(row: usize) -> Result<u32, Failure> {
    u32::try_from(row).map_err(|_| Failure::Usage(format!("row {row}: a frame has fewer rows")))
}
