//! A simulation: one scene made ready on a device, traced view by view and illuminated.

#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    clippy::cast_possible_wrap,
    reason = "counts and indices are bounded by the scene's validation; rounding to f32 is meant"
)]

use crate::engine::{Engine, EngineOptions};
use crate::geometry::{self, Sample};
use crate::gpu::Device;
use crate::gpu::interface::Pixel;
use crate::illuminate::{Cast, CellIlluminator, LightRecord, RandomKernels, Sums, cast};
use crate::memory::{self, MemoryEstimate};
use crate::run::{Backend, Control, Progress, RunRecord, Tally};
use crate::scene::{Scene, Scheme};
use crate::stack::{self, RunStart, Sink};
use crate::trace::{
    self, DeviceSample, Lattice, Law, Media, Moments, Ray, Shadow, Strips, TraceKernels, Tracer,
};
use crate::{Error, Result};
use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Instant;

/// Rays of a calibration.
const CALIBRATION_RAYS: usize = 1 << 13;
/// A run fails when more than this share of its rays stays unbalanced.
const UNBALANCED_SHARE: f64 = 1e-5;

/// One scene, ready on a device.
#[derive(Debug)]
pub struct Simulation<'e> {
    engine: &'e Engine,
    scene: Scene,
    sample: Sample,
    on_device: Arc<DeviceSample>,
    lattice: Lattice,
    memory: MemoryEstimate,
    start: RunStart,
    prepared_in: f64,
}

