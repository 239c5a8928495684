//! Reading a run directory: its scene, its record, and the views that are committed.

use super::checksums::{Checksums, Compared};
use super::stack_file::StackFile;
use crate::layout::{self, COUNTS, LOG, RUN, SCENE};
use crate::progress_log::{self, Contents, Entry};
use crate::run_file::RunFile;
use crate::shape::StackShape;
use beamlet_core::cancel::Cancel;
use beamlet_core::{Error, Result, numbers};
use beamlet_model::scene::{Exposure, Scene, hash_until};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// A run directory, opened to be read. Every view is compared with its checksum when it is first
/// read.
#[derive(Debug)]
pub struct OpenRun {
    path: PathBuf,
    scene: Scene,
    file: RunFile,
    /// progress.log.
    committed: BTreeMap<Exposure, Entry>,
    compared: Compared,
    /// Views from the first on that are committed.
    views: usize,
    /// SHA-256 of scene.toml and progress.log as they were read, by path.
    hashes: BTreeMap<String, String>,
}

impl OpenRun {
    /// Opens a run: reads its scene, record and log. An interrupted run counts as far as it
    /// came.
    ///
    /// # Errors
    /// [`Error::File`] where there is no run, or where a committed view follows one that is
    /// not (names it); [`Error::Scene`] where scene.toml does not read.
    ///
    /// # Example
    ///
    /// ```no_run
    /// let run = beamlet::stack::OpenRun::open("run")?;
    /// let flat = run.flat()?.view(0)?;
    /// println!("{:?}", flat.shape());
    /// # Ok::<(), beamlet::Error>(())
    /// ```
    pub fn open(path: impl AsRef<Path>) -> Result<Self> {
        let path = path.as_ref();
        if !layout::is_run(path) {
            let file = "is a file: name a run directory, as `beamlet simulate` makes it";
            let lacks = format!("is not a run directory: it has no {RUN}");
            let problem = layout::problem_of(path, file, &lacks);
            return Err(Error::file(path, problem, None));
        }
        let file = RunFile::read(&path.join(RUN))?;
        file.refuse_part(path)?;
        let [scene_path, log] = [SCENE, LOG].map(|name| path.join(name));
        let scene = read_scene(&scene_path)?;
        let Contents { views: committed, sha256, .. } = progress_log::read_all(&log)?;
        let scene_hash = hash_until(&scene_path, &Cancel::default())?;
        let name = |path: PathBuf| path.display().to_string();
        let hashes = [(name(scene_path), scene_hash), (name(log), sha256)].into();
        let of_scene = StackShape::of(&scene)?;
        if of_scene != file.extent {
            let problem = format!("claims {:?}; {SCENE} has {of_scene:?}", file.extent);
            return Err(Error::file(path.join(RUN), problem, None));
        }
        let is_there = |view: &u32| committed.contains_key(&Exposure::Sample(*view));
        let views = (0..file.extent.views).take_while(is_there).count();
        let is_sample = |view: &&Exposure| matches!(view, Exposure::Sample(index) if *index < file.extent.views);
        let count = committed.keys().filter(is_sample).count();
        if count != views {
            let problem =
                format!("view {views} is not committed, but later views are; resume the run");
            return Err(Error::file(path, problem, None));
        }
        let path = path.to_path_buf();
        let compared = Compared::default();
        Ok(Self { path, scene, file, committed, compared, views, hashes })
    }

    /// The directory.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The resolved scene.
    #[must_use]
    pub const fn scene(&self) -> &Scene {
        &self.scene
    }

    /// run.json.
    #[must_use]
    pub const fn record(&self) -> &RunFile {
        &self.file
    }

    /// SHA-256 of scene.toml and progress.log as they were read, by path.
    #[doc(hidden)]
    pub const fn hashes(&self) -> &BTreeMap<String, String> {
        &self.hashes
    }

    /// Views of the sample that are committed, from the first on.
    #[must_use]
    pub const fn views(&self) -> usize {
        self.views
    }

    /// The flats, a view each.
    ///
    /// # Errors
    /// [`Error::File`] where a flat before a committed view is not committed, or does not have the shape
    /// of run.json.
    pub fn flat(&self) -> Result<StackFile> {
        match self.committed_of(Exposure::Flat(0))? {
            0 => Err(Error::file(&self.path, "the flat is not committed: resume the run", None)),
            flats => self.stack(Exposure::Flat(0), false, flats),
        }
    }

    /// The committed views with the sample.
    ///
    /// # Errors
    /// As [`OpenRun::flat`], where no view is committed.
    pub fn sample(&self) -> Result<StackFile> {
        if self.views == 0 {
            return Err(Error::file(&self.path, "no view is committed: resume the run", None));
        }
        self.stack(Exposure::Sample(0), false, self.views)
    }

