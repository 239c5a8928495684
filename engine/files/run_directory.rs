//! A run on disk: scene.toml, geometry.json, run.json, progress.log and the frames, view by view.
//!
//! Long runs get interrupted, so a run directory can always be resumed: a view is there with
//! all its steps or it is not, and progress.log says which. Nothing is written before the run
//! begins, and nothing that beamlet did not write is ever removed.

mod begun;
mod join;
mod resume;

use super::frames::Frames;
use super::geometry_file::GeometryFile;
use super::image_folder::{ImageDirectory, Kind};
use super::layout::{self, COUNTS, GEOMETRY, LOG, PARTIAL, RUN, SCENE};
use super::own_files::{self, remove_file, remove_frames, remove_stacks};
use super::part::{Part, ViewRange};
use super::progress_log::ProgressLog;
use super::record::{RunRecord, RunStart};
use super::run_file::{RunFile, RunState};
use super::scene_file;
use super::shape::StackShape;
use super::sink::Sink;
use super::values::Values;
use beamlet_core::array_file::Format;
use beamlet_core::whole_file::{sync_directory, write_whole};
use beamlet_core::{Error, Result, Tally, folder, numbers};
use beamlet_model::scene::{Exposure, Scene};
use begun::Begun;
pub use join::{JoinOptions, join};
use ndarray::ArrayView3;
use resume::{Resumed, refuse_other_scene};
use std::fs;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Sink that keeps a run in a directory. One that may overwrite or resume a run holds its lock
/// from the first look on, as long as it lives.
#[derive(Debug)]
pub struct RunDirectory {
    path: PathBuf,
    /// Views of the part of a run that is here; `None`: all of it.
    part: Option<ViewRange>,
    format: Format,
    overwrite: bool,
    allow_mixed: bool,
    /// `key=value` that the scene was loaded with, for scene.toml.
    overrides: Vec<String>,
    /// Command line, for run.json.
    command: Option<String>,
    resumed: Option<Resumed>,
    /// Lock of the run in this directory: from the first look at it to the end.
    log: Option<ProgressLog>,
    open: Option<Begun>,
}

impl RunDirectory {
    /// A directory for a new run. Only looks; it is made when the run begins.
    ///
    /// # Errors
    /// [`Error::File`] where `path` is taken: a run, or anything else that is not an empty
    /// directory. With `overwrite` the files of an earlier run there are replaced, its retrieved images and
    /// its report are removed, and files of others are left; it is still an error where a file of others has the name of one of ours.
    pub fn create(path: impl Into<PathBuf>, format: Format, overwrite: bool) -> Result<Self> {
        let path = path.into();
        let mut log = None;
        if overwrite || own_files::has_only_begun(&path) {
            log = ProgressLog::lock_if_there(&path.join(LOG))?;
        }
        own_files::look(&path, overwrite)?;
        let mut run = Self::at(path, format, log);
        run.overwrite = overwrite;
        Ok(run)
    }

    /// A run in a place that was looked at.
    fn at(path: PathBuf, format: Format, log: Option<ProgressLog>) -> Self {
        Self {
            path,
            part: None,
            format,
            overwrite: false,
            allow_mixed: false,
            overrides: Vec::new(),
            command: None,
            resumed: None,
            log,
            open: None,
        }
    }

    /// Lets a run be resumed on another device, driver, backend or version. The result is then
    /// equal within the tolerances of docs/developers/validation.md only.
    #[must_use]
    pub fn allow_mixed(mut self, allow: bool) -> Self {
        self.allow_mixed = allow;
        self
    }

    /// Records in scene.toml the `key=value` overrides that the scene was loaded with.
    #[must_use]
    pub fn overrides(mut self, overrides: &[String]) -> Self {
        self.overrides = overrides.to_vec();
        self
    }

    /// Records in run.json the command line that makes the run, or goes on with it.
    #[must_use]
    pub fn command(mut self, command: impl Into<String>) -> Self {
        self.command = Some(command.into());
        self
    }

