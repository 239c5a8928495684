//! `beamlet illuminate`: kept moments of a run under other masks, spectra, constants or detectors.

use super::simulate::{quoted, summary};
use crate::args::Illuminate;
use crate::failure::Failure;
use crate::interrupt;
use crate::progress::Reporter;
use beamlet::kept::Kept;
use beamlet::scene::Scene;
use beamlet::stack::{Extent, RunDirectory};
use beamlet::{Control, Engine, EngineOptions, Error};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::Instant;

pub(super) fn run(arguments: &Illuminate, out: &mut impl Write) -> Result<(), Failure> {
    let outputs = outputs(arguments)?;
    let kept = Kept::open(&arguments.run)?;
    // Every scene and directory is looked at before the first is illuminated.
    let mut jobs = Vec::new();
    for (path, output) in arguments.scene.iter().zip(outputs) {
        let scene = Scene::load_with(path, &arguments.sets)?;
        let extent = Extent::of(&scene)?;
        let format = arguments.format.map(Into::into).unwrap_or_default();
        let sink = RunDirectory::create(&output, format, arguments.overwrite)?;
        jobs.push((path, scene, extent, sink.overrides(&arguments.sets)));
    }
    interrupt::listen();
    let engine = Engine::open(&EngineOptions {
        device: arguments.device.clone(),
        backend: arguments.backend.choice(),
        memory_limit: arguments.memory_limit,
        ..EngineOptions::default()
    })?;
    for (path, scene, extent, mut sink) in jobs {
        let began = Instant::now();
        let mut reporter = Reporter::new(arguments.quiet, arguments.verbose);
        let done = engine.reilluminate(&kept, &scene).and_then(|simulation| {
            simulation.run(
                &mut sink,
                Control {
                    progress: Some(&mut |progress| reporter.update(progress)),
                    cancel: Some(&interrupt::CANCELLED),
                    ..Control::default()
                },
            )
        });
        reporter.finish();
        match done {
            Ok(record) => summary(&sink, extent, &record, began.elapsed().as_secs_f64(), out)?,
            Err(Error::Interrupted) => {
                let advice = advice(arguments, path, sink.path());
                return Err(Failure::Interrupted { advice });
            }
            Err(error) => return Err(Scene::locate(path, &arguments.sets, error).into()),
        }
    }
    Ok(())
}

/// What to enter to go on after an interrupt.
fn advice(arguments: &Illuminate, scene: &Path, output: &Path) -> String {
    let word = |path: &Path| quoted(&path.to_string_lossy());
    let mut command = vec!["beamlet illuminate".to_owned(), word(&arguments.run)];
    command.extend(["--scene".into(), word(scene), "-o".into(), word(output)]);
    for set in &arguments.sets {
        command.extend(["--set".into(), quoted(set)]);
    }
    command.push("--overwrite".into());
    format!("to start this scene again: {}", command.join(" "))
}

/// A directory for each scene: as given, or below the one given by the names of the scenes.
fn outputs(arguments: &Illuminate) -> Result<Vec<PathBuf>, Failure> {
    if let [_] = arguments.scene.as_slice() {
        return Ok(vec![arguments.output.clone()]);
    }
    let mut outputs: Vec<PathBuf> = Vec::new();
    for path in &arguments.scene {
        let output = arguments.output.join(path.file_stem().unwrap_or_default());
        if outputs.contains(&output) {
            let name = output.display();
            return Err(Failure::Usage(format!("two scenes would be written to {name}")));
        }
        outputs.push(output);
    }
    Ok(outputs)
}
