//! A simulation: one scene made ready on a device, traced view by view and illuminated.

#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    clippy::cast_possible_wrap,
    reason = "counts and indices are bounded by the scene's validation; rounding to f32 is meant"
)]

pub(crate) mod cells;
mod crossings;
mod work;

use crate::accel::Backend;
use crate::detector::DetectorModel;
use crate::geometry::{self, Sample};
use crate::gpu::Device;
use crate::illuminate::{self, Spectral};
use crate::moments::{self, StoredMoments, StoredSource};
use crate::numbers;
use crate::run::engine::{Engine, EngineOptions};
use crate::run::memory::{self, MemoryEstimate};
use crate::run::{self, Control};
use crate::sampling::{self, ErrorBudget, Lattice, ProjectedBounds, Response};
use crate::scene::{Exposure, Scene, Scheme};
use crate::stack::{self, RunRecord, RunStart, SamplingSummary, Sink};
use crate::trace::{DeviceSample, Law, MaterialTable, Moments, Ray, Tally, TraceKernels, Tracer};
use crate::{Error, Result};
use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Instant;
use work::Work;

/// Rays of a calibration.
const CALIBRATION_RAYS: usize = 1 << 13;
/// Places they are at.
const CALIBRATION_PATCHES: usize = 16;
/// A run fails when more than this share of its rays stays unbalanced.
const UNBALANCED_SHARE: f64 = 1e-5;

/// What a simulation is made of, besides its geometry.
struct Parts<'e> {
    detection: DetectorModel,
    media: MaterialTable,
    lattice: Lattice,
    spectral: Option<Spectral>,
    kept: Option<StoredSource<'e>>,
    delta_ratio: f64,
}

/// One scene, ready on a device.
#[derive(Debug)]
pub struct Simulation<'e> {
    engine: &'e Engine,
    scene: Scene,
    /// The detector; its grid stands in the scene that is traced and illuminated.
    detection: DetectorModel,
    sample: Sample,
    on_device: Arc<DeviceSample>,
    /// Surfaces of the sample, for means over facets.
    facets: Option<sampling::SampleFacets>,
    media: MaterialTable,
    lattice: Lattice,
    /// For a spectrum or kept moments, by cells.
    spectral: Option<Spectral>,
    /// For what moments of the rays that bound cells are kept.
    keep: Option<sampling::MomentRecording>,
    /// What changes of a cell do to recorded values.
    response: Response,
    /// What sampling may leave in them.
    budget: ErrorBudget,
    /// Moments that another run kept, in place of rays.
    kept: Option<StoredSource<'e>>,
    memory: MemoryEstimate,
    start: RunStart,
    prepared_in: f64,
}

impl<'e> Simulation<'e> {
    pub(crate) fn new(
        engine: &'e Engine,
        scene: &Scene,
        control: &mut Control<'_>,
    ) -> Result<Self> {
        Self::of_loaded(engine, scene, None, control)
    }

    /// The same with geometry that was loaded and checked before.
    pub(crate) fn of_loaded(
        engine: &'e Engine,
        scene: &Scene,
        sample: Option<Sample>,
        control: &mut Control<'_>,
    ) -> Result<Self> {
        scene.validate()?;
        // From here on every reader of a file compares it with its hash.
        let scene = &scene.with_file_hashes()?;
        let detection = DetectorModel::of(scene)?;
        let lit = detection.lit();
        let media = MaterialTable::of(scene)?;
        let lattice = lattice_of(lit, &media)?;
        let delta_ratio = if engine.options().keep_moments { moments::DELTA_HEADROOM } else { 1.0 };
        let several = media.energies.len() > 1 || engine.options().keep_moments;
        let spectral = if several && scene.sampling.scheme == Scheme::Cells {
            let flagged = delta_ratio * media.strongest();
            Some(Spectral::new(lit, &media, &lattice, &media.mean(), flagged)?)
        } else {
            None
        };
        Self::with(
            engine,
            scene,
            Parts { detection, media, lattice, spectral, kept: None, delta_ratio },
            sample,
            control,
        )
    }

