//! Inputs of a retrieval: a run of beamlet, or measured stacks with their geometry.

mod bad_pixels;
mod correction;
mod faults;
mod flats;
mod full_scale;
mod offsets;
mod omitted;
mod open;
mod reopened;
mod selection;
mod times;

use super::Method;
use beamlet_core::array_file::Format;
use beamlet_core::cancel::Aside;
use beamlet_core::printed::counted;
use beamlet_core::{Error, Result};
use beamlet_files::layout::GEOMETRY;
use beamlet_files::{FrameOrder, InputHashes, StackFile};
use beamlet_model::scene::{Scene, Transport};
use correction::{Correction, LEFT_OUT};
use full_scale::Largest;
use ndarray::Array3;
pub use offsets::offsets;
use selection::Selection;
pub use selection::{Columns, centre_of_lights, columns_of_images};
use std::collections::BTreeMap;
use std::ops::Range;
use std::path::PathBuf;

/// Stacks of flat and sample, and the scene whose geometry and offsets they have.
#[derive(Debug)]
pub struct Input {
    scene: Scene,
    flat: StackFile,
    sample: StackFile,
    /// Views between one flat and the next; `None` where there is one flat, or one for each view.
    flats_every: Option<u32>,
    correction: Correction,
    /// Largest values of flat and sample, of measured stacks.
    largest: [Largest; 2],
    selection: Selection,
    /// Mask steps of the files that are left out, ascending.
    omitted: Vec<usize>,
    /// Values of kept pixels from here on are left out.
    limit: Option<f32>,
    /// Detector number of one photon, and the noise of no light, where the scene has them.
    noise: Option<[f64; 2]>,
    counts: bool,
    /// The views are the first of the scene's; measured ones have angles where there are as many.
    is_run: bool,
    /// Everything that was read, files and folders, but for the run.
    read: Vec<PathBuf>,
    /// SHA-256 of the files of the run, by path.
    run: BTreeMap<String, String>,
    /// Files of each folder of measured frames, in their order.
    frames: BTreeMap<String, Vec<String>>,
    /// Warnings about the files.
    warnings: Vec<String>,
    /// Options that were given, by name, with their texts.
    options: BTreeMap<String, String>,
}

impl Input {
    /// Values as they are in the files.
    fn new(scene: Scene, flat: StackFile, sample: StackFile, read: Vec<PathBuf>) -> Self {
        let [_, _, rows, columns] = flat.shape();
        let mut selection = Selection::whole([rows, columns], scene.group());
        if let Some(columns) = selection::lit_columns(&scene) {
            selection = selection.of_columns(columns);
        }
        Self {
            scene,
            flat,
            sample,
            flats_every: None,
            correction: Correction::default(),
            largest: Default::default(),
            selection,
            omitted: Vec::new(),
            limit: None,
            noise: None,
            counts: false,
            is_run: false,
            read,
            run: BTreeMap::new(),
            frames: BTreeMap::new(),
            warnings: Vec::new(),
            options: BTreeMap::new(),
        }
    }

    /// Names other files that were read for it, such as the geometry, for the record.
    #[must_use]
    pub fn with_read(mut self, files: &[PathBuf]) -> Self {
        self.read.extend_from_slice(files);
        self
    }

    /// Enters the options that were given, for the record.
    pub(super) fn with_options(mut self, given: &BTreeMap<String, String>) -> Self {
        self.options.clone_from(given);
        self
    }

    /// Options that were given, by name, with their texts.
    pub(super) const fn options(&self) -> &BTreeMap<String, String> {
        &self.options
    }

    /// Begins to find the SHA-256 of everything that is read, by its path, while curves are fitted.
    pub(super) fn hashes(&self) -> Aside<Result<InputHashes>> {
        let (read, run) = (self.read.clone(), self.run.clone());
        Aside::begin(move |end| {
            let mut found = InputHashes::of(&read, end)?;
            found.hashes.extend(run);
            Ok(found)
        })
    }

    /// Leaves out values from here on, as they are in the files: before the dark is subtracted.
    /// `None` leaves it at what a run's scene says.
    #[must_use]
    pub const fn saturated_at(mut self, saturation: Option<f32>) -> Self {
        if saturation.is_some() {
            self.correction.saturation = saturation;
        }
        self
    }

