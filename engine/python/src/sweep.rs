//! Designs of a scene with their scores.

use crate::engine::Engine;
use crate::scene::Scene;
use crate::stacks::json;
use crate::work::interruptible;
use beamlet::sweep::{Outcome, Results, Sweep, SweepReport};
use pyo3::prelude::*;

/// Scores the designs of a scene; the report as JSON. `vary`, `score` and `fix` are those of `beamlet sweep`.
#[pyfunction]
pub(crate) fn sweep(
    py: Python<'_>,
    engine: &Engine,
    scene: &Scene,
    vary: Vec<String>,
    score: Vec<String>,
    fix: Option<String>,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<String> {
    let engine = engine.get(py)?;
    let report = interruptible(py, progress, |watch| {
        let load = |sets: &[String]| scene.with_sets(sets);
        let work = || -> beamlet::Result<SweepReport> {
            let mut sweep = Sweep::new(&vary, &score, fix.as_deref())?;
            sweep.prepare(&load)?;
            let (count, mut outcomes) = (sweep.designs().count() as f64, Vec::new());
            let mut each = |outcomes: &[Outcome], in_work: f64| {
                watch.report("designs", Some((outcomes.len() as f64 + in_work) / count));
                Ok(())
            };
            sweep.complete(&engine, &load, &mut outcomes, watch.cancel(), &mut each)?;
            Ok(Results::of(&sweep, &outcomes).report())
        };
        work().map_err(|error| scene.located(error))
    })?;
    json(&report)
}
