//! `beamlet retrieve`: a run or measured stacks to transmission, refraction and dark field.

mod summary;

use super::simulate::command_line;
use crate::args::Retrieve;
use crate::failure::Failure;
use crate::interrupt;
use crate::progress::Reporter;
use beamlet::RowsControl;
use beamlet::retrieve::{ImagesTo, Input, Method, RetrieveOptions, Weights, offsets, retrieve};
use beamlet::scene::Scene;
use beamlet::stack::{OpenRun, StackFile, layout, refuse_overlap};
use beamlet::{Engine, Error};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::Instant;

pub(super) fn run(arguments: &Retrieve, out: &mut impl Write) -> Result<(), Failure> {
    let began = Instant::now();
    let (input, path) = match &arguments.run {
        Some(run) => (of_run(arguments, run)?, run.join(layout::RETRIEVED)),
        None => measured(arguments)?,
    };
    let path = arguments.output.clone().unwrap_or(path);
    refuse_overlap(&path, &read(arguments))?;
    let has_counts = arguments.run.is_some() && input.scene().detector.counts.is_some();
    let mut input = input.saturated_at(arguments.saturation);
    if let Some(file) = &arguments.bad_pixels {
        input = input.with_bad_pixels(file)?;
    }
    if arguments.columns.is_some() || arguments.bin.is_some() {
        input = input.with_selection(arguments.columns, arguments.bin)?;
    }
    let of_scene = input.noise();
    let gain_assumed = arguments.gain.is_none() && of_scene.is_none();
    for (key, given) in [
        ("--gain", arguments.gain.is_some()),
        ("--read-noise", arguments.read_noise.is_some()),
        ("--weights poisson", Weights::from(arguments.weights) == Weights::Poisson),
    ] {
        if given && !input.counts() {
            let problem = format!("{key} is for counts: add --counts for a run");
            return Err(Failure::Usage(problem));
        }
    }
    let [gain_of_scene, noise_of_scene] = of_scene.unwrap_or([1.0, 0.0]);
    let gain = input.counts().then(|| arguments.gain.unwrap_or(gain_of_scene));
    let offsets_z = arguments.offsets_z.as_deref().map(offsets).transpose()?;
    let chosen = RetrieveOptions::default()
        .with_lattice(arguments.lattice)
        .with_aperture(arguments.aperture)
        .with_detector_aperture(arguments.detector_aperture)
        .with_offsets_z(offsets_z.unwrap_or_default());
    let options = chosen
        .with_method(arguments.method.map(Method::from))
        .with_background(arguments.background)
        .with_weights(arguments.weights.into())
        .with_gain(gain)
        .with_gain_assumed(gain_assumed)
        .with_empty_beam(arguments.empty_beam.clone())
        .with_correct(arguments.correct.unwrap_or_default())
        .with_phase(arguments.phase)
        .with_read_noise(arguments.read_noise.unwrap_or(noise_of_scene));
    let cancel = interrupt::listen();
    let mut reporter = Reporter::new(arguments.messages);
    let options_of_device = arguments.device.options().with_profile(arguments.profile.profile);
    let engine = Engine::open(&options_of_device)?;
    let format = arguments.format.unwrap_or_else(|| input.format());
    let mut progress = |done, all| reporter.rows(done, all);
    let mut control = RowsControl::default().with_progress(&mut progress).with_cancel(cancel);
    let command = command_line();
    let to = ImagesTo::new(&path, format)
        .with_overwrite(arguments.overwrite)
        .with_command(Some(&command));
    let done = retrieve(&engine, input, &options, to, &mut control);
    reporter.finish();
    arguments.profile.show(&engine, None);
    match done {
        Ok(record) if arguments.json => super::write_json(&record, out),
        Ok(_) if arguments.messages.quiet => Ok(()),
        Ok(record) => {
            summary::write(&record, &path, began.elapsed().as_secs_f64(), has_counts, out)
        }
        Err(Error::Interrupted) => {
            Err(Failure::Interrupted { advice: "nothing was written".into() })
        }
        Err(error) => Err(error.into()),
    }
}

/// Files that are read beside the stacks of flat and sample.
fn read(arguments: &Retrieve) -> Vec<PathBuf> {
    let scene = arguments.run.as_ref().map(|run| run.join(layout::SCENE));
    let bad_pixels = arguments.bad_pixels.clone();
    let files = [arguments.geometry.clone(), arguments.dark.clone(), bad_pixels, scene];
    files.into_iter().flatten().chain(lists(arguments)).collect()
}

/// Files of offsets.
fn lists(arguments: &Retrieve) -> Vec<PathBuf> {
    let lists = [&arguments.offsets, &arguments.offsets_z].into_iter().flatten();
    lists.map(PathBuf::from).filter(|path| path.is_file()).collect()
}

fn of_run(arguments: &Retrieve, run: &Path) -> Result<Input, Failure> {
    Ok(Input::of_run(&OpenRun::open(run)?, arguments.counts)?
        .without_steps(&arguments.omit_steps)?)
}

/// Stacks of their own, with the geometry of a scene.
fn measured(arguments: &Retrieve) -> Result<(Input, PathBuf), Failure> {
    let missing = |name: &str| {
        Failure::Usage(format!("measured stacks need {name}; or give a run directory"))
    };
    if arguments.counts {
        let problem = "--counts belongs to a run: measured stacks are detector numbers already";
        return Err(Failure::Usage(problem.into()));
    }
    let flat = arguments.flat.as_ref().ok_or_else(|| missing("--flat"))?;
    let sample = arguments.sample.as_ref().ok_or_else(|| missing("--sample"))?;
    let geometry = arguments.geometry.as_ref().ok_or_else(|| missing("--geometry"))?;
    // A run is the set-up of its scene.
    let geometry = match layout::is_run(geometry) {
        true => &geometry.join(layout::SCENE),
        false => geometry,
    };
    let output = arguments.output.as_ref().ok_or_else(|| missing("--output"))?;
    let mut scene = Scene::load_with(geometry, &arguments.sets)?;
    if let Some(list) = &arguments.offsets {
        scene.scan.replace_offsets(offsets(list)?);
    }
    let flat = StackFile::open(flat)?;
    let sample = StackFile::open(sample)?;
    let dark = arguments.dark.as_ref().map(StackFile::open).transpose()?;
    let others: Vec<PathBuf> = std::iter::once(geometry.clone()).chain(lists(arguments)).collect();
    let input = Input::measured(&scene, flat, sample, dark.as_ref())?
        .without_steps(&arguments.omit_steps)?
        .with_flats_every(arguments.flats_every)
        .with_read(&others);
    Ok((input, output.clone()))
}
