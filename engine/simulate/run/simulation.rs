//! A simulation: one scene made ready on a device, traced view by view and illuminated.

mod backend;
pub mod cells;
pub mod designs;
mod detection;
mod estimate;
mod light;
mod prepare;
mod rays;
mod work;

use crate::detector::{self, DetectorModel};
use crate::run::Control;
use crate::run::edge_blur::bounded;
use crate::run::memory::MemoryEstimate;
use crate::run::simulator::Simulator;
use crate::sampling::{self, ErrorBudget, Lattice, ProjectedBounds, Response, Responses};
use crate::trace::{DeviceSample, Tracer};
use crate::wave;
pub use backend::choose;
use beamlet_core::parallel::start_threads;
use beamlet_core::tally::Tally;
use beamlet_core::{Cancel, Result, numbers};
use beamlet_files as stack;
use beamlet_files::{RunProfile, RunRecord, RunStart, SamplingError, SamplingSummary, Sink};
use beamlet_geometry::{self as geometry, Sample};
use beamlet_gpu::{Device, DeviceKind, EngineOptions};
use beamlet_model::media::MaterialTable;
use beamlet_model::scene::{Exposure, Scene};
use light::{LightKind, Pose};
pub use rays::{moments, trace};
use std::ops::Range;
use std::sync::Arc;
use std::time::Instant;
use work::ViewWork;

/// One scene, ready on a device. It owns its parts: the engine may be dropped, and the simulation may be
/// sent to another thread.
#[derive(Debug)]
pub struct Simulation {
    simulator: Simulator,
    scene: Arc<Scene>,
    /// The detector; its optics are traced and illuminated.
    detector: DetectorModel,
    sample: Arc<Sample>,
    on_device: Arc<DeviceSample>,
    /// Surfaces of the sample, for means over facets.
    facets: Arc<sampling::SampleFacets>,
    media: MaterialTable,
    lattice: Lattice,
    light: LightKind,
    /// Effect of changes of a cell on recorded values.
    response: Arc<Response>,
    /// Shares of the light that the bars of the masks let through.
    leaks: [f64; 2],
    /// Error that sampling may leave in them.
    budget: ErrorBudget,
    memory: MemoryEstimate,
    start: RunStart,
    prepared_in: f64,
}

impl Simulation {
    /// The scene.
    #[must_use]
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// Geometry of the sample.
    #[must_use]
    pub fn sample(&self) -> &Sample {
        &self.sample
    }

    /// Device, backend and why.
    #[must_use]
    pub const fn start(&self) -> &RunStart {
        &self.start
    }

    const fn device(&self) -> &Arc<Device> {
        self.simulator.device()
    }

    fn options(&self) -> &EngineOptions {
        self.simulator.options()
    }

    /// A tracer on the chosen backend whose batches adapt, which `cancel` ends.
    ///
    /// # Errors
    /// [`beamlet_core::Error::Device`], [`beamlet_core::Error::Memory`].
    #[doc(hidden)]
    pub fn tracer(&self, cancel: &Cancel) -> Result<Tracer> {
        self.tracer_with(None, cancel)
    }

    /// A tracer of rays that are made and stay on the device, where their batches do not adapt: a GPU takes all, but
    /// for small ones, whose drivers end long dispatches.
    fn tracer_of_batches(&self, cancel: &Cancel) -> Result<Tracer> {
        let whole = self.device().description().kind == DeviceKind::Discrete;
        self.tracer_with(whole.then_some(self.memory.batch_rays), cancel)
    }

    fn tracer_with(&self, batch: Option<u32>, cancel: &Cancel) -> Result<Tracer> {
        let kernels = self.simulator.trace_kernels();
        let (backend, transport) = (self.start.backend, self.scene.sampling.transport);
        let (batch, most) = (self.options().batch_rays.or(batch), self.memory.batch_rays);
        let mut tracer =
            Tracer::new(self.device(), kernels, &self.on_device, backend, transport, batch, most)?;
        tracer.set_cancel(cancel.clone());
        Ok(tracer)
    }

    /// View of a pose of the sample.
    fn view_of(&self, pose: u32) -> u32 {
        numbers::count(self.scene.scan.view_of(pose as usize))
    }

    fn projected_bounds(&self, pose: u32) -> Vec<ProjectedBounds> {
        let motion = self.scene.pose(pose as usize, self.scene.detector.pitch[0]);
        sampling::projected_bounds(&self.sample, &self.lattice, &motion)
    }

    /// The detector, and the grid that takes its light.
    #[doc(hidden)]
    pub const fn detector_model(&self) -> &DetectorModel {
        &self.detector
    }

    /// Room that lines may take.
    fn room(&self) -> sampling::Room {
        let limit = self.options().memory_limit.zip(self.memory.left_for_lines);
        sampling::Room {
            limit: limit.map(<[u64; 2]>::from),
            words: self.light.spectrum().map_or(0, |spectrum| spectrum.recording.words),
        }
    }

    /// Effect of changes of a cell on recorded values of a view, of designs that are lit together.
    fn responses(designs: &[Self], view: Exposure) -> Responses {
        Responses::new(designs.iter().map(|design| design.response(view)).collect())
    }

    /// Effect of changes of a cell on recorded values at the mask offsets of a view.
    fn response(&self, view: Exposure) -> Arc<Response> {
        let optics = self.detector.optics();
        match optics.offsets.list_of(view) {
            0 => self.response.clone(),
            list => Arc::new(Response::new(
                optics,
                &self.lattice,
                (self.leaks, &self.response.hardening),
                list,
            )),
        }
    }

