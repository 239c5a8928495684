//! Joins parts of a run: every view is put in place, compared with the checksum of its part, and
//! committed. A join that ends at any moment is repeated, and goes on.

use super::RunDirectory;
use super::begun::Begun;
use crate::frames::Frames;
use crate::layout::{self, COUNTS, LOG, RUN, SCENE};
use crate::part::{Part, ViewRange, views_of_part};
use crate::progress_log::{self, Entry};
use crate::read::read_scene;
use crate::record::{RunRecord, RunStart, SamplingError, SamplingSummary};
use crate::run_file::{JoinedPart, RunFile, RunState};
use crate::scene_file;
use crate::sink::Sink;
use beamlet_core::cancel::Cancel;
use beamlet_core::{Error, Result, Tally, printed, setters};
use beamlet_model::scene::{Exposure, Scene};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// Options of a join.
#[derive(Default)]
#[non_exhaustive]
pub struct JoinOptions<'a> {
    /// Joins parts of different devices, drivers, backends or versions.
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
        /// Sets whether parts of different devices are joined.
        with_allow_mixed(allow_mixed: bool);
        /// Sets the command line.
        with_command(command: impl Into<Option<String>>);
        /// Sets the callback of the progress.
        with_progress(progress: &'a mut dyn FnMut(usize, usize));
        /// Sets what ends the join.
        with_cancel(cancel: Cancel);
    }
}

/// A part that is done.
struct Ready {
    path: PathBuf,
    views: ViewRange,
    part: Part,
    scene: Scene,
    file: RunFile,
    entries: BTreeMap<Exposure, Entry>,
}

/// Joins parts, in any order, to the run in `run`; its record. The parts stay.
///
/// # Errors
/// [`Error::File`] where a folder holds no part or one that is not complete, a view is not as its part
/// committed it, parts differ in scene, format, device, driver, backend or version, or share views, or `run`
/// is taken; [`Error::Argument`] where views are in no part; [`Error::Tally`] where too many rays are out of
/// balance; [`Error::Interrupted`].
///
/// # Example
///
/// ```no_run
/// let parts = ["part0".into(), "part1".into()];
/// let record = beamlet::stack::join(&parts, "run".as_ref(), Default::default())?;
/// println!("{} rays", record.tally.rays);
/// # Ok::<(), beamlet::Error>(())
/// ```
pub fn join(parts: &[PathBuf], run: &Path, options: JoinOptions<'_>) -> Result<RunRecord> {
    let mut parts = parts.iter().map(|path| Ready::open(path)).collect::<Result<Vec<_>>>()?;
    parts.sort_by_key(|part| (part.views.first, part.views.end));
    let Some((first, others)) = parts.split_first() else {
        return Err(Error::argument("parts", "none", "one or more"));
    };
    others.iter().try_for_each(|other| other.refuse_unlike(first, options.allow_mixed))?;
    refuse_gaps(&parts, first.part.extent.views)?;
    let scene = &first.scene;
    let record = record_of(scene, &parts, &first.file.record)?;
    let mut directory = match run.join(RUN).exists() {
        true => RunDirectory::resume(run, scene)?,
        false => RunDirectory::create(run, first.file.format, false)?,
    };
    if let Some(views) = directory.part {
        let problem = format!("holds views {views} of a run: choose another directory");
        return Err(Error::file(run, problem, None));
    }
    if directory.format != first.file.format {
        let problem =
            format!("has the format {}, its parts {}", directory.format, first.file.format);
        return Err(Error::file(run, problem, None));
    }
    directory.allow_mixed = options.allow_mixed;
    directory.command = options.command;
    put_in_place(directory, &parts, &record, options.progress, &options.cancel)?;
    Ok(record)
}

/// Puts every view in place that is not yet, and ends the run.
fn put_in_place(
    mut directory: RunDirectory,
    parts: &[Ready],
    record: &RunRecord,
    mut progress: Option<&mut dyn FnMut(usize, usize)>,
    cancel: &Cancel,
) -> Result<()> {
    let [first, ..] = parts else { return Ok(()) };
    let committed: BTreeSet<Exposure> = directory.committed().iter().copied().collect();
    let mut start =
        RunStart::new(&record.device, &record.driver, record.backend, &record.backend_reason);
    start.mesh_hashes = mesh_hashes(&first.scene);
    directory.begin(&first.scene, &start)?;
    let path = directory.path.clone();
    let all = views_of_part(&first.scene, None)?;
    for (done, view) in all.iter().enumerate() {
        if let Some(progress) = &mut progress {
            progress(done, all.len());
        }
        cancel.check()?;
        let of_view = parts.iter().find(|part| part.part.has(*view));
        let Some(part) = of_view.filter(|_| !committed.contains(view)) else { continue };
        super::opened(&mut directory.open, &path)?.in_place(|open| open.adopt(*view, part))?;
    }
    super::opened(&mut directory.open, &path)?.file.parts =
        parts.iter().map(Ready::provenance).collect();
    directory.finish(record)
}

impl Begun {
    /// Takes a view of a part, and makes it count where it has the checksums of the part's log.
    fn adopt(&mut self, view: Exposure, from: &Ready) -> Result<()> {
        let entry = from.entries.get(&view).ok_or_else(|| from.changed(view, false))?;
        let take = |frames: &mut Frames, folder: &Path| frames.adopt(view, folder, from.part);
        let counts = match &mut self.counts {
            Some(frames) if !view.is_dark() => Some(take(frames, &from.path.join(COUNTS))?),
            _ => None,
        };
        if counts != entry.counts {
            return Err(from.changed(view, true));
        }
        if take(&mut self.frames, &from.path)? != entry.sha256 {
            return Err(from.changed(view, false));
        }
        self.log.refuse_moved()?;
        self.log.append(view, entry)
    }
}