    pub(crate) fn of_kept(
        engine: &'e Engine,
        moments: &'e StoredMoments,
        scene: &Scene,
        control: &mut Control<'_>,
    ) -> Result<Self> {
        scene.validate()?;
        if scene.sampling.scheme != Scheme::Cells {
            return Err(Error::scene("sampling.scheme", "random", "cells, which moments are of"));
        }
        let scene = &scene.with_file_hashes()?;
        let detection = DetectorModel::of(scene)?;
        let lit = detection.lit();
        let own = MaterialTable::of(scene)?;
        let lattice = lattice_of(lit, &own)?;
        let source = moments.for_scene(lit, &lattice)?;
        let media = source.media.clone();
        let flagged = source.flagged;
        let spectral = Spectral::new(lit, &media, &lattice, &source.reference, flagged)?;
        let (kept, delta_ratio) = (Some(source), 1.0);
        Self::with(
            engine,
            scene,
            Parts { detection, media, lattice, spectral: Some(spectral), kept, delta_ratio },
            None,
            control,
        )
    }

    fn with(
        engine: &'e Engine,
        scene: &Scene,
        parts: Parts<'e>,
        loaded: Option<Sample>,
        control: &mut Control<'_>,
    ) -> Result<Self> {
        let begin = Instant::now();
        let options = engine.options();
        let load = parts.kept.as_ref().is_none_or(|kept| kept.retrace);
        let sample = if let Some(sample) = loaded {
            sample
        } else if load {
            memory::check_before_loading(scene, options.memory_limit)?;
            let progress = control.progress.as_deref_mut();
            let sample = run::watching(progress, control.cancel, |watcher| {
                geometry::load_watched(scene, watcher)
            })?;
            if control.cancel.is_some_and(|cancel| cancel.load(Ordering::Relaxed)) {
                return Err(Error::Interrupted);
            }
            for object in &sample.objects {
                object.warnings.iter().for_each(|text| log::warn!("\"{}\": {text}", object.name));
            }
            geometry::check_clearance(scene, &sample)?;
            sample
        } else {
            Sample::default()
        };
        let memory =
            memory::estimate(scene, &sample.objects, options.memory_limit, options.band_rows)?;
        memory::ask_for_run(scene, &memory)?;
        if let Some(fit) = scene.source.spot.fit() {
            let (parts, samples) = (scene.source.spot.parts().len(), fit.samples);
            log::info!("focal spot {}: {parts} Gaussians for {samples} pixels", fit.file);
            scene.source.spot.warnings().iter().for_each(|text| log::warn!("{text}"));
        }
        let device = engine.device();
        let wanted = options.backend;
        let description = device.description();
        if wanted == Some(Backend::RayQuery) && !description.ray_query {
            return Err(Error::device(
                "the backend ray-query",
                format!("{} does not have VK_KHR_ray_query", description.name),
                "use the backend bvh, or a driver with ray query",
            ));
        }
        let keep = parts.spectral.as_ref().map(|_| {
            sampling::MomentRecording::new(&parts.media, &parts.media.mean(), parts.delta_ratio)
        });
        let ray_query = description.ray_query && wanted != Some(Backend::Bvh);
        let Parts { detection, media, lattice, spectral, kept, delta_ratio } = parts;
        let response = Response::new(detection.lit(), &lattice, options.keep_moments);
        let budget = error_budget(scene, detection.lit());
        let across = geometry::across_edges(&sample);
        let on_device =
            DeviceSample::upload(device, scene, &sample, &across, &media, ray_query, delta_ratio)?;
        let facets =
            sampling::SampleFacets::new(detection.lit(), &sample, &media, delta_ratio, across);
        let mut simulation = Self {
            engine,
            scene: scene.clone(),
            detection,
            start: RunStart {
                device: description.name.clone(),
                driver: description.driver.clone(),
                backend: Backend::Bvh,
                backend_reason: String::new(),
                calibration: BTreeMap::new(),
                mesh_hashes: mesh_hashes(scene, &sample),
            },
            sample,
            on_device: Arc::new(on_device),
            facets,
            media,
            lattice,
            spectral,
            response,
            budget,
            keep,
            kept,
            memory,
            prepared_in: 0.0,
        };
        simulation.choose_backend(wanted)?;
        simulation.prepared_in = begin.elapsed().as_secs_f64();
        Ok(simulation)
    }

