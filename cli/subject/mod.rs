//! What pictures and reports are of: a run with its retrieved images, or retrieved images alone,
//! with the measured stacks that they come from where these are still there.

mod flags;
mod open;
mod pixel;

use crate::failure::Failure;
use crate::numbers;
use crate::picture::image::Grid;
use crate::picture::quantity::Quantity;
use crate::picture::text::joined;
use beamlet::retrieve::{Input, Method, Record};
use beamlet::scene::Scene;
use beamlet::stack::{Maps, OpenRun, StackFile};
pub(crate) use flags::trusted;
use ndarray::{Array2, Array3};
use std::ops::Range;
use std::path::{Path, PathBuf};

/// A run with its retrieved images, or retrieved images alone.
#[derive(Debug)]
pub(crate) struct Subject {
    /// The path on the command line.
    path: PathBuf,
    /// Directory of the retrieved images, whether it is there or not.
    retrieved: PathBuf,
    run: Option<OpenRun>,
    /// Intensities of a run: flat and sample.
    frames: Option<[StackFile; 2]>,
    maps: Option<Maps>,
    /// Images with a column per beamlet or dithered pixel, which have no pixels.
    beamlets: Option<Maps>,
    /// retrieved.json.
    record: Option<Record>,
    /// Input of the retrieval, made or possible.
    fitted: Option<Input>,
    /// Why that is not there.
    without: Option<String>,
    scene: Option<Scene>,
    /// Views, steps, rows, columns.
    shape: [usize; 4],
}

impl Subject {
    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    /// The run; `None` where there are retrieved images alone.
    pub(crate) const fn run(&self) -> Option<&OpenRun> {
        self.run.as_ref()
    }

    /// Why the frames that the images were retrieved from are not shown, where they are not.
    pub(crate) fn without(&self) -> Option<&str> {
        self.without.as_deref()
    }

    /// The resolved scene of a run, or the geometry of measured stacks where it was kept.
    pub(crate) const fn scene(&self) -> Option<&Scene> {
        self.scene.as_ref()
    }

    /// Title of the scene; empty where it has none.
    pub(crate) fn title(&self) -> String {
        let of_scene = self.scene.as_ref().and_then(|scene| scene.title.clone());
        let of_record = || self.record.as_ref().and_then(|record| record.title.clone());
        of_scene.or_else(of_record).unwrap_or_default()
    }

    /// Intensities of a run: flat and sample.
    pub(crate) const fn frames(&self) -> Option<&[StackFile; 2]> {
        self.frames.as_ref()
    }

    /// Detector numbers of a run: flat and sample.
    pub(crate) fn counts(&self) -> Result<Option<[StackFile; 2]>, Failure> {
        let Some(run) = &self.run else { return Ok(None) };
        Ok(run.counts_flat()?.zip(run.counts_sample()?).map(|(flat, sample)| [flat, sample]))
    }

    pub(crate) const fn maps(&self) -> Option<&Maps> {
        self.maps.as_ref()
    }

    /// Images with a column per beamlet.
    pub(crate) const fn beamlets(&self) -> Option<&Maps> {
        self.beamlets.as_ref()
    }

    /// Images of pixels or of beamlets, whichever there are.
    pub(crate) fn images(&self) -> Option<&Maps> {
        self.maps.as_ref().or(self.beamlets.as_ref())
    }

    /// retrieved.json.
    pub(crate) const fn record(&self) -> Option<&Record> {
        self.record.as_ref()
    }

    /// Views (committed ones of a run), steps, rows, columns.
    pub(crate) const fn shape(&self) -> [usize; 4] {
        self.shape
    }

    pub(crate) const fn views(&self) -> usize {
        self.shape[0]
    }

    /// Rows of the frames.
    pub(crate) fn row_count(&self) -> u32 {
        numbers::count(self.shape[2])
    }

    /// Mask offsets, m.
    pub(crate) fn offsets(&self) -> &[f64] {
        match (&self.run, &self.record, &self.scene) {
            (None, Some(record), _) => &record.offsets,
            (_, _, Some(scene)) => &scene.scan.mask_offsets,
            _ => &[],
        }
    }

    /// Mask offsets as the centres of curves count them, m: without whole periods of the sample
    /// mask.
    pub(crate) fn curve_offsets(&self) -> Vec<f64> {
        let periods = self.record.as_ref().map_or(0.0, |record| record.whole_periods);
        self.offsets().iter().map(|offset| offset - periods).collect()
    }

    /// Angles of the views, rad; none where the geometry does not say which they are.
    pub(crate) fn angles(&self) -> Vec<f64> {
        let Some(scene) = &self.scene else { return Vec::new() };
        match self.run.is_some() || scene.scan.views() == self.views() {
            true => (0..scene.scan.views()).map(|view| scene.scan.angle_of(view)).collect(),
            false if scene.scan.angles.len() == self.views() => scene.scan.angles.clone(),
            false => Vec::new(),
        }
    }

    /// Positions of the pixels of frames and images.
    pub(crate) fn grid(&self) -> Grid {
        let [_, _, rows, columns] = self.shape;
        Grid::of_pixels(self.pitch(), [rows, columns])
    }

    /// Size of a pixel of frames and images, x and z, m.
    pub(crate) fn pitch(&self) -> Option<[f64; 2]> {
        let of_scene = self.scene.as_ref().map(|scene| scene.detector.pitch);
        self.fitted.as_ref().map(Input::pitch).or(of_scene)
    }

