//! `beamlet man`: manual pages, one for the program and one for each verb.

use crate::args::{Arguments, Man};
use crate::failure::Failure;
use clap::{Command, CommandFactory};
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};

pub(super) fn run(arguments: &Man, out: &mut impl Write) -> Result<(), Failure> {
    let mut command = Arguments::command();
    // Names of verbs as they stand in the title: beamlet-simulate.
    command.build();
    let mut pages = vec![page(&command, &arguments.output)?];
    for verb in command.get_subcommands().filter(|verb| verb.get_name() != "help") {
        pages.push(page(verb, &arguments.output)?);
    }
    if !arguments.overwrite
        && let Some((path, _)) = pages.iter().find(|(path, _)| path.symlink_metadata().is_ok())
    {
        let problem = "exists already; --overwrite replaces it".to_owned();
        return Err(Failure::File { path: path.clone(), problem });
    }
    let failed = |path: &Path, error: std::io::Error| Failure::File {
        path: path.to_owned(),
        problem: format!("cannot be written: {error}"),
    };
    fs::create_dir_all(&arguments.output).map_err(|error| failed(&arguments.output, error))?;
    for (path, text) in pages {
        fs::write(&path, text).map_err(|error| failed(&path, error))?;
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
