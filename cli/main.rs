//! The command line of beamlet: a thin shell over the engine's public interface.
//!
//! Arguments are parsed, resolved into options and handed to one function per verb. Results go
//! to stdout and everything else to stderr, so that a pipe gets results only. The process ends
//! with 0 (done), 1 (failed), 2 (usage) or 130 (interrupted), whether or not anybody reads stdout.

mod args;
mod commands;
mod failure;
mod interrupt;
#[path = "../engine/numbers.rs"]
#[allow(dead_code, reason = "casts of the engine, of which the command line needs some")]
mod numbers;
mod picture;
mod printed;
mod progress;
mod report;
mod subject;

use clap::Parser;
use printed::{Printed, Results};
use std::io::Write;
use std::process::ExitCode;

fn main() -> ExitCode {
    interrupt::let_large_writes_fail();
    let arguments = match args::Arguments::try_parse() {
        Ok(arguments) => arguments,
        Err(error) => {
            // Help and version come this way too, with code 0; a closed pipe is no failure.
            print(&error);
            return ExitCode::from(u8::try_from(error.exit_code()).unwrap_or(2));
        }
    };
    log_to_stderr(arguments.messages());
    let mut out = Printed::new(Results::new(std::io::stdout().lock()));
    match commands::run(arguments, &mut out) {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            let _ = writeln!(Printed::new(std::io::stderr()), "{failure}");
            ExitCode::from(failure.exit_code())
        }
    }
}

/// Help in colour where there is a terminal; what the user typed, escaped.
fn print(error: &clap::Error) {
    let _ = match error.use_stderr() {
        false => error.print(),
        true => write!(Printed::new(std::io::stderr()), "{}", error.render()),
    };
}

/// Sends log messages of the engine to stderr. `RUST_LOG`, where set, has the last word.
fn log_to_stderr(messages: args::Messages) {
    let level = match messages {
        args::Messages { quiet: true, .. } => "error",
        args::Messages { verbose: true, .. } => "debug",
        args::Messages { .. } => "warn",
    };
    // What pictures leave out, tiny_skia warns of: areas without height.
    let filter = format!("{level},tiny_skia=error,tiny_skia_path=error");
    env_logger::Builder::from_env(env_logger::Env::default().default_filter_or(filter))
        .format(|out, record| {
            let level = record.level().as_str().to_lowercase();
            writeln!(Printed::new(out), "{level}: {}", record.args())
        })
        .init();
}