    /// Makes a part of a run: these views, with their flats and darks.
    #[must_use]
    pub fn views(mut self, views: impl Into<Option<ViewRange>>) -> Self {
        self.part = views.into();
        self
    }

    /// Views of the part of a run that is here; `None`: all of it.
    #[must_use]
    pub const fn part(&self) -> Option<ViewRange> {
        self.part
    }

    /// Where the run is.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Format of the frames; for a resumed run the recorded one.
    #[must_use]
    pub fn format(&self) -> Format {
        self.format
    }

    /// True if [`Sink::begin`] has written to the directory and [`Sink::finish`] has not ended the run.
    /// Before that an earlier run may still be there.
    #[must_use]
    pub fn has_begun(&self) -> bool {
        self.open.is_some()
    }

    /// Locks the run; it is nobody else's from here to the end.
    fn lock(&mut self) -> Result<ProgressLog> {
        if let Some(log) = self.log.take() {
            return Ok(log);
        }
        folder::make_all(&self.path)?;
        let path = self.path.join(LOG);
        let fresh = fs::symlink_metadata(&path).is_err();
        let log = ProgressLog::lock(&path)?;
        // Somebody else may have come here since `create` looked.
        if self.resumed.is_none()
            && let Err(error) = own_files::look(&self.path, self.overwrite)
        {
            if fresh {
                let _ = fs::remove_file(&path);
            }
            return Err(error);
        }
        Ok(log)
    }

    /// Removes the remains of an earlier run or of an interrupted view; never a file of others.
    fn clear(&self, extent: StackShape, log: &mut ProgressLog) -> Result<()> {
        let keep = self.resumed.as_ref().map_or(&[][..], |resumed| &resumed.committed);
        let earlier = match &self.resumed {
            Some(_) => extent,
            None => match RunFile::read(&self.path.join(RUN)) {
                Ok(file) => file.extent,
                Err(_) => return remove_frames(&self.path.join(PARTIAL), extent),
            },
        };
        let counts = self.path.join(COUNTS);
        if self.resumed.is_none() {
            // The log first: without its lines no remaining file counts as committed. It stays, since it
            // is the lock; run.json stays until the new one replaces it, so that the remains of a crash
            // are recognised as a run.
            log.clear()?;
            ImageDirectory::discard(&self.path.join(layout::RETRIEVED), Kind::Images)?;
            own_files::remove_report(&self.path)?;
            for name in layout::stack_files() {
                remove_file(&self.path.join(&name))?;
                remove_file(&counts.join(name))?;
            }
        }
        remove_stacks(&counts, earlier, keep)?;
        remove_stacks(&self.path, earlier, keep)?;
        let _ = fs::remove_dir(counts);
        Ok(())
    }
}

impl Sink for RunDirectory {
    fn begin(&mut self, scene: &Scene, start: &RunStart) -> Result<()> {
        let part = Part::of(scene, self.part)?;
        let extent = part.extent;
        let scene = &scene.with_file_hashes()?;
        let mut file = RunFile::begin(self.format, extent, scene, start);
        file.part = self.part;
        let scene_path = self.path.join(SCENE);
        if let Some(resumed) = &self.resumed {
            let hashes = Some(&start.mesh_hashes);
            let differences = scene_file::differences(&scene_path, scene, hashes)?;
            refuse_other_scene(&self.path, &differences)?;
            self.refuse_mixed(&resumed.file.record.platform(), &file.record.platform())?;
            file.resumed_views = numbers::count(resumed.committed.len());
            file.go_on_from(&resumed.file);
        }
        file.commands.extend(self.command.clone());
        // Locked before anything is removed: another process may be writing this run.
        let mut log = self.lock()?;
        own_files::refuse_links(&self.path)?;
        log.mend()?;
        self.clear(extent, &mut log)?;
        if self.resumed.is_none() {
            let (hashes, sets) = (&start.mesh_hashes, &self.overrides);
            let resolved = scene_file::resolved(&self.path, scene, hashes, sets)?;
            write_whole(&scene_path, resolved.as_bytes())?;
        }
        write_whole(&self.path.join(GEOMETRY), GeometryFile::of(scene).text()?.as_bytes())?;
        file.write(&self.path.join(RUN))?;
        let noisy = scene.detector.counts.is_some();
        let frames = |root: &Path, values: Values, dark: bool| {
            Frames::begin(self.format, root, part, scene, values, dark)
        };
        let counts = match noisy {
            true => {
                let root = self.path.join(COUNTS);
                folder::make(&root)
                    .map_err(|error| Error::file(&root, "cannot be created", Some(error)))?;
                Some(frames(&root, Values::Numbers, false)?)
            }
            false => None,
        };
        let frames = frames(&self.path, Values::Intensities, noisy)?;
        // Files that were made here last from now on.
        sync_directory(&self.path)?;
        let (since, before) = (Instant::now(), file.duration_s);
        let open = Begun {
            file,
            part,
            since,
            before,
            log,
            frames,
            counts,
            tally: Tally::default(),
            next: [0; 2],
        };
        self.open = Some(open);
        Ok(())
    }

