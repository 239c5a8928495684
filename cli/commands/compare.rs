//! `beamlet compare`: how two stacks, runs or retrievals differ.

use super::difference_pictures;
use super::pictures::PictureForm;
use crate::args::Compare;
use crate::failure::Failure;
use crate::interrupt;
use crate::progress::Reporter;
use beamlet::Error;
use beamlet::RowsControl;
use beamlet::compare::{Difference, DifferencesTo, compare};
use std::io::Write;

pub(super) fn run(arguments: &Compare, out: &mut impl Write) -> Result<(), Failure> {
    let to = arguments.difference.as_ref().map(|path| DifferencesTo::new(path, arguments.format));
    let cancel = interrupt::listen();
    let mut reporter = Reporter::new(arguments.messages);
    let mut progress = |done, all| reporter.rows(done, all);
    let mut control = RowsControl::default().with_progress(&mut progress).with_cancel(cancel);
    let found = compare(&arguments.a, &arguments.b, to, &mut control);
    reporter.finish();
    let found = found.map_err(|error| match error {
        Error::Interrupted => Failure::Interrupted { advice: "nothing was written".into() },
        error => error.into(),
    })?;
    let unlike: Vec<&str> = found
        .iter()
        .filter(|difference| !difference.within(arguments.tolerance))
        .map(|difference| difference.name.as_str())
        .collect();
    if arguments.json {
        super::write_json(&found, out)?;
    } else {
        table(&found, out)?;
    }
    if let Some(directory) = &arguments.output {
        let paths = [arguments.a.as_path(), arguments.b.as_path()];
        let drawn = difference_pictures::draw(paths, &found, PictureForm::default())?;
        let read = paths.map(std::path::Path::to_path_buf);
        drawn.write(directory, arguments.overwrite, &read, out)?;
    }
    if unlike.is_empty() {
        return Ok(());
    }
    out.flush()?;
    let names = unlike.join(", ");
    Err(Failure::Differs(if arguments.tolerance > 0.0 {
        format!("{names} by more than {:e}", arguments.tolerance)
    } else {
        names
    }))
}

fn table(found: &[Difference], out: &mut impl Write) -> Result<(), Failure> {
    let width = found.iter().map(|d| d.name.len()).max().unwrap_or(0).max(4);
    writeln!(
        out,
        "{:width$} {:>7} {:>12} {:>12} {:>12} {:>11} {:>11} {:>9}  largest at",
        "name", "images", "mean of A", "mean of B", "mean B - A", "rms", "largest", "unlike"
    )?;
    for d in found {
        let [view, step, row, column] = d.largest_at;
        writeln!(
            out,
            "{:width$} {:>7} {:>12.5e} {:>12.5e} {:>12.4e} {:>11.4e} {:>11.4e} {:>9}  view {view}, \
             step {step}, row {row}, column {column}",
            d.name, d.images, d.mean_a, d.mean_b, d.mean, d.rms, d.largest, d.unlike
        )?;
    }
    Ok(())
}
