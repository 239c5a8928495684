//! `beamlet reconstruct`: retrieved images or sinograms to volumes.

mod source;
mod summary;

use super::simulate::command_line;
use crate::args::{Centre, Hardening, QuantityName, Reconstruct, ReconstructionName};
use crate::failure::Failure;
use crate::interrupt;
use crate::progress::Reporter;
use beamlet::reconstruct::{
    BeamEnergy, FbpOptions, GridChoice, HardeningChoice, IterativeOptions, Method, Quantity,
    Solver, VolumePlan, VolumesTo, estimate, gradient_bias, reconstruct,
};
use beamlet::retrieve::rim_errors;
use beamlet::{Cancel, Engine, Error, RowsControl};
use source::Source;
use std::io::Write;
use std::time::Instant;
use summary::{describe, summary};

pub(super) fn run(arguments: &Reconstruct, out: &mut impl Write) -> Result<(), Failure> {
    let cancel = interrupt::listen();
    let mut reporter = Reporter::new(arguments.messages);
    let done = work(arguments, &cancel, &mut reporter, out);
    reporter.finish();
    match done {
        Err(Failure::Engine(Error::Interrupted)) => {
            Err(Failure::Interrupted { advice: "no volume was written".into() })
        }
        other => other,
    }
}

fn work(
    arguments: &Reconstruct,
    cancel: &Cancel,
    reporter: &mut Reporter,
    out: &mut impl Write,
) -> Result<(), Failure> {
    let began = Instant::now();
    refuse_options(arguments)?;
    let options = arguments.device.options().with_memory_limit(arguments.memory_limit);
    let options = options.with_profile(arguments.profile.profile);
    let engine = Engine::open(&options)?;
    let mut source = Source::of(arguments, &engine, cancel, reporter)?;
    match arguments.centre {
        Some(Centre::Column(column)) => source.input = source.input.with_centre(column),
        Some(Centre::Auto) => {
            reporter.doing("finding the axis of rotation");
            source.input = source.input.with_found_centre(cancel)?;
        }
        None => {}
    }
    let plan = plan(arguments, &source)?;
    let mut to = VolumesTo::new(&arguments.output, arguments.format);
    to = to.with_overwrite(arguments.overwrite);
    to.check(&source.input)?;
    plan.check(&source.input)?;
    let geometry = source.input.geometry();
    let repeated = geometry.repeated_views();
    if repeated > 0 && matches!(plan.method, Method::Fbp(_)) {
        log::warn!("{repeated} views repeat the direction of another and share its weight");
    }
    // Several folders are dithers.
    let one = source.scene.as_ref().filter(|_| arguments.inputs.len() == 1);
    if let Some(scene) = one.filter(|_| plan.quantities.contains(&Quantity::Delta)) {
        rim_errors(scene).iter().for_each(|error| log::warn!("{}", error.warning()));
    }
    if arguments.dry_run {
        reporter.doing("measuring a part of the projections");
        let mut control = RowsControl::default().with_cancel(cancel.clone());
        let found = estimate(&engine, geometry, &plan, arguments.truth, &mut control)?;
        reporter.finish();
        return describe(arguments, &plan, &source.input, found, out);
    }
    let truth = match (arguments.truth, &source.scene) {
        (false, _) => None,
        (true, Some(scene)) if scene.objects.is_empty() => {
            let path = arguments.inputs[0].clone();
            let problem =
                "has a geometry without objects, which --truth needs: use a --geometry with the sample"
                    .into();
            return Err(Failure::File { path, problem });
        }
        (true, Some(scene)) => {
            reporter.doing("finding the objects at the voxels");
            let truth = beamlet::truth(&engine, scene, geometry, &plan.grid, cancel)?;
            Some(match &plan.beam_hardening {
                Some(choice) => truth.with_mu_at(scene, choice.quoted()?)?,
                None => truth,
            })
        }
        (true, None) => {
            let path = arguments.inputs[0].clone();
            let problem = "has no record of its scene, which --truth needs: retrieve again".into();
            return Err(Failure::File { path, problem });
        }
    };
    let command = command_line();
    let mut progress = |done, all| reporter.volumes(done, all);
    let mut control =
        RowsControl::default().with_progress(&mut progress).with_cancel(cancel.clone());
    let to = to.with_command(Some(&command));
    let done = reconstruct(&engine, &source.input, &plan, truth.as_ref(), to, &mut control)?;
    reporter.finish();
    arguments.profile.show(&engine, None);
    if arguments.json {
        return super::write_json(&done.record, out);
    }
    if arguments.messages.quiet {
        return Ok(());
    }
    summary(arguments, &done, source.retrieved.as_deref(), began.elapsed().as_secs_f64(), out)
}

