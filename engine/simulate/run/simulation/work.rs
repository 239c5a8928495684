//! The run in progress: bands of rows, traced and illuminated in groups, handed to the sink.

mod cells;
mod detection;
mod in_bands;
mod mean;
mod random;
mod share;
mod survey;
mod waves;

use super::Simulation;
use super::seconds::Seconds;
use crate::detector::Clipped;
use crate::illuminate::{
    ApertureEdges, CellIlluminator, IlluminationBuffer, MaskTransmissionCache, PixelSums,
    RandomIlluminator, SpectralBand,
};
use crate::run::memory::MemoryEstimate;
use crate::run::{Control, Progress, ViewProgress};
use crate::sampling::{ProjectedBounds, Response};
use crate::trace::Tracer;
use crate::wave::WaveBand;
use beamlet_core::cancel::Cancel;
use beamlet_core::tally::Tally;
use beamlet_core::{Result, numbers};
use beamlet_files::Sink;
use beamlet_gpu::LazyKernel;
use beamlet_model::scene::{Exposure, Scheme};
use in_bands::bands;
use mean::Mean;
use ndarray::Array3;
use share::Share;
use std::ops::Range;
use std::sync::Arc;
use std::time::Instant;

/// The run in progress.
pub(super) struct ViewWork<'s> {
    simulation: &'s Simulation,
    tracer: Tracer,
    /// One for each list of cell rows.
    lights: Vec<IlluminationBuffer>,
    sums: PixelSums,
    cells: CellIlluminator,
    random_light: RandomIlluminator,
    /// Light by waves in place of cells, where the scene wants that.
    wave: Option<WaveBand>,
    /// Cells add light near grazing to the light of the band by waves.
    has_grazing_light: bool,
    bars: MaskTransmissionCache,
    random: bool,
    band: u32,
    pixel_columns: Range<i64>,
    tally: Tally,
    pub(crate) seconds: Seconds,
    rows_done: u64,
    rows_total: u64,
    share: Share,
    cancel: Cancel,
    memory: MemoryEstimate,
    /// Pose of the sample in work.
    pose: u32,
    /// Index of the list of mask offsets of the view, and the response at these.
    response: (usize, Arc<Response>),
}

impl<'s> ViewWork<'s> {
    pub(super) fn new(
        simulation: &'s Simulation,
        views: &[Exposure],
        cancel: &Cancel,
        memory: MemoryEstimate,
    ) -> Result<Self> {
        let (scene, optics) = (&simulation.scene, simulation.detector.optics());
        let device = simulation.device().clone();
        let band = simulation.band_rows();
        let grid = simulation.detector.grid();
        let all_bands = || bands(grid.pixels[1], band);
        let lit_rows = || all_bands().map(|rows| grid.lit_rows(&rows).len());
        let lit_views = views.iter().filter(|view| !view.is_dark()).count();
        let blank = views.iter().filter(|view| view.is_flat()).count();
        let traced = !simulation.sample.is_empty();
        let [columns, _] = optics.detector.pixels;
        let steps = optics.mask_steps();
        let random = scene.sampling.scheme == Scheme::Random;
        let side = simulation.lattice.halo_columns;
        let pixel_columns = -side..i64::from(columns) + side;
        let media = &simulation.media;
        let lattice = &simulation.lattice;
        let nodes = media.energies.iter().zip(&media.weights);
        let nodes = nodes.map(|(&energy, &weight)| SpectralBand::Node { energy, weight });
        let lights = match &simulation.spectral {
            Some(spectral) => spectral.lights(&device, scene, optics, media)?,
            None if random => nodes
                .map(|part| {
                    let pixels = (&pixel_columns, &lattice.rows());
                    IlluminationBuffer::of_pixels(&device, scene, optics, pixels, &part)
                })
                .collect::<Result<_>>()?,
            None => nodes
                .map(|part| IlluminationBuffer::of_cells(&device, scene, optics, lattice, &part))
                .collect::<Result<_>>()?,
        };
        let mut tracer = simulation.tracer(simulation.start.backend, &memory)?;
        tracer.set_cancel(cancel.clone());
        let simulator = &simulation.simulator;
        let edges = ApertureEdges::of(optics);
        let mut kernels = vec![simulator.illuminate_kernels().usual(edges)];
        if random {
            kernels.extend(simulator.random_kernels().all(edges));
        }
        if !simulation.sample.is_empty() {
            kernels.extend(tracer.wanted_kernels());
        }
        if simulation.wave.is_some() {
            kernels.extend(simulator.wave_kernels().all());
        }
        LazyKernel::make_all(&kernels, cancel)?;
        let wave = simulation.wave.as_ref();
        let wave =
            wave.map(|plans| WaveBand::new(&device, plans, simulator.wave_kernels(), columns));
        let wave = wave.transpose()?;
        Ok(Self {
            tracer,
            lights,
            sums: PixelSums::new(&device, steps, lit_rows().max().unwrap_or(0), columns as usize)?,
            cells: CellIlluminator::new(&device, simulator.illuminate_kernels(), cancel),
            random_light: RandomIlluminator::new(&device, simulator.random_kernels(), optics),
            wave,
            has_grazing_light: false,
            bars: MaskTransmissionCache::default(),
            random,
            band,
            pixel_columns,
            tally: Tally::default(),
            seconds: Seconds::default(),
            rows_done: 0,
            rows_total: ((blank + (lit_views - blank) * scene.scan.poses_of_view())
                * all_bands().map(|rows| grid.own_rows(&rows).len()).sum::<usize>())
                as u64,
            pose: 0,
            share: Share::new([blank, lit_views - blank], traced),
            cancel: cancel.clone(),
            memory,
            response: (0, simulation.response.clone()),
            simulation,
        })
    }

