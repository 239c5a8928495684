//! `beamlet illuminate`: kept moments of a run under other masks, spectra, constants or detectors.

use super::simulate::{command_line, quoted, summary};
use crate::args::Illuminate;
use crate::failure::Failure;
use crate::interrupt;
use crate::progress::Reporter;
use beamlet::moments::StoredMoments;
use beamlet::scene::Scene;
use beamlet::stack::{RunDirectory, RunFile, StackShape, is_same_place, layout};
use beamlet::{Cancel, Control, Engine, Error, RunRecord};
use std::collections::BTreeMap;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError, mpsc};
use std::thread;
use std::time::Instant;

/// Scenes illuminated side by side: while one is written the next keeps the device busy.
const SIDE_BY_SIDE: usize = 2;

/// Bytes of cells that scenes which make the same share.
const SHARED: u64 = 256 << 20;

/// A scene and where its stacks go.
struct Job {
    path: PathBuf,
    output: PathBuf,
    scene: Scene,
    extent: StackShape,
    sink: RunDirectory,
}

/// A scene that is done.
struct Done {
    title: Option<String>,
    extent: StackShape,
    sink: RunDirectory,
    record: RunRecord,
    seconds: f64,
}

/// Every scene and directory is looked at before the first is illuminated.
fn jobs(arguments: &Illuminate, outputs: Vec<PathBuf>) -> Result<Vec<Job>, Failure> {
    let mut jobs = Vec::new();
    for (path, output) in arguments.scene.iter().zip(outputs) {
        let scene = beamlet::cli_support::load_scene(path, &arguments.sets)?;
        let extent = StackShape::of(&scene)?;
        let format = arguments.format.unwrap_or_default();
        // Inputs are not replaced: the run with the moments, scenes and their files.
        let mut read = scene.input_files();
        read.push(arguments.run.clone());
        read.extend(arguments.scene.iter().cloned());
        let sink = RunDirectory::reading(&output, &read)
            .and_then(|()| RunDirectory::create(&output, format, arguments.overwrite))?;
        let sink = sink.overrides(&arguments.sets).command(command_line());
        jobs.push(Job { path: path.clone(), output, scene, extent, sink });
    }
    Ok(jobs)
}

pub(super) fn run(arguments: &Illuminate, out: &mut impl Write) -> Result<(), Failure> {
    let mut arguments = arguments.clone();
    if arguments.scene.is_empty() {
        arguments.scene.push(arguments.run.join(layout::SCENE));
    }
    let arguments = &arguments;
    let outputs = outputs(arguments)?;
    let record = arguments.run.join(layout::RUN);
    if record.exists() {
        // Moments lie in a run directory whose layout has to be known.
        RunFile::read(&record)?;
    }
    let mut kept = StoredMoments::open(&arguments.run)?;
    if arguments.scene.len() > 1 && arguments.engine.memory_limit.is_none() {
        kept = kept.sharing(SHARED);
    }
    let jobs = jobs(arguments, outputs)?;
    let cancel = interrupt::listen();
    let options = arguments.engine.options().with_profile(arguments.profile.profile);
    let engine = Engine::open(&options)?;
    let places: Vec<_> = jobs.iter().map(|job| (job.path.clone(), job.output.clone())).collect();
    // A limit applies to one run.
    let at_once = if arguments.engine.memory_limit.is_some() { 1 } else { SIDE_BY_SIDE };
    let at_once = at_once.min(jobs.len());
    let unfinished = side_by_side(arguments, (&engine, &kept), (jobs, at_once), &cancel, out)?;
    arguments.profile.show(&engine, None);
    let left: Vec<_> = unfinished.keys().map(|index| &places[*index]).collect();
    let advice = || advice(arguments, &left);
    // What went wrong says more than that the others were stopped.
    let mut failures: Vec<_> = unfinished.into_values().flatten().collect();
    failures.sort_by_key(|failure| matches!(failure, Failure::Interrupted { .. }));
    match failures.into_iter().next() {
        Some(Failure::Interrupted { .. }) => Err(Failure::Interrupted { advice: advice() }),
        Some(failure) => Err(failure),
        None => Ok(()),
    }
}

