//! `beamlet sweep`: designs of a set-up with their scores.

mod table;

use super::pictures::{PictureForm, Pictures, refuse_existing, refuse_read};
use crate::args::Sweep as Arguments;
use crate::failure::Failure;
use crate::interrupt;
use crate::picture::sweep as picture;
use crate::progress::Reporter;
use beamlet::cli_support::{load_scene, printed, write_file};
use beamlet::scene::Scene;
use beamlet::sweep::{Outcome, Results, Sweep, SweepRecord};
use beamlet::{Engine, Error};
use std::collections::BTreeMap;
use std::io::Write;
use std::path::{Path, PathBuf};

pub(super) fn run(arguments: &Arguments, out: &mut impl Write) -> Result<(), Failure> {
    let load = |sets: &[String]| {
        let all: Vec<String> = arguments.scene.sets.iter().chain(sets).cloned().collect();
        load_scene(&arguments.scene.scene, &all)
    };
    let mut sweep = Sweep::new(&arguments.vary, &arguments.score, arguments.fix.as_deref())?;
    sweep.prepare(&load)?;
    let scene = load(&[])?;
    let cancel = interrupt::listen();
    let mut record = SweepRecord::new(&arguments.output, &sweep, &load, &cancel)?;
    let mut outcomes = begin(arguments, &record, &scene)?;
    let mut reporter = Reporter::new(arguments.messages);
    let engine = Engine::open(&arguments.device.options())?;
    let count = sweep.designs().count();
    let mut each = |outcomes: &[Outcome], in_work: f64| {
        reporter.designs(outcomes.len(), in_work, count);
        record.keep(outcomes)
    };
    let ended = sweep.complete(&engine, &load, &mut outcomes, &cancel, &mut each);
    reporter.finish();
    record.write(&outcomes)?;
    ended.map_err(|error| match error {
        Error::Interrupted => Failure::Interrupted {
            advice: format!(
                "{} of {count} designs are in {}; --resume continues",
                outcomes.len(),
                printed::path(&arguments.output)
            ),
        },
        error => error.into(),
    })?;
    let done = Results::of(&sweep, &outcomes);
    let files = write(arguments, &done, &load)?;
    done.warnings().iter().for_each(|text| log::warn!("{text}"));
    match arguments.json {
        true => super::write_json(&done.report(), out)?,
        false if arguments.messages.quiet => {}
        false => summary(&done, &files, out)?,
    }
    let reason = outcomes.iter().find_map(|outcome| outcome.refused.clone());
    match (done.best, reason) {
        (None, Some(reason)) => {
            Err(Failure::Refused(vec![format!("no design has a score: {reason}")]))
        }
        _ => Ok(()),
    }
}

/// Finished designs of a sweep that is resumed; refuses to replace files that it reads, or an earlier sweep.
fn begin(
    arguments: &Arguments,
    record: &SweepRecord,
    scene: &Scene,
) -> Result<Vec<Outcome>, Failure> {
    let path = record.path().to_owned();
    let mut read = scene.input_files();
    read.push(arguments.scene.scene.clone());
    read.extend(arguments.vary.iter().map(Into::into));
    refuse_read(&[path.clone(), arguments.output.join("best.toml")], &read)?;
    if arguments.resume {
        return Ok(record.resume()?);
    }
    refuse_existing(&[path], arguments.overwrite)?;
    remove_earlier(&arguments.output, record);
    Ok(Vec::new())
}

/// Removes the files of an earlier sweep, which may have other scores.
fn remove_earlier(output: &Path, record: &SweepRecord) {
    let pictures = record.earlier_scores().iter().map(picture::file_name).collect::<Vec<_>>();
    let pictures = pictures.into_iter().chain(["front".into()]);
    let pictures = pictures.flat_map(|name| [format!("{name}.png"), format!("{name}.svg")]);
    for name in pictures.chain(["sweep.csv".into(), "best.toml".into()]) {
        // A missing file needs no removal, and one that stays is replaced later.
        let _ = std::fs::remove_file(output.join(name));
    }
}

/// Writes table, best design and pictures; gives their paths.
fn write(
    arguments: &Arguments,
    done: &Results<'_>,
    load: &dyn Fn(&[String]) -> beamlet::Result<Scene>,
) -> Result<Vec<PathBuf>, Failure> {
    let output = &arguments.output;
    let mut files = vec![output.join("sweep.csv")];
    write_file(&files[0], table::csv(done).as_bytes())?;
    if let Some(best) = done.best {
        let own = done.sets(best);
        let sets = [&arguments.scene.sets[..], &own].concat();
        let text = load(&own)?.to_toml(output, &BTreeMap::new(), &sets)?;
        files.push(output.join("best.toml"));
        let comment =
            format!("# Best of {} designs: {}\n", done.outcomes.len(), table::best(done, best));
        write_file(&files[1], (comment + &text).as_bytes())?;
    }
    let mut pictures = Pictures::new(PictureForm { format: arguments.format, width: None });
    for (name, drawing) in picture::draw_all(done) {
        pictures.add(&name, &drawing)?;
    }
    let mut paths = Vec::new();
    pictures.write(output, true, &[], &mut paths)?;
    files.extend(String::from_utf8_lossy(&paths).lines().map(PathBuf::from));
    Ok(files)
}

fn summary(done: &Results<'_>, files: &[PathBuf], out: &mut impl Write) -> std::io::Result<()> {
    let refused = done.outcomes.iter().filter(|outcome| outcome.refused.is_some()).count();
    let of_refused = if refused > 0 { format!(", {refused} refused") } else { String::new() };
    writeln!(out, "designs  {}{of_refused}", done.outcomes.len())?;
    if let Some(best) = done.best {
        writeln!(out, "best     {}", table::best(done, best))?;
    }
    if let [first, second, ..] = done.sweep.scores() {
        let designs = done.front.iter().filter(|on_front| **on_front).count();
        let [first, second] = [first, second].map(|score| score.name());
        writeln!(out, "front    {designs} designs, of {first} and {second}")?;
    }
    files.iter().try_for_each(|file| writeln!(out, "wrote    {}", printed::path(file)))
}