impl<'e> Simulation<'e> {
    pub(crate) fn new(engine: &'e Engine, scene: &Scene) -> Result<Self> {
        let begin = Instant::now();
        scene.validate()?;
        memory::check_before_loading(scene, engine.options().memory_limit)?;
        let sample = geometry::load(scene)?;
        for object in &sample.objects {
            object.warnings.iter().for_each(|text| log::warn!("\"{}\": {text}", object.name));
        }
        geometry::check_clearance(scene, &sample)?;
        let options = engine.options();
        let memory =
            memory::estimate(scene, &sample.objects, options.memory_limit, options.band_rows)?;
        let media = Media::of(scene)?;
        let device = engine.device();
        let wanted = engine.options().backend;
        let description = device.description();
        if wanted == Some(Backend::RayQuery) && !description.ray_query {
            return Err(Error::device(
                "the backend ray-query",
                format!("{} does not have VK_KHR_ray_query", description.name),
                "use the backend bvh, or a driver with ray query",
            ));
        }
        let ray_query = description.ray_query && wanted != Some(Backend::Bvh);
        let on_device = Arc::new(DeviceSample::upload(device, scene, &sample, &media, ray_query)?);
        let strongest = media.constants.iter().fold(0.0_f64, |m, c| m.max(c.delta.abs()));
        let lattice = Lattice::of(scene, strongest);
        let mut simulation = Self {
            engine,
            scene: scene.clone(),
            start: RunStart {
                device: description.name.clone(),
                driver: description.driver.clone(),
                backend: Backend::Bvh,
                backend_reason: String::new(),
                calibration: BTreeMap::new(),
                mesh_hashes: sample
                    .objects
                    .iter()
                    .filter(|o| !o.hash.is_empty())
                    .map(|o| (o.name.clone(), o.hash.clone()))
                    .collect(),
            },
            sample,
            on_device,
            lattice,
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
            (backend, "asked for".to_owned())
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
                let n = u32::try_from(n).unwrap_or(u32::MAX);
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

    /// Rays spread over the shadow of the sample in the first view.
    fn calibration_rays(&self) -> Vec<Ray> {
        let shadows = self.shadows(0);
        let span = |f: fn(&Shadow) -> [f64; 2]| {
            shadows
                .iter()
                .map(f)
                .fold([f64::INFINITY, f64::NEG_INFINITY], |a, b| [a[0].min(b[0]), a[1].max(b[1])])
        };
        let (x, rows) = (span(|s| s.x), span(|s| s.rows));
        let middle = self.lattice.beamlets.start;
        let side = (CALIBRATION_RAYS as f64).sqrt() as usize;
        (0..side * side)
            .map(|i| {
                let at = |j: usize, range: [f64; 2]| {
                    range[0] + (range[1] - range[0]) * (j as f64 + 0.5) / side as f64
                };
                let centre = self.lattice.centre(middle);
                self.lattice.ray(middle, at(i % side, x) - centre, at(i / side, rows), 0)
            })
            .collect()
    }

    fn shadows(&self, view: u32) -> Vec<Shadow> {
        let angle = self.scene.scan.angles[view as usize];
        trace::shadows(&self.sample, &self.lattice, &self.scene.view_at(angle))
    }

    /// Traces rays and returns their laws at the scene's energy, in the order of the rays.
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

    /// Traces and refines the strips of cells of some detector rows of a view (`cells` scheme).
    ///
    /// # Errors
    /// As [`Simulation::trace`].
    pub fn strips(&self, view: u32, rows: Range<i64>) -> Result<Strips> {
        let shadows = self.shadows(view);
        let mut tracer = self.tracer(self.start.backend)?;
        let view = self.view(view, &shadows);
        let mut strips = Strips::default();
        let at_once = self.memory.rays_at_once as usize;
        trace::trace_strips(&view, &mut tracer, rows.clone(), &rows, at_once, &mut |part| {
            strips.append(part);
            Ok(())
        })?;
        Ok(strips)
    }

    fn view<'a>(&'a self, index: u32, shadows: &'a [Shadow]) -> trace::View<'a> {
        trace::View { scene: &self.scene, lattice: &self.lattice, index, shadows }
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
        let begin = Instant::now();
        let views: Vec<stack::View> = std::iter::once(stack::View::Flat)
            .chain((0..self.scene.scan.angles.len()).map(|i| stack::View::Sample(i as u32)))
            .filter(|v| !control.skip.contains(v))
            .collect();
        let mut work = Work::new(self, views.len())?;
        // Last of all, so that a run that cannot start writes nothing.
        sink.begin(&self.scene, &self.start)?;
        for view in views {
            work.view(view, sink, &mut control)?;
            sink.commit(view)?;
        }
        let defective =
            self.sample.objects.iter().filter(|object| object.defects.refused()).count();
        let tally = Tally { defective_objects: defective as u64, ..work.tally()? };
        let record = RunRecord {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            device: self.start.device.clone(),
            driver: self.start.driver.clone(),
            backend: self.start.backend,
            backend_reason: self.start.backend_reason.clone(),
            calibration: self.start.calibration.clone(),
            seed: self.scene.sampling.seed,
            tally,
            seconds: [
                ("prepare".to_owned(), self.prepared_in),
                ("trace".to_owned(), work.seconds.trace),
                ("illuminate".to_owned(), work.seconds.illuminate),
                ("write".to_owned(), work.seconds.write),
                ("total".to_owned(), self.prepared_in + begin.elapsed().as_secs_f64()),
            ]
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

#[derive(Debug, Default)]
struct Seconds {
    trace: f64,
    illuminate: f64,
    write: f64,
}

/// The run in progress.
struct Work<'s> {
    simulation: &'s Simulation<'s>,
    device: Arc<Device>,
    tracer: Tracer,
    light: LightRecord,
    sums: Sums,
    cells: CellIlluminator,
    random: Option<RandomKernels>,
    band: u32,
    /// Rows beyond a band that blur it without a sample.
    blur_rows: i64,
    pixel_columns: Range<i64>,
    tally: Tally,
    seconds: Seconds,
    rows_done: u64,
    rows_total: u64,
}

impl<'s> Work<'s> {
    fn new(simulation: &'s Simulation<'_>, views: usize) -> Result<Self> {
        let scene = &simulation.scene;
        let device = simulation.device().clone();
        let band = simulation.band_rows();
        let [columns, rows] = scene.detector.pixels;
        let steps = scene.scan.mask_offsets.len();
        let random = scene.sampling.scheme == Scheme::Random;
        let side = simulation.lattice.halo_columns;
        let pixel_columns = -side..i64::from(columns) + side;
        let offsets = &scene.scan.mask_offsets;
        let light = if random {
            LightRecord::of_pixels(&device, scene, &pixel_columns)?
        } else {
            LightRecord::of_cells(&device, scene, &simulation.lattice, offsets)?
        };
        let blur = 6.0
            * trace::deviation(scene.source.spot[1])
            * (scene.detector.distance - scene.source.distance)
            / scene.source.distance
            / scene.detector.pitch[1];
        Ok(Self {
            tracer: simulation.tracer(simulation.start.backend)?,
            light,
            sums: Sums::new(&device, steps, band as usize, columns as usize)?,
            cells: CellIlluminator::new(&device, simulation.engine.illuminate_kernel()),
            random: if random { Some(RandomKernels::new(&device)?) } else { None },
            band,
            blur_rows: blur.ceil() as i64,
            pixel_columns,
            tally: Tally::default(),
            seconds: Seconds::default(),
            rows_done: 0,
            rows_total: views as u64 * u64::from(rows),
            device,
            simulation,
        })
    }

    fn view(
        &mut self,
        view: stack::View,
        sink: &mut dyn Sink,
        control: &mut Control<'_>,
    ) -> Result<()> {
        let rows = self.simulation.scene.detector.pixels[1];
        let shadows = match view {
            stack::View::Sample(i) if !self.simulation.sample.triangles.is_empty() => {
                self.simulation.shadows(i)
            }
            _ => Vec::new(),
        };
        let mut first = 0;
        while first < rows {
            let band = first..rows.min(first + self.band);
            self.sums.clear(&band)?;
            self.light.set_band(&band)?;
            self.band(view, &shadows, &band, control)?;
            let begin = Instant::now();
            let intensities = self.sums.intensities()?;
            sink.write(view, band.clone(), intensities.view())?;
            self.seconds.write += begin.elapsed().as_secs_f64();
            first = band.end;
        }
        Ok(())
    }

    /// Sums the light of one band, in groups of rows small enough to stop between them.
    fn band(
        &mut self,
        view: stack::View,
        shadows: &[Shadow],
        band: &Range<u32>,
        control: &mut Control<'_>,
    ) -> Result<()> {
        let inner = i64::from(band.start)..i64::from(band.end);
        let halo = self.simulation.lattice.halo.max(self.blur_rows);
        let group = self.group_rows();
        let mut row = inner.start - halo;
        while row < inner.end + halo {
            // Groups end at the borders of the band, so that its own counts can be told apart.
            let border = [inner.start, inner.end, inner.end + halo]
                .into_iter()
                .find(|b| *b > row)
                .unwrap_or(inner.end + halo);
            let rows = row..border.min(row + group);
            row = rows.end;
            let own = inner.contains(&rows.start);
            if self.simulation.scene.sampling.scheme == Scheme::Random {
                self.random_rows(view, shadows, &rows)?;
            } else {
                self.cell_rows(view, shadows, &rows, &inner, own)?;
            }
            if own {
                self.rows_done += (rows.end - rows.start) as u64;
            }
            self.report(view, control)?;
        }
        Ok(())
    }

    fn group_rows(&self) -> i64 {
        let scene = &self.simulation.scene;
        let lattice = &self.simulation.lattice;
        let per_row = if scene.sampling.scheme == Scheme::Random {
            let [x, z] = scene.sampling.rays.map(u64::from);
            u64::from(scene.detector.pixels[0]) * x * z
        } else {
            let beamlets = (lattice.beamlets.end - lattice.beamlets.start) as u64;
            beamlets * (2 * u64::from(lattice.cells) + 1) * 2 * u64::from(scene.sampling.rows)
        };
        (self.simulation.memory.rays_at_once / per_row.max(1)).max(1) as i64
    }

    fn report(&mut self, view: stack::View, control: &mut Control<'_>) -> Result<()> {
        if control.cancel.is_some_and(|c| c.load(Ordering::Relaxed)) {
            return Err(Error::Interrupted);
        }
        if let Some(progress) = control.progress.as_mut() {
            progress(Progress {
                rows_done: self.rows_done,
                rows_total: self.rows_total,
                view,
                rays: self.tracer.rays_traced(),
            });
        }
        Ok(())
    }

    fn cell_rows(
        &mut self,
        view: stack::View,
        shadows: &[Shadow],
        rows: &Range<i64>,
        inner: &Range<i64>,
        own: bool,
    ) -> Result<()> {
        let begin = Instant::now();
        let lit = inner.start - self.blur_rows..inner.end + self.blur_rows;
        let steps = self.simulation.scene.scan.mask_offsets.len() as u32;
        let Self { cells, light, sums, tally, tracer, .. } = self;
        let mut illuminating = 0.0;
        let mut add = |strips: &Strips| {
            if own {
                tally.split += strips.splits;
                tally.landed_off += strips.landed_off;
            }
            let begin = Instant::now();
            cells.add(light, strips, sums, steps)?;
            illuminating += begin.elapsed().as_secs_f64();
            Ok(())
        };
        match view {
            stack::View::Sample(index) if !shadows.is_empty() => {
                let view = self.simulation.view(index, shadows);
                let at_once = self.simulation.memory.rays_at_once as usize;
                trace::trace_strips(&view, tracer, rows.clone(), &lit, at_once, &mut add)?;
            }
            _ => {
                let rows = rows.start.max(lit.start)..rows.end.min(lit.end);
                add(&trace::empty_strips(&self.simulation.lattice, rows))?;
            }
        }
        self.seconds.trace += begin.elapsed().as_secs_f64() - illuminating;
        self.seconds.illuminate += illuminating;
        Ok(())
    }

    fn random_rows(
        &mut self,
        view: stack::View,
        shadows: &[Shadow],
        rows: &Range<i64>,
    ) -> Result<()> {
        let Some(kernels) = &self.random else { return Ok(()) };
        let begin = Instant::now();
        let scene = &self.simulation.scene;
        let detector_rows = 0..i64::from(scene.detector.pixels[1]);
        let detector_columns = 0..i64::from(scene.detector.pixels[0]);
        let (mut met, mut missed) = (Vec::new(), Vec::new());
        for row in rows.clone() {
            for column in self.pixel_columns.clone() {
                let inside = detector_rows.contains(&row) && detector_columns.contains(&column);
                let pixel = Pixel {
                    column: column as i32,
                    row: row as i32,
                    table: (column - self.pixel_columns.start) as u32,
                };
                if self.simulation.lattice.pixel_meets(shadows, column, row) {
                    met.push(pixel);
                } else if inside {
                    missed.push(pixel);
                }
            }
        }
        let view = match view {
            stack::View::Flat => 0,
            stack::View::Sample(i) => i,
        };
        for (pixels, empty) in [(&met, false), (&missed, true)] {
            if !pixels.is_empty() {
                let job = Cast { pixels, view, empty };
                cast(&self.device, kernels, scene, &mut self.tracer, &self.light, &self.sums, job)?;
            }
        }
        self.seconds.trace += begin.elapsed().as_secs_f64();
        Ok(())
    }

    fn tally(&self) -> Result<Tally> {
        let traced = self.tracer.tally()?;
        Ok(Tally { split: self.tally.split, landed_off: self.tally.landed_off, ..traced })
    }
}

/// Kernels that every simulation of an engine shares.
#[derive(Debug)]
pub(crate) struct Kernels {
    pub(crate) trace: Arc<TraceKernels>,
    pub(crate) illuminate: Arc<crate::gpu::Kernel>,
}