    pub(super) fn view(
        &mut self,
        view: Exposure,
        sink: &mut dyn Sink,
        control: &mut Control<'_>,
    ) -> Result<()> {
        let rows = self.simulation.scene.detector.pixels[1];
        // The largest of a view are its own.
        (self.tally.most_patch_rays, self.tally.worst_error) = (0, 0);
        if view.is_dark() {
            return self.dark(view, sink);
        }
        let detector = &self.simulation.detector;
        self.take_offsets(view);
        let poses: Vec<(u32, Vec<ProjectedBounds>)> = self.poses(view);
        let halo = self.simulation.lattice.halo;
        let all: Vec<Range<u32>> = bands(rows, self.band).collect();
        let sampled: Vec<Range<i64>> = all
            .iter()
            .map(|band| detector.grid().lit_rows(band))
            .map(|lit| i64::from(lit.start) - halo..i64::from(lit.end) + halo)
            .collect();
        let repeated: Vec<Range<i64>> =
            poses.iter().flat_map(|_| sampled.iter().cloned()).collect();
        let lattice = &self.simulation.lattice;
        self.share.begin(lattice, &poses[0].1, !view.is_flat(), &repeated);
        self.report(view, control)?;
        for band in all {
            let mut mean = Mean::of(poses.len());
            for (pose, projected_bounds) in &poses {
                self.pose = *pose;
                mean.add(self.lit_band(view, projected_bounds, &band, control)?);
            }
            let mut intensities = mean.finish();
            self.scale(view, &mut intensities);
            let begin = Instant::now();
            let counts = detector.counts(view, &band, intensities.view(), &self.cancel)?;
            self.seconds.noise += begin.elapsed().as_secs_f64();
            let begin = Instant::now();
            sink.write(view, band.clone(), intensities.view())?;
            if let Some(frame) = counts {
                self.count_clipped(frame.clipped);
                sink.write_counts(view, band, frame.numbers.view())?;
            }
            self.seconds.write += begin.elapsed().as_secs_f64();
        }
        Ok(())
    }

    /// Poses of the sample in a view, each with its shadows; one without any for a flat.
    fn poses(&self, view: Exposure) -> Vec<(u32, Vec<ProjectedBounds>)> {
        let Exposure::Sample(view) = view else { return vec![(0, Vec::new())] };
        let is_traced = !self.simulation.sample.is_empty();
        let count = numbers::count(self.simulation.scene.scan.poses_of_view());
        let bounds = |pose| match is_traced {
            true => self.simulation.projected_bounds(pose),
            false => Vec::new(),
        };
        (view * count..(view + 1) * count).map(|pose| (pose, bounds(pose))).collect()
    }

    /// Intensities of a band at one pose of the sample.
    fn lit_band(
        &mut self,
        view: Exposure,
        projected_bounds: &[ProjectedBounds],
        band: &Range<u32>,
        control: &mut Control<'_>,
    ) -> Result<Array3<f32>> {
        let detector = &self.simulation.detector;
        let lit = detector.grid().lit_rows(band);
        let list = self.response.0;
        self.clear_band(&lit, list)?;
        self.band(view, projected_bounds, &lit, &detector.grid().own_rows(band), control)?;
        let begin = Instant::now();
        let light = match &self.wave {
            Some(wave) if self.has_grazing_light => {
                wave.intensities()? + self.sums.intensities()?
            }
            Some(wave) => wave.intensities()?,
            None => self.sums.intensities()?,
        };
        let intensities = detector.intensities(view, band, light, &self.cancel)?;
        self.seconds.detect += begin.elapsed().as_secs_f64();
        Ok(intensities)
    }

    /// Begins sums of the light of rows, at a list of mask offsets.
    pub(super) fn clear_band(&mut self, lit: &Range<u32>, list: usize) -> Result<()> {
        if let Some(wave) = &mut self.wave {
            wave.begin(lit, list)?;
        }
        self.has_grazing_light = false;
        let uploads = self.lights.iter_mut().map(|light| light.set_band(lit, list));
        self.sums.clear(lit, &uploads.collect::<Vec<_>>())
    }

    /// Takes the response at the mask offsets of a view; index of their list.
    fn take_offsets(&mut self, view: Exposure) -> usize {
        let list = self.simulation.detector.optics().offsets.list_of(view);
        if self.response.0 != list {
            self.response = (list, self.simulation.response(view));
        }
        list
    }

