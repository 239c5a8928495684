//! What is retrieved from: a run of beamlet, or measured stacks with their geometry.

mod bad_pixels;
mod faults;
mod flats;
mod reopened;

use super::retriever::Retriever;
use crate::cancel::{Aside, Cancel};
use crate::detector::DetectorModel;
use crate::numbers;
use crate::scene::{Scene, hash_until, text_hash};
use crate::stack::layout::{GEOMETRY, LOG, SCENE};
use crate::stack::{OpenRun, StackFile};
use crate::{Error, Result, folder, input_file, reserve};
use ndarray::{Array2, Array3, Zip};
use std::collections::BTreeMap;
use std::ops::Range;
use std::path::{Path, PathBuf};

/// Stands for a value that is left out: finite, and above every saturation.
const LEFT_OUT: f32 = f32::MAX;

/// Stacks of flat and sample, and the scene whose geometry and offsets they have.
#[derive(Debug)]
pub struct Input {
    scene: Scene,
    flat: StackFile,
    sample: StackFile,
    /// Views between one flat and the next; `None` where there is one flat, or one for each view.
    flats_every: Option<u32>,
    dark: Option<Array2<f32>>,
    /// File or folder of the dark frames.
    dark_path: Option<PathBuf>,
    /// File of bad pixels, and these, `[row][column]`.
    bad: Option<(PathBuf, Array2<bool>)>,
    /// Values from here on, before the dark is subtracted, are left out.
    saturation: Option<f32>,
    /// Detector number of one photon, and the noise of no light, where the scene has them.
    noise: Option<[f64; 2]>,
    counts: bool,
    /// The views are the first of the scene's; measured ones have angles where there are as many.
    is_run: bool,
    /// Everything that was read, files and folders.
    read: Vec<PathBuf>,
    /// Files of each folder of measured frames, in their order.
    frames: BTreeMap<String, Vec<String>>,
}

impl Input {
    /// A run; with `counts` its detector numbers instead of intensities. Noise and saturation are
    /// then those of the scene's detector, and the mean of the run's dark frames is subtracted.
    ///
    /// # Errors
    /// [`Error::File`] where it has none, or cannot be read.
    pub fn of_run(run: &OpenRun, counts: bool) -> Result<Self> {
        let scene = run.scene().clone();
        let all = run.record().extent.views;
        if run.views() < all as usize {
            let path = run.path().display();
            log::warn!(
                "{path}: {} of {all} views are committed; the rest is left out",
                run.views()
            );
        }
        let read = [SCENE, LOG].map(|name| run.path().join(name));
        let input = if counts {
            let (Some(flat), Some(sample)) = (run.counts_flat()?, run.counts_sample()?) else {
                let problem = match scene.detector.counts {
                    Some(_) => {
                        "has no committed counts of flat and sample yet: wait for the run, or resume it"
                    }
                    None => "has no counts: its scene has no detector.photons",
                };
                return Err(Error::file(run.path(), problem, None));
            };
            Self::simulated_counts(&scene, flat, sample, run.dark()?.as_ref())?
        } else {
            Self::simulated(&scene, run.flat()?, run.sample()?)
        };
        Ok(input.with_read(&read))
    }

    /// Simulated intensities of a scene.
    #[must_use]
    pub fn simulated(scene: &Scene, flat: StackFile, sample: StackFile) -> Self {
        Self {
            scene: scene.clone(),
            flat,
            sample,
            flats_every: None,
            dark: None,
            dark_path: None,
            bad: None,
            saturation: None,
            noise: None,
            counts: false,
            is_run: true,
            read: Vec::new(),
            frames: BTreeMap::new(),
        }
    }

