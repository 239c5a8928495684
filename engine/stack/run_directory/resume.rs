//! Resuming a run: the views that are still as committed, and whether it may continue.

use super::RunDirectory;
use crate::numbers;
use crate::scene::{Exposure, Scene};
use crate::stack::layout::{self, LOG, RUN, SCENE};
use crate::stack::progress_log::{self, ProgressLog};
use crate::stack::record::RunRecord;
use crate::stack::run_file::RunFile;
use crate::stack::shape::StackShape;
use crate::stack::{own_files, scene_file, verify};
use crate::{Error, Result, Tally, moments};
use std::path::{Path, PathBuf};

/// Contents of the directory when the run was resumed.
#[derive(Debug)]
pub(super) struct Resumed {
    pub(super) file: RunFile,
    pub(super) committed: Vec<Exposure>,
    /// Views whose frames are whole, even where their moments are not.
    pub(super) intact: Vec<Exposure>,
    /// Views of the log that are made again.
    pub(super) again: Vec<Exposure>,
    /// Differences from the committed state.
    pub(super) problems: Vec<String>,
    /// Counts of the committed views, and the number of those without.
    pub(super) counted: Tally,
    pub(super) uncounted: u32,
}

impl RunDirectory {
    /// The scene with the tolerances of an interrupted run where it has no numbers: the scene that a
    /// resumed run goes on with.
    ///
    /// # Errors
    /// [`Error::File`] where there is no run.
    pub fn scene_of_resumed(path: &Path, scene: &Scene) -> Result<Scene> {
        require_run(path)?;
        let mut scene = scene.clone();
        // A scene that cannot be read is an error of `resume`, which compares the two.
        scene_file::keep_tolerances(&path.join(SCENE), &mut scene);
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
        refuse_other_scene(&path, &differences.found)?;
        let extent = StackShape::of(scene)?;
        let entries = progress_log::read(&path.join(LOG))?;
        let found = verify::frames(&path, file.format, extent, scene, &entries);
        let mut problems: Vec<String> = found
            .problems
            .into_iter()
            .map(|(view, problem)| match view {
                Some(_) => format!("{problem}; it is simulated again"),
                None => format!("{problem}; repaired, and lost views are simulated again"),
            })
            .collect();
        let mut committed = found.whole.clone();
        let keep_moments = file.keep_moments.unwrap_or_else(|| moments::file::is_there(&path));
        if keep_moments {
            for (view, problem) in verify::moments(&path, &found.whole) {
                committed.retain(|other| *other != view);
                problems.push(format!("{problem}; it is simulated again"));
            }
        }
        let counted = committed.iter().filter_map(|view| entries[view].tally);
        let (uncounted, counted) = (committed.len() - counted.clone().count(), counted.sum());
        let again = entries.into_keys().filter(|view| !committed.contains(view)).collect();
        let mut run = Self::at(path, file.format, log);
        run.keep_moments = keep_moments;
        run.resumed = Some(Resumed {
            file,
            committed,
            intact: found.whole,
            again,
            problems,
            counted,
            uncounted: numbers::count(uncounted),
        });
        Ok(run)
    }

    /// Views that are committed already, for [`crate::Control::skip`].
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

    /// Counts of the views that are committed already, for [`crate::Control::counted`].
    #[must_use]
    pub fn counted(&self) -> Tally {
        self.resumed.as_ref().map_or_else(Tally::default, |resumed| resumed.counted)
    }

    /// Whether the run that is resumed keeps moments, where that is known: runs of earlier
    /// versions do not record it, and may have been interrupted before they kept any.
    #[must_use]
    pub fn keeps_moments(&self) -> Option<bool> {
        let recorded = self.resumed.as_ref().and_then(|resumed| resumed.file.keep_moments);
        recorded.or_else(|| moments::file::is_there(&self.path).then_some(true))
    }

    /// run.json of the run that is resumed.
    #[must_use]
    pub fn recorded(&self) -> Option<&RunFile> {
        self.resumed.as_ref().map(|resumed| &resumed.file)
    }

    /// Refuses files that the run began without the hashes of.
    pub(super) fn refuse_unhashed(&self, files: &[String]) -> Result<()> {
        if files.is_empty() || self.allow_unhashed {
            return Ok(());
        }
        let problem = format!(
            "has no hash of {}, so that a change of that file cannot be found; start anew, or allow it (--allow-unhashed)",
            files.join(", ")
        );
        Err(Error::file(&self.path, problem, None))
    }

    /// Refuses a device, driver, backend or version other than those that began the run.
    pub(super) fn refuse_mixed(&self, recorded: &RunRecord, now: &RunRecord) -> Result<()> {
        let pairs = [
            ("version", recorded.version.clone(), now.version.clone()),
            ("device", recorded.device.clone(), now.device.clone()),
            ("driver", recorded.driver.clone(), now.driver.clone()),
            ("backend", recorded.backend.to_string(), now.backend.to_string()),
        ];
        for (what, before, now) in pairs {
            if before == now {
                continue;
            }
            if !self.allow_mixed {
                let problem = format!(
                    "was begun with {what} {before}, now {now}; results may differ in the last digits: use the first, start anew, or allow a mixed run"
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
    let problem = match path.exists() {
        true => format!("holds no run to resume: it has no {RUN}"),
        false => format!("is not there: it has no {RUN} to go on from"),
    };
    Err(Error::file(path, problem, None))
}

pub(super) fn refuse_other_scene(path: &Path, differences: &[String]) -> Result<()> {
    if differences.is_empty() {
        return Ok(());
    }
    let problem = format!("holds a run of another scene:\n  {}", differences.join("\n  "));
    Err(Error::file(path, problem, None))
}