    /// The scene.
    #[must_use]
    pub const fn scene(&self) -> &Scene {
        &self.scene
    }

    /// Geometry of the sample.
    #[must_use]
    pub const fn sample(&self) -> &Sample {
        &self.sample
    }

    /// Device, backend and why.
    #[must_use]
    pub const fn start(&self) -> &RunStart {
        &self.start
    }

    fn device(&self) -> &'e Arc<Device> {
        self.engine.device()
    }

    fn options(&self) -> &'e EngineOptions {
        self.engine.options()
    }

    fn tracer(&self, backend: Backend) -> Result<Tracer> {
        Tracer::new(
            self.device(),
            self.engine.trace_kernels(),
            &self.on_device,
            backend,
            self.scene.sampling.transport,
            self.options().batch_rays,
            self.memory.rays_at_once as u32,
        )
    }

    /// By what the caller wants, what the device can, and a short calibration on the scene.
    fn choose_backend(&mut self, wanted: Option<Backend>) -> Result<()> {
        let (backend, reason) = if let Some(backend) = wanted {
            (backend, "requested".to_owned())
        } else if !self.on_device.has_acceleration() {
            let reason = if self.sample.triangles.is_empty() {
                "nothing to trace"
            } else {
                "the device has no ray query"
            };
            (Backend::Bvh, reason.to_owned())
        } else {
            let rays = self.calibration_rays();
            for backend in [Backend::Bvh, Backend::RayQuery] {
                let tracer = self.tracer(backend)?;
                let n = rays.len().min(tracer.capacity() as usize);
                tracer.rays().write(0, &rays[..n])?;
                let n = numbers::count(n);
                tracer.trace_on_device(n)?; // the first dispatch pays for compilation
                let time = tracer.trace_on_device(n)?;
                let rate = f64::from(n) / time.as_secs_f64().max(1e-9) / 1e6;
                self.start.calibration.insert(backend.to_string(), rate);
            }
            let rate = |b: Backend| self.start.calibration[&b.to_string()];
            let best = if rate(Backend::RayQuery) > rate(Backend::Bvh) {
                Backend::RayQuery
            } else {
                Backend::Bvh
            };
            (best, "faster in calibration on this scene".to_owned())
        };
        log::info!("backend {backend}: {reason}");
        self.start.backend = backend;
        self.start.backend_reason = reason;
        Ok(())
    }

    /// Rays over the shadow of the sample in the first view, side by side in lines as in a run:
    /// how fast a backend is depends on their order.
    fn calibration_rays(&self) -> Vec<Ray> {
        let shadows = self.shadows(0);
        let span = |f: fn(&ProjectedBounds) -> [f64; 2]| {
            shadows
                .iter()
                .map(f)
                .fold([f64::INFINITY, f64::NEG_INFINITY], |a, b| [a[0].min(b[0]), a[1].max(b[1])])
        };
        let (x, rows) = (span(|s| s.x), span(|s| s.rows));
        let at = |share: f64, range: [f64; 2]| range[0] + (range[1] - range[0]) * share;
        let places: Vec<f64> = (0..=2 * self.lattice.cells)
            .map(|i| self.lattice.period * (f64::from(i) / f64::from(2 * self.lattice.cells) - 0.5))
            .collect();
        let lines = CALIBRATION_RAYS / places.len() / CALIBRATION_PATCHES + 1;
        let mut rays = Vec::with_capacity(CALIBRATION_PATCHES * lines * places.len());
        for patch in 0..CALIBRATION_PATCHES {
            // Spread over width and height by the golden ratio.
            let share = (patch as f64 + 0.5) / CALIBRATION_PATCHES as f64;
            let beamlet = self.lattice.beamlet_at(at(share, x));
            let row = at((share * 1.618 * CALIBRATION_PATCHES as f64).fract(), rows);
            for line in 0..lines {
                let row = row + 0.5 * line as f64;
                rays.extend(places.iter().map(|&x| self.lattice.ray(beamlet, x, row, 0)));
            }
        }
        rays
    }

    fn shadows(&self, view: u32) -> Vec<ProjectedBounds> {
        let angle = self.scene.scan.angles[view as usize];
        sampling::shadows(&self.sample, &self.lattice, &self.scene.view_at(angle))
    }

    /// Traces rays and returns their laws at the scene's energy (for a spectrum at the constants
    /// averaged over it), in the order of the rays.
    ///
    /// # Errors
    /// [`Error::Device`], [`Error::Memory`]; [`Error::Scene`] for a view that is not there.
    pub fn trace(&self, rays: &[Ray]) -> Result<Vec<Law>> {
        self.check_views(rays)?;
        self.tracer(self.start.backend)?.trace(rays)
    }

    /// Traces rays and returns their laws and first-order moments.
    ///
    /// # Errors
    /// As [`Simulation::trace`].
    pub fn moments(&self, rays: &[Ray]) -> Result<(Vec<Law>, Moments)> {
        self.check_views(rays)?;
        let (laws, words) = self.tracer(self.start.backend)?.trace_with_moments(rays)?;
        Ok((laws, Moments::new(words, self.on_device.materials)))
    }

    fn check_views(&self, rays: &[Ray]) -> Result<()> {
        let views = self.scene.scan.angles.len();
        match rays.iter().find(|r| r.view as usize >= views) {
            Some(ray) => {
                let found = ray.view;
                Err(Error::scene(
                    "view",
                    format!("a ray of view {found}"),
                    format!("0 to {}", views - 1),
                ))
            }
            None => Ok(()),
        }
    }

    /// The detector, and the grid that takes its light.
    #[must_use]
    pub const fn detection(&self) -> &DetectorModel {
        &self.detection
    }

    /// Words of a ray's moments.
    fn moment_words(&self) -> usize {
        self.media.names.len() * crate::interface::MOMENTS_PER_MATERIAL
    }

    fn view<'a>(&'a self, index: u32, shadows: &'a [ProjectedBounds]) -> sampling::ViewContext<'a> {
        sampling::ViewContext {
            scene: self.detection.lit(),
            sample: &self.sample,
            facets: self.facets.as_ref(),
            lattice: &self.lattice,
            index,
            shadows,
            keep: self.keep.as_ref(),
            response: &self.response,
            budget: self.budget,
        }
    }

    /// Rows of a band within the memory limit.
    #[must_use]
    pub const fn band_rows(&self) -> u32 {
        self.memory.band_rows
    }

    /// What a run takes of memory at its peak.
    #[must_use]
    pub const fn memory(&self) -> &MemoryEstimate {
        &self.memory
    }

    /// Runs every view that `control` does not skip and hands it to the sink.
    ///
    /// # Errors
    /// See [`Error`]; [`Error::Interrupted`] when `control.cancel` was set.
    pub fn run(&self, sink: &mut dyn Sink, mut control: Control<'_>) -> Result<RunRecord> {
        if self.kept.is_some() && control.keep.is_some() {
            let found = "moments to be kept of a scene that is itself made from kept moments";
            return Err(Error::scene("moments", found, "a simulation that traces"));
        }
        let begin = Instant::now();
        let views: Vec<Exposure> =
            stack::views(&self.scene)?.filter(|v| !control.skip.contains(v)).collect();
        let mut work = Work::new(self, &views)?;
        // Last of all, so that a run that cannot start writes nothing.
        sink.begin(&self.scene, &self.start)?;
        let (mut before, mut counted) = (Tally::default(), control.counted);
        for view in views {
            work.view(view, sink, &mut control)?;
            let tally = work.tally()?;
            let own = tally.since(before);
            sink.tally(view, &own)?;
            (before, counted) = (tally, counted + own);
            if let (Exposure::Sample(index), Some(keep)) = (view, control.keep.as_mut()) {
                keep.commit(index, self.moment_words())?;
            }
            sink.commit(view)?;
        }
        let defective =
            self.sample.objects.iter().filter(|object| object.defects.refused()).count();
        let tally = Tally { defective_objects: defective as u64, ..counted };
        let record = RunRecord {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            device: self.start.device.clone(),
            driver: self.start.driver.clone(),
            backend: self.start.backend,
            backend_reason: self.start.backend_reason.clone(),
            calibration: self.start.calibration.clone(),
            seed: self.scene.sampling.seed,
            tally,
            sampling: SamplingSummary::of(&tally, self.budget.light),
            seconds: [
                ("prepare", self.prepared_in),
                ("trace", work.seconds.trace),
                ("illuminate", work.seconds.illuminate),
                ("detect", work.seconds.detect),
                ("noise", work.seconds.noise),
                ("write", work.seconds.write),
                ("total", self.prepared_in + begin.elapsed().as_secs_f64()),
            ]
            .map(|(stage, seconds)| (stage.to_owned(), seconds))
            .into(),
        };
        if tally.unbalanced as f64 > UNBALANCED_SHARE * tally.rays as f64 {
            let problem = format!(
                "{} of {} rays entered and left an object unequally often",
                tally.unbalanced, tally.rays
            );
            // Through a hole that is what rays do.
            if defective == 0 {
                return Err(Error::Tally(problem));
            }
            log::warn!("{problem}: {defective} objects have defects");
        }
        sink.finish(&record)?;
        Ok(record)
    }
}