    /// Inputs of the sampling of a pose.
    fn pose_context<'a>(
        &'a self,
        pose: &'a Pose,
        responses: &'a Responses,
    ) -> sampling::ViewContext<'a> {
        let optics = self.detector.optics();
        sampling::ViewContext {
            optics,
            motion: self.scene.pose(pose.index as usize, optics.detector.pitch[0]),
            sample: &self.sample,
            facets: &self.facets,
            lattice: &self.lattice,
            pose: pose.index,
            projected_bounds: &pose.shadows,
            recording: self.light.spectrum().map(|spectrum| &spectrum.recording),
            responses,
            budget: self.budget,
        }
    }

    /// The rows of the detector in bands.
    fn bands(&self) -> impl Iterator<Item = Range<u32>> + use<> {
        let (rows, band) = (self.scene.detector.pixels[1], self.band_rows());
        (0..rows).step_by(band as usize).map(move |first| first..rows.min(first + band))
    }

    /// Rows of a band within the memory limit.
    #[must_use]
    pub const fn band_rows(&self) -> u32 {
        self.memory.band_rows
    }

    /// Peak memory of a run.
    #[must_use]
    pub const fn memory(&self) -> &MemoryEstimate {
        &self.memory
    }

    /// Objects that have defects and are used all the same.
    fn defective_objects(&self) -> u64 {
        self.sample.objects.iter().filter(|object| object.defects.refused()).count() as u64
    }

    /// Refuses results of which too many rays stayed unbalanced; where objects have defects it warns.
    ///
    /// # Errors
    /// [`Error::Tally`].
    #[doc(hidden)]
    pub fn check_tally(&self, tally: &Tally) -> Result<()> {
        Tally { defective_objects: self.defective_objects(), ..*tally }.refuse_unbalanced()
    }

    /// Runs every view that `control` does not skip and hands it to the sink.
    ///
    /// # Errors
    /// See [`beamlet_core::Error`]; [`beamlet_core::Error::Interrupted`] when `control.cancel` was set.
    ///
    /// # Example
    ///
    /// ```no_run
    /// use beamlet::stack::ArraySink;
    /// use beamlet::{Control, Engine, EngineOptions, scene::Scene};
    ///
    /// let engine = Engine::open(&EngineOptions::default())?;
    /// let scene = Scene::load("scene.toml")?;
    /// let simulation = engine.prepare(&scene)?;
    /// println!("about {} s", simulation.estimate()?.seconds);
    /// let mut sink = ArraySink::new();
    /// let record = simulation.run(&mut sink, Control::default())?;
    /// println!("{} rays", record.tally.rays);
    /// # Ok::<(), beamlet::Error>(())
    /// ```
    pub fn run(&self, sink: &mut dyn Sink, mut control: Control<'_>) -> Result<RunRecord> {
        start_threads()?;
        let begin = Instant::now();
        let swept = geometry::swept(&self.scene, &self.sample);
        let edges = bounded(&self.scene, &swept);
        let of_edges =
            edges.as_ref().and_then(|it| it.warning(self.scene.sampling.tolerances().light));
        let mut warnings = swept.fov_warnings(&self.scene);
        warnings.extend(detector::offset_warning(&self.scene).into_iter().chain(of_edges));
        warnings.iter().for_each(|text| log::warn!("{text}"));
        let mut views = stack::views_of_part(&self.scene, control.views)?;
        views.retain(|view| !control.skip.contains(view));
        let mut work = ViewWork::new(std::slice::from_ref(self), &views, &control.cancel)?;
        // Last of all, so that a run that cannot start writes nothing.
        sink.begin(&self.scene, &self.start)?;
        let prepared = self.device().traffic();
        let (mut first, mut before, mut counted) = (prepared, Tally::default(), control.counted);
        for view in &views {
            work.view(*view, &mut [sink], &mut control)?;
            let tally = work.tally();
            let own = tally.since(before);
            sink.tally(*view, &own)?;
            sink.commit(*view)?;
            (before, counted) = (tally, counted + own);
            if *view == views[0] {
                first = self.device().traffic();
            }
        }
        let profile = self
            .options()
            .profile
            .then(|| RunProfile::of(prepared, first, self.device().profile(), views.len()));
        let seconds = work.seconds();
        let tally = Tally { defective_objects: self.defective_objects(), ..counted };
        let mut record = RunRecord {
            tally,
            sampling: SamplingSummary::of(&tally, self.budget.tolerance),
            sampling_error: SamplingError::of(&tally, self.budget.tolerance),
            edge_error: edges.map(|edges| edges.error),
            seconds: [
                ("prepare", self.prepared_in),
                ("trace", seconds.trace),
                ("illuminate", seconds.illuminate),
                ("detect", seconds.detect),
                ("noise", seconds.noise),
                ("write", seconds.write),
                ("total", self.prepared_in + begin.elapsed().as_secs_f64()),
            ]
            .map(|(stage, seconds)| (stage.to_owned(), seconds))
            .into(),
            profile,
            ..RunRecord::begin(&self.start, self.scene.sampling.seed)
        };
        record.warnings = warnings;
        // The counts of a part are too few to be judged: the join judges the sum.
        if control.views.is_none() {
            let grazing = wave::grazing_warning(&self.scene, &tally);
            let audited = record.sampling_error.and_then(|it| it.warning(self.budget.tolerance));
            for text in grazing.into_iter().chain(audited) {
                log::warn!("{text}");
                record.warnings.push(text);
            }
            self.check_tally(&tally)?;
        }
        sink.finish(&record)?;
        Ok(record)
    }
}
