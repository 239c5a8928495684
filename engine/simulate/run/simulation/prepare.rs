//! A scene made ready on a device.

use super::light::{LightKind, Spectrum};
use super::{Simulation, backend};
use crate::accel::Bvh;
use crate::detector::DetectorModel;
use crate::illuminate::{self, EnergyBinning};
use crate::run::memory::MemoryEstimate;
use crate::run::simulator::Simulator;
use crate::run::{self, Control, memory, quality};
use crate::sampling::{self, ErrorBudget, Hardening, Lattice, Response};
use crate::trace::DeviceSample;
use crate::wave::{self, WavePlans};
use beamlet_core::Result;
use beamlet_core::parallel::start_threads;
use beamlet_files::RunStart;
use beamlet_geometry as geometry;
use beamlet_geometry::{LoadStep, Sample};
use beamlet_gpu::{Backend, Device};
use beamlet_model::media::MaterialTable;
use beamlet_model::optics::{self, Optics};
use beamlet_model::scene::{Scene, Scheme, Transport};
use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Instant;

/// Parts of a simulation besides its geometry.
pub(super) struct SimulationParts {
    scene: Arc<Scene>,
    pub(super) detector: DetectorModel,
    pub(super) media: MaterialTable,
    pub(super) lattice: Lattice,
}

impl SimulationParts {
    /// # Errors
    /// The scene or its files.
    pub(super) fn of(scene: &Scene) -> Result<Self> {
        scene.validate()?;
        Self::of_resolved(quality::resolved(scene)?)
    }

    /// Parts of a scene with a number for each tolerance.
    fn of_resolved(scene: Scene) -> Result<Self> {
        let scene = Arc::new(scene);
        let detector = DetectorModel::of(&scene)?;
        let media = MaterialTable::of(&scene)?;
        let lattice = lattice_of(&scene, detector.optics(), &media)?;
        Ok(Self { scene, detector, media, lattice })
    }

    /// Energies of cells that are gathered.
    fn energies(&self) -> Result<Option<EnergyBinning>> {
        let Self { scene, detector, media, lattice } = self;
        let is_gathered = media.energies.len() > 1
            && scene.sampling.scheme == Scheme::Cells
            && scene.sampling.transport != Transport::Wave;
        let energies = || EnergyBinning::new(scene, detector.optics(), media, lattice);
        is_gathered.then(energies).transpose()
    }

    fn leaks(&self) -> Result<[f64; 2]> {
        let Self { scene, detector, media, .. } = self;
        optics::mean_leaks(scene, detector.optics(), (&media.energies, &media.weights))
    }

    /// Effect of changes of a cell on recorded values.
    fn response(&self, leaks: [f64; 2]) -> Arc<Response> {
        let optics = self.detector.optics();
        let hardening = Hardening::of(&self.media);
        Arc::new(Response::new(optics, &self.lattice, (leaks, &hardening), 0))
    }
}

impl Simulation {
    /// Prepares a scene: reads its sample, uploads it and plans its rays.
    ///
    /// # Errors
    ///
    /// The scene, its files, the device or memory.
    #[doc(hidden)]
    pub fn new(simulator: &Simulator, scene: &Scene, control: &mut Control<'_>) -> Result<Self> {
        Self::of_loaded(simulator, scene, None, control)
    }

    /// The same with geometry that was loaded and checked before.
    ///
    /// # Errors
    ///
    /// The scene, its files, the device or memory.
    #[doc(hidden)]
    pub fn of_loaded(
        simulator: &Simulator,
        scene: &Scene,
        sample: Option<Sample>,
        control: &mut Control<'_>,
    ) -> Result<Self> {
        start_threads()?;
        scene.validate()?;
        // From here on every reader of a file compares it with its hash.
        let resolved = quality::resolved(scene)?.with_file_hashes()?;
        let parts = SimulationParts::of_resolved(resolved)?;
        wave::refuse(&parts.scene, parts.detector.optics())?;
        Self::with(simulator, parts, sample, control)
    }

