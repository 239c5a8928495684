//! `beamlet reconstruct`: retrieved images or sinograms to volumes.

use super::simulate::command_line;
use crate::args::{Centre, Hardening, QuantityName, Reconstruct, ReconstructionName};
use crate::failure::Failure;
use crate::interrupt;
use crate::progress::Reporter;
use beamlet::cli_support::printed;
use beamlet::reconstruct::{
    BeamEnergy, FbpOptions, GridChoice, HardeningChoice, Input, IterativeOptions, LostUse, Method,
    Quantity, Reconstructed, Solver, VolumeEstimate, VolumePlan, VolumeRecord, VolumesTo, estimate,
    gradient_bias, reconstruct,
};
use beamlet::retrieve::{self, ImagesTo, Record, RetrieveOptions};
use beamlet::scene::Scene;
use beamlet::stack::{Format, OpenRun, layout};
use beamlet::{Cancel, Engine, Error, RowsControl};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::Instant;

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
    let repeated = geometry.repeated_views().filter(|_| matches!(plan.method, Method::Fbp(_)));
    if let Some(repeated) = repeated {
        log::warn!(
            "the views cover more than a turn: {repeated} of them repeat a direction and share its weight"
        );
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
    if arguments.json {
        return super::write_json(&done.record, out);
    }
    if arguments.messages.quiet {
        return Ok(());
    }
    summary(arguments, &done, source.retrieved.as_deref(), began.elapsed().as_secs_f64(), out)
}

/// Inputs of a reconstruction, and their scene.
struct Source {
    input: Input,
    scene: Option<Scene>,
    /// Images that were made on the way.
    retrieved: Option<PathBuf>,
    /// Standard deviation of the curves without sample, m of offset.
    flat_width: Option<f64>,
}

impl Source {
    fn of(
        arguments: &Reconstruct,
        engine: &Engine,
        cancel: &Cancel,
        reporter: &mut Reporter,
    ) -> Result<Self, Failure> {
        if let Some(geometry) = &arguments.geometry {
            return Self::of_file(arguments, geometry);
        }
        let (mut folders, mut scene, mut retrieved) = (Vec::new(), None, None);
        for input in &arguments.inputs {
            if layout::is_run(input) {
                let images = input.join(layout::RETRIEVED);
                if !layout::is_retrieved(&images) {
                    if arguments.dry_run {
                        let problem = "is not retrieved yet: run beamlet retrieve before --dry-run";
                        return Err(Failure::File { path: input.clone(), problem: problem.into() });
                    }
                    retrieve_run(engine, input, &images, cancel, reporter)?;
                    retrieved = Some(images.clone());
                }
                folders.push(images);
                if scene.is_none() {
                    scene = Some(OpenRun::open(input)?.scene().clone());
                }
            } else if input.is_file() {
                let is_scene = input.extension().is_some_and(|it| it == "toml" || it == "json");
                let problem = match is_scene {
                    true => "is a scene: simulate it, and give the run directory",
                    false => "is a file: sinograms need --geometry SCENE, for angles and distances",
                };
                return Err(Failure::File { path: input.clone(), problem: problem.into() });
            } else {
                folders.push(input.clone());
            }
        }
        let input = Input::of_images(&folders)?;
        let record = Record::read(&folders[0].join(layout::RECORD))?;
        if scene.is_none() {
            scene = record.geometry.map(|text| Scene::from_toml(&text, &folders[0])).transpose()?;
        }
        Ok(Self { input, scene, retrieved, flat_width: record.flat_width })
    }

    fn of_file(arguments: &Reconstruct, geometry: &Path) -> Result<Self, Failure> {
        let usage = |problem: &str| Err(Failure::Usage(problem.into()));
        let [path] = arguments.inputs.as_slice() else {
            return usage("--geometry requires exactly one file of sinograms");
        };
        if path.is_dir() {
            return usage(
                "--geometry is for files of sinograms; retrieved images have their own geometry",
            );
        }
        let [QuantityName::One(quantity)] = arguments.quantity.as_slice() else {
            return usage(
                "a file of sinograms needs --quantity: mu (-ln of the transmission), delta (rad) \
                          or dark-field (rad^2)",
            );
        };
        // A run is the set-up of its scene.
        let geometry = match layout::is_run(geometry) {
            true => &geometry.join(layout::SCENE),
            false => geometry,
        };
        let scene = Scene::load_with(geometry, &arguments.sets)?;
        let input = Input::of_file(path, *quantity, &scene)
            .map_err(|error| Scene::locate(geometry, &arguments.sets, error))?;
        Ok(Self { input, scene: Some(scene), retrieved: None, flat_width: None })
    }
}

