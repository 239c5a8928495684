//! `beamlet check`: what a scene amounts to, before hours are spent on it; or whether a run is
//! whole.

use crate::args::Check;
use crate::failure::Failure;
use beamlet::stack::check_run;
use std::io::Write;

pub(super) fn run(arguments: &Check, out: &mut impl Write) -> Result<(), Failure> {
    // What is left of a run that lost one of them is a run, too.
    let is_run = |name: &str| arguments.scene.scene.join(name).is_file();
    if is_run("run.json") || is_run("progress.log") {
        return run_directory(arguments, out);
    }
    let scene = arguments.scene.load()?;
    let report = beamlet::check::check_within(&scene, arguments.memory_limit)
        .map_err(|e| arguments.scene.locate(e))?;
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

/// Every view of a run, and its moments, against their checksums.
fn run_directory(arguments: &Check, out: &mut impl Write) -> Result<(), Failure> {
    if !arguments.scene.sets.is_empty() || arguments.memory_limit.is_some() {
        let problem = "--set and --memory-limit are for scenes; this is a run";
        return Err(Failure::Usage(problem.into()));
    }
    let path = &arguments.scene.scene;
    let found = check_run(path)?;
    if arguments.json {
        super::write_json(&found, out)?;
    } else {
        writeln!(out, "run      {} ({})", beamlet::printed::path(path), found.format)?;
        writeln!(out, "views    {} of {} as they were committed", found.whole, found.views)?;
        if let Some(moments) = found.moments {
            writeln!(out, "moments  of {moments} views as they were kept")?;
        }
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
