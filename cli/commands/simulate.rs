//! `beamlet simulate`: a scene into a run directory, resumable at any time.

use crate::args::Simulate;
use crate::failure::Failure;
use crate::interrupt;
use crate::progress::Reporter;
use beamlet::cli_support::views_of_part;
use beamlet::scene::Scene;
use beamlet::stack::{RunDirectory, RunState, StackShape};
use beamlet::{AuditedError, Control, Engine, Error, RunRecord, SamplingSummary, Tally};
use std::io::Write;
use std::time::Instant;

pub(super) fn run(arguments: &Simulate, out: &mut impl Write) -> Result<(), Failure> {
    let began = Instant::now();
    let mut scene = arguments.scene.load()?;
    if arguments.resume {
        scene = RunDirectory::scene_of_resumed(&arguments.output, &scene)?;
    }
    let failed = |error| Failure::from(arguments.scene.locate(error));
    let extent = StackShape::of(&scene).map_err(failed)?;
    let mut sink = directory(arguments, &scene)?;
    let all = views_of_part(&scene, sink.part()).map_err(failed)?;
    if let Some(recorded) = sink.recorded()
        && recorded.state == RunState::Done
        && sink.problems().is_empty()
        && all.iter().all(|view| sink.committed().contains(view))
    {
        if !arguments.messages.quiet {
            let path = beamlet::cli_support::printed::path(&arguments.output);
            writeln!(out, "{path} is complete already")?;
        }
        return Ok(());
    }
    let recorded_backend = sink.recorded().map(|file| file.record.backend);
    let cancel = interrupt::listen();
    let mut reporter = Reporter::new(arguments.messages);
    // A resumed run goes on with the backend that began it, or its bits would change.
    let backend = arguments.engine.backend.choice().or(recorded_backend);
    let options = arguments.engine.options().with_backend(backend);
    let options = options.with_profile(arguments.profile.profile);
    let engine = Engine::open(&options)?;
    let mut report = |progress| reporter.update(progress);
    let control = Control::default().with_progress(&mut report).with_cancel(cancel).going_on(&sink);
    let done = engine.run(&scene, &mut sink, control);
    reporter.finish();
    let of_run = done.as_ref().ok().and_then(|record| record.profile.as_ref());
    arguments.profile.show(&engine, of_run);
    match done {
        Ok(_) if arguments.messages.quiet => Ok(()),
        Ok(record) => {
            let seconds = began.elapsed().as_secs_f64();
            summary(scene.title.as_deref(), &sink, extent, &record, seconds, out)
        }
        Err(Error::Interrupted) => {
            let began = arguments.resume || sink.has_begun();
            Err(Failure::Interrupted { advice: advice(arguments, began) })
        }
        Err(error) => Err(failed(error)),
    }
}

fn directory(arguments: &Simulate, scene: &Scene) -> Result<RunDirectory, Failure> {
    let format = arguments.format;
    let sink = if arguments.resume {
        let mut reporter = Reporter::new(arguments.messages);
        reporter.doing("comparing frames with their checksums");
        let sink = RunDirectory::resume(&arguments.output, scene)?;
        reporter.finish();
        if let Some(views) = arguments.views.filter(|views| Some(*views) != sink.part()) {
            let path = beamlet::cli_support::printed::path(&arguments.output);
            let here = sink.part().map_or("a whole run".to_owned(), |part| format!("views {part}"));
            let words = format!("{path} holds {here}; it cannot continue with --views {views}");
            return Err(Failure::Usage(words));
        }
        // Also under --quiet: data was lost.
        for problem in sink.problems() {
            let _ = writeln!(
                std::io::stderr(),
                "warning: {}",
                beamlet::cli_support::printed::line(problem)
            );
        }
        if let Some(format) = format.filter(|format| *format != sink.format()) {
            return Err(Failure::Usage(format!(
                "the run was begun with --format {}; it cannot continue with --format {format}",
                sink.format()
            )));
        }
        sink.allow_mixed(arguments.allow_mixed)
    } else {
        let output = &arguments.output;
        if arguments.overwrite {
            let mut read = scene.input_files();
            read.push(arguments.scene.scene.clone());
            RunDirectory::reading(output, &read)?;
        }
        views_of_part(scene, arguments.views)?;
        let format = format.unwrap_or_default();
        RunDirectory::create(output, format, arguments.overwrite)?.views(arguments.views)
    };
    Ok(sink.overrides(&arguments.scene.sets).command(command_line()))
}

/// Closing lines, on stdout.
fn summary(
    title: Option<&str>,
    sink: &RunDirectory,
    extent: StackShape,
    record: &RunRecord,
    seconds: f64,
    out: &mut impl Write,
) -> Result<(), Failure> {
    let StackShape { views, steps, rows, columns, .. } = extent;
    // Of a resumed run the tally covers all views, and the time this part.
    let rays = record.tally.rays.saturating_sub(sink.counted().rays);
    let rate = rays as f64 / 1e6 / seconds.max(1e-9);
    if let Some(title) = title {
        writeln!(out, "title    {}", beamlet::cli_support::printed::line(title))?;
    }
    writeln!(
        out,
        "run      {} ({})",
        beamlet::cli_support::printed::path(sink.path()),
        sink.format()
    )?;
    let views = sink.part().map_or(views.to_string(), |part| format!("{part} of {views}"));
    writeln!(out, "views    {views} x {steps} steps of {columns} x {rows} pixels, and the flat")?;
    writeln!(out, "device   {} ({})", record.device, record.driver)?;
    if record.tally.rays == 0 {
        writeln!(out, "rays     none traced, in {seconds:.1} s")?;
        return print_tally(&record.tally, out);
    }
    writeln!(out, "backend  {}: {}", record.backend, record.backend_reason)?;
    let part = match sink.committed().len() {
        0 => String::new(),
        views => format!(" (and {} earlier, for {views} views)", record.tally.rays - rays),
    };
    writeln!(out, "rays     {rays} in {seconds:.1} s ({rate:.2} million a second){part}")?;
    if let Some(sampling) = &record.sampling {
        tell_sampling(sampling, out)?;
    }
    if let Some(AuditedError { rms, standard_error, patches, .. }) =
        record.sampling_error.map(|it| it.all)
    {
        writeln!(
            out,
            "         measured error {rms:.1e} of open beam (rms, standard error {standard_error:.1e}), by {patches} patches"
        )?;
    }
    print_tally(&record.tally, out)
}

