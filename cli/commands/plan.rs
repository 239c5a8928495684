//! `beamlet plan`: the directory of a run in shards, and scripts that make these.

use super::simulate::{command_line, quoted};
use super::slurm;
use crate::args::PlanArguments;
use crate::failure::Failure;
use crate::interrupt;
use crate::progress::Reporter;
use beamlet::cli_support::{printed, with_tolerances};
use beamlet::scene::{Scene, Scheme};
use beamlet::stack::{Plan, PlanOptions, StackShape};
use beamlet::{Control, Engine, Error, RunRecord};
use std::collections::BTreeMap;
use std::io::Write;

pub(super) fn run(arguments: &PlanArguments, out: &mut impl Write) -> Result<(), Failure> {
    let scene = arguments.scene.load()?;
    let failed = |error| Failure::from(arguments.scene.locate(error));
    if arguments.keep_moments && scene.sampling.scheme == Scheme::Random {
        return Err(failed(Error::scene(
            "sampling.scheme",
            "random",
            "cells, with --keep-moments",
        )));
    }
    let template = slurm::template(&arguments.slurm)?;
    let views = StackShape::of(&scene).map_err(failed)?.views;
    if arguments.shards > views {
        return Err(Failure::Usage(format!(
            "--shards {}: allowed: 1 to {views}, the number of views",
            arguments.shards
        )));
    }
    let mut reporter = Reporter::new(arguments.messages);
    let mut progress = |progress| reporter.update(progress);
    let mut control =
        Control::default().with_progress(&mut progress).with_cancel(interrupt::listen());
    let found = settled(arguments, &scene, &mut control);
    reporter.finish();
    let (platform, mesh_hashes) = found.map_err(|error| match error {
        Error::Interrupted => Failure::Interrupted { advice: String::new() },
        error => failed(error),
    })?;
    let options = PlanOptions::default()
        .with_shards(arguments.shards)
        .with_format(arguments.format.unwrap_or_default())
        .with_keep_moments(arguments.keep_moments)
        .with_mesh_hashes(mesh_hashes)
        .with_platform(platform)
        .with_overrides(arguments.scene.sets.clone())
        .with_command(command_line());
    // Shards take the tolerances of the plan.
    let scene = with_tolerances(&scene, arguments.keep_moments).map_err(failed)?;
    let plan = Plan::create(&arguments.output, &scene, &options).map_err(failed)?;
    if let Some(template) = template {
        slurm::write(arguments, &scene, &template)?;
    }
    if arguments.messages.quiet {
        return Ok(());
    }
    summary(arguments, &plan, out)
}

type Settled = (Option<beamlet::stack::Platform>, BTreeMap<String, String>);

/// Platform of the shards, and hashes of the meshes: the scene is prepared as a shard prepares it.
fn settled(
    arguments: &PlanArguments,
    scene: &Scene,
    control: &mut Control<'_>,
) -> beamlet::Result<Settled> {
    if arguments.no_device {
        let sample = beamlet::load_sample(scene, control)?;
        let meshes = sample.objects.iter().filter(|object| !object.hash.is_empty());
        return Ok((None, meshes.map(|it| (it.name.clone(), it.hash.clone())).collect()));
    }
    let options = arguments.engine.options().with_keep_moments(arguments.keep_moments);
    let simulation = Engine::open(&options)?.prepare_with(scene, control)?;
    let start = simulation.start();
    let record = RunRecord::begin(start, scene.sampling.seed);
    Ok((Some(record.platform()), start.mesh_hashes.clone()))
}

fn summary(arguments: &PlanArguments, plan: &Plan, out: &mut impl Write) -> Result<(), Failure> {
    let run = &arguments.output;
    let (shards, last) = (plan.shards, plan.shards - 1);
    let word = quoted(&run.to_string_lossy());
    let scene = quoted(&run.join(beamlet::stack::layout::SCENE).to_string_lossy());
    writeln!(out, "run      {} ({})", printed::path(run), plan.format)?;
    writeln!(out, "shards   {shards} for {} views", plan.extent.views)?;
    match Plan::platform(run)? {
        Some(made_by) => {
            writeln!(out, "device   {} ({})", made_by.device, made_by.driver)?;
            writeln!(out, "backend  {}", made_by.backend)?;
        }
        None => writeln!(out, "device   recorded by the first shard that begins")?,
    }
    if arguments.slurm.slurm {
        let script = run.join(beamlet::stack::layout::SCRIPTS).join(slurm::SUBMIT);
        return Ok(writeln!(out, "next     sh {}", quoted(&script.to_string_lossy()))?);
    }
    writeln!(out, "next     beamlet simulate {scene} --shard 0/{shards} -o {word}")?;
    if last > 0 {
        writeln!(out, "         and so on up to --shard {last}/{shards}, in any order")?;
    }
    Ok(writeln!(out, "then     beamlet join {word}")?)
}