/// Refuses options of another method than the chosen one.
fn refuse_options(arguments: &Reconstruct) -> Result<(), Failure> {
    let (given, allowed) = match arguments.method {
        ReconstructionName::Fbp => (arguments.iterated.first(), "cgls, sirt and bb"),
        _ => (arguments.filtered.first(), "fbp"),
    };
    let Some(option) = given else { return Ok(()) };
    let method = method(arguments).name();
    let reason = match arguments.method {
        ReconstructionName::Fbp => "filtered back-projection has one step",
        _ => "iterative methods do not filter rows, and their model contains the lever arms",
    };
    Err(Failure::Usage(format!("{option} is for {allowed}, not for {method}: {reason}")))
}

fn plan(arguments: &Reconstruct, source: &Source) -> Result<VolumePlan, Failure> {
    let input = &source.input;
    let has = input.quantities();
    let mut quantities: Vec<Quantity> = Vec::new();
    for name in &arguments.quantity {
        let named = match name {
            QuantityName::All => has.clone(),
            QuantityName::One(quantity) => vec![*quantity],
        };
        for quantity in named {
            if !has.contains(&quantity) {
                let path = input.paths().into_iter().next().unwrap_or_default();
                let problem = format!(
                    "has no image {}, from which {} is reconstructed",
                    quantity.image(),
                    quantity.name()
                );
                return Err(Failure::File { path, problem });
            }
            if !quantities.contains(&quantity) {
                quantities.push(quantity);
            }
        }
    }
    let choice = GridChoice::default()
        .with_voxel(arguments.voxel)
        .with_size(arguments.size)
        .with_origin(arguments.origin);
    let grid = choice.grid(input.geometry())?;
    let beam = source.scene.as_ref().and_then(|scene| BeamEnergy::of(scene).ok());
    let plan = VolumePlan::new(quantities, grid, method(arguments));
    Ok(plan
        .with_rings(arguments.rings)
        .with_keep_views(arguments.keep_views)
        .with_gradient_bias(bias(arguments, source))
        .with_beam(beam)
        .with_beam_hardening(hardening(arguments, source)?)
        .with_mask(arguments.iterated.mask.clone())
        .with_start(arguments.iterated.start.clone()))
}

/// Material and energy of the correction of beam hardening.
fn hardening(arguments: &Reconstruct, source: &Source) -> Result<Option<HardeningChoice>, Failure> {
    let Some(Hardening { material, energy }) = &arguments.beam_hardening else { return Ok(None) };
    let Some(scene) = &source.scene else {
        let path = arguments.inputs[0].clone();
        let problem = "has no record of its scene, which --beam-hardening needs for the spectrum: \
                       retrieve again";
        return Err(Failure::File { path, problem: problem.into() });
    };
    Ok(Some(HardeningChoice::new(scene.clone(), material, *energy)?))
}

fn method(arguments: &Reconstruct) -> Method {
    let solver = match arguments.method {
        ReconstructionName::Fbp => {
            let given = &arguments.filtered;
            let options = FbpOptions::default()
                .with_filter(given.filter.unwrap_or_default())
                .with_cut_off(given.cut_off.unwrap_or(1.0));
            let options = options.with_arm_passes(given.arm_passes);
            return Method::Fbp(options.with_extrapolate(given.extrapolate));
        }
        ReconstructionName::Cgls => Solver::Cgls,
        ReconstructionName::Sirt => Solver::Sirt,
        ReconstructionName::Bb => Solver::Bb,
    };
    let given = &arguments.iterated;
    let usual = IterativeOptions::default();
    let options = usual
        .with_solver(solver)
        .with_iterations(given.iterations.unwrap_or(usual.iterations))
        .with_discrepancy(given.discrepancy)
        .with_non_negative(given.non_negative);
    Method::iterative(options, given.phase)
}

/// Length of the bias of δ by gradients of μ, where the retrieval and the scene give it.
fn bias(arguments: &Reconstruct, source: &Source) -> Option<f64> {
    let (scene, width) = (source.scene.as_ref()?, source.flat_width?);
    let has_masks = scene.sample_mask.is_some() && scene.detector_mask.is_some();
    if arguments.no_gradient_bias || !has_masks {
        return None;
    }
    gradient_bias(scene, width)
        .inspect_err(|error| log::warn!("delta is not corrected for gradients of mu: {error}"))
        .ok()
}
