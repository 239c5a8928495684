//! `beamlet report`: a run as one page for a browser.

use super::pictures::{refuse_existing, refuse_read};
use crate::args::Report;
use crate::failure::Failure;
use crate::report;
use crate::run_reader::RunReader;
use std::io::Write;

/// Bytes of image data in a page, unless asked otherwise: base64 makes a third more of it.
const MOST: u64 = 24 << 20;

pub(super) fn run(arguments: &Report, out: &mut impl Write) -> Result<(), Failure> {
    let path = match &arguments.output {
        Some(path) => path.clone(),
        None => arguments.run.join("report.html"),
    };
    refuse_read(std::slice::from_ref(&path), std::slice::from_ref(&arguments.run))?;
    refuse_existing(std::slice::from_ref(&path), arguments.overwrite)?;
    let run = RunReader::open(&arguments.run)?;
    let page = report::page(&run, arguments.most.unwrap_or(MOST))?;
    beamlet::write_file(&path, page.as_bytes())?;
    Ok(writeln!(out, "{}", beamlet::printed::path(&path))?)
}