/// Illuminates scenes, `at_once` of them side by side, and prints a summary of each. Returns the indices of
/// the unfinished ones, with the failures of those that were begun.
fn side_by_side(
    arguments: &Illuminate,
    (engine, kept): (&Engine, &StoredMoments),
    (jobs, at_once): (Vec<Job>, usize),
    cancel: &Cancel,
    out: &mut impl Write,
) -> Result<BTreeMap<usize, Option<Failure>>, Failure> {
    let mut unfinished: BTreeMap<usize, Option<Failure>> =
        (0..jobs.len()).map(|index| (index, None)).collect();
    let (sender, results) = mpsc::channel();
    let jobs = Mutex::new(jobs.into_iter().enumerate());
    let failed = AtomicBool::new(false);
    thread::scope(|scope| {
        for worker in 0..at_once {
            let sender = sender.clone();
            let (jobs, failed) = (&jobs, &failed);
            let cancel = cancel.clone();
            let begun = thread::Builder::new().spawn_scoped(scope, move || {
                while !failed.load(Ordering::Relaxed) {
                    let next = jobs.lock().unwrap_or_else(PoisonError::into_inner).next();
                    let Some((index, job)) = next else { break };
                    // One bar is enough.
                    let mut messages = arguments.messages;
                    messages.quiet |= worker > 0;
                    let reporter = Reporter::new(messages);
                    let done = illuminate(engine, kept, job, &arguments.sets, (reporter, &cancel));
                    failed.fetch_or(done.is_err(), Ordering::Relaxed);
                    let _ = sender.send((index, done));
                }
            });
            match begun {
                Ok(_) => {}
                // The first one does it alone.
                Err(_) if worker > 0 => break,
                Err(error) => return Err(error.into()),
            }
        }
        drop(sender);
        for (index, done) in results {
            match done {
                Ok(Done { title, extent, sink, record, seconds }) => {
                    unfinished.remove(&index);
                    if arguments.messages.quiet {
                        continue;
                    }
                    let printed = summary(title.as_deref(), &sink, extent, &record, seconds, out);
                    failed.fetch_or(printed.is_err(), Ordering::Relaxed);
                    printed?;
                }
                Err(failure) => {
                    unfinished.insert(index, Some(failure));
                }
            }
        }
        Ok::<_, Failure>(())
    })?;
    Ok(unfinished)
}

fn illuminate(
    engine: &Engine,
    kept: &StoredMoments,
    mut job: Job,
    sets: &[String],
    (mut reporter, cancel): (Reporter, &Cancel),
) -> Result<Done, Failure> {
    let began = Instant::now();
    let mut report = |progress| reporter.update(progress);
    let mut control = Control::default().with_progress(&mut report).with_cancel(cancel.clone());
    let done = engine
        .reilluminate_with(kept, &job.scene, &mut control)
        .and_then(|simulation| simulation.run(&mut job.sink, control));
    reporter.finish();
    let Job { path, scene: Scene { title, .. }, extent, sink, .. } = job;
    match done {
        Ok(record) => {
            Ok(Done { title, extent, sink, record, seconds: began.elapsed().as_secs_f64() })
        }
        Err(Error::Interrupted) => Err(Failure::Interrupted { advice: String::new() }),
        Err(error) => Err(Scene::locate(&path, sets, error).into()),
    }
}

/// What to enter to go on after an interrupt, with the remaining scenes.
fn advice(arguments: &Illuminate, left: &[&(PathBuf, PathBuf)]) -> String {
    let word = |path: &Path| quoted(&path.to_string_lossy());
    let mut command = vec!["beamlet illuminate".to_owned(), word(&arguments.run)];
    for (scene, _) in left {
        command.extend(["--scene".into(), word(scene)]);
    }
    let output = match left {
        [(_, output)] => output,
        _ => &arguments.output,
    };
    command.extend(["-o".into(), word(output)]);
    for set in &arguments.sets {
        command.extend(["--set".into(), quoted(set)]);
    }
    if let Some(format) = arguments.format {
        command.extend(["--format".into(), format.to_string()]);
    }
    command.push("--overwrite".into());
    let what = if left.len() == 1 { "this scene" } else { "the remaining scenes" };
    format!("to start {what} again: {}", command.join(" "))
}

/// A directory for each scene: as given, or below the one given by the names of the scenes.
fn outputs(arguments: &Illuminate) -> Result<Vec<PathBuf>, Failure> {
    if let [_] = arguments.scene.as_slice() {
        return Ok(vec![arguments.output.clone()]);
    }
    let mut outputs: Vec<PathBuf> = Vec::new();
    for path in &arguments.scene {
        let output = arguments.output.join(path.file_stem().unwrap_or_default());
        if outputs.iter().any(|other| is_same_place(other, &output)) {
            let name = beamlet::cli_support::printed::path(&output);
            return Err(Failure::Usage(format!("two scenes would be written to {name}")));
        }
        outputs.push(output);
    }
    Ok(outputs)
}