    /// Variance of a number over its mean above the dark (the gain, times the excess noise of an
    /// integrating detector), and the standard deviation of one without light: those of a run's
    /// scene, `None` for measured stacks.
    #[must_use]
    pub const fn noise(&self) -> Option<[f64; 2]> {
        self.noise
    }

    /// The scene whose geometry and offsets the frames have.
    #[must_use]
    pub const fn scene(&self) -> &Scene {
        &self.scene
    }

    /// True if the values are detector numbers, and not intensities.
    #[must_use]
    pub const fn counts(&self) -> bool {
        self.counts
    }

    /// Warnings about the files.
    pub(super) fn warnings(&self) -> &[String] {
        &self.warnings
    }

    /// Warnings of stacks whose largest value is that of a full camera, after their rows were read.
    pub(super) fn full_scale(&self) -> impl Iterator<Item = String> {
        let stacks = [&self.flat, &self.sample].into_iter().zip(&self.largest);
        stacks.filter_map(|(stack, largest)| {
            let (value, count) = largest.full_scale()?;
            Some(format!(
                "{}: {count} values are {value}, and hardly any lies just below: the camera is saturated there, which makes \
                 transmission and dark field wrong; --saturation {value} leaves these values out",
                stack.path().display()
            ))
        })
    }

    /// A warning where a method fits the curve of ray optics to a run by waves.
    pub(super) fn other_optics(&self, method: Method) -> Option<String> {
        let by_waves = self.is_run && self.scene.sampling.transport == Transport::Wave;
        (by_waves && method == Method::ExactCurve).then(|| {
            "exact-curve fits the curve of ray optics to a run by waves, whose flat differs from it: angles are \
             up to 0.7 % too large (docs/waves.md, \"Refused\"); more steps within the curve reduce this"
                .into()
        })
    }

    /// True if these are stacks given beside a geometry, and not a run's.
    pub(super) const fn is_measured(&self) -> bool {
        !self.is_run
    }

    /// Files or folders of flat and sample.
    #[must_use]
    pub fn sources(&self) -> Vec<String> {
        [&self.flat, &self.sample].map(|stack| stack.path().display().to_string()).to_vec()
    }

    /// File or folder of the dark frames.
    #[must_use]
    pub(crate) fn dark_source(&self) -> Option<String> {
        self.correction.dark.as_ref().map(|dark| dark.path.display().to_string())
    }

    /// Files of each folder of measured frames, in their order, by the folder's path.
    #[must_use]
    pub const fn frames(&self) -> &BTreeMap<String, Vec<String>> {
        &self.frames
    }

    /// Order of the frames of the stacks.
    pub(super) const fn frame_order(&self) -> FrameOrder {
        self.sample.order()
    }

    /// Views and steps of the sample where its steps are those of the files; `None` where steps are left out, or columns of
    /// groups are points of curves.
    pub(super) const fn extent_of_files(&self) -> Option<[usize; 2]> {
        let [views, steps, ..] = self.sample.shape();
        if self.omitted.is_empty() && self.group() == 1 { Some([views, steps]) } else { None }
    }

    /// Files and folders of the stacks.
    pub(super) fn paths(&self) -> Vec<PathBuf> {
        [&self.flat, &self.sample].into_iter().flat_map(StackFile::places).collect()
    }

    /// Format of the sample's stack.
    #[must_use]
    pub fn format(&self) -> Format {
        self.sample.format()
    }

    /// Views of the sample.
    #[must_use]
    pub const fn views(&self) -> usize {
        self.sample.shape()[0]
    }

    /// True if the scene has the angle of each view; warns where it has other angles.
    pub(super) fn has_angles(&self) -> bool {
        let (views, angles) = (self.views(), self.scene.scan.views());
        let has = angles == views || self.is_run;
        if !has {
            log::warn!(
                "{}, and {} in scan.angles: the images have no {GEOMETRY}, which `reconstruct` needs; list the angle \
                 of each view",
                counted(views, "view"),
                counted(angles, "angle")
            );
        }
        has
    }