    /// Simulated detector numbers of a scene. Noise and saturation are those of its detector; the mean
    /// of the dark frames is subtracted.
    ///
    /// # Errors
    /// [`Error::File`] where the dark cannot be read; [`Error::Scene`] for materials of the detector.
    pub fn simulated_counts(
        scene: &Scene,
        flat: StackFile,
        sample: StackFile,
        dark: Option<&StackFile>,
    ) -> Result<Self> {
        let numbers = scene.detector.counts;
        // The largest number stands for all that was clipped to it.
        let saturation = numbers
            .and_then(|n| n.bit_depth)
            .map(|bits| numbers::single(libm::exp2(f64::from(bits)) - 1.0));
        let noise = match numbers {
            Some(n) => Some([DetectorModel::variance_per_value(scene)?, n.electronic_noise]),
            None => None,
        };
        Ok(Self {
            dark: dark.map(mean).transpose()?,
            dark_path: dark.map(|dark| dark.path().to_path_buf()),
            saturation,
            noise,
            counts: true,
            ..Self::simulated(scene, flat, sample)
        })
    }

    /// Measured stacks. `scene` gives the geometry; its mask offsets are those of the frames.
    /// The dark is averaged over its frames and subtracted from both.
    ///
    /// # Errors
    /// [`Error::File`] where shapes do not agree, naming both files; where the sample has the values of
    /// the flat, or the dark is brighter than the flat in its darkest steps; where a file that the scene
    /// refers to does not have the hash that the scene has of it. [`Error::Argument`] where mask offsets
    /// span less than a tenth or more than ten periods of the sample mask.
    pub fn measured(
        scene: &Scene,
        flat: StackFile,
        sample: StackFile,
        dark: Option<&StackFile>,
    ) -> Result<Self> {
        if let Some(error) = scene.changed_files().into_iter().next() {
            return Err(error);
        }
        let scene = scene.with_file_hashes()?;
        faults::check_offsets(&scene)?;
        let [_, _, rows, columns] = flat.shape();
        for other in std::iter::once(&sample).chain(dark) {
            let [_, _, other_rows, other_columns] = other.shape();
            if [other_rows, other_columns] != [rows, columns] {
                let problem = format!(
                    "has frames of {other_rows} x {other_columns} pixels; those of {} have {rows} x \
                     {columns}",
                    flat.path().display()
                );
                return Err(Error::file(other.path(), problem, None));
            }
        }
        let files = [&flat, &sample].into_iter().chain(dark).filter_map(StackFile::file);
        let read = files.map(Path::to_owned).collect();
        let names = |s: &StackFile| Some((s.path().display().to_string(), s.frame_names()?));
        let frames = [&flat, &sample].into_iter().chain(dark).filter_map(names).collect();
        let dark_path = dark.map(|dark| dark.path().to_path_buf());
        faults::check_sample(&flat, &sample)?;
        let dark = match dark {
            Some(dark) => {
                let mean = mean(dark)?;
                faults::check_dark(&flat, dark, &mean)?;
                Some(mean)
            }
            None => None,
        };
        let (saturation, noise, counts) = (None, None, true);
        Ok(Self {
            scene,
            flat,
            sample,
            flats_every: None,
            dark,
            dark_path,
            bad: None,
            saturation,
            noise,
            counts,
            is_run: false,
            read,
            frames,
        })
    }

    /// Names other files that were read for it, such as that of the geometry, for the record.
    #[must_use]
    pub fn with_read(mut self, files: &[PathBuf]) -> Self {
        self.read.extend_from_slice(files);
        self
    }

    /// Begins to find the SHA-256 of everything that is read, by its path, while curves are fitted.
    pub(super) fn hashes(&self) -> Aside<Result<BTreeMap<String, String>>> {
        let read = self.read.clone();
        Aside::begin(move |end| {
            let hash = |path: &PathBuf| Ok((path.display().to_string(), path_hash(path, end)?));
            read.iter().map(hash).collect()
        })
    }

