//! `beamlet check`: what a scene amounts to, before hours are spent on it.

use crate::args::Check;
use crate::failure::Failure;
use std::io::Write;

pub(super) fn run(arguments: &Check, out: &mut impl Write) -> Result<(), Failure> {
    let scene = arguments.scene.load()?;
    let report = beamlet::check::check_within(&scene, arguments.memory_limit)
        .map_err(|e| arguments.scene.locate(e))?;
    if arguments.json {
        super::write_json(&report, out)?;
    } else {
        write!(out, "{report}")?;
    }
    match report.refusals.is_empty() {
        true => Ok(()),
        false => Err(Failure::Refused(report.refusals)),
    }
}