    /// Angles of which there are the views of all dithers.
    ///
    /// # Errors
    /// [`Error::File`] where there is none, and where measured stacks have some of the dithers of an angle.
    pub(super) fn angles(&self) -> Result<usize> {
        let (views, dithers) = (self.views(), self.scene.scan.dithers_of_angle());
        let angles = views / dithers;
        if angles * dithers == views {
            return Ok(angles);
        }
        let problem = format!("has {views} views; each angle has {dithers}, by scan.dithers");
        if angles == 0 || !self.is_run {
            return Err(Error::file(self.sample.path(), problem, None));
        }
        log::warn!("{}: {problem}; the last views are ignored", self.sample.path().display());
        Ok(angles)
    }

    /// Points of a curve of the flat and of each view of the sample: mask steps without omitted ones, of all
    /// columns of a group.
    #[must_use]
    pub fn steps(&self) -> [usize; 2] {
        let kept = |stack: &StackFile| stack.shape()[1].saturating_sub(self.omitted.len());
        [&self.flat, &self.sample].map(|stack| kept(stack) * self.group())
    }

    /// Rows and columns of the kept part of a frame.
    #[must_use]
    pub fn frame(&self) -> [usize; 2] {
        self.selection.frame()
    }

    /// Rows and columns of a frame as the files have it.
    pub(super) const fn whole_frame(&self) -> [usize; 2] {
        let [_, _, rows, columns] = self.flat.shape();
        [rows, columns]
    }

    /// The saturation that a retriever of these values has to know.
    #[must_use]
    pub fn saturation(&self) -> Option<f32> {
        self.correction.saturation.or(self.limit).map(|_| LEFT_OUT)
    }

    /// Leaves out values from `limit` on, as a retriever gets them, where none are left out as they are in
    /// the files: corrections of frames change values, and not which of them are saturated.
    pub(super) const fn limited_to(mut self, limit: Option<f32>) -> Self {
        if self.correction.saturation.is_none() {
            self.limit = limit;
        }
        self
    }

    /// Splits the sample's frames into views of some steps. `steps`: number of offsets of a curve, without omitted ones.
    ///
    /// # Errors
    /// [`Error::File`] where frames and offsets do not agree in number, naming the file, and where the
    /// mean of the dark is not finite in a pixel that is not a bad one.
    pub(crate) fn fitted_to(mut self, steps: usize) -> Result<Self> {
        self.correction.check()?;
        let steps = steps / self.group() + self.omitted.len();
        let [flats, frames, ..] = self.flat.shape();
        if frames != steps {
            let problem = format!("has {frames} frames for {steps} mask offsets");
            if flats != 1 || frames % steps != 0 {
                return Err(Error::file(self.flat.path(), problem, None));
            }
            self.flat = self.flat.with_steps(steps)?;
        }
        let path = self.sample.path().to_path_buf();
        let [views, frames, ..] = self.sample.shape();
        self.sample = self.sample.with_steps(steps).map_err(|error| {
            if views == 1 && frames % steps == 0 {
                // Their names say something else.
                return error;
            }
            let mut problem =
                format!("has {frames} frames in each of {views} views for {steps} mask offsets");
            if views == steps {
                problem += "; --frame-order step,view reads a folder, or the first index of an array, as a mask step";
            }
            Error::file(path, problem, None)
        })?;
        self.check_flats()?;
        Ok(self)
    }

    /// Rows of a view of the sample, `[step][row][column]`.
    ///
    /// # Errors
    /// As [`StackFile::rows`].
    pub fn sample_rows(&self, view: usize, rows: Range<u32>) -> Result<Array3<f32>> {
        let sample = (&self.sample, &self.largest[1]);
        self.values(sample, view, &rows, times::during(view))
    }

    /// Rows of a view that is taken at this time, corrected, of the pixels that are kept.
    fn values(
        &self,
        (stack, largest): (&StackFile, &Largest),
        view: usize,
        rows: &Range<u32>,
        time: f64,
    ) -> Result<Array3<f32>> {
        let rows = self.selection.rows(rows);
        let mut data = self.kept_steps(stack.rows(view, rows.clone())?);
        if self.is_measured() && self.saturation().is_none() {
            largest.add(&data);
        }
        self.correction.apply(&mut data, &rows, time)?;
        let mut data = self.selection.of(data, self.counts);
        if let Some(limit) = self.limit {
            data.mapv_inplace(|y| if y >= limit { LEFT_OUT } else { y });
        }
        Ok(data)
    }
}
