//! `beamlet retrieve`: a run or measured stacks to transmission, refraction and dark field.

mod summary;

use super::simulate::command_line;
use crate::args::TableArguments;
use crate::failure::Failure;
use crate::interrupt;
use crate::progress::Reporter;
use beamlet::RowsControl;
use beamlet::cli_support::options::RetrieveArguments;
use beamlet::retrieve::{ImagesTo, Input, retrieve};
use beamlet::scene::Scene;
use beamlet::stack::{OpenRun, StackFile, layout, refuse_overlap};
use beamlet::{Engine, Error};
use std::io::Write;
use std::path::PathBuf;
use std::time::Instant;

pub(super) fn run(
    arguments: &TableArguments<RetrieveArguments>,
    out: &mut impl Write,
) -> Result<(), Failure> {
    let began = Instant::now();
    let given = &arguments.table.0;
    let (input, path) = match &given.run {
        Some(run) => {
            (Input::of_run(&OpenRun::open(run)?, given.counts)?, run.join(layout::RETRIEVED))
        }
        None => measured(given)?,
    };
    let path = given.output.clone().unwrap_or(path);
    refuse_overlap(&path, &read(given))?;
    let has_counts = given.run.is_some() && input.scene().detector.counts.is_some();
    let input = given.applied_to(input)?;
    let options = given.options(&input).map_err(Failure::of_options)?;
    let cancel = interrupt::listen();
    let mut reporter = Reporter::new(arguments.messages);
    let options_of_device = arguments.device.options().with_profile(arguments.profile.profile);
    let engine = Engine::open(&options_of_device)?;
    let format = given.format.unwrap_or_else(|| input.format());
    let mut progress = |done, all| reporter.rows(done, all);
    let mut control = RowsControl::default().with_progress(&mut progress).with_cancel(cancel);
    let command = command_line();
    let to =
        ImagesTo::new(&path, format).with_overwrite(given.overwrite).with_command(Some(&command));
    let done = retrieve(&engine, input, &options, to, &mut control);
    reporter.finish();
    arguments.profile.show(&engine, None);
    match done {
        Ok(record) if given.json => super::write_json(&record, out),
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
fn read(given: &RetrieveArguments) -> Vec<PathBuf> {
    let scene = given.run.as_ref().map(|run| run.join(layout::SCENE));
    let files = [given.geometry.clone(), given.dark.clone(), given.bad_pixels.clone(), scene];
    files.into_iter().flatten().chain(given.lists()).collect()
}

/// Stacks of their own, with the geometry of a scene.
fn measured(given: &RetrieveArguments) -> Result<(Input, PathBuf), Failure> {
    let missing = |name: &str| {
        Failure::Usage(format!("measured stacks need {name}; or give a run directory"))
    };
    if given.counts {
        let problem = "--counts belongs to a run: measured stacks are detector numbers already";
        return Err(Failure::Usage(problem.into()));
    }
    let flat = given.flat.as_ref().ok_or_else(|| missing("--flat"))?;
    let sample = given.sample.as_ref().ok_or_else(|| missing("--sample"))?;
    let geometry = given.geometry.as_ref().ok_or_else(|| missing("--geometry"))?;
    // A run is the set-up of its scene.
    let geometry = match layout::is_run(geometry) {
        true => &geometry.join(layout::SCENE),
        false => geometry,
    };
    let output = given.output.as_ref().ok_or_else(|| missing("--output"))?;
    let mut scene = Scene::load_with(geometry, &given.set)?;
    if let Some(offsets) = &given.offsets {
        scene.scan.replace_offsets(offsets.lengths()?);
    }
    let flat = StackFile::open(flat)?.with_order(given.frame_order);
    let sample = StackFile::open(sample)?.with_order(given.frame_order);
    let dark = given.dark.as_ref().map(StackFile::open).transpose()?;
    let others: Vec<PathBuf> = std::iter::once(geometry.clone()).chain(given.lists()).collect();
    let input = Input::measured(&scene, flat, sample, dark.as_ref())?.with_read(&others);
    Ok((input, output.clone()))
}