    /// What to do where there are no retrieved images.
    pub(crate) fn not_retrieved(&self) -> Failure {
        let problem = match &self.record {
            Some(_) => "holds images per beamlet, which cannot be drawn on pixels".to_owned(),
            None => format!(
                "does not exist; `beamlet retrieve {}` makes it",
                beamlet::cli_support::printed::path(&self.path)
            ),
        };
        Failure::File { path: self.retrieved.clone(), problem }
    }

    /// A retrieved image of a view, in the file's unit.
    pub(crate) fn map(&self, name: &str, view: usize) -> Result<Array2<f32>, Failure> {
        self.map_of(self.maps.as_ref(), name, view)
    }

    /// As [`Subject::map`], of pixels or of beamlets, whichever there are.
    pub(crate) fn image(&self, name: &str, view: usize) -> Result<Array2<f32>, Failure> {
        self.map_of(self.images(), name, view)
    }

    fn map_of(&self, maps: Option<&Maps>, name: &str, view: usize) -> Result<Array2<f32>, Failure> {
        let maps = maps.ok_or_else(|| self.not_retrieved())?;
        if view >= maps.views() {
            return Err(Failure::File {
                path: self.retrieved.clone(),
                problem: format!(
                    "has {} views, but view {view} was requested; retrieve the run again",
                    maps.views()
                ),
            });
        }
        Ok(maps.map(name, view)?)
    }

    /// True if there is a retrieved image of pixels.
    pub(crate) fn has(&self, name: &str) -> bool {
        self.maps.as_ref().is_some_and(|maps| maps.names().any(|found| found == name))
    }

    /// Name of the image of the 1 sigma of another, where values have noise.
    pub(crate) fn sigma_of(&self, name: &str) -> Option<String> {
        let sigma = format!("{name}_sigma");
        let there = |maps: &Maps| maps.names().any(|found| found == sigma);
        self.images().is_some_and(there).then_some(sigma)
    }

    /// How the images were retrieved, in words.
    pub(crate) fn method_words(&self) -> String {
        let Some(record) = &self.record else { return String::new() };
        let weights = match record.weights.as_str() {
            "" => String::new(),
            weights => format!("weights {weights}"),
        };
        let values = if record.counts { "counts" } else { "intensities" };
        joined(&[format!("method {}", record.method), weights, format!("from {values}")])
    }

    /// True if the run has detector numbers, and was retrieved from its intensities.
    pub(crate) fn has_unused_counts(&self) -> bool {
        let counts = self.record.as_ref().is_none_or(|record| record.counts);
        let run = self.run.as_ref();
        !counts && run.is_some_and(|run| run.scene().detector.counts.is_some())
    }

    /// Quantity of the values of [`Subject::fitted_rows`].
    pub(crate) fn fitted_quantity(&self) -> Quantity {
        match self.fitted.as_ref().is_some_and(Input::counts) {
            true => Quantity { label: "detector number less dark".into(), ..Quantity::counts() },
            false => Quantity::intensity(),
        }
    }

    /// True if there are frames that the images were, or would be, retrieved from.
    pub(crate) const fn has_fitted(&self) -> bool {
        self.fitted.is_some()
    }

    /// Rows of the flat (`None`) or of a view, `[step][row][column]`, as they were fitted:
    /// intensities, or detector numbers less the dark.
    pub(crate) fn fitted_rows(
        &self,
        view: Option<usize>,
        rows: Range<u32>,
    ) -> Result<Array3<f32>, Failure> {
        let fitted = self.fitted.as_ref().ok_or_else(|| self.no_frames())?;
        Ok(match view {
            Some(view) => fitted.sample_rows(view, rows)?,
            None => fitted.flat_rows(0, rows)?,
        })
    }

    /// Why frames cannot be shown.
    pub(crate) fn no_frames(&self) -> Failure {
        let problem = self.without.clone().unwrap_or_else(|| "has no frames".into());
        Failure::File { path: self.path.clone(), problem }
    }

    /// True if the images hold curves that were fitted: Gaussians, or curves of the masks.
    pub(crate) fn has_fits(&self) -> bool {
        let gaussian = [Method::Gaussian, Method::ThreeStep];
        let method = self.record.as_ref().map(|record| record.method.as_str());
        // A curve of steps along x and z is a surface, of which a line over x says too little.
        let is_surface = self.record.as_ref().is_some_and(|record| !record.offsets_z.is_empty());
        let is_gaussian = gaussian.iter().any(|known| method == Some(known.name()));
        let has_curve = self.record.as_ref().is_some_and(|record| record.curve.is_some());
        self.maps.is_some() && (is_gaussian || has_curve) && !is_surface
    }

    /// Meanings of the bits of a flag, separated by semicolons; empty without any.
    pub(crate) fn flag_words(&self, flags: u32) -> String {
        let meanings = self.record.iter().flat_map(|record| &record.flags);
        let set = meanings.filter(|(bit, _)| flags & **bit != 0);
        set.map(|(_, meaning)| meaning.as_str()).collect::<Vec<_>>().join("; ")
    }
}

/// A row as stacks count them.
pub(crate) fn row_number(row: usize) -> Result<u32, Failure> {
    u32::try_from(row).map_err(|_| Failure::Usage(format!("row {row}: a frame has fewer rows")))
}
