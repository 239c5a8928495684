//! `beamlet check`: set-up and cost of a scene, before hours are spent on it; or whether a run is whole.

use super::pictures::{refuse_read, save_plot};
use crate::args::Check;
use crate::failure::Failure;
use crate::interrupt;
use crate::picture::illumination;
use crate::progress::Reporter;
use beamlet::check::CheckReport;
use beamlet::scene::Scene;
use beamlet::stack::{check_run, layout};
use beamlet::{Control, Engine, Error};
use std::io::Write;
use std::path::Path;

pub(super) fn run(arguments: &Check, out: &mut impl Write) -> Result<(), Failure> {
    // The remains of a run that lost one of them are a run, too.
    let is_run = |name: &str| arguments.scene.scene.join(name).is_file();
    if is_run(layout::RUN) || is_run(layout::LOG) {
        return run_directory(arguments, out);
    }
    if arguments.no_estimate && arguments.plot.is_none() && chooses_device(arguments) {
        let problem =
            "--device and --backend have no effect with --no-estimate: remove them, or add --plot";
        return Err(Failure::Usage(problem.into()));
    }
    let scene = arguments.scene.load()?;
    let mut reporter = Reporter::new(arguments.messages);
    let mut progress = |progress| reporter.update(progress);
    let mut control =
        Control::default().with_progress(&mut progress).with_cancel(interrupt::listen());
    let report = report(arguments, &scene, &mut control);
    reporter.finish();
    let report = report.map_err(|error| match error {
        Error::Interrupted => Failure::Interrupted { advice: String::new() },
        error => arguments.scene.locate(error).into(),
    })?;
    if let Some(path) = &arguments.plot {
        plot(arguments, &scene, &report, path)?;
    }
    if arguments.json {
        super::write_json(&report, out)?;
    } else {
        write!(out, "{report}")?;
    }
    match report.refusals.is_empty() {
        true => Ok(()),
        false => Err(Failure::Refused(report.refusals)),
    }
}

fn chooses_device(arguments: &Check) -> bool {
    arguments.engine.backend.choice().is_some() || arguments.engine.device.device.is_some()
}

/// Draws the illumination curve.
fn plot(
    arguments: &Check,
    scene: &Scene,
    report: &CheckReport,
    path: &Path,
) -> Result<(), Failure> {
    let mut read = scene.input_files();
    read.push(arguments.scene.scene.clone());
    refuse_read(&[path.to_owned()], &read)?;
    let Some(curve) = &report.illumination else {
        let problem = match (&scene.sample_mask, &scene.detector_mask) {
            (Some(_), Some(_)) => {
                "--plot: the illumination curve needs a Vulkan device; see `beamlet devices`"
            }
            _ => "--plot: an illumination curve needs both [sample_mask] and [detector_mask]",
        };
        return Err(Failure::Usage(problem.into()));
    };
    let name = beamlet::cli_support::printed::path(&arguments.scene.scene);
    let drawing = illumination::draw(&format!("Illumination curve of {name}"), curve);
    save_plot(&drawing, path, arguments.overwrite)
}

/// The report; without an estimate where there is no device, since the rest needs none but for the
/// illumination curve.
fn report(
    arguments: &Check,
    scene: &Scene,
    control: &mut Control<'_>,
) -> beamlet::Result<CheckReport> {
    let limit = arguments.engine.memory_limit;
    let check = beamlet::check::Check::of(scene).with_memory_limit(limit);
    if arguments.no_estimate && arguments.plot.is_none() {
        return check.without_estimate().run_with(control);
    }
    let engine = Engine::open(&arguments.engine.options());
    match engine {
        Ok(engine) if arguments.no_estimate => {
            check.with_engine(&engine).without_estimate().run_with(control)
        }
        Ok(engine) => check.with_engine(&engine).run_with(control),
        Err(error) if arguments.engine.device.device.is_some() => Err(error),
        Err(error) => {
            let mut report = check.run_with(control)?;
            report.work.no_estimate = Some(error.to_string());
            Ok(report)
        }
    }
}

/// Every view of a run against its checksum.
fn run_directory(arguments: &Check, out: &mut impl Write) -> Result<(), Failure> {
    let estimate = chooses_device(arguments) || arguments.no_estimate;
    if arguments.plot.is_some()
        || !arguments.scene.sets.is_empty()
        || arguments.engine.memory_limit.is_some()
        || estimate
    {
        let problem = "--set, --memory-limit, --backend, --device, --no-estimate and --plot are for scenes; \
                       this is a run";
        return Err(Failure::Usage(problem.into()));
    }
    let path = &arguments.scene.scene;
    let mut reporter = Reporter::new(arguments.messages);
    reporter.doing("comparing frames with their checksums");
    let found = check_run(path)?;
    reporter.finish();
    if arguments.json {
        super::write_json(&found, out)?;
    } else {
        writeln!(out, "run      {} ({})", beamlet::cli_support::printed::path(path), found.format)?;
        writeln!(out, "views    {} of {} match their checksums", found.whole, found.views)?;
        for file in &found.changed_files {
            writeln!(out, "note     {file}")?;
        }
        if found.problems.is_empty() {
            writeln!(out, "whole    yes")?;
        }
    }
    match found.problems.is_empty() {
        true => Ok(()),
        false => Err(Failure::Refused(found.problems)),
    }
}