    /// Leaves out values from here on, as they are in the files: before the dark is subtracted.
    /// `None` leaves it at what a run's scene says.
    #[must_use]
    pub const fn saturated_at(mut self, saturation: Option<f32>) -> Self {
        if saturation.is_some() {
            self.saturation = saturation;
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

    /// Whether the values are detector numbers, and not intensities.
    #[must_use]
    pub const fn counts(&self) -> bool {
        self.counts
    }

    /// Files or folders of flat and sample.
    #[must_use]
    pub fn sources(&self) -> Vec<String> {
        [&self.flat, &self.sample].map(|stack| stack.path().display().to_string()).to_vec()
    }

    /// File or folder of the dark frames.
    #[must_use]
    pub(crate) fn dark_source(&self) -> Option<String> {
        self.dark_path.as_ref().map(|path| path.display().to_string())
    }

    /// Files of each folder of measured frames, in their order, by the folder's path.
    #[must_use]
    pub const fn frames(&self) -> &BTreeMap<String, Vec<String>> {
        &self.frames
    }

    /// Files and folders of the stacks.
    pub(super) fn paths(&self) -> Vec<PathBuf> {
        [&self.flat, &self.sample].map(|stack| stack.path().to_path_buf()).to_vec()
    }

    /// Views of the sample.
    #[must_use]
    pub const fn views(&self) -> usize {
        self.sample.shape()[0]
    }

    /// Whether the scene has the angle of each view; warns where it has other angles.
    pub(super) fn has_angles(&self) -> bool {
        let (views, angles) = (self.views(), self.scene.scan.views());
        let has = angles == views || self.is_run;
        if !has {
            log::warn!(
                "{views} views, and {angles} angles in scan.angles: the images have no {GEOMETRY}"
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
        log::warn!("{}: {problem}; the last are left out", self.sample.path().display());
        Ok(angles)
    }

    /// Mask steps of the flat and of each view of the sample.
    #[must_use]
    pub const fn steps(&self) -> [usize; 2] {
        [self.flat.shape()[1], self.sample.shape()[1]]
    }

    /// Rows and columns of a frame.
    #[must_use]
    pub const fn frame(&self) -> [usize; 2] {
        let [_, _, rows, columns] = self.flat.shape();
        [rows, columns]
    }

    /// The saturation that a retriever of these values has to know.
    #[must_use]
    pub fn saturation(&self) -> Option<f32> {
        self.saturation.map(|_| LEFT_OUT)
    }

    /// Splits the sample's frames into views of as many steps as `retriever` has offsets.
    ///
    /// # Errors
    /// [`Error::File`] where frames and offsets do not agree in number, naming the file, and where the
    /// mean of the dark is not finite in a pixel that is not a bad one.
    pub(crate) fn fitted_to(mut self, retriever: &Retriever) -> Result<Self> {
        self.check_dark()?;
        let [flat, sample] = retriever.steps();
        let [flats, frames, ..] = self.flat.shape();
        if frames != flat {
            let problem = format!("has {frames} frames for {flat} mask offsets");
            if flats != 1 || frames % flat != 0 {
                return Err(Error::file(self.flat.path(), problem, None));
            }
            self.flat = self.flat.with_steps(flat)?;
        }
        let path = self.sample.path().to_path_buf();
        let [views, frames, ..] = self.sample.shape();
        self.sample = self.sample.with_steps(sample).map_err(|error| {
            if views == 1 && frames % sample == 0 {
                // Their names say something else.
                return error;
            }
            let problem =
                format!("has {frames} frames in each of {views} views for {sample} mask offsets");
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
        self.corrected(self.sample.rows(view, rows.clone())?, &rows)
    }

    /// Refuses a dark without a value in a pixel that is not a bad one.
    fn check_dark(&self) -> Result<()> {
        let (Some(dark), Some(path)) = (&self.dark, &self.dark_path) else { return Ok(()) };
        let is_bad = |at| self.bad_pixels().is_some_and(|bad| bad[at]);
        match dark.indexed_iter().find(|(at, value)| !value.is_finite() && !is_bad(*at)) {
            None => Ok(()),
            Some(((row, column), _)) => {
                let problem = format!(
                    "is not finite in row {row}, column {column}: --bad-pixels leaves out such pixels"
                );
                Err(Error::file(path, problem, None))
            }
        }
    }

    /// Marks what is saturated and what is bad, and subtracts the dark.
    fn corrected(&self, mut data: Array3<f32>, rows: &Range<u32>) -> Result<Array3<f32>> {
        let dark = self
            .dark
            .as_ref()
            .map(|dark| dark.slice(ndarray::s![rows.start as usize..rows.end as usize, ..]));
        for mut frame in data.outer_iter_mut() {
            if let Some(saturation) = self.saturation {
                frame.mapv_inplace(|y| if y >= saturation { LEFT_OUT } else { y });
            }
            if let Some(dark) = &dark {
                Zip::from(&mut frame).and(dark).for_each(|y, dark| {
                    if *y < LEFT_OUT {
                        *y -= dark;
                    }
                });
            }
            if let Some(bad) = self.bad_pixels() {
                let bad = bad.slice(ndarray::s![rows.start as usize..rows.end as usize, ..]);
                Zip::from(&mut frame).and(&bad).for_each(|y, bad| {
                    if *bad {
                        *y = f32::NAN;
                    }
                });
            }
        }
        Ok(data)
    }
}

/// SHA-256 of a file, or of what a folder holds: lines of hash and name.
pub(crate) fn path_hash(path: &Path, cancel: &Cancel) -> Result<String> {
    if !path.is_dir() {
        return hash_until(path, cancel);
    }
    let unread = |error| Error::file(path, "cannot be read", Some(error));
    let paths = folder::paths(path).map_err(unread)?;
    let line = |path: &PathBuf| {
        let name = path.file_name().unwrap_or_default().display().to_string();
        Ok(format!("{}  {name}\n", path_hash(path, cancel)?))
    };
    let lines = paths.iter().map(line).collect::<Result<String>>()?;
    Ok(text_hash(&lines))
}

/// Mean of all frames.
fn mean(stack: &StackFile) -> Result<Array2<f32>> {
    let [views, steps, rows, columns] = stack.shape();
    let sums = reserve::zeroed::<f64>(rows * columns, "the mean of dark frames")?;
    let mut sum = Array2::from_shape_vec((rows, columns), sums)
        .map_err(|error| Error::file(stack.path(), format!("cannot be read: {error}"), None))?;
    let all = 0..numbers::count(rows);
    for view in 0..views {
        for step in 0..steps {
            let frame = stack.frame(view, step, all.clone())?;
            Zip::from(&mut sum).and(&frame).for_each(|sum, y| *sum += f64::from(*y));
        }
    }
    let count = (views * steps) as f64;
    Ok(sum.mapv(|sum| numbers::single(sum / count)))
}

/// Mask offsets from a list such as "-10 um, 0 um, 10 um", or from a file with one per line.
///
/// # Errors
/// [`Error::File`] for a file that cannot be read; [`Error::Argument`] for a value without a unit,
/// naming its place in the list.
pub fn offsets(list_or_file: &str) -> Result<Vec<f64>> {
    let path = Path::new(list_or_file);
    // A word that begins with no number can only be meant as the name of a file.
    let begins = |c: char| c.is_ascii_digit() || "+-.,".contains(c);
    let named = !list_or_file.trim().is_empty() && !list_or_file.trim_start().starts_with(begins);
    let text = if path.is_file() || named {
        let problem =
            "cannot be read as a file of offsets, nor is it a list such as \"-10 um, 0 um\"";
        input_file::text(path).map_err(|error| Error::file(path, problem, Some(error)))?
    } else {
        list_or_file.to_owned()
    };
    let words = text
        .lines()
        .map(|line| line.split('#').next().unwrap_or_default())
        .flat_map(|line| line.split(','))
        .map(str::trim)
        .filter(|word| !word.is_empty());
    let offsets: Vec<f64> = words
        .enumerate()
        .map(|(index, word)| {
            crate::units::Dimension::Length.parse(word).map_err(|error| {
                let allowed = "lengths with units, as in \"-10 um, 0 um, 10 um\", or a file with \
                               one on each line";
                Error::argument(format!("offsets[{index}]"), format!("{word:?} ({error})"), allowed)
            })
        })
        .collect::<Result<_>>()?;
    if offsets.is_empty() {
        return Err(Error::argument("offsets", "nothing", "at least one length"));
    }
    Ok(offsets)
}
