//! A shard of a planned run: a part of its views in a folder of its own, with its own lock and log.

use super::RunDirectory;
use crate::layout::{self, LOG, RUN};
use crate::plan::Plan;
use crate::progress_log::ProgressLog;
use crate::run_file::{RunFile, RunState};
use crate::scene_file;
use crate::shard::Shard;
use beamlet_core::{Error, Result, folder};
use beamlet_model::scene::Scene;
use std::path::{Path, PathBuf};

/// Name of the machine, where the system has it in a file.
pub(super) fn host() -> Option<String> {
    let text = std::fs::read_to_string("/proc/sys/kernel/hostname").ok()?;
    Some(text.trim().to_owned()).filter(|name| !name.is_empty())
}

impl RunDirectory {
    /// The scene with the tolerances of the planned run in `run` where it has no numbers, and its `refine`
    /// for `"auto"`: the scene of its shards.
    ///
    /// # Errors
    /// [`Error::File`] where there is no plan.
    pub fn scene_of_shard(run: &Path, scene: &Scene) -> Result<Scene> {
        Plan::read(run)?;
        let mut scene = scene.clone();
        scene_file::keep_resolved(&run.join(layout::SCENE), &mut scene);
        Ok(scene)
    }

    /// The directory of a shard of the planned run in `run`, new or resumed. Its lock is held from now
    /// on.
    ///
    /// # Errors
    /// [`Error::File`] where there is no plan, or one of another scene or number of shards, or
    /// another process makes the shard.
    pub fn shard(run: impl Into<PathBuf>, shard: Shard, scene: &Scene) -> Result<Self> {
        let root = run.into();
        let plan = Plan::read(&root)?;
        if plan.shards != shard.count {
            let problem = format!("is planned in {} shards, not in {}", plan.shards, shard.count);
            return Err(Error::file(&root, problem, None));
        }
        plan.scene(&root)?;
        let scene = &Self::scene_of_shard(&root, scene)?;
        let path = layout::shard(&root, shard.index);
        beamlet_core::whole_file::refuse_link(&path)?;
        folder::make_all(&path)?;
        let log = ProgressLog::lock_patiently(&path.join(LOG))?;
        // A join removes a shard with its lock.
        let whole = root.join(RUN);
        if whole.exists() && RunFile::read(&whole)?.state == RunState::Done {
            return Err(Error::file(&root, "was joined meanwhile", None));
        }
        let record = path.join(RUN);
        if record.exists() {
            plan.refuse_other(&path, &RunFile::read(&record)?, shard)?;
        }
        let mut directory = match record.exists() {
            true => Self::resume_part(path, root.clone(), Some(shard), Some(log), scene)?,
            false => Self::at(path, plan.format, Some(log)),
        };
        (directory.root, directory.shard, directory.is_planned) = (root, Some(shard), true);
        directory.scene_sha256 = Some(plan.scene_sha256);
        Ok(directory)
    }

    /// The part of the run that is here; all of it, where it has no shards.
    #[must_use]
    pub fn part_of_run(&self) -> Shard {
        self.shard.unwrap_or(Shard::WHOLE)
    }
}