    /// Gives the frames of a view the light that they have over the nominal one.
    fn scale(&self, view: Exposure, intensities: &mut Array3<f32>) {
        let scan = &self.simulation.scene.scan;
        let Some(view) = scan.view_of_errors(view) else { return };
        if scan.errors.intensities.is_empty() {
            return;
        }
        for (step, mut frame) in intensities.outer_iter_mut().enumerate() {
            let light = scan.intensity(view, step);
            frame.mapv_inplace(|y| numbers::single(light * f64::from(y)));
        }
    }

    fn count_clipped(&mut self, clipped: Clipped) {
        self.tally.saturated += clipped.high;
        self.tally.clipped_at_zero += clipped.low;
    }

    /// Dark frames need no light.
    fn dark(&mut self, view: Exposure, sink: &mut dyn Sink) -> Result<()> {
        let Some(noise) = self.simulation.detector.noise() else { return Ok(()) };
        for band in bands(self.simulation.scene.detector.pixels[1], self.band) {
            let begin = Instant::now();
            let frame = noise.dark(view.index(), band.clone(), &self.cancel)?;
            self.seconds.noise += begin.elapsed().as_secs_f64();
            self.count_clipped(frame.clipped);
            let begin = Instant::now();
            sink.write_counts(view, band, frame.numbers.view())?;
            self.seconds.write += begin.elapsed().as_secs_f64();
        }
        Ok(())
    }

    /// Sums the light of one band, in groups of rows small enough to stop between them. `own`: rows that
    /// no other band counts.
    fn band(
        &mut self,
        view: Exposure,
        projected_bounds: &[ProjectedBounds],
        band: &Range<u32>,
        own: &Range<u32>,
        control: &mut Control<'_>,
    ) -> Result<()> {
        let inner = i64::from(band.start)..i64::from(band.end);
        let halo = self.simulation.lattice.halo;
        let group = self.group_rows(!projected_bounds.is_empty());
        let mut row = inner.start - halo;
        while row < inner.end + halo {
            // Groups end at the borders of the band, so that its own counts stay separate.
            let borders = [inner.start, own.start.into(), own.end.into(), inner.end];
            let border = borders.into_iter().find(|b| *b > row).unwrap_or(inner.end + halo);
            let rows = row..border.min(row + group);
            row = rows.end;
            let own = i64::from(own.start)..i64::from(own.end);
            let own = own.contains(&rows.start);
            if self.wave_rows(view, projected_bounds, (&rows, &inner), own)? {
                // All light comes from lines.
            } else if self.simulation.scene.sampling.scheme == Scheme::Random {
                self.random_rows(self.simulation.detector.optics(), view, projected_bounds, &rows)?;
            } else {
                self.cell_rows(view, projected_bounds, &rows, &inner, own, control)?;
            }
            if own {
                self.rows_done += numbers::narrow::<u64>(rows.end - rows.start);
            }
            self.share.finish(&rows);
            self.report(view, control)?;
        }
        Ok(())
    }

    /// Rows sampled together; `traced`: their rays may cross the sample.
    fn group_rows(&self, traced: bool) -> i64 {
        let optics = self.simulation.detector.optics();
        let lattice = &self.simulation.lattice;
        let per_row = if optics.sampling.scheme == Scheme::Random {
            u64::from(optics.detector.pixels[0]) * u64::from(optics.sampling.rays.count())
        } else if !traced {
            // Nothing is traced. Invocations
            // side by side that see one aperture from several rows do the same work: four times as
            // fast as those that see apertures side by side.
            numbers::narrow::<u64>(lattice.beamlets.end - lattice.beamlets.start)
        } else {
            let beamlets = numbers::narrow::<u64>(lattice.beamlets.end - lattice.beamlets.start);
            beamlets * (2 * u64::from(lattice.cells) + 1) * 2
        };
        (self.memory.rays_at_once / per_row.max(1)).max(1) as i64
    }

    fn report(&mut self, view: Exposure, control: &mut Control<'_>) -> Result<()> {
        self.cancel.check()?;
        if let Some(progress) = control.progress.as_mut() {
            progress(Progress::Views(ViewProgress {
                rows_done: self.rows_done,
                rows_total: self.rows_total,
                view,
                rays: self.tracer.rays_traced(),
                share: self.share.with(&(0..0), 0.0),
            }));
        }
        Ok(())
    }

    /// Counts views that others have made as done.
    pub(super) fn begin_after(&mut self, views: &[Exposure]) {
        let grid = self.simulation.detector.grid();
        let rows = grid.own_rows(&(0..grid.pixels[1])).len() as u64;
        for view in views.iter().filter(|view| !view.is_dark()) {
            let is_sample = matches!(view, Exposure::Sample(_));
            let poses = if is_sample { self.simulation.scene.scan.poses_of_view() } else { 1 };
            self.rows_done += poses as u64 * rows;
            self.share.skip(is_sample);
        }
    }

    /// Pixel rows of all views.
    pub(super) const fn rows_total(&self) -> u64 {
        self.rows_total
    }

    pub(super) fn tally(&self) -> Tally {
        self.tracer.tally() + self.tally
    }
}
