//! Builder of a check: the scene, and the engine, memory limit and estimate that it may use.

use super::{CheckReport, estimate, load_lenient};
use crate::Engine;
use beamlet_core::Result;
use beamlet_core::parallel::start_threads;
use beamlet_model::scene::Scene;
use beamlet_simulate::run::{Control, quality};

/// Check of a scene: loads everything that a run would load, and reports sizes, costs and doubts.
///
/// # Example
///
/// ```no_run
/// use beamlet::{Engine, EngineOptions, check::Check, scene::Scene};
///
/// let scene = Scene::load("scene.toml")?;
/// for refusal in &Check::of(&scene).run()?.refusals {
///     eprintln!("{refusal}");
/// }
/// let engine = Engine::open(&EngineOptions::default())?;
/// let report = Check::of(&scene).with_engine(&engine).run()?;
/// // For people, as `beamlet check` prints it; fields hold the numbers in SI units.
/// println!("{report}");
/// if let Some(estimate) = &report.work.estimate {
///     println!("{} rays, {} s", estimate.rays, estimate.seconds);
/// }
/// # Ok::<(), beamlet::Error>(())
/// ```
#[derive(Debug, Clone, Copy)]
#[must_use]
pub struct Check<'a> {
    scene: &'a Scene,
    engine: Option<&'a Engine>,
    memory_limit: Option<u64>,
    estimates: bool,
}

impl<'a> Check<'a> {
    /// Check without a device: neither curve nor estimate.
    pub const fn of(scene: &'a Scene) -> Self {
        Self { scene, engine: None, memory_limit: None, estimates: true }
    }

    /// Adds the illumination curve, and an estimate of rays and time of a run of this engine, within its
    /// memory limit. It samples a part of the patches, for about a second beyond the time of a run to its
    /// first ray.
    pub fn with_engine(mut self, engine: &'a Engine) -> Self {
        self.engine = Some(engine);
        self
    }

    /// Memory limit of a run in place of the limit of the engine, bytes (see [`beamlet_gpu::EngineOptions`]).
    pub fn with_memory_limit(mut self, memory_limit: impl Into<Option<u64>>) -> Self {
        self.memory_limit = memory_limit.into();
        self
    }

    /// Leaves out the estimate of rays and time: no ray is traced.
    pub const fn without_estimate(mut self) -> Self {
        self.estimates = false;
        self
    }

    /// Checks the scene.
    ///
    /// # Errors
    /// Whatever would stop a run before its first ray: materials, meshes that cannot be read, a
    /// sample that would hit a mask; [`beamlet_core::Error::Memory`] where the memory limit is too small.
    /// Meshes that a run refuses for their defects are reported, and listed in
    /// [`CheckReport::refusals`]. Where the device fails, [`super::Work::no_estimate`] says why.
    pub fn run(self) -> Result<CheckReport> {
        self.run_with(&mut Control::default())
    }

    /// As [`Self::run`]; `control.progress` receives the loading of objects, from the calling thread,
    /// and `control.cancel` ends it.
    ///
    /// # Errors
    /// As [`Self::run`]; [`beamlet_core::Error::Interrupted`] when `control.cancel` was set.
    pub fn run_with(self, control: &mut Control<'_>) -> Result<CheckReport> {
        let Self { scene, engine, memory_limit, estimates } = self;
        start_threads()?;
        scene.validate()?;
        let scene = &quality::resolved(scene)?;
        let of_engine = engine.and_then(|engine| engine.options().memory_limit);
        let limit = memory_limit.or(of_engine);
        let mut report = match engine {
            Some(engine) if estimates => estimate::estimated(engine, scene, limit, control)?,
            _ => {
                let (mut report, _, edges) = load_lenient(scene, limit, control)?;
                report.add_edges(scene, edges.as_ref());
                report.add_needless(scene, |_| Ok(None))?;
                let reason = if estimates { "it needs a device" } else { "it was not requested" };
                report.work.no_estimate = Some(reason.into());
                if let Some(engine) = engine {
                    estimate::add_curve(engine, scene, &mut report);
                }
                report.add_doubts_of_scan(scene)?;
                report
            }
        };
        report.add_usual(scene);
        Ok(report)
    }
}
