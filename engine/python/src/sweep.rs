//! Designs of a scene with their scores.

use crate::engine::Engine;
use crate::scene::Scene;
use crate::stacks::json;
use crate::work::interruptible;
use beamlet::Error;
use beamlet::sweep::{Outcome, Results, Sweep, SweepRecord, SweepReport};
use pyo3::prelude::*;
use std::path::{Path, PathBuf};

/// Refuses keywords that contradict one another.
fn refuse(has_path: bool, overwrite: bool, resume: bool) -> beamlet::Result<()> {
    if resume && overwrite {
        return Err(Error::argument("overwrite", "besides resume=True", "one of the two"));
    }
    match (has_path, resume) {
        (false, true) => Err(Error::argument("resume", "True without path", "a path as well")),
        (false, false) if overwrite => {
            Err(Error::argument("overwrite", "True without path", "a path as well"))
        }
        _ => Ok(()),
    }
}

/// Finished designs of the record that is resumed; an earlier record is replaced by `overwrite` alone.
fn begin(record: &SweepRecord, overwrite: bool, resume: bool) -> beamlet::Result<Vec<Outcome>> {
    if resume {
        return record.resume();
    }
    match record.path().exists() && !overwrite {
        true => Err(Error::file(record.path(), "exists already; overwrite=True replaces it", None)),
        false => Ok(Vec::new()),
    }
}

/// Scores the designs of a scene; the report as JSON. `vary`, `score` and `fix` are those of `beamlet sweep`. `path`:
/// directory of the record of finished designs, from which the sweep is resumed.
#[pyfunction]
#[expect(clippy::too_many_arguments, reason = "keywords of Python")]
pub(crate) fn sweep(
    py: Python<'_>,
    engine: &Engine,
    scene: &Scene,
    vary: Vec<String>,
    score: Vec<String>,
    fix: Option<String>,
    path: Option<PathBuf>,
    overwrite: bool,
    resume: bool,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<String> {
    let engine = engine.get(py)?;
    let report = interruptible(py, progress, |watch| {
        let load = |sets: &[String]| scene.with_sets(sets);
        let work = || -> beamlet::Result<SweepReport> {
            let mut sweep = Sweep::new(&vary, &score, fix.as_deref())?;
            sweep.prepare(&load)?;
            let count = sweep.designs().count() as f64;
            refuse(path.is_some(), overwrite, resume)?;
            let record = path
                .as_deref()
                .map(|path: &Path| SweepRecord::new(path, &sweep, &load, watch.cancel()));
            let mut record = record.transpose()?;
            let begun = record.as_ref().map(|record| begin(record, overwrite, resume));
            let mut outcomes = begun.transpose()?.unwrap_or_default();
            let mut each = |outcomes: &[Outcome], in_work: f64| {
                watch.report("designs", Some((outcomes.len() as f64 + in_work) / count));
                record.as_mut().map_or(Ok(()), |record| record.keep(outcomes))
            };
            let ended = sweep.complete(&engine, &load, &mut outcomes, watch.cancel(), &mut each);
            record.as_ref().map_or(Ok(()), |record| record.write(&outcomes))?;
            ended?;
            Ok(Results::of(&sweep, &outcomes).report())
        };
        work().map_err(|error| scene.located(error))
    })?;
    json(&report)
}
