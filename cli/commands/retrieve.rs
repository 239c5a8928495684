//! `beamlet retrieve`: a run or measured stacks to transmission, refraction and dark field.

use crate::args::Retrieve;
use crate::failure::Failure;
use crate::interrupt;
use crate::progress::Reporter;
use beamlet::RowsControl;
use beamlet::retrieve::{
    ImagesTo, Input, Method, Record, RetrieveOptions, Weights, offsets, retrieve,
};
use beamlet::scene::Scene;
use beamlet::stack::{OpenRun, StackFile, refuse_overlap};
use beamlet::{Engine, Error};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::Instant;

pub(super) fn run(arguments: &Retrieve, out: &mut impl Write) -> Result<(), Failure> {
    let began = Instant::now();
    let (input, path) = match &arguments.run {
        Some(run) => (of_run(arguments, run)?, run.join("retrieved")),
        None => measured(arguments)?,
    };
    let path = arguments.output.clone().unwrap_or(path);
    refuse_overlap(&path, &read(arguments))?;
    let input = input.saturated_at(arguments.saturation);
    let of_scene = input.noise();
    let gain = match (input.counts(), arguments.gain) {
        (true, gain) => gain.or(of_scene.map(|[gain, _]| gain)).or(Some(1.0)),
        (false, None) => None,
        (false, Some(_)) => {
            let problem = "--gain belongs to counts: a run needs --counts with it";
            return Err(Failure::Usage(problem.into()));
        }
    };
    let options = RetrieveOptions::default()
        .with_method(arguments.method.into())
        .with_weights(arguments.weights.into())
        .with_gain(gain)
        .with_read_noise(arguments.read_noise.or(of_scene.map(|[_, noise]| noise)).unwrap_or(0.0))
        .with_steps(arguments.steps)
        .with_sample_offsets(arguments.sample_offsets.as_deref().map(offsets).transpose()?);
    if options.weights == Weights::Poisson && !input.counts() {
        let problem = "--weights poisson belongs to counts: a run needs --counts with it";
        return Err(Failure::Usage(problem.into()));
    }
    if arguments.read_noise.is_some() && options.weights == Weights::None {
        return Err(Failure::Usage("--read-noise belongs to --weights poisson".into()));
    }
    let two_step = options.method == Method::TwoStep;
    for (key, given) in [
        ("--steps", options.steps.is_some()),
        ("--sample-offsets", options.sample_offsets.is_some()),
    ] {
        if given && !two_step {
            let problem = format!("{key} belongs to --method two-step, not to {}", options.method);
            return Err(Failure::Usage(problem));
        }
    }
    interrupt::listen();
    let mut reporter = Reporter::new(arguments.messages);
    let engine = Engine::open(&arguments.device.options())?;
    let mut progress = |done, all| reporter.rows(done, all);
    let mut control =
        RowsControl::default().with_progress(&mut progress).with_cancel(&interrupt::CANCELLED);
    let to = ImagesTo::new(&path, arguments.format.into()).with_overwrite(arguments.overwrite);
    let done = retrieve(&engine, input, &options, to, &mut control);
    reporter.finish();
    match done {
        Ok(record) if arguments.json => super::write_json(&record, out),
        Ok(record) => summary(&record, &path, began.elapsed().as_secs_f64(), out),
        Err(Error::Interrupted) => {
            Err(Failure::Interrupted { advice: "nothing was written".into() })
        }
        Err(error) => Err(error.into()),
    }
}

/// Files that are read beside the stacks of flat and sample.
fn read(arguments: &Retrieve) -> Vec<PathBuf> {
    let lists = [&arguments.offsets, &arguments.sample_offsets];
    let lists = lists.into_iter().flatten().map(PathBuf::from).filter(|path| path.is_file());
    let scene = arguments.run.as_ref().map(|run| run.join("scene.toml"));
    let files = [arguments.geometry.clone(), arguments.dark.clone(), scene];
    files.into_iter().flatten().chain(lists).collect()
}

fn of_run(arguments: &Retrieve, run: &Path) -> Result<Input, Failure> {
    Ok(Input::of_run(&OpenRun::open(run)?, arguments.counts)?)
}

/// Stacks of their own, with the geometry of a scene.
fn measured(arguments: &Retrieve) -> Result<(Input, PathBuf), Failure> {
    let missing = |name: &str| {
        Failure::Usage(format!("measured stacks need {name} (or name a run directory)"))
    };
    let flat = arguments.flat.as_ref().ok_or_else(|| missing("--flat"))?;
    let sample = arguments.sample.as_ref().ok_or_else(|| missing("--sample"))?;
    let geometry = arguments.geometry.as_ref().ok_or_else(|| missing("--geometry"))?;
    let output = arguments.output.as_ref().ok_or_else(|| missing("--output"))?;
    let mut scene = Scene::load_with(geometry, &arguments.sets)?;
    if let Some(list) = &arguments.offsets {
        scene.scan.mask_offsets = offsets(list)?;
    }
    let flat = StackFile::open(flat)?;
    let sample = StackFile::open(sample)?;
    let dark = arguments.dark.as_ref().map(StackFile::open).transpose()?;
    let lists = [&arguments.offsets, &arguments.sample_offsets];
    let lists = lists.into_iter().flatten().map(PathBuf::from).filter(|path| path.is_file());
    let others: Vec<PathBuf> = std::iter::once(geometry.clone()).chain(lists).collect();
    let input = Input::measured(&scene, flat, sample, dark.as_ref())?.with_read(&others);
    Ok((input, output.clone()))
}

/// What the user wants to know at the end, on stdout.
fn summary(
    record: &Record,
    path: &Path,
    seconds: f64,
    out: &mut impl Write,
) -> Result<(), Failure> {
    let [views, rows, columns] = record.shape;
    writeln!(out, "images   {}", beamlet::printed::path(path))?;
    writeln!(out, "method   {}, weights {}", record.method, record.weights)?;
    writeln!(out, "views    {views} of {columns} x {rows} pixels, in {seconds:.1} s")?;
    let pixels = views * rows * columns;
    writeln!(out, "pixels   {} of {pixels} without an answer", record.without_answer)?;
    for (bit, count) in record.flagged.iter().filter(|(_, count)| **count > 0) {
        let meaning = record.flags.get(bit).map_or("", String::as_str);
        writeln!(out, "         {count} with flag {bit} ({meaning})")?;
    }
    Ok(())
}