impl Ready {
    fn open(path: &Path) -> Result<Self> {
        let path = path.to_path_buf();
        if !layout::is_run(&path) {
            let file = "is a file: name the folder of a part";
            let lacks = format!("is no part of a run: it has no {RUN}");
            return Err(Error::file(&path, layout::problem_of(&path, file, &lacks), None));
        }
        let file = RunFile::read(&path.join(RUN))?;
        let Some(views) = file.part else {
            let problem = "holds a whole run, not a part of one as `simulate --views` makes it";
            return Err(Error::file(path, problem, None));
        };
        let scene = read_scene(&path.join(SCENE))?;
        let part = Part::of(&scene, Some(views))?;
        let entries = progress_log::read(&path.join(LOG))?;
        let all = views_of_part(&scene, Some(views))?;
        let ready = Self { path, views, part, scene, file, entries };
        let committed = all.iter().filter(|view| ready.entries.contains_key(view)).count();
        if ready.file.state == RunState::Done && committed == all.len() {
            return Ok(ready);
        }
        let problem = format!(
            "has {committed} of {} exposures, which include its flats and darks; make the others: {}",
            all.len(),
            ready.remedy()
        );
        Err(Error::file(ready.path, problem, None))
    }

    /// The command that completes the part.
    fn remedy(&self) -> String {
        let scene = printed::path(&self.path.join(SCENE));
        format!("`beamlet simulate {scene} --resume -o {}`", printed::path(&self.path))
    }

    /// The error of a view whose values do not have the checksum of the log.
    fn changed(&self, view: Exposure, counts: bool) -> Error {
        let name = layout::view(view, counts);
        let problem =
            format!("{name} does not have the checksum of {LOG}; make it again: {}", self.remedy());
        Error::file(&self.path, problem, None)
    }

    /// Refuses a part that differs from the first in scene, format, device, driver, backend or version.
    fn refuse_unlike(&self, first: &Self, allow_mixed: bool) -> Result<()> {
        let there = printed::path(&first.path);
        let hashes = mesh_hashes(&self.scene);
        let differences =
            scene_file::differences(&first.path.join(SCENE), &self.scene, Some(&hashes))?;
        if !differences.is_empty() {
            let problem = format!(
                "is of another scene than {there} (there: {there}; here: this part):\n  {}",
                differences.join("\n  ")
            );
            return Err(Error::file(&self.path, problem, None));
        }
        if self.file.format != first.file.format {
            let problem =
                format!("has the format {}, {there} {}", self.file.format, first.file.format);
            return Err(Error::file(&self.path, problem, None));
        }
        let [here, other] = [self, first].map(|part| part.file.record.platform());
        for [what, here, other] in here.differences(&other) {
            if !allow_mixed {
                let problem = format!(
                    "is of {what} {here}, {there} of {other}; values may differ in the last digits: \
                     simulate one of them again, or allow a mixed run (--allow-mixed)"
                );
                return Err(Error::file(&self.path, problem, None));
            }
            log::warn!("{}: {what} {here}, {there} has {other}", self.path.display());
        }
        Ok(())
    }

    fn provenance(&self) -> JoinedPart {
        JoinedPart {
            views: self.views,
            platform: self.file.record.platform(),
            began: self.file.began.clone(),
            duration_s: self.file.duration_s,
        }
    }
}

/// Refuses parts, in their order, that share views or lack some of `views`.
fn refuse_gaps(parts: &[Ready], views: u32) -> Result<()> {
    for pair in parts.windows(2) {
        let [before, after] = pair else { continue };
        let (first, end) = (after.views.first, before.views.end.min(after.views.end));
        if first < end {
            let other = printed::path(&before.path);
            let problem = format!("has the views {first}..{end}, and {other} has them, too");
            return Err(Error::file(&after.path, problem, None));
        }
    }
    let ends = parts.iter().map(|part| part.views.end);
    let firsts = parts.iter().map(|part| part.views.first);
    for (end, first) in std::iter::once(0).chain(ends).zip(firsts.chain([views])) {
        if end < first {
            let found = format!("no part with the views {end}..{first}");
            return Err(Error::argument(
                "parts",
                found,
                format!("each of the views 0..{views} once"),
            ));
        }
    }
    Ok(())
}

/// SHA-256 of the meshes of a scene by the name of their object.
fn mesh_hashes(scene: &Scene) -> BTreeMap<String, String> {
    let hashes = scene.objects.iter();
    hashes.filter_map(|object| Some((object.name.clone(), object.sha256.clone()?))).collect()
}

/// Record of the whole run: the record of its first part, with the counts and times of all parts.
fn record_of(scene: &Scene, parts: &[Ready], first: &RunRecord) -> Result<RunRecord> {
    let mut record = first.clone();
    let counted: Tally =
        parts.iter().flat_map(|part| part.entries.values()).map(|entry| entry.tally).sum();
    record.tally = Tally { defective_objects: record.tally.defective_objects, ..counted };
    let tolerance = scene.sampling.tolerances().light;
    record.sampling = SamplingSummary::of(&record.tally, tolerance);
    record.sampling_error = SamplingError::of(&record.tally, tolerance);
    record.warnings.extend(record.sampling_error.and_then(|it| it.warning(tolerance)));
    record.seconds = BTreeMap::new();
    for (stage, seconds) in parts.iter().flat_map(|part| &part.file.record.seconds) {
        *record.seconds.entry(stage.clone()).or_default() += seconds;
    }
    record.tally.refuse_unbalanced()?;
    Ok(record)
}
