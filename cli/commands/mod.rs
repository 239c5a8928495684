//! One file per verb, each a function from arguments to lines on stdout.

mod beam;
mod check;
mod compare;
mod completions;
mod convert;
mod devices;
mod difference_pictures;
mod example;
mod explain;
mod join;
mod man;
mod mask;
mod material;
mod mesh;
mod pictures;
mod reconstruct;
mod report;
mod retrieve;
mod schema;
mod simulate;
mod spectrum;
mod sweep;
mod view;

use crate::args::{Arguments, Verb};
use crate::failure::Failure;
use beamlet::retrieve::Drift;
use std::io::Write;

/// Runs the requested verb and flushes its results.
pub(crate) fn run(arguments: Arguments, out: &mut impl Write) -> Result<(), Failure> {
    let is_comparison = matches!(arguments.verb, Verb::Compare(_));
    let done = verb(arguments, out).and_then(|()| Ok(out.flush()?));
    if is_comparison { done.map_err(Failure::of_comparison) } else { done }
}

fn verb(arguments: Arguments, out: &mut impl Write) -> Result<(), Failure> {
    beamlet::cli_support::start_threads()?;
    match arguments.verb {
        Verb::Simulate(arguments) => simulate::run(&arguments, out),
        Verb::Join(arguments) => join::run(&arguments, out),
        Verb::Retrieve(arguments) => retrieve::run(&arguments, out),
        Verb::Reconstruct(arguments) => reconstruct::run(&arguments, out),
        Verb::Convert(arguments) => convert::run(&arguments, out),
        Verb::Compare(arguments) => compare::run(&arguments, out),
        Verb::Check(arguments) => check::run(&arguments, out),
        Verb::Sweep(arguments) => sweep::run(&arguments, out),
        Verb::View(arguments) => view::run(&arguments, out),
        Verb::Report(arguments) => report::run(&arguments, out),
        Verb::Spectrum(arguments) => spectrum::run(&arguments, out),
        Verb::Material(arguments) => material::run(&arguments, out),
        Verb::Mesh(arguments) => mesh::run(&arguments, out),
        Verb::Mask(arguments) => mask::run(&arguments, out),
        Verb::Devices(arguments) => devices::run(&arguments, out),
        Verb::Example(arguments) => example::run(&arguments, out),
        Verb::Explain(arguments) => explain::run(&arguments, out),
        Verb::Schema(_) => schema::run(out),
        Verb::Completions(arguments) => completions::run(&arguments, out),
        Verb::Man(arguments) => man::run(&arguments, out),
    }
}

/// Prints a value as JSON.
fn write_json(value: &impl serde::Serialize, out: &mut impl Write) -> Result<(), Failure> {
    let text = serde_json::to_string_pretty(value).map_err(std::io::Error::from)?;
    Ok(writeln!(out, "{text}")?)
}

/// How refraction angles were integrated along the rows, in words.
fn drift_words(drift: &Drift) -> String {
    // Without a sample little but rounding is left of the phase.
    let share = match drift.largest_share {
        share if share < 10.0 => format!("{:.1} % of the largest phase", 100.0 * share),
        _ => "more than ten times the phase that is left".to_owned(),
    };
    format!(
        "{} angles without a result are interpolated along the row; the mean angle of each row, rms {:.2e} \
         rad, largest {:.2e} rad ({share}), is subtracted",
        drift.filled, drift.rms_rad, drift.largest_rad,
    )
}