    /// The simulation of another scene with the sample of this one, whose light is that of cells. `memory`: of all
    /// that run together.
    ///
    /// # Errors
    /// The scene.
    pub(super) fn with_parts(
        &self,
        parts: SimulationParts,
        memory: MemoryEstimate,
    ) -> Result<Self> {
        geometry::check_clearance(&parts.scene, &self.sample)?;
        let energies = parts.energies()?;
        let leaks = parts.leaks()?;
        let response = parts.response(leaks);
        let SimulationParts { scene, detector, media, lattice } = parts;
        // An audit compares the light of one design.
        let budget = ErrorBudget { audit: 0.0, ..error_budget(&scene, detector.optics()) };
        Ok(Self {
            simulator: self.simulator.clone(),
            sample: self.sample.clone(),
            on_device: self.on_device.clone(),
            facets: self.facets.clone(),
            light: LightKind::Cells(energies.map(|it| spectrum(it, &media, &self.sample))),
            budget,
            scene,
            detector,
            media,
            lattice,
            response,
            leaks,
            memory,
            start: self.start.clone(),
            prepared_in: 0.0,
        })
    }

    fn with(
        simulator: &Simulator,
        parts: SimulationParts,
        loaded: Option<Sample>,
        control: &mut Control<'_>,
    ) -> Result<Self> {
        let begin = Instant::now();
        let options = simulator.options();
        let energies = parts.energies()?;
        let scene = parts.scene.clone();
        let sample = match loaded {
            Some(sample) => sample,
            None => load(&scene, options.memory_limit, control)?,
        };
        let memory =
            memory::estimate(&scene, &sample.objects, options.memory_limit, options.band_rows)?;
        memory::ask_for_run(&scene, &memory)?;
        log_spot(&scene);
        scene.middle_line_warning().iter().for_each(|text| log::warn!("{text}"));
        let device = simulator.device();
        let wanted = options.backend;
        let description = device.description();
        backend::check(wanted, description)?;
        let ray_query = backend::may_query(wanted, description);
        let leaks = parts.leaks()?;
        let response = parts.response(leaks);
        let SimulationParts { detector, media, lattice, .. } = parts;
        let optics = detector.optics();
        let is_random = scene.sampling.scheme == Scheme::Random;
        let light = match scene.sampling.transport {
            Transport::Wave => {
                LightKind::Waves(WavePlans::new(device, &scene, optics, &lattice, &media)?)
            }
            Transport::Auto | Transport::FirstOrder | Transport::Exact if is_random => {
                LightKind::Random
            }
            Transport::Auto | Transport::FirstOrder | Transport::Exact => {
                LightKind::Cells(energies.map(|energies| spectrum(energies, &media, &sample)))
            }
        };
        let facet_kinks = wave::facet_kinks(&scene, &sample)?;
        facet_kinks.iter().for_each(|kink| log::warn!("waves: {kink}"));
        let budget = error_budget(&scene, detector.optics());
        let (to, of) = (device.clone(), scene.clone());
        let Built { sample, media, facets, on_device } = control
            .step(LoadStep::Building, move || build(&to, &of, sample, media, ray_query))??;
        let mut simulation = Self {
            simulator: simulator.clone(),
            detector,
            start: RunStart {
                mesh_hashes: mesh_hashes(&scene, &sample),
                facet_kinks,
                ..RunStart::new(&description.name, &description.driver, Backend::Bvh, "")
            },
            scene,
            sample: Arc::new(sample),
            on_device: Arc::new(on_device),
            facets: Arc::new(facets),
            media,
            lattice,
            light,
            response,
            leaks,
            budget,
            memory,
            prepared_in: 0.0,
        };
        control.cancel.check()?;
        simulation.choose_backend(wanted)?;
        simulation.prepared_in = begin.elapsed().as_secs_f64();
        Ok(simulation)
    }
}

/// Energies of cells with the moments of rays.
fn spectrum(energies: EnergyBinning, media: &MaterialTable, sample: &Sample) -> Box<Spectrum> {
    let recording = sampling::MomentRecording::new(media, &sample.components);
    Box::new(Spectrum { energies, recording })
}

