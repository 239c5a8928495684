//! The command line of beamlet: a thin shell over the engine's public interface.
//!
//! Arguments are parsed, resolved into options and handed to one function per verb. Results go
//! to stdout and everything else to stderr, so that a pipe gets results only. The process ends
//! with 0 (done), 1 (failed), 2 (usage) or 130 (interrupted), whether or not anybody reads stdout.

mod args;
mod commands;
#[cfg(test)]
mod documents;
mod failure;
mod interrupt;
mod picture;
mod printed;
mod profile;
mod progress;
mod report;
mod residuals;
mod subject;
mod system;

use beamlet::cli_support::numbers;
use clap::{CommandFactory, Parser};
use printed::{Printed, Results};
use std::ffi::OsString;
use std::io::Write;
use std::process::ExitCode;
use std::sync::OnceLock;

/// Words of the command line behind the name of the program.
static WORDS: OnceLock<Vec<OsString>> = OnceLock::new();

#[allow(dead_code, reason = "the Python package calls `run` alone")]
fn main() -> ExitCode {
    ExitCode::from(run(std::env::args_os().skip(1).collect()))
}

/// Runs the program once in this process and returns its exit code. `words`: its arguments, without
/// the name of the program.
#[allow(unreachable_pub, reason = "public where the Python package has the program as a library")]
pub fn run(words: Vec<OsString>) -> u8 {
    system::let_large_writes_fail();
    system::limit_heaps();
    let words = WORDS.get_or_init(|| words);
    let name = OsString::from("beamlet");
    let arguments = match args::Arguments::try_parse_from(std::iter::once(&name).chain(words)) {
        Ok(arguments) => arguments,
        Err(error) => {
            // Help and version come this way too, with code 0; a closed pipe is no failure.
            print(&error);
            if error.use_stderr()
                && let Some(option) = with_one_dash(words)
            {
                let mut stderr = Printed::new(std::io::stderr());
                let _ = writeln!(stderr, "\n  tip: --{option} has two dashes");
            }
            return u8::try_from(error.exit_code()).unwrap_or(2);
        }
    };
    log_to_stderr(arguments.messages());
    let mut out = Printed::new(Results::new(std::io::stdout().lock()));
    match commands::run(arguments, &mut out) {
        Ok(()) => 0,
        Err(failure) => {
            let _ = writeln!(Printed::new(std::io::stderr()), "{failure}");
            failure.exit_code()
        }
    }
}

/// Words of the command line behind the name of the program.
fn words() -> &'static [OsString] {
    WORDS.get().map_or(&[], Vec::as_slice)
}

/// A long option that is written with one dash: clap reads its letters as short options.
fn with_one_dash(words: &[OsString]) -> Option<String> {
    let program = args::Arguments::command();
    let is_long = |name: &str| {
        let mut verbs = program.get_subcommands();
        verbs.any(|verb| verb.get_arguments().any(|arg| arg.get_long() == Some(name)))
    };
    let mut names = words.iter().filter_map(|word| word.to_str()?.strip_prefix('-'));
    names.find(|name| is_long(name)).map(str::to_owned)
}

/// Help in colour on a terminal; typed words are escaped.
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
