//! `beamlet convert`: retrieved images for other programs.

use crate::args::{Convert, Program};
use crate::failure::Failure;
use crate::interrupt;
use crate::progress::Reporter;
use beamlet::Error;
use beamlet::cli_support::printed;
use beamlet::reconstruct::write_astra;
use beamlet::stack::{layout, refuse_overlap};
use std::io::Write;

pub(super) fn run(arguments: &Convert, out: &mut impl Write) -> Result<(), Failure> {
    if let Some(name) = of_python(arguments.to) {
        let paths = [&arguments.input, &arguments.output].map(|path| printed::path(path));
        let [input, output] = paths.map(|path| format!("'{}'", path.replace('\'', "'\\''")));
        return Err(Failure::Usage(format!(
            "this program writes arrays for ASTRA; {name} is HDF5, which the Python package writes with \
             h5py:\n\n  pip install 'beamlet[convert]'\n  python -m beamlet.convert {input} --to {name} \
             -o {output}\n\ndocs/how-to/convert.md describes all formats"
        )));
    }
    let images = match layout::is_run(&arguments.input) {
        true => arguments.input.join(layout::RETRIEVED),
        false => arguments.input.clone(),
    };
    if !layout::is_retrieved(&images) {
        let lacks = "holds no retrieved images: beamlet retrieve makes them";
        let problem = layout::problem_of(&arguments.input, lacks, lacks);
        return Err(Failure::File { path: images, problem });
    }
    refuse_overlap(&arguments.output, std::slice::from_ref(&images))?;
    let cancel = interrupt::listen();
    let mut reporter = Reporter::new(arguments.messages);
    let mut progress = |done, all| reporter.rows(done, all);
    let (fill, overwrite) = (!arguments.as_retrieved, arguments.overwrite);
    let written = write_astra(&images, &arguments.output, fill, overwrite, &mut progress, &cancel);
    reporter.finish();
    match written {
        Ok(_) if arguments.messages.quiet => Ok(()),
        Ok(about) => {
            let [rows, views, columns] = about.shape;
            let names: Vec<&str> = about.units.keys().map(String::as_str).collect();
            let path = printed::path(&arguments.output);
            writeln!(out, "arrays   {path}, {rows} rows, {views} views, {columns} columns")?;
            writeln!(out, "         {}", names.join(", "))?;
            if about.filled_pixels.is_empty() {
                return Ok(());
            }
            let filled: Vec<String> =
                about.filled_pixels.iter().map(|(name, count)| format!("{name} {count}")).collect();
            Ok(writeln!(
                out,
                "filled   {} of {} pixels",
                filled.join(", "),
                rows * views * columns
            )?)
        }
        Err(Error::Interrupted) => {
            Err(Failure::Interrupted { advice: "nothing was written".into() })
        }
        Err(error) => Err(error.into()),
    }
}

/// Name of a format that the Python package writes; `None` for one that this program writes.
const fn of_python(to: Program) -> Option<&'static str> {
    match to {
        Program::Astra => None,
        Program::Nxtomo => Some("nxtomo"),
        Program::Cil => Some("cil"),
        Program::Dxchange => Some("dxchange"),
    }
}
