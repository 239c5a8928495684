//! Joins the shards of a planned run: every view is put in place, compared with the checksum of its
//! shard, and committed. A join that ends at any moment is repeated, and goes on.

use super::RunDirectory;
use super::begun::Begun;
use crate::frames::Frames;
use crate::layout::{self, COUNTS, DEVICE, LOG, PLAN, RUN, SHARDS};
use crate::own_files::{remove_file, remove_stacks};
use crate::plan::Plan;
use crate::progress_log::{self, Entry, ProgressLog};
use crate::record::{RunRecord, RunStart, SamplingSummary};
use crate::run_file::{JoinedShard, RunFile, RunState};
use crate::shape::{StackShape, views};
use crate::shard::{Part, Shard};
use crate::sink::Sink;
use beamlet_core::cancel::Cancel;
use beamlet_core::{Error, Result, Tally, printed, setters};
use beamlet_model::scene::{Exposure, Scene};
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

/// State of a shard of a planned run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum ShardState {
    /// Not begun.
    Waiting,
    /// A process makes it.
    Running,
    /// It was stopped, or failed, and can go on.
    Interrupted,
    /// Its process ended without a word, and it can go on.
    Dead,
    /// Every view is committed.
    Done,
}

/// State of a shard, and how far it is.
#[derive(Debug, Clone, Serialize)]
#[non_exhaustive]
pub struct ShardStatus {
    /// The shard.
    pub shard: Shard,
    /// Its state.
    pub state: ShardState,
    /// Views that are committed, with the flats and the darks.
    pub committed: usize,
    /// All of its views.
    pub views: usize,
    /// Machine of its last process.
    pub host: Option<String>,
    /// When it began, UTC.
    pub began: Option<String>,
}

/// The shards of the planned run in `run`, each with its state.
///
/// # Errors
/// [`Error::File`] where there is no plan, or a record or log cannot be read.
pub fn shard_states(run: &Path) -> Result<Vec<ShardStatus>> {
    let plan = Plan::read(run)?;
    let scene = plan.scene(run)?;
    let all: Vec<Exposure> = views(&scene)?.collect();
    let of_shard = |shard: Shard| {
        let path = layout::shard(run, shard.index);
        let entries = progress_log::read(&path.join(LOG))?;
        let own = all.iter().filter(|view| shard.has(**view, plan.extent));
        let (committed, views) = own
            .fold((0, 0), |(n, all), view| (n + usize::from(entries.contains_key(view)), all + 1));
        let record = path.join(RUN);
        let file = if record.exists() { Some(RunFile::read(&record)?) } else { None };
        if let Some(file) = &file {
            plan.refuse_other(&path, file, shard)?;
        }
        let is_running = progress_log::is_locked(&path.join(LOG));
        let state = match file.as_ref().map(|file| file.state) {
            _ if is_running => ShardState::Running,
            Some(RunState::Done) if committed == views => ShardState::Done,
            Some(RunState::Running) => ShardState::Dead,
            Some(_) => ShardState::Interrupted,
            None => ShardState::Waiting,
        };
        let (host, began) = file.map(|file| (file.host, Some(file.began))).unwrap_or_default();
        Ok(ShardStatus { shard, state, committed, views, host, began })
    };
    plan.all().map(of_shard).collect()
}

/// A shard that is done.
struct Ready {
    part: Part,
    path: PathBuf,
    file: RunFile,
    entries: BTreeMap<Exposure, Entry>,
}

/// Options of a join.
#[derive(Default)]
#[non_exhaustive]
pub struct JoinOptions<'a> {
    /// Joins shards of different devices, drivers, backends or versions.
    pub allow_mixed: bool,
    /// Command line, for run.json.
    pub command: Option<String>,
    /// Called with views that are done and views in all.
    pub progress: Option<&'a mut dyn FnMut(usize, usize)>,
    /// Ends the join with [`Error::Interrupted`]; another one goes on.
    pub cancel: Cancel,
}

impl std::fmt::Debug for JoinOptions<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("JoinOptions")
            .field("allow_mixed", &self.allow_mixed)
            .finish_non_exhaustive()
    }
}

