//! Sums of the light of cells on the device.

use super::Simulation;
use crate::illuminate::{
    ApertureEdges, CellIlluminator, Gatherer, IlluminationBuffer, PixelSums, SpectralBand,
};
use crate::sampling::{self, CellBatch, Lattice};
use crate::trace::Tracer;
use beamlet_core::cancel::Cancel;
use beamlet_core::{Result, numbers};
use beamlet_gpu::LazyKernel;
use ndarray::Array3;
use std::ops::Range;
use std::time::Instant;

/// Sums of the light of cells in a band of rows.
pub(super) struct CellLight<'s> {
    lattice: &'s Lattice,
    /// Gathers energies.
    gatherer: Option<Gatherer<'s>>,
    /// One for each list of cells.
    lights: Vec<IlluminationBuffer>,
    sums: PixelSums,
    illuminator: CellIlluminator,
    /// Mask steps that are illuminated.
    steps: u32,
    /// Seconds of illumination, and of the host's part of gathering energies.
    pub(super) illumination: f64,
    gathering: f64,
}

impl<'s> CellLight<'s> {
    /// Light of cells at the mean of a spectrum.
    ///
    /// # Errors
    /// Of the device or memory.
    pub(super) fn new(simulation: &'s Simulation, cancel: &Cancel) -> Result<Self> {
        let Some(spectrum) = simulation.light.spectrum() else {
            return Self::by_energy(simulation, cancel);
        };
        let (scene, media) = (&simulation.scene, &simulation.media);
        let optics = simulation.detector.optics();
        let lights = spectrum.energies.lights(simulation.device(), scene, optics, media)?;
        let gatherer = Gatherer::new(simulation.device(), &spectrum.energies)?;
        Self::with(simulation, lights, Some(gatherer), cancel)
    }

    /// Light of cells of each energy.
    ///
    /// # Errors
    /// Of the device or memory.
    pub(super) fn by_energy(simulation: &'s Simulation, cancel: &Cancel) -> Result<Self> {
        let (device, lattice) = (simulation.device(), &simulation.lattice);
        let (scene, optics) = (&simulation.scene, simulation.detector.optics());
        let bands = SpectralBand::nodes(&simulation.media);
        let lights = bands
            .map(|band| IlluminationBuffer::of_cells(device, scene, optics, lattice, &band))
            .collect::<Result<_>>()?;
        Self::with(simulation, lights, None, cancel)
    }

    fn with(
        simulation: &'s Simulation,
        lights: Vec<IlluminationBuffer>,
        gatherer: Option<Gatherer<'s>>,
        cancel: &Cancel,
    ) -> Result<Self> {
        let (device, optics) = (simulation.device(), simulation.detector.optics());
        let columns = optics.detector.pixels[0] as usize;
        let (steps, rows) = (optics.mask_steps(), simulation.most_lit_rows());
        let kernels = simulation.simulator.illuminate_kernels();
        Ok(Self {
            lattice: &simulation.lattice,
            gatherer,
            lights,
            sums: PixelSums::new(device, steps, rows, columns)?,
            illuminator: CellIlluminator::new(device, kernels, cancel),
            steps: numbers::count(steps),
            illumination: 0.0,
            gathering: 0.0,
        })
    }

    /// The kernel of most cells.
    pub(super) fn kernel(simulation: &Simulation) -> &LazyKernel {
        let edges = ApertureEdges::of(simulation.detector.optics());
        simulation.simulator.illuminate_kernels().usual(edges)
    }

    /// Begins sums of rows at a list of mask offsets.
    ///
    /// # Errors
    /// Of the device.
    pub(super) fn begin(&mut self, rows: &Range<u32>, list: usize) -> Result<()> {
        let uploads = self.lights.iter_mut().map(|light| light.set_band(rows, list));
        self.sums.clear(rows, &uploads.collect::<Vec<_>>())
    }

    /// Seconds of illumination and of gathering energies.
    pub(super) fn seconds(&self) -> f64 {
        self.illumination + self.gathering
    }

    /// Mask steps that are illuminated.
    pub(super) const fn steps(&self) -> u32 {
        self.steps
    }

    /// Illuminates the first mask steps only.
    pub(super) const fn limit_steps(&mut self, steps: u32) {
        self.steps = steps;
    }

    /// Adds the light of cells; `tracer`: `None` for cells without a sample.
    ///
    /// # Errors
    /// Of the device or memory; [`beamlet_core::Error::Interrupted`].
    pub(super) fn add(&mut self, tracer: Option<&Tracer>, cells: &CellBatch) -> Result<()> {
        let Some(gatherer) = &mut self.gatherer else {
            return self.add_lists(std::slice::from_ref(cells));
        };
        for part in cells.parts(gatherer.cells_at_once()) {
            let begin = Instant::now();
            let gathering = gatherer.plan(tracer, &part)?;
            self.gathering += begin.elapsed().as_secs_f64();
            let (begin, lights) = (Instant::now(), &self.lights);
            self.illuminator.add_gathered(gatherer, &gathering, lights, &self.sums, self.steps)?;
            self.illumination += begin.elapsed().as_secs_f64();
        }
        Ok(())
    }

    /// Adds the light of rows without a sample.
    ///
    /// # Errors
    /// As [`CellLight::add`].
    pub(super) fn add_blank(&mut self, rows: Range<i64>) -> Result<()> {
        self.add(None, &sampling::empty_cell_rows(self.lattice, rows))
    }

    /// Adds the light of lists of cells, one for each record of light.
    ///
    /// # Errors
    /// As [`CellLight::add`].
    pub(super) fn add_lists(&mut self, lists: &[CellBatch]) -> Result<()> {
        let begin = Instant::now();
        self.illuminator.add(self.lights.iter().zip(lists), &self.sums, self.steps)?;
        self.illumination += begin.elapsed().as_secs_f64();
        Ok(())
    }

    /// The sums, `[step][row][column]`.
    ///
    /// # Errors
    /// Of the device or memory.
    pub(super) fn intensities(&self) -> Result<Array3<f32>> {
        self.sums.intensities()
    }
}
