//! `beamlet join`: the shards of a run into one, or how far each is.

use super::simulate::{command_line, quoted};
use crate::args::Join;
use crate::failure::Failure;
use crate::interrupt;
use crate::progress::Reporter;
use beamlet::Error;
use beamlet::cli_support::printed;
use beamlet::stack::{JoinOptions, ShardState, join, layout, shard_states};
use std::io::Write;

pub(super) fn run(arguments: &Join, out: &mut impl Write) -> Result<(), Failure> {
    if arguments.status {
        return status(arguments, out);
    }
    let was_planned = layout::is_planned(&arguments.run);
    let mut reporter = Reporter::new(arguments.messages);
    reporter.doing("comparing shards with the plan");
    let mut progress = |done, total| reporter.joined(done, total);
    let options = JoinOptions::default()
        .with_progress(&mut progress)
        .with_allow_mixed(arguments.allow_mixed)
        .with_command(command_line())
        .with_cancel(interrupt::listen());
    let record = join(&arguments.run, options);
    reporter.finish();
    let record = record.map_err(|error| match error {
        Error::Interrupted => {
            let run = quoted(&arguments.run.to_string_lossy());
            Failure::Interrupted { advice: format!("to continue: beamlet join {run}") }
        }
        error => error.into(),
    })?;
    if arguments.messages.quiet {
        return Ok(());
    }
    let run = printed::path(&arguments.run);
    if !was_planned {
        return Ok(writeln!(out, "{run} is joined already")?);
    }
    writeln!(out, "run      {run}")?;
    Ok(writeln!(out, "rays     {}", record.tally.rays)?)
}

fn status(arguments: &Join, out: &mut impl Write) -> Result<(), Failure> {
    let states = shard_states(&arguments.run)?;
    if arguments.json {
        return super::write_json(&states, out);
    }
    for status in &states {
        let state = match status.state {
            ShardState::Waiting => "waiting",
            ShardState::Running => "running",
            ShardState::Interrupted => "interrupted",
            ShardState::Dead => "dead",
            ShardState::Done => "done",
            _ => "unknown",
        };
        let host = status.host.as_ref().map(|host| format!("  on {}", printed::line(host)));
        writeln!(
            out,
            "shard {}  {state:11}  {} of {} views{}",
            status.shard,
            status.committed,
            status.views,
            host.unwrap_or_default()
        )?;
    }
    let done = states.iter().filter(|status| status.state == ShardState::Done).count();
    Ok(writeln!(
        out,
        "{done} of {} shards are done (views include the flat and the dark frames)",
        states.len()
    )?)
}
