//! `beamlet reconstruct`: retrieved images or sinograms to volumes.

mod source;
mod summary;

use super::simulate::command_line;
use crate::args::TableArguments;
use crate::failure::Failure;
use crate::interrupt;
use crate::progress::Reporter;
use beamlet::cli_support::options::{Centre, Options, ReconstructArguments};
use beamlet::reconstruct::{Method, Quantity, VolumePlan, VolumesTo, estimate, reconstruct};
use beamlet::retrieve::rim_errors;
use beamlet::{Cancel, Engine, Error, RowsControl};
use source::Source;
use std::io::Write;
use std::time::Instant;
use summary::{describe, summary};

pub(super) fn run(
    arguments: &TableArguments<ReconstructArguments>,
    out: &mut impl Write,
) -> Result<(), Failure> {
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
    arguments: &TableArguments<ReconstructArguments>,
    cancel: &Cancel,
    reporter: &mut Reporter,
    out: &mut impl Write,
) -> Result<(), Failure> {
    let began = Instant::now();
    let given = &arguments.table.0;
    given.check_method(given.method().name()).map_err(Failure::of_options)?;
    let options = arguments.device.options().with_memory_limit(given.memory_limit);
    let options = options.with_profile(arguments.profile.profile);
    let engine = Engine::open(&options)?;
    let mut source = Source::of(given, &engine, cancel, reporter)?;
    match given.centre {
        Some(Centre::Column(column)) => source.input = source.input.with_centre(column),
        Some(Centre::Auto) => {
            reporter.doing("finding the axis of rotation");
            source.input = source.input.with_found_centre(cancel)?;
        }
        None => {}
    }
    let plan = plan(given, &source)?;
    let mut to = VolumesTo::new(&given.output, given.format);
    to = to.with_overwrite(given.overwrite);
    to.check(&source.input)?;
    plan.check(&source.input)?;
    let geometry = source.input.geometry();
    let repeated = geometry.repeated_views();
    if repeated > 0 && matches!(plan.method, Method::Fbp(_)) {
        log::warn!("{repeated} views repeat the direction of another and share its weight");
    }
    // Several folders are dithers.
    let one = source.scene.as_ref().filter(|_| given.inputs.len() == 1);
    if let Some(scene) = one.filter(|_| plan.quantities.contains(&Quantity::Delta)) {
        rim_errors(scene).iter().for_each(|error| log::warn!("{}", error.warning()));
    }
    if given.dry_run {
        reporter.doing("measuring a part of the projections");
        let mut control = RowsControl::default().with_cancel(cancel.clone());
        let found = estimate(&engine, geometry, &plan, given.truth, &mut control)?;
        reporter.finish();
        return describe(given, &plan, &source.input, found, out);
    }
    let truth = match (given.truth, &source.scene) {
        (false, _) => None,
        (true, Some(scene)) if scene.objects.is_empty() => {
            let path = given.inputs[0].clone();
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
            let path = given.inputs[0].clone();
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
    if given.json {
        return super::write_json(&done.record, out);
    }
    if arguments.messages.quiet {
        return Ok(());
    }
    summary(given, &done, source.retrieved.as_deref(), began.elapsed().as_secs_f64(), out)
}

fn plan(given: &ReconstructArguments, source: &Source) -> Result<VolumePlan, Failure> {
    let input = &source.input;
    let has = input.quantities();
    let mut quantities: Vec<Quantity> = Vec::new();
    for quantity in if given.quantity.is_empty() { &has } else { &given.quantity } {
        if !has.contains(quantity) {
            let path = input.paths().into_iter().next().unwrap_or_default();
            let problem = format!(
                "has no image {}, from which {} is reconstructed",
                quantity.image(),
                quantity.name()
            );
            return Err(Failure::File { path, problem });
        }
        if !quantities.contains(quantity) {
            quantities.push(*quantity);
        }
    }
    Ok(given.plan(quantities, input.geometry(), source.scene.as_ref(), source.flat_width)?)
}