impl<'a> JoinOptions<'a> {
    setters! {
        /// Sets whether shards of different devices are joined.
        with_allow_mixed(allow_mixed: bool);
        /// Sets the command line.
        with_command(command: impl Into<Option<String>>);
        /// Sets the callback of the progress.
        with_progress(progress: &'a mut dyn FnMut(usize, usize));
        /// Sets what ends the join.
        with_cancel(cancel: Cancel);
    }
}

/// Joins the shards of the planned run in `run`; its record. A run that is joined already is left
/// alone.
///
/// # Errors
/// [`Error::File`] where there is no planned run, shards are missing or running (names them), a view is
/// not as its shard committed it, or shards differ in device, driver, backend or version; [`Error::Tally`] where too many
/// rays are out of balance; [`Error::Interrupted`].
///
/// # Example
///
/// ```no_run
/// let record = beamlet::stack::join("run".as_ref(), Default::default())?;
/// println!("{} rays", record.tally.rays);
/// # Ok::<(), beamlet::Error>(())
/// ```
pub fn join(run: &Path, options: JoinOptions<'_>) -> Result<RunRecord> {
    let record = run.join(RUN);
    let there = if record.exists() { Some(RunFile::read(&record)?) } else { None };
    let is_done = |file: &RunFile| file.state == RunState::Done && !file.shards.is_empty();
    if let Some(file) = there.as_ref().filter(|file| is_done(file)) {
        if layout::is_planned(run) {
            // Joined, and ended before the shards were removed.
            let _lock = ProgressLog::lock(&run.join(LOG))?;
            let plan = Plan::read(run)?;
            plan.all().try_for_each(|shard| remove_shard(run, shard, plan.extent))?;
            remove_plan(run)?;
        }
        return Ok(file.record.clone());
    }
    let plan = Plan::read(run)?;
    let scene = plan.scene(run)?;
    let log = ProgressLog::lock(&run.join(LOG))?;
    let shards = ready(run, &plan, &scene)?;
    refuse_mixed(run, &shards, options.allow_mixed)?;
    let record = record_of(&scene, &shards)?;
    let mut directory = match there {
        Some(_) => RunDirectory::resume_part(
            run.to_path_buf(),
            run.to_path_buf(),
            None,
            Some(log),
            &scene,
        )?,
        None => RunDirectory::at(run.to_path_buf(), plan.format, Some(log)),
    };
    directory.is_planned = true;
    directory.allow_mixed = options.allow_mixed;
    directory.command = options.command;
    let joined = joined(directory, &scene, &shards, &record, options.progress, &options.cancel);
    joined?;
    for Ready { part, .. } in shards {
        remove_shard(run, part.shard, plan.extent)?;
    }
    remove_plan(run)?;
    Ok(record)
}

/// Puts every view in place that is not yet, and ends the run.
fn joined(
    mut directory: RunDirectory,
    scene: &Scene,
    shards: &[Ready],
    record: &RunRecord,
    mut progress: Option<&mut dyn FnMut(usize, usize)>,
    cancel: &Cancel,
) -> Result<()> {
    let committed: BTreeSet<Exposure> = directory.committed().iter().copied().collect();
    let mut start =
        RunStart::new(&record.device, &record.driver, record.backend, &record.backend_reason);
    start.search = record.search;
    let hashes = scene.objects.iter().filter_map(|it| Some((it.name.clone(), it.sha256.clone()?)));
    start.mesh_hashes = hashes.collect();
    directory.begin(scene, &start)?;
    let all: Vec<Exposure> = views(scene)?.collect();
    // Of one shard at a time: a process may open few files. Views of a shard follow each other.
    let mut locked: Option<(Shard, ProgressLog)> = None;
    for (done, view) in all.iter().enumerate() {
        if let Some(progress) = &mut progress {
            progress(done, all.len());
        }
        cancel.check()?;
        if committed.contains(view) {
            continue;
        }
        let at = shards.partition_point(|shard| shard.part.is_before(*view));
        let Some(shard) = shards.get(at) else { continue };
        if locked.as_ref().is_none_or(|(of, _)| *of != shard.part.shard) {
            drop(locked.take());
            let log = ProgressLog::lock_patiently(&shard.path.join(LOG))?;
            locked = Some((shard.part.shard, log));
        }
        let path = directory.path.clone();
        let open = super::opened(&mut directory.open, &path)?;
        open.in_place(|open| open.adopt(&path, *view, shard))?;
    }
    let path = directory.path.clone();
    super::opened(&mut directory.open, &path)?.file.shards =
        shards.iter().map(joined_shard).collect();
    directory.finish(record)
}

fn joined_shard(shard: &Ready) -> JoinedShard {
    let file = &shard.file;
    JoinedShard {
        host: file.host.clone(),
        platform: file.record.platform(),
        began: file.began.clone(),
        duration_s: file.duration_s,
    }
}

impl Begun {
    /// Takes a view of a shard, and makes it count where it has the checksums of the shard's log.
    fn adopt(&mut self, path: &Path, view: Exposure, from: &Ready) -> Result<()> {
        let entry = from.entries.get(&view).ok_or_else(|| {
            let problem = format!("has no {}", layout::view(view, false));
            Error::file(from.path.join(LOG), problem, None)
        })?;
        let changed = |counts| {
            let name = layout::view(view, counts);
            let problem = format!(
                "{name} does not have the checksum of its shard; simulate it again: {}",
                remedy(path, from.part.shard)
            );
            Error::file(&from.path, problem, None)
        };
        let take = |frames: &mut Frames, folder: &Path| frames.adopt(view, folder, from.part);
        let counts = match &mut self.counts {
            Some(frames) if !view.is_dark() => Some(take(frames, &from.path.join(COUNTS))?),
            _ => None,
        };
        if counts != entry.counts {
            return Err(changed(true));
        }
        if take(&mut self.frames, &from.path)? != entry.sha256 {
            return Err(changed(false));
        }
        self.log.refuse_moved()?;
        self.log.append(view, entry)
    }
}

/// The shards, where all are done and of this plan.
fn ready(run: &Path, plan: &Plan, scene: &Scene) -> Result<Vec<Ready>> {
    let states = shard_states(run)?;
    let all: Vec<Exposure> = views(scene)?.collect();
    let missing: Vec<&ShardStatus> =
        states.iter().filter(|status| status.state != ShardState::Done).collect();
    if let Some(first) = missing.first() {
        let count = |state| missing.iter().filter(|status| status.state == state).count();
        let kinds = [
            (ShardState::Waiting, "not begun"),
            (ShardState::Running, "running"),
            (ShardState::Interrupted, "interrupted"),
            (ShardState::Dead, "dead"),
        ];
        let words: Vec<String> = kinds
            .into_iter()
            .map(|(state, word)| (count(state), word))
            .filter(|(count, _)| *count > 0)
            .map(|(count, word)| format!("{count} {word}"))
            .collect();
        let listed: Vec<String> =
            missing.iter().take(20).map(|status| status.shard.index.to_string()).collect();
        let more = if missing.len() > 20 { ", …" } else { "" };
        let problem = format!(
            "{} of {} shards are missing ({}): {}{more}; simulate them, for example: {}",
            missing.len(),
            plan.shards,
            words.join(", "),
            listed.join(", "),
            remedy(run, first.shard)
        );
        return Err(Error::file(run, problem, None));
    }
    let of_shard = |shard: Shard| {
        let path = layout::shard(run, shard.index);
        let file = RunFile::read(&path.join(RUN))?;
        plan.refuse_other(&path, &file, shard)?;
        let entries = progress_log::read(&path.join(LOG))?;
        let part = Part { extent: plan.extent, shard };
        let mut own = all.iter().filter(|view| part.has(**view));
        if let Some(view) = own.find(|view| !entries.contains_key(view)) {
            let problem = format!("has no {}", layout::view(*view, false));
            return Err(Error::file(path.join(LOG), problem, None));
        }
        Ok(Ready { part, path, file, entries })
    };
    plan.all().map(of_shard).collect()
}

/// The command that makes a shard.
fn remedy(run: &Path, shard: Shard) -> String {
    let scene = printed::path(&run.join(layout::SCENE));
    format!("beamlet simulate {scene} --shard {shard} -o {}", printed::path(run))
}

/// Refuses shards that were made by different devices, drivers, backends or versions.
fn refuse_mixed(run: &Path, shards: &[Ready], allow: bool) -> Result<()> {
    let [first, others @ ..] = shards else { return Ok(()) };
    for other in others {
        let [here, there] = [first, other].map(|shard| shard.file.record.platform());
        let Some([what, here, there]) = here.differences(&there).into_iter().next() else {
            continue;
        };
        let [one, other] = [first, other].map(|shard| shard.part.shard);
        let problem = format!(
            "has shard {one} of {what} {here} and shard {other} of {what} {there}; values may \
             differ in the last digits: simulate one of them again, or allow a mixed run \
             (--allow-mixed)"
        );
        if !allow {
            return Err(Error::file(run, problem, None));
        }
        log::warn!("{}: shards {one} and {other} differ in {what}: {here}, {there}", run.display());
    }
    Ok(())
}

/// Record of the whole run: the record of its first shard, with the counts and times of all shards.
fn record_of(scene: &Scene, shards: &[Ready]) -> Result<RunRecord> {
    let Some(first) = shards.first() else {
        return Err(Error::argument("shards", "none", "one or more"));
    };
    let mut record = first.file.record.clone();
    let of_views = shards.iter().flat_map(|shard| shard.entries.values());
    let counted: Tally = of_views.map(|entry| entry.tally).sum();
    record.tally = Tally { defective_objects: record.tally.defective_objects, ..counted };
    let tolerance = scene.sampling.tolerances().light;
    record.sampling = SamplingSummary::of(&record.tally, tolerance);
    record.seconds = BTreeMap::new();
    for (stage, seconds) in shards.iter().flat_map(|shard| &shard.file.record.seconds) {
        *record.seconds.entry(stage.clone()).or_default() += seconds;
    }
    record.tally.refuse_unbalanced()?;
    Ok(record)
}

/// Removes beamlet's own files of a shard, which no other process may use then.
fn remove_shard(run: &Path, shard: Shard, extent: StackShape) -> Result<()> {
    let path = layout::shard(run, shard.index);
    if !path.exists() {
        return Ok(());
    }
    let _log = ProgressLog::lock_patiently(&path.join(LOG))?;
    let counts = path.join(COUNTS);
    for root in [&counts, &path] {
        remove_stacks(root, extent, &[])?;
        layout::stack_files().try_for_each(|name| remove_file(&root.join(name)))?;
    }
    let _ = fs::remove_dir(counts);
    let others = [DEVICE, RUN, LOG].into_iter().map(str::to_owned);
    layout::unfinished().chain(others).try_for_each(|name| remove_file(&path.join(name)))?;
    let _ = fs::remove_dir(path);
    Ok(())
}

/// Removes the plan, last of all.
fn remove_plan(run: &Path) -> Result<()> {
    let _ = fs::remove_dir(run.join(SHARDS));
    remove_file(&run.join(DEVICE))?;
    remove_file(&run.join(PLAN))
}