    fn write(&mut self, view: Exposure, rows: Range<u32>, data: ArrayView3<'_, f32>) -> Result<()> {
        let (path, open) = (&self.path, opened(&mut self.open, &self.path)?);
        open.in_place(|open| open.write(path, view, &rows, data, Values::Intensities))
    }

    fn write_counts(
        &mut self,
        view: Exposure,
        rows: Range<u32>,
        numbers: ArrayView3<'_, f32>,
    ) -> Result<()> {
        let (path, open) = (&self.path, opened(&mut self.open, &self.path)?);
        open.in_place(|open| open.write(path, view, &rows, numbers, Values::Numbers))
    }

    fn tally(&mut self, _view: Exposure, tally: &Tally) -> Result<()> {
        opened(&mut self.open, &self.path)?.tally = *tally;
        Ok(())
    }

    fn commit(&mut self, view: Exposure) -> Result<()> {
        let open = opened(&mut self.open, &self.path)?;
        let extent = open.file.extent;
        let rows = match view {
            Exposure::Dark(_) => open.next[1],
            _ if open.counts.is_some() => open.next[0].min(open.next[1]),
            _ => open.next[0],
        };
        if rows != extent.rows {
            let problem = format!("{view:?} has {rows} of {} rows", extent.rows);
            return Err(Error::file(&self.path, problem, None));
        }
        open.in_place(|open| open.commit(view))?;
        open.next = [0; 2];
        Ok(())
    }

    fn finish(&mut self, record: &RunRecord) -> Result<()> {
        let (path, open) = (&self.path, opened(&mut self.open, &self.path)?);
        open.file.record = record.clone();
        open.in_place(|open| {
            open.refuse_missing()?;
            open.end(path, RunState::Done)
        })?;
        open.log.refuse_moved()?;
        for root in [self.path.join(COUNTS), self.path.clone()] {
            let _ = fs::remove_dir(root.join(PARTIAL));
        }
        self.open = None;
        Ok(())
    }
}

impl Drop for RunDirectory {
    /// A view of which nothing is committed leaves nothing behind.
    fn drop(&mut self) {
        // At the path of a run that was moved may be one of others.
        if let Some(mut open) = self.open.take().filter(|open| open.log.refuse_moved().is_ok()) {
            // Where it cannot be written the run is still known for one that is not done.
            let _ = open.end(&self.path, RunState::Interrupted);
            for root in [self.path.join(COUNTS), self.path.clone()] {
                let _ = remove_frames(&root.join(PARTIAL), open.file.extent);
            }
        }
    }
}

fn opened<'a>(open: &'a mut Option<Begun>, path: &Path) -> Result<&'a mut Begun> {
    open.as_mut().ok_or_else(|| Error::file(path, "no run has begun here", None))
}