/// The lattice of a scene with its blocks of rows.
fn lattice_of(scene: &Scene, media: &MaterialTable) -> Result<Lattice> {
    let mut lattice = Lattice::of(scene, media.strongest());
    lattice.alike_rows = illuminate::alike_rows(scene, media)?;
    Ok(lattice)
}

/// SHA-256 of the meshes by object: as loaded, or as the scene records them.
fn mesh_hashes(scene: &Scene, sample: &Sample) -> BTreeMap<String, String> {
    if sample.objects.is_empty() {
        let recorded = |o: &crate::scene::Object| Some((o.name.clone(), o.sha256.clone()?));
        return scene.objects.iter().filter_map(recorded).collect();
    }
    let loaded = sample.objects.iter().filter(|o| !o.hash.is_empty());
    loaded.map(|o| (o.name.clone(), o.hash.clone())).collect()
}

/// Kernels that every simulation of an engine shares.
#[derive(Debug)]
pub(crate) struct Kernels {
    pub(crate) trace: Arc<TraceKernels>,
    pub(crate) illuminate: Arc<illuminate::CellKernels>,
}

/// What sampling may leave in a value of the grid that is traced, `lit`, so that pixels of the
/// detector hold the tolerance.
fn error_budget(scene: &Scene, lit: &Scene) -> ErrorBudget {
    let sampling = &scene.sampling;
    let pixel = |scene: &Scene| scene.detector.pitch[0] * scene.detector.pitch[1];
    let parts = pixel(scene) / pixel(lit);
    let angles = scene.sample_mask.is_some();
    ErrorBudget {
        light: sampling.tolerance * parts.sqrt(),
        displacement: if angles {
            sampling.angle_tolerance * scene.lever_arm()
        } else {
            f64::INFINITY
        },
        max_rays: sampling.max_rays,
    }
}
