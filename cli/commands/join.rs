//! `beamlet join`: parts of a run into one.

use super::simulate::{command_line, quoted};
use crate::args::Join;
use crate::failure::Failure;
use crate::interrupt;
use crate::progress::Reporter;
use beamlet::Error;
use beamlet::cli_support::printed;
use beamlet::stack::{JoinOptions, join};
use std::io::Write;

pub(super) fn run(arguments: &Join, out: &mut impl Write) -> Result<(), Failure> {
    let mut reporter = Reporter::new(arguments.messages);
    reporter.doing("comparing parts");
    let mut progress = |done, total| reporter.joined(done, total);
    let options = JoinOptions::default()
        .with_progress(&mut progress)
        .with_allow_mixed(arguments.allow_mixed)
        .with_command(command_line())
        .with_cancel(interrupt::listen());
    let record = join(&arguments.parts, &arguments.output, options);
    reporter.finish();
    let record = record.map_err(|error| match error {
        Error::Interrupted => {
            let words = arguments.parts.iter().map(|part| quoted(&part.to_string_lossy()));
            let parts = words.collect::<Vec<_>>().join(" ");
            let run = quoted(&arguments.output.to_string_lossy());
            Failure::Interrupted { advice: format!("to continue: beamlet join {parts} -o {run}") }
        }
        error => error.into(),
    })?;
    if arguments.messages.quiet {
        return Ok(());
    }
    writeln!(out, "run      {}", printed::path(&arguments.output))?;
    Ok(writeln!(out, "rays     {}", record.tally.rays)?)
}