/// The sample.
fn load(
    scene: &Arc<Scene>,
    memory_limit: Option<u64>,
    control: &mut Control<'_>,
) -> Result<Sample> {
    memory::check_before_loading(scene, memory_limit)?;
    let progress = control.progress.as_deref_mut();
    let sample =
        run::watching(progress, &control.cancel, |watcher| geometry::load_watched(scene, watcher))?;
    control.cancel.check()?;
    for object in &sample.objects {
        object.warnings.iter().for_each(|text| log::warn!("\"{}\": {text}", object.name));
    }
    let scene = scene.clone();
    let sample = control.step(LoadStep::Clearance, move || {
        geometry::check_clearance(&scene, &sample).map(|()| sample)
    })??;
    control.cancel.check()?;
    Ok(sample)
}

/// A sample on the device, with its data on the host.
struct Built {
    sample: Sample,
    media: MaterialTable,
    facets: sampling::SampleFacets,
    on_device: DeviceSample,
}

fn build(
    device: &Arc<Device>,
    scene: &Scene,
    sample: Sample,
    media: MaterialTable,
    ray_query: bool,
) -> Result<Built> {
    let across = geometry::across_edges(&sample);
    let bvh = Bvh::build(&sample, &across, scene.displacement())?;
    let facets =
        sampling::SampleFacets::new(scene.sampling.transport, &sample, &media, &bvh, across);
    let on_device = DeviceSample::with_bvh(device, scene, &sample, bvh, &media, ray_query)?;
    Ok(Built { sample, media, facets, on_device })
}

/// Logs what stands for a focal spot that is not one Gaussian.
fn log_spot(scene: &Scene) {
    let spot = &scene.source.spot;
    let Some(fit) = spot.fit() else { return };
    let (parts, samples) = (spot.parts().len(), fit.samples);
    log::info!("focal spot {}: {parts} Gaussians for {samples} pixels", fit.file);
    spot.warnings().iter().for_each(|text| log::warn!("{text}"));
}

/// The lattice of a run with its blocks of rows.
fn lattice_of(scene: &Scene, optics: &Optics, media: &MaterialTable) -> Result<Lattice> {
    let mut lattice = Lattice::of(optics, media.strongest());
    lattice.alike_rows = illuminate::alike_rows(scene, optics, media)?;
    Ok(lattice)
}

/// SHA-256 of the meshes by object: as loaded, or as the scene records them.
fn mesh_hashes(scene: &Scene, sample: &Sample) -> BTreeMap<String, String> {
    if sample.objects.is_empty() {
        let recorded = |o: &beamlet_model::scene::Object| Some((o.name.clone(), o.sha256.clone()?));
        return scene.objects.iter().filter_map(recorded).collect();
    }
    let loaded = sample.objects.iter().filter(|o| !o.hash.is_empty());
    loaded.map(|o| (o.name.clone(), o.hash.clone())).collect()
}

/// Part of the tolerance that a pixel of a detector that blurs gets: it takes the errors of those beside it
/// as well. With all of it a ball holds 1e-4 but for its root mean square (0.34), with half 0.2
/// (docs/developers/validation.md).
const BLURRED: f64 = 0.5;

/// Error that sampling may leave in a value of the grid that takes the light, so that pixels of the
/// detector hold the tolerance.
fn error_budget(scene: &Scene, optics: &Optics) -> ErrorBudget {
    let tolerances = scene.sampling.tolerances();
    let [columns, rows] =
        [0, 1].map(|axis| scene.detector.pitch[axis] / optics.detector.pitch[axis]);
    let angles = scene.sample_mask.is_some();
    // Rays judge the light of a beamlet of a sample mask by whole pixels, in the unit of one of their parts. Without a sample
    // mask each part has lines of its own, but lines at the same heights err alike; rows err separately.
    let by_grid = rows.sqrt() * if angles { columns } else { 1.0 };
    let blurred = if by_grid > 1.0 { BLURRED } else { 1.0 };
    ErrorBudget {
        light: blurred * tolerances.light * by_grid,
        by_grid,
        tolerance: tolerances.light,
        displacement: if angles { tolerances.angle * scene.lever_arm() } else { f64::INFINITY },
        max_rays: scene.sampling.max_rays,
        audit: scene.sampling.audit,
    }
}