/// Fineness of the sampling and its estimated error.
fn tell_sampling(sampling: &SamplingSummary, out: &mut impl Write) -> Result<(), Failure> {
    let SamplingSummary { patches, mean_rays, most_rays, rms_error, worst_error, .. } = sampling;
    writeln!(
        out,
        "sampling {mean_rays:.1} rays per beamlet and row with sample, at most {most_rays}; \
         estimated error {rms_error:.1e} of open beam (rms), {worst_error:.1e} (worst)"
    )?;
    if sampling.beyond_tolerance > 0 {
        let (beyond, tolerance) = (sampling.beyond_tolerance, sampling.tolerance);
        writeln!(
            out,
            "         {beyond} of {patches} patches (one beamlet, one row) may exceed a tolerance: \
             {tolerance:.1e} of open beam, or the tolerance of angles"
        )?;
    }
    Ok(())
}

/// Prints the entries of a tally that are not zero.
fn print_tally(tally: &Tally, out: &mut impl Write) -> Result<(), Failure> {
    for (count, what) in counts(tally).into_iter().filter(|(count, _)| *count > 0) {
        writeln!(out, "         {count} {what}")?;
    }
    Ok(())
}

/// Counts of a tally that are worth a line where they are not zero.
fn counts(tally: &Tally) -> [(u64, &'static str); 12] {
    [
        (tally.exact, "rays traced exactly"),
        (tally.unbalanced, "rays unbalanced after re-tracing"),
        (tally.negative, "rays with negative paths, through objects with defects"),
        (tally.unordered, "rays not followed exactly; their first order is used"),
        (tally.retraced, "rays traced again with the software BVH"),
        (tally.dropped, "cells or crossings dropped at a limit"),
        (tally.reflected, "rays totally reflected"),
        (tally.not_finite, "rays not finite; their light is omitted"),
        (
            tally.landed_off,
            "cells whose light landed outside the detector or too far off to follow (by waves: kept in its row)",
        ),
        (tally.defective_objects, "objects with defects, accepted by allow_defects"),
        (tally.saturated, "detector numbers clipped at the upper end of the bit depth"),
        (tally.clipped_at_zero, "detector numbers clipped at 0"),
    ]
}

/// The command that continues after an interrupt. `began`: whether this run has written anything; its
/// directory may hold an earlier run that it was about to replace.
fn advice(arguments: &Simulate, began: bool) -> String {
    let mut command = vec![
        "beamlet simulate".to_owned(),
        quoted(&arguments.scene.scene.to_string_lossy()),
        "-o".into(),
        quoted(&arguments.output.to_string_lossy()),
    ];
    for set in &arguments.scene.sets {
        command.extend(["--set".into(), quoted(set)]);
    }
    if let Some(device) = &arguments.engine.device.device {
        command.extend(["--device".into(), quoted(device)]);
    }
    if let Some(limit) = arguments.engine.memory_limit {
        command.extend(["--memory-limit".into(), format!("{limit}B")]);
    }
    if arguments.allow_mixed {
        command.push("--allow-mixed".into());
    }
    if !began {
        // A resumed run finds these in its directory.
        if let Some(views) = arguments.views {
            command.extend(["--views".into(), views.to_string()]);
        }
        if let Some(format) = arguments.format {
            command.extend(["--format".into(), format.to_string()]);
        }
        if let Some(backend) = arguments.engine.backend.choice() {
            command.extend(["--backend".into(), backend.to_string()]);
        }
        if arguments.overwrite {
            command.push("--overwrite".into());
        }
        return format!("nothing was written; to start again: {}", command.join(" "));
    }
    command.push("--resume".into());
    format!("to resume: {}", command.join(" "))
}

/// The command line as it was entered, as a shell takes it.
pub(super) fn command_line() -> String {
    let words = crate::words().iter().map(|word| quoted(&word.to_string_lossy()));
    std::iter::once("beamlet".to_owned()).chain(words).collect::<Vec<_>>().join(" ")
}

/// A word as a shell takes it.
pub(super) fn quoted(word: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "-_./:,+@%=".contains(c);
    if !word.is_empty() && word.chars().all(plain) {
        return word.to_owned();
    }
    format!("'{}'", word.replace('\'', r"'\''"))
}

#[cfg(test)]
mod tests {
    use super::quoted;

    #[test]
    fn words_with_blanks_and_quotes_survive_a_shell() {
        assert_eq!(quoted("runs/a-1.toml"), "runs/a-1.toml");
        assert_eq!(quoted("source.energy=40 keV"), "'source.energy=40 keV'");
        assert_eq!(quoted("it's"), r"'it'\''s'");
        assert_eq!(quoted(""), "''");
    }
}
