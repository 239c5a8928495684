//! Light of random rays.

use super::{Light, LitRows, Pose, Report, Seconds};
use crate::illuminate::{
    ApertureEdges, IlluminationBuffer, PixelSums, RandomBatch, RandomIlluminator, SpectralBand,
};
use crate::run::RunEstimate;
use crate::run::simulation::Simulation;
use crate::sampling::touches_pixel;
use crate::trace::Tracer;
use beamlet_core::cancel::Cancel;
use beamlet_core::tally::Tally;
use beamlet_core::{Result, numbers};
use beamlet_gpu::LazyKernel;
use beamlet_interface::Pixel;
use beamlet_model::scene::Exposure;
use ndarray::Array3;
use std::ops::Range;
use std::time::Instant;

/// Rows that are timed for an estimate.
const TIMED_ROWS: i64 = 8;
/// Rays that are timed, about.
const TIMED_RAYS: f64 = 2e6;

/// Light of random rays of each pixel.
pub(super) struct Random<'s> {
    simulation: &'s Simulation,
    tracer: Tracer,
    /// One for each energy.
    lights: Vec<IlluminationBuffer>,
    sums: PixelSums,
    rays: RandomIlluminator,
    /// Columns of pixels whose rays may land on the detector.
    columns: Range<i64>,
    /// Seconds of [`Light::add`].
    seconds: f64,
}

impl<'s> Random<'s> {
    pub(super) fn new(simulation: &'s Simulation, cancel: &Cancel) -> Result<Self> {
        let (device, optics) = (simulation.device(), simulation.detector.optics());
        let (lattice, scene) = (&simulation.lattice, &simulation.scene);
        let kernels = simulation.simulator.random_kernels();
        let tracer = simulation.tracer_of_batches(cancel)?;
        let [rays, light] = kernels.all(ApertureEdges::of(optics));
        let walks = tracer.wanted_kernels();
        let walks = if simulation.sample.is_empty() { &[][..] } else { &walks[..] };
        LazyKernel::make_all(&[&[rays, light], walks].concat(), cancel)?;
        let count = i64::from(optics.detector.pixels[0]);
        let columns = -lattice.halo_columns..count + lattice.halo_columns;
        let lights = SpectralBand::nodes(&simulation.media)
            .map(|band| {
                let pixels = (&columns, &lattice.rows());
                IlluminationBuffer::of_pixels(device, scene, optics, pixels, &band)
            })
            .collect::<Result<_>>()?;
        let (steps, rows) = (optics.mask_steps(), simulation.most_lit_rows());
        Ok(Self {
            simulation,
            tracer,
            lights,
            sums: PixelSums::new(device, steps, rows, numbers::narrow(count))?,
            rays: RandomIlluminator::new(device, kernels, optics),
            columns,
            seconds: 0.0,
        })
    }

    /// Adds the light of the rays of some rows.
    fn add_rows(&mut self, pose: &Pose, rows: &Range<i64>) -> Result<()> {
        let pixels = self.simulation.detector.optics().detector.pixels.map(i64::from);
        let (mut met, mut missed) = (Vec::new(), Vec::new());
        for row in rows.clone() {
            for column in self.columns.clone() {
                let inside = (0..pixels[1]).contains(&row) && (0..pixels[0]).contains(&column);
                let pixel = Pixel {
                    column: numbers::narrow::<i32>(column),
                    row: numbers::narrow::<i32>(row),
                    table: numbers::narrow::<u32>(column - self.columns.start),
                };
                if touches_pixel(&pose.shadows, &self.simulation.lattice, [column, row]) {
                    met.push(pixel);
                } else if inside {
                    missed.push(pixel);
                }
            }
        }
        for (pixels, empty) in [(&met, false), (&missed, true)] {
            if pixels.is_empty() {
                continue;
            }
            for (node, light) in self.lights.iter().enumerate() {
                self.tracer.cancel().check()?;
                self.tracer.set_node(Some(node));
                let job = RandomBatch { pixels, pose: pose.index, empty };
                self.rays.add(&mut self.tracer, light, &self.sums, job)?;
            }
        }
        Ok(())
    }
}

impl Light for Random<'_> {
    fn begin(&mut self, rows: &Range<u32>, view: Exposure) -> Result<()> {
        let list = self.simulation.detector.optics().offsets.list_of(view);
        let uploads = self.lights.iter_mut().map(|light| light.set_band(rows, list));
        self.sums.clear(rows, &uploads.collect::<Vec<_>>())
    }

    fn items_of_row(&self, _: &Pose) -> u64 {
        let optics = self.simulation.detector.optics();
        u64::from(optics.detector.pixels[0]) * u64::from(optics.sampling.rays.count())
    }

    fn add(&mut self, pose: &Pose, rows: &LitRows, _: Report<'_>) -> Result<Tally> {
        let begin = Instant::now();
        self.add_rows(pose, &rows.rows)?;
        self.seconds += begin.elapsed().as_secs_f64();
        Ok(Tally::default())
    }

    fn intensities(&self) -> Result<Vec<Array3<f32>>> {
        Ok(vec![self.sums.intensities()?])
    }

    fn tally(&self) -> Tally {
        self.tracer.tally()
    }

    fn seconds(&self) -> Seconds {
        Seconds { trace: self.seconds, ..Seconds::default() }
    }

    fn estimate(&mut self) -> Result<RunEstimate> {
        let simulation = self.simulation;
        let all = simulation.grid_rows();
        let rows = all / 2..(all / 2 + TIMED_ROWS).min(all);
        self.begin(&simulation.band_of(rows.start), Exposure::Flat(0))?;
        // Fewer rays of each pixel where these are many.
        let optics = simulation.detector.optics();
        let mut sparse = optics.clone();
        let [columns, _] = optics.detector.pixels.map(f64::from);
        let timed = (rows.end - rows.start) as f64;
        let most = (TIMED_RAYS / (timed * columns)).max(1.0);
        while f64::from(sparse.sampling.rays.count()) > most {
            sparse.sampling.rays = sparse.sampling.rays.halved();
        }
        let kernels = simulation.simulator.random_kernels();
        self.rays = RandomIlluminator::new(simulation.device(), kernels, &sparse);
        let pose = simulation.pose(0);
        let begin = Instant::now();
        self.add_rows(&pose, &rows)?;
        let spent = begin.elapsed().as_secs_f64();
        let [sparse, full] =
            [&sparse, optics].map(|optics| f64::from(optics.sampling.rays.count()));
        let views = simulation.pose_count();
        let rays = columns * all as f64 * full;
        Ok(RunEstimate {
            rays_per_view: rays,
            rays: rays * views,
            seconds: spent * (all as f64 / timed) * (full / sparse) * (views + 1.0),
            ..RunEstimate::default()
        })
    }
}
