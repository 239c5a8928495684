//! Resuming a run: the views that are still as committed, and whether it may continue.

use super::RunDirectory;
use crate::layout::{self, LOG, RUN, SCENE};
use crate::part::Part;
use crate::progress_log::{self, ProgressLog};
use crate::record::Platform;
use crate::run_file::RunFile;
use crate::{own_files, scene_file, verify};
use beamlet_core::{Error, Result, Tally};
use beamlet_model::scene::{Exposure, Scene};
use std::path::{Path, PathBuf};

/// Contents of the directory when the run was resumed.
#[derive(Debug)]
pub(super) struct Resumed {
    pub(super) file: RunFile,
    pub(super) committed: Vec<Exposure>,
    /// Differences from the committed state.
    pub(super) problems: Vec<String>,
    /// Counts of the committed views.
    pub(super) counted: Tally,
}

impl RunDirectory {
    /// The scene with the tolerances of an interrupted run where it has no numbers: the scene that a resumed run goes
    /// on with.
    ///
    /// # Errors
    /// [`Error::File`] where there is no run.
    pub fn scene_of_resumed(path: &Path, scene: &Scene) -> Result<Scene> {
        require_run(path)?;
        let mut scene = scene.clone();
        // A scene that cannot be read is an error of `resume`, which compares the two.
        scene_file::keep_resolved(&path.join(SCENE), &mut scene);
        Ok(scene)
    }

    /// The directory of an interrupted run of `scene` ([`RunDirectory::scene_of_resumed`]). Only reads;
    /// [`RunDirectory::committed`] lists committed views that still have their checksum.
    ///
    /// # Errors
    /// [`Error::File`] where there is no run, or one of another scene (says what differs).
    pub fn resume(path: impl Into<PathBuf>, scene: &Scene) -> Result<Self> {
        let path = path.into();
        let scene = &Self::scene_of_resumed(&path, scene)?;
        let log = ProgressLog::lock_if_there(&path.join(LOG))?;
        own_files::refuse_links(&path)?;
        let file = RunFile::read(&path.join(RUN))?;
        let scene = &scene.with_file_hashes()?;
        let differences = scene_file::differences(&path.join(SCENE), scene, None)?;
        refuse_other_scene(&path, &differences)?;
        let part = Part::of(scene, file.part)?;
        let entries = progress_log::read(&path.join(LOG))?;
        let found = verify::frames(&path, file.format, part, scene, &entries);
        let problems: Vec<String> = found
            .problems
            .into_iter()
            .map(|(view, problem)| match view {
                Some(_) => format!("{problem}; it is simulated again"),
                None => format!("{problem}; repaired, and lost views are simulated again"),
            })
            .collect();
        let committed = found.whole;
        let counted = committed.iter().map(|view| entries[view].tally).sum();
        let mut run = Self::at(path, file.format, log);
        run.part = file.part;
        run.resumed = Some(Resumed { file, committed, problems, counted });
        Ok(run)
    }

    /// Views that are committed already, for `Control::skip`.
    #[must_use]
    pub fn committed(&self) -> &[Exposure] {
        self.resumed.as_ref().map_or(&[], |resumed| &resumed.committed)
    }

    /// Differences of the resumed run from its committed state, one message each: the views concerned are
    /// not among [`RunDirectory::committed`].
    #[must_use]
    pub fn problems(&self) -> &[String] {
        self.resumed.as_ref().map_or(&[], |resumed| &resumed.problems)
    }

    /// Counts of the views that are committed already, for `Control::counted`.
    #[must_use]
    pub fn counted(&self) -> Tally {
        self.resumed.as_ref().map_or_else(Tally::default, |resumed| resumed.counted)
    }

    /// run.json of the run that is resumed.
    #[must_use]
    pub fn recorded(&self) -> Option<&RunFile> {
        self.resumed.as_ref().map(|resumed| &resumed.file)
    }

    /// Refuses a device, driver, backend or version other than those that began the run.
    pub(super) fn refuse_mixed(&self, recorded: &Platform, now: &Platform) -> Result<()> {
        for [what, before, now] in recorded.differences(now) {
            if !self.allow_mixed {
                let problem = format!(
                    "was begun with {what} {before}, now {now}; results may differ in the last \
                     digits: use the first, start a new run, or allow a mixed run (--allow-mixed)"
                );
                return Err(Error::file(&self.path, problem, None));
            }
            log::warn!("{}: {what} changes from {before} to {now}", self.path.display());
        }
        Ok(())
    }
}

/// Refuses a place without a run.
fn require_run(path: &Path) -> Result<()> {
    if layout::is_run(path) {
        return Ok(());
    }
    let lacks = format!("holds no run to resume: it has no {RUN}");
    Err(Error::file(path, layout::problem_of(path, &lacks, &lacks), None))
}

pub(super) fn refuse_other_scene(path: &Path, differences: &[String]) -> Result<()> {
    if differences.is_empty() {
        return Ok(());
    }
    let problem = format!(
        "holds a run of another scene (there: the run; here: this scene): choose another directory, or \
         take these differences back:\n  {}",
        differences.join("\n  ")
    );
    Err(Error::file(path, problem, None))
}
