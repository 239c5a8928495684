//! `beamlet plan`: the directory of a run in shards, and scripts that make these.

use super::simulate::{command_line, quoted};
use super::slurm::{self, Scripts};
use crate::args::PlanArguments;
use crate::failure::Failure;
use crate::interrupt;
use crate::progress::Reporter;
use beamlet::cli_support::{printed, with_tolerances};
use beamlet::scene::{Refine, Scene};
use beamlet::stack::{Plan, PlanOptions, StackShape};
use beamlet::{Control, Engine, Error, RunRecord};
use std::collections::BTreeMap;
use std::io::Write;

pub(super) fn run(arguments: &PlanArguments, out: &mut impl Write) -> Result<(), Failure> {
    let scene = arguments.scene.load()?;
    let failed = |error| Failure::from(arguments.scene.locate(error));
    let scripts = Scripts::of(arguments, &scene)?;
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
    let Settled { platform, mesh_hashes, refine } = found.map_err(|error| match error {
        Error::Interrupted => Failure::Interrupted { advice: String::new() },
        error => failed(error),
    })?;
    let options = PlanOptions::default()
        .with_shards(arguments.shards)
        .with_format(arguments.format.unwrap_or_default())
        .with_mesh_hashes(mesh_hashes)
        .with_platform(platform)
        .with_overrides(arguments.scene.sets.clone())
        .with_command(command_line());
    // Shards take the tolerances of the plan, and choose rays in the same place.
    let mut scene = with_tolerances(&scene).map_err(failed)?;
    scene.sampling.refine = refine;
    let plan = Plan::create(&arguments.output, &scene, &options).map_err(failed)?;
    if let Some(scripts) = scripts {
        scripts.write()?;
    }
    if arguments.messages.quiet {
        return Ok(());
    }
    summary(arguments, &plan, out)
}

/// Properties that all shards have in common.
struct Settled {
    platform: Option<beamlet::stack::Platform>,
    mesh_hashes: BTreeMap<String, String>,
    refine: Refine,
}

/// Platform of the shards, hashes of the meshes, and the place where rays are chosen: the scene is prepared as a
/// shard prepares it. Without a device rays are chosen on the host, which every device allows.
fn settled(
    arguments: &PlanArguments,
    scene: &Scene,
    control: &mut Control<'_>,
) -> beamlet::Result<Settled> {
    if arguments.no_device {
        let sample = beamlet::load_sample(scene, control)?;
        let meshes = sample.objects.iter().filter(|object| !object.hash.is_empty());
        let mesh_hashes = meshes.map(|it| (it.name.clone(), it.hash.clone())).collect();
        let refine = match scene.sampling.refine {
            Refine::Auto => Refine::Host,
            given => given,
        };
        return Ok(Settled { platform: None, mesh_hashes, refine });
    }
    let simulation = Engine::open(&arguments.engine.options())?.prepare_with(scene, control)?;
    let start = simulation.start();
    let record = RunRecord::begin(start, scene.sampling.seed);
    Ok(Settled {
        platform: Some(record.platform()),
        mesh_hashes: start.mesh_hashes.clone(),
        refine: simulation.scene().sampling.refine,
    })
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
