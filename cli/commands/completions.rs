//! `beamlet completions`: what completes words in a shell, on stdout.

use crate::args::{Arguments, Completions};
use crate::failure::Failure;
use clap::CommandFactory;
use std::io::Write;

pub(super) fn run(arguments: &Completions, out: &mut impl Write) -> Result<(), Failure> {
    // Made in memory: the generator panics where its writer fails, as a closed pipe does.
    let mut text = Vec::new();
    clap_complete::generate(arguments.shell, &mut Arguments::command(), "beamlet", &mut text);
    Ok(out.write_all(&text)?)
}