    /// Detector numbers of the flats, if the scene has noise.
    ///
    /// # Errors
    /// As [`OpenRun::flat`].
    pub fn counts_flat(&self) -> Result<Option<StackFile>> {
        self.optional(Exposure::Flat(0), true, self.committed_of(Exposure::Flat(0))?)
    }

    /// Detector numbers with the sample, if the scene has noise.
    ///
    /// # Errors
    /// As [`OpenRun::flat`].
    pub fn counts_sample(&self) -> Result<Option<StackFile>> {
        self.optional(Exposure::Sample(0), true, self.views)
    }

    /// Detector numbers without beam, if the scene has noise: the darks, a view each.
    ///
    /// # Errors
    /// As [`OpenRun::flat`].
    pub fn dark(&self) -> Result<Option<StackFile>> {
        self.optional(Exposure::Dark(0), false, self.committed_of(Exposure::Dark(0))?)
    }

    /// Number of flats or darks, from the first on, that are committed; 0 where there are none.
    fn committed_of(&self, stack: Exposure) -> Result<usize> {
        let scan = &self.scene.scan;
        let places = if stack.is_flat() { scan.flat_places() } else { scan.dark_places() };
        let indices = (0..numbers::count(places.len())).map(|index| stack.with_index(index));
        let found = indices.take_while(|view| self.committed.contains_key(view)).count();
        let needed = places.iter().filter(|place| (**place as usize) < self.views).count();
        if found > 0 && found < needed {
            let name = layout::view(stack.with_index(numbers::count(found)), false);
            let problem = format!("{name} is not committed and later views are: resume the run");
            return Err(Error::file(&self.path, problem, None));
        }
        Ok(found)
    }

    /// Checksums of the log of the first `views` views of a stack.
    fn checksums(
        &self,
        stack: Exposure,
        counts: bool,
        views: usize,
        steps: usize,
    ) -> Result<Checksums> {
        let of_view = |index: usize| {
            let view = stack.with_index(numbers::count(index));
            let entry = self.committed.get(&view);
            let found =
                entry.and_then(|e| if counts { e.counts.as_ref() } else { Some(&e.sha256) });
            let checksum = found.cloned().ok_or_else(|| {
                let name = layout::stack_of(stack, counts);
                let problem = format!("has no checksum of view {index} of {name}: resume the run");
                Error::file(self.path.join(LOG), problem, None)
            })?;
            Ok([layout::view(view, counts), checksum])
        };
        let views = (0..views).map(of_view).collect::<Result<_>>()?;
        Ok(Checksums::new(views, steps, &self.compared))
    }

    /// The first `views` views of a stack that is there.
    fn optional(&self, stack: Exposure, counts: bool, views: usize) -> Result<Option<StackFile>> {
        if views == 0 || !self.file_of(stack, counts).exists() {
            return Ok(None);
        }
        self.stack(stack, counts, views).map(Some)
    }

    fn file_of(&self, stack: Exposure, counts: bool) -> PathBuf {
        let root = if counts { self.path.join(COUNTS) } else { self.path.clone() };
        layout::array(&root, &layout::stack(stack), self.file.format)
    }

    fn stack(&self, stack: Exposure, counts: bool, views: usize) -> Result<StackFile> {
        let path = self.file_of(stack, counts);
        let extent = self.file.extent;
        let file = StackFile::open(&path)?;
        let is_dark = stack.is_dark() && extent.darks == 1;
        // Pages do not say where a view ends.
        let file = match is_dark || self.file.format.abilities().sides {
            true => file,
            false => file.with_steps(extent.steps as usize)?,
        };
        let file = file.first_views(views);
        let [steps, rows, columns] =
            [extent.steps, extent.rows, extent.columns].map(|side| side as usize);
        // The number of dark frames is the detector's own.
        let expected = [views, if is_dark { file.shape()[1] } else { steps }, rows, columns];
        if file.shape() != expected {
            let problem = format!(
                "has {:?} views, steps, rows and columns; {RUN} says {expected:?}",
                file.shape()
            );
            return Err(Error::file(path, problem, None));
        }
        let checksums = self.checksums(stack, counts, views, file.shape()[1])?;
        Ok(file.with_checksums(checksums))
    }
}

/// The resolved scene; one whose meshes were arrays does not load, and is read without objects.
pub(crate) fn read_scene(path: &Path) -> Result<Scene> {
    let error = match Scene::load(path) {
        Ok(scene) => return Ok(scene),
        Err(error) => error,
    };
    let without_objects = || {
        let text = beamlet_core::input_file::text(path).ok()?;
        let mut table: toml::Table = toml::from_str(&text).ok()?;
        table.remove("object")?;
        Scene::from_toml(&toml::to_string(&table).ok()?, path.parent()?).ok()
    };
    without_objects().ok_or(error)
}
