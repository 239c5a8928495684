//! `beamlet report`: a run, or a reconstruction, as one page for a browser.

use super::pictures::{refuse_existing, refuse_read};
use crate::args::Report;
use crate::failure::Failure;
use crate::progress::Reporter;
use crate::report::{self, PageOptions};
use crate::subject::Subject;
use beamlet::stack::layout;
use std::ffi::OsString;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Bytes of image data in a page, unless asked otherwise: base64 makes a third more of it.
const MOST: u64 = 24 << 20;

pub(super) fn run(arguments: &Report, out: &mut impl Write) -> Result<(), Failure> {
    let path = match &arguments.output {
        Some(path) => path.clone(),
        None if layout::is_run(&arguments.run) => arguments.run.join(layout::REPORT),
        // A directory of images or volumes holds nothing else.
        None => beside(&arguments.run),
    };
    let read: Vec<PathBuf> =
        std::iter::once(&arguments.run).chain(&arguments.retrieved).cloned().collect();
    refuse_read(std::slice::from_ref(&path), &read)?;
    refuse_existing(std::slice::from_ref(&path), arguments.overwrite)?;
    let options = PageOptions {
        most: arguments.most.unwrap_or(MOST),
        device: arguments.device.device.clone(),
        command: command(),
    };
    let mut reporter = Reporter::new(arguments.messages);
    let page = match (layout::is_volume(&arguments.run), &arguments.retrieved) {
        (true, Some(_)) => {
            let problem = "--retrieved is for runs; this is a reconstruction";
            return Err(Failure::Usage(problem.into()));
        }
        (true, None) => report::volume_page(&arguments.run, &options, &mut reporter)?,
        (false, retrieved) => {
            let run = Subject::open(&arguments.run, retrieved.as_deref())?;
            report::page(&run, &options, &mut reporter)?
        }
    };
    reporter.finish();
    beamlet::cli_support::write_file(&path, page.as_bytes())?;
    Ok(writeln!(out, "{}", beamlet::cli_support::printed::path(&path))?)
}

/// `DIR.html` beside a directory.
fn beside(directory: &Path) -> PathBuf {
    let whole = directory.canonicalize().unwrap_or_else(|_| directory.to_path_buf());
    let mut name = whole.file_name().unwrap_or_default().to_owned();
    name.push(".html");
    match directory.file_name() {
        Some(_) => directory.with_file_name(name),
        None => whole.with_file_name(name),
    }
}

/// The command line; words with spaces in quotes.
fn command() -> String {
    let word = |word: &OsString| {
        let word = word.to_string_lossy().into_owned();
        if word.contains(' ') { format!("'{word}'") } else { word }
    };
    let words: Vec<String> = crate::words().iter().map(word).collect();
    format!("beamlet {}", words.join(" "))
}
