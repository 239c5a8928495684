//! What of a check needs a device: the illumination curve, and the estimate of rays and time.

use super::{CheckReport, illumination, load_lenient};
use crate::run::memory;
use crate::run::{RunEstimate, Simulation};
use crate::scene::Scene;
use crate::{Control, Engine, Result};
use std::time::Instant;

/// As [`super::check_within`], with an estimate of rays and time of a run of this engine. A part of the
/// patches is sampled for it, for about a second beyond what a run takes to its first ray.
///
/// # Errors
/// As [`super::check_within`]. Where the device fails, [`super::Work::no_estimate`] says why.
///
/// # Example
///
/// ```no_run
/// use beamlet::check::check_on;
/// use beamlet::{Engine, EngineOptions, scene::Scene};
///
/// let engine = Engine::open(&EngineOptions::default())?;
/// let scene = Scene::load("scene.toml")?;
/// let report = check_on(&engine, &scene)?;
/// // For people, as `beamlet check` prints it; fields hold the numbers in SI units.
/// println!("{report}");
/// if let Some(estimate) = &report.work.estimate {
///     println!("{} rays, {} s", estimate.rays, estimate.seconds);
/// }
/// # Ok::<(), beamlet::Error>(())
/// ```
pub fn check_on(engine: &Engine, scene: &Scene) -> Result<CheckReport> {
    check_on_watched(engine, scene, &mut Control::default())
}

/// As [`check_on`]; `control` is used as in [`super::check_watched`].
///
/// # Errors
/// As [`check_on`]; [`crate::Error::Interrupted`] when `control.cancel` was set.
pub fn check_on_watched(
    engine: &Engine,
    scene: &Scene,
    control: &mut Control<'_>,
) -> Result<CheckReport> {
    let begin = Instant::now();
    let (mut report, sample, bounded) =
        load_lenient(scene, engine.options().memory_limit, control)?;
    let loaded_in = begin.elapsed().as_secs_f64();
    add_curve(engine, scene, &mut report);
    if !report.refusals.is_empty() {
        report.add_edges(scene, bounded.as_ref());
        report.work.no_estimate = Some("a run refuses the sample".into());
        return Ok(report);
    }
    let limit = engine.options().memory_limit;
    let objects = sample.objects.clone();
    let made = Simulation::of_loaded(engine, scene, Some(sample), control);
    let edges = match &made {
        Ok(made) => made.edge_blur(&control.cancel)?,
        Err(_) => bounded,
    };
    report.add_edges(scene, edges.as_ref());
    match made.and_then(|made| made.estimate_until(&control.cancel)) {
        Ok(estimate) => {
            let seconds = loaded_in + estimate.seconds;
            let rays = estimate.rays_per_view;
            report.work.memory = memory::estimate_refined(scene, &objects, limit, rays)?;
            report.work.estimate = Some(RunEstimate { seconds, ..estimate });
        }
        Err(crate::Error::Interrupted) => return Err(crate::Error::Interrupted),
        Err(error) => report.work.no_estimate = Some(error.to_string()),
    }
    Ok(report)
}

/// As [`super::check_watched`], with the illumination curve, for which this engine computes a part of
/// the flat: no ray is traced, and no rays and time are estimated.
///
/// # Errors
/// As [`super::check_watched`].
pub fn check_with_curve(
    engine: &Engine,
    scene: &Scene,
    control: &mut Control<'_>,
) -> Result<CheckReport> {
    let (mut report, _, edges) = load_lenient(scene, engine.options().memory_limit, control)?;
    report.add_edges(scene, edges.as_ref());
    report.work.no_estimate = Some("it was not requested".into());
    add_curve(engine, scene, &mut report);
    Ok(report)
}

/// Adds the curve and what is odd about it; a device that fails takes it away.
fn add_curve(engine: &Engine, scene: &Scene, report: &mut CheckReport) {
    let curve = illumination::illumination(engine, scene, &report.setup.nodes);
    report.illumination = curve.unwrap_or(None);
    if let Some(curve) = &report.illumination {
        report.warnings.extend(illumination::warnings(scene, curve));
    }
}
