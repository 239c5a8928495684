//! `beamlet man`: manual pages, one for the program and one for each verb.

use super::pictures::refuse_existing;
use crate::args::{Arguments, Man};
use crate::failure::Failure;
use clap::{Command, CommandFactory};
use std::io::Write;
use std::path::{Path, PathBuf};

pub(super) fn run(arguments: &Man, out: &mut impl Write) -> Result<(), Failure> {
    let mut command = Arguments::command();
    // Names of verbs as in the title: beamlet-simulate.
    command.build();
    let mut pages = vec![page(&command, &arguments.output)?];
    for verb in command.get_subcommands().filter(|verb| verb.get_name() != "help") {
        pages.push(page(verb, &arguments.output)?);
    }
    let paths: Vec<_> = pages.iter().map(|(path, _)| path.clone()).collect();
    refuse_existing(&paths, arguments.overwrite)?;
    for (path, text) in pages {
        beamlet::cli_support::write_file(&path, &text)?;
        writeln!(out, "{}", beamlet::cli_support::printed::path(&path))?;
    }
    Ok(())
}

/// The path and the text of a page.
fn page(command: &Command, directory: &Path) -> Result<(PathBuf, Vec<u8>), Failure> {
    let name = command.get_display_name().unwrap_or("beamlet");
    let mut text = Vec::new();
    clap_mangen::Man::new(command.clone()).render(&mut text)?;
    Ok((directory.join(format!("{name}.1")), text))
}
