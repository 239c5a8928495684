//! Parts of a check that need a device: the illumination curve, and the estimate of rays and time.

use super::{CheckReport, costs, illumination, load_lenient, two_directions};
use crate::Engine;
use beamlet_core::{Error, Result};
use beamlet_model::scene::Scene;
use beamlet_simulate::run::{Control, Simulation, memory};
use std::time::Instant;

/// The report with the curve, and an estimate of rays and time of a run of this engine.
///
/// # Errors
/// As [`super::Check::run_with`].
pub(super) fn estimated(
    engine: &Engine,
    scene: &Scene,
    limit: Option<u64>,
    control: &mut Control<'_>,
) -> Result<CheckReport> {
    let begin = Instant::now();
    let (mut report, sample, bounded) = load_lenient(scene, limit, control)?;
    let loaded_in = begin.elapsed().as_secs_f64();
    add_curve(engine, scene, &mut report);
    report.add_doubts_of_scan(scene)?;
    if !report.refusals.is_empty() {
        report.add_edges(scene, bounded.as_ref());
        report.add_needless(scene, |_| Ok(None))?;
        report.work.no_estimate = Some("a run refuses the sample".into());
        return Ok(report);
    }
    let objects = sample.objects.clone();
    // No other run may be estimated without an estimate of this one.
    let again = costs::by_noise(scene, &report.work.tolerances)?.map(|_| sample.clone());
    let made = Simulation::of_loaded(engine.simulator(), scene, Some(sample), control);
    report.add_edges(scene, bounded.as_ref());
    let found = made.and_then(|made| made.estimate_until(&control.cancel));
    let is_known = found.is_ok();
    match found {
        Ok(mut estimate) => {
            estimate.seconds += loaded_in;
            let cells = estimate.cells_at_once;
            report.work.memory = memory::estimate_sampled(scene, &objects, limit, cells)?;
            report.work.estimate = Some(estimate);
        }
        // What is wrong with the scene, a run refuses.
        Err(error @ (Error::Interrupted | Error::Scene { .. })) => return Err(error),
        Err(error) => report.work.no_estimate = Some(error.to_string()),
    }
    report.add_needless(scene, |faster| {
        let Some(sample) = again.filter(|_| is_known) else { return Ok(None) };
        let made = Simulation::of_loaded(engine.simulator(), faster, Some(sample), control)?;
        Ok(Some(loaded_in + made.estimate_until(&control.cancel)?.seconds))
    })?;
    Ok(report)
}

/// Adds the curve; a device that fails takes it away.
pub(super) fn add_curve(engine: &Engine, scene: &Scene, report: &mut CheckReport) {
    let curve = illumination::illumination(engine, scene, &report.setup.nodes);
    report.illumination = curve.unwrap_or(None);
    report.in_two_directions = two_directions::uncertainty(engine, scene).unwrap_or(None);
}
