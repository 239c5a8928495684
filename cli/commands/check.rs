//! `beamlet check`: what a scene amounts to, before hours are spent on it.

use crate::args::Check;
use crate::failure::Failure;
use beamlet::scene::Scene;
use std::io::Write;

pub(super) fn run(arguments: &Check, out: &mut impl Write) -> Result<(), Failure> {
    let scene = Scene::load_with(&arguments.scene.scene, &arguments.scene.sets)?;
    let failed = |error| super::located(&arguments.scene, error);
    let report = beamlet::check::check(&scene).map_err(failed)?;
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
