//! Light of lines by waves, and of their parts near grazing by cells.

use super::cells::CellLight;
use super::{Light, LitRows, Pose, Report, Seconds};
use crate::lines::SampleImage;
use crate::run::RunEstimate;
use crate::run::simulation::Simulation;
use crate::trace::Tracer;
use crate::wave::{CellPlaces, WaveBand, WavePlans, WaveView};
use beamlet_core::cancel::Cancel;
use beamlet_core::random::GOLDEN;
use beamlet_core::tally::Tally;
use beamlet_core::{Result, numbers};
use beamlet_gpu::LazyKernel;
use beamlet_model::scene::Exposure;
use ndarray::Array3;
use std::ops::Range;
use std::time::Instant;

/// Rows of a view that are timed for an estimate.
const TIMED_ROWS: i64 = 2;
/// Places that are timed, spread over views and rows.
const LOOKS: u32 = 4;

/// Light by waves.
pub(super) struct Waves<'s> {
    simulation: &'s Simulation,
    plans: &'s WavePlans,
    tracer: Tracer,
    band: WaveBand,
    /// Light of cells near grazing, and their number in the band.
    grazing: CellLight<'s>,
    grazing_cells: usize,
    /// Index of the list of mask offsets in work.
    list: usize,
    /// Seconds of [`Light::add`].
    seconds: f64,
}

impl<'s> Waves<'s> {
    pub(super) fn new(
        simulation: &'s Simulation,
        plans: &'s WavePlans,
        cancel: &Cancel,
    ) -> Result<Self> {
        let kernels = simulation.simulator.wave_kernels();
        let tracer = simulation.tracer(cancel)?;
        let [field, line] = kernels.all();
        let traced = [tracer.wanted_kernels(), CellLight::kernels(simulation)].concat();
        let traced = if simulation.sample.is_empty() { &[][..] } else { &traced[..] };
        LazyKernel::make_all(&[traced, &[field, line]].concat(), cancel)?;
        let columns = simulation.detector.optics().detector.pixels[0];
        Ok(Self {
            simulation,
            plans,
            tracer,
            band: WaveBand::new(simulation.device(), plans, kernels, columns)?,
            grazing: CellLight::new(std::slice::from_ref(simulation), cancel)?,
            grazing_cells: 0,
            list: 0,
            seconds: 0.0,
        })
    }

    /// Image of the sample: what counts of a beamlet is what its openings hold, and fringes beside them.
    fn image(&self, pose: &Pose) -> SampleImage<'s> {
        let (simulation, lattice) = (self.simulation, &self.plans.lattice);
        let response = simulation.response(pose.view);
        let has_mask = simulation.detector.optics().sample_mask.is_some();
        let openings = |beamlet| match has_mask && simulation.lattice.beamlets.contains(&beamlet) {
            true => response.openings(simulation.lattice.column(beamlet)),
            false => Vec::new(),
        };
        let motion = simulation.scene.pose(pose.index as usize, simulation.scene.detector.pitch[0]);
        let tolerance = simulation.budget.tolerance;
        SampleImage::new(&simulation.sample, &simulation.facets, motion, lattice, tolerance)
            .with_borders(openings, self.plans.fringe)
    }

    fn add_rows(&mut self, pose: &Pose, rows: &Range<i64>) -> Result<Tally> {
        let simulation = self.simulation;
        let image = self.image(pose);
        let view = WaveView {
            image: &image,
            shadows: &pose.shadows,
            pose: pose.index,
            list: self.list,
            tolerance: simulation.budget.light,
            max_rays: simulation.budget.max_rays,
            cells: CellPlaces {
                lattice: &simulation.lattice,
                optics: simulation.detector.optics(),
                weights: &simulation.media.weights,
            },
        };
        let (tally, cells) = self.band.add_rows(&mut self.tracer, &view, rows)?;
        let count: usize = cells.iter().map(|list| list.cells.len()).sum();
        if count > 0 {
            self.grazing_cells += count;
            self.grazing.add_lists(&cells)?;
        }
        Ok(tally)
    }
}

impl Light for Waves<'_> {
    fn begin(&mut self, rows: &Range<u32>, view: Exposure) -> Result<()> {
        self.list = self.simulation.detector.optics().offsets.list_of(view);
        self.grazing_cells = 0;
        self.band.begin(rows, self.list)?;
        self.grazing.begin(rows, &[self.list])
    }

    fn items_of_row(&self, pose: &Pose) -> u64 {
        self.simulation.cells_of_row(pose)
    }

    fn add(&mut self, pose: &Pose, rows: &LitRows, _: Report<'_>) -> Result<Tally> {
        if pose.shadows.is_empty() {
            // The band began with its light.
            return Ok(Tally::default());
        }
        let begin = Instant::now();
        let direct = rows.direct(&self.simulation.lattice);
        let lit = rows.rows.start.max(direct.start)..rows.rows.end.min(direct.end);
        let tally = self.add_rows(pose, &lit)?;
        self.seconds += begin.elapsed().as_secs_f64();
        Ok(tally)
    }

    fn intensities(&self) -> Result<Vec<Array3<f32>>> {
        let mut light = self.band.intensities()?;
        if self.grazing_cells > 0 {
            self.grazing.intensities()?.iter().for_each(|of_cells| light += of_cells);
        }
        Ok(vec![light])
    }

    fn tally(&self) -> Tally {
        self.tracer.tally()
    }

    fn seconds(&self) -> Seconds {
        let illuminate = self.grazing.illumination;
        Seconds { trace: self.seconds - illuminate, illuminate, ..Seconds::default() }
    }

    /// Rays and time as a few rows of views take them.
    fn estimate(&mut self) -> Result<RunEstimate> {
        let simulation = self.simulation;
        let views = simulation.pose_count();
        let (mut rays, mut seconds) = (0.0, 0.0);
        for look in 0..LOOKS {
            let turn = (f64::from(look) * GOLDEN + 0.5).fract();
            let pose = simulation.pose(numbers::whole::<u32>(turn * views));
            let all = simulation.shadow_rows(&pose.shadows);
            let first = all.start + numbers::whole::<i64>(turn * (all.end - all.start) as f64);
            let rows = first..(first + TIMED_ROWS).min(all.end);
            if rows.is_empty() {
                continue;
            }
            self.begin(&simulation.band_of(rows.start), Exposure::Flat(0))?;
            let before = self.tracer.rays_traced();
            let begin = Instant::now();
            self.add_rows(&pose, &rows)?;
            let scale = (all.end - all.start) as f64 / (rows.end - rows.start) as f64;
            rays += scale * (self.tracer.rays_traced() - before) as f64 / f64::from(LOOKS);
            seconds += scale * begin.elapsed().as_secs_f64() / f64::from(LOOKS);
        }
        Ok(RunEstimate {
            rays_per_view: rays,
            rays: rays * views,
            seconds: seconds * views,
            ..RunEstimate::default()
        })
    }
}