/// Retrieves a run as `beamlet retrieve RUN` does.
fn retrieve_run(
    engine: &Engine,
    run: &Path,
    images: &Path,
    cancel: &Cancel,
    reporter: &mut Reporter,
) -> Result<(), Failure> {
    let input = retrieve::Input::of_run(&OpenRun::open(run)?, false)?;
    let mut progress = |done, all| reporter.rows(done, all);
    let mut control =
        RowsControl::default().with_progress(&mut progress).with_cancel(cancel.clone());
    let command = command_line();
    let to = ImagesTo::new(images, Format::default()).with_command(Some(&command));
    retrieve::retrieve(engine, input, &RetrieveOptions::default(), to, &mut control)?;
    Ok(())
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
        .with_regions(arguments.regions.clone())
        .with_rings(arguments.rings)
        .with_keep_views(arguments.keep_views)
        .with_sigma(arguments.sigma)
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

/// Where the voxels lie, in words.
fn grid_words(grid: &beamlet::reconstruct::VolumeGrid) -> String {
    let [x, y, z] = grid.size;
    let [a, b, c] = grid.voxel.map(|side| side * 1e6);
    let [[left, right], [front, back], [low, high]] =
        grid.ends().map(|ends| ends.map(|end| end * 1e3));
    format!(
        "{x} x {y} x {z} voxels of {a:.4} x {b:.4} x {c:.4} um, centres at x {left:.4} to {right:.4}, y \
         {front:.4} to {back:.4}, z {low:.4} to {high:.4} mm"
    )
}

fn names(quantities: &[Quantity]) -> String {
    quantities.iter().map(|quantity| quantity.name()).collect::<Vec<_>>().join(", ")
}

/// Prints the plan of a reconstruction.
fn describe(
    arguments: &Reconstruct,
    plan: &VolumePlan,
    input: &Input,
    found: VolumeEstimate,
    out: &mut impl Write,
) -> Result<(), Failure> {
    let [views, rows, columns] = input.geometry().shape();
    let mib = |bytes: u64| bytes as f64 / f64::from(1 << 20);
    writeln!(out, "volumes  {} ({})", names(&plan.quantities), arguments.format)?;
    writeln!(
        out,
        "views    {views} of {columns} x {rows} pixels, axis of rotation in column {:.3}",
        input.geometry().axis_column()
    )?;
    writeln!(out, "grid     {}", grid_words(&plan.grid))?;
    writeln!(
        out,
        "memory   {:.1} MiB on the host and {:.1} MiB on the device; each volume {:.1} MiB",
        mib(found.host_bytes),
        mib(found.device_bytes),
        mib(found.volume_bytes)
    )?;
    let what = match &plan.method {
        Method::Iterative { options, .. } => {
            format!("projections and back-projections, {} iterations", options.iterations)
        }
        _ => "back-projection".to_owned(),
    };
    writeln!(
        out,
        "time     about {:.1} s of {what}, extrapolated from a part of it on this device",
        found.seconds
    )?;
    writeln!(out, "nothing was written")?;
    Ok(())
}

/// The energy that μ is quoted at.
fn energy_words(record: &VolumeRecord, out: &mut impl Write) -> Result<(), Failure> {
    if let Some(it) = &record.beam_hardening {
        writeln!(
            out,
            "energy   mu at {:.3} keV, corrected for beam hardening in {} (-ln T up to {:.3}; fit \
             within {:.1e})",
            it.energy_kev, it.material, it.largest, it.error
        )?;
        return Ok(());
    }
    match record.beam {
        Some(beam) if beam.spectrum => writeln!(
            out,
            "energy   mu and delta are means over the spectrum (mean detected energy {:.3} keV); mu \
             is not corrected for beam hardening",
            beam.kev
        )?,
        Some(beam) => writeln!(out, "energy   {:.3} keV", beam.kev)?,
        None => {}
    }
    Ok(())
}

/// Views that lost their refraction.
fn lost_views(record: &VolumeRecord, out: &mut impl Write) -> Result<(), Failure> {
    let Some(moment) = &record.refraction_moment else { return Ok(()) };
    let Some(way) = moment.lost_views_are else { return Ok(()) };
    let way = match way {
        LostUse::Interpolated => "interpolated in delta (--keep-views keeps them)",
        LostUse::ZeroWeight => "weight 0 in delta (--keep-views keeps them)",
        _ => "kept in delta",
    };
    writeln!(out, "lost     refraction in {}: {way}", moment.words())?;
    Ok(())
}

/// Closing lines.
fn summary(
    arguments: &Reconstruct,
    done: &Reconstructed,
    retrieved: Option<&Path>,
    seconds: f64,
    out: &mut impl Write,
) -> Result<(), Failure> {
    let record = &done.record;
    if let Some(path) = retrieved {
        let note = "retrieved first, with the defaults of beamlet retrieve";
        writeln!(out, "images   {} ({note})", printed::path(path))?;
    }
    writeln!(out, "volumes  {}", printed::path(&arguments.output))?;
    for (name, unit) in &record.units {
        writeln!(out, "         {name} ({unit})")?;
    }
    writeln!(out, "method   {} {}", record.method, record.options)?;
    let [views, rows, columns] = record.sinograms;
    writeln!(out, "views    {views} of {columns} x {rows} pixels, in {seconds:.1} s")?;
    writeln!(out, "grid     {}", grid_words(&record.grid()))?;
    writeln!(out, "axis     in column {:.3}", record.axis_column)?;
    energy_words(record, out)?;
    for (what, value) in [("mask", &record.mask), ("start", &record.start)] {
        if let Some(value) = value {
            writeln!(out, "{what:<8} {value}")?;
        }
    }
    lost_views(record, out)?;
    if let Some(drift) = record.drift {
        writeln!(out, "phase    {}", crate::commands::drift_words(&drift))?;
    }
    if let Some(k) = record.gradient_bias_m {
        writeln!(out, "bias     delta + k mu, k = {k:.3e} m (gradients of the attenuation)")?;
    }
    for (name, counts) in &record.pixels {
        let is_mu = name == Quantity::Mu.name();
        let misfits = if is_mu { "filled" } else { "kept" };
        writeln!(
            out,
            "pixels   {name}: of {}, {} without a result and {} with T <= 0 are filled, {} misfits {misfits}",
            counts.pixels, counts.without_answer, counts.dark, counts.misfits
        )?;
    }
    if let Some(noise) = &record.noise_of_flat {
        writeln!(out, "sigma    noise of the flat that views share (rings): {noise}")?;
    }
    for table in [&done.regions, &done.errors].into_iter().flatten() {
        writeln!(out)?;
        write!(out, "{table}")?;
    }
    Ok(())
}
