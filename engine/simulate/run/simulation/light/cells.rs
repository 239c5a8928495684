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

/// Sums of the light of cells in a band of rows, of each of some designs with one lattice.
pub(super) struct CellLight<'s> {
    lattice: &'s Lattice,
    designs: Vec<DesignLight<'s>>,
    illuminator: CellIlluminator,
    /// Seconds of illumination, and of the host's part of gathering energies.
    pub(super) illumination: f64,
    gathering: f64,
}

/// Sums of the light of a design.
struct DesignLight<'s> {
    /// Gathers energies.
    gatherer: Option<Gatherer<'s>>,
    /// One for each list of cells.
    lights: Vec<IlluminationBuffer>,
    sums: PixelSums,
    /// Mask steps that are illuminated.
    steps: u32,
}

impl<'s> DesignLight<'s> {
    fn new(simulation: &'s Simulation) -> Result<Self> {
        let energies = simulation.light.spectrum().map(|spectrum| &spectrum.energies);
        let (device, optics) = (simulation.device(), simulation.detector.optics());
        let (scene, media, lattice) = (&simulation.scene, &simulation.media, &simulation.lattice);
        let lights = match energies {
            Some(energies) => energies.lights(device, scene, optics, media)?,
            None => SpectralBand::nodes(media)
                .map(|band| IlluminationBuffer::of_cells(device, scene, optics, lattice, &band))
                .collect::<Result<_>>()?,
        };
        let columns = optics.detector.pixels[0] as usize;
        let (steps, rows) = (optics.mask_steps(), simulation.most_lit_rows());
        Ok(Self {
            gatherer: energies.map(|energies| Gatherer::new(device, energies)).transpose()?,
            lights,
            sums: PixelSums::new(device, steps, rows, columns)?,
            steps: numbers::count(steps),
        })
    }
}

impl<'s> CellLight<'s> {
    /// Light of cells of designs: at the mean of a spectrum whose energies are gathered, else of each energy.
    ///
    /// # Errors
    /// Of the device or memory.
    pub(super) fn new(designs: &'s [Simulation], cancel: &Cancel) -> Result<Self> {
        let first = &designs[0];
        let kernels = first.simulator.illuminate_kernels();
        Ok(Self {
            lattice: &first.lattice,
            designs: designs.iter().map(DesignLight::new).collect::<Result<_>>()?,
            illuminator: CellIlluminator::new(first.device(), kernels, cancel),
            illumination: 0.0,
            gathering: 0.0,
        })
    }

    /// The kernels of most cells.
    pub(super) fn kernels(simulation: &Simulation) -> Vec<&LazyKernel> {
        let edges = ApertureEdges::of(simulation.detector.optics());
        let kernels = simulation.simulator.illuminate_kernels();
        let gather = simulation.light.spectrum().map(|_| kernels.gathering());
        std::iter::once(kernels.of(edges, false)).chain(gather.into_iter().flatten()).collect()
    }

    /// Begins sums of rows at a list of mask offsets of each design.
    ///
    /// # Errors
    /// Of the device.
    pub(super) fn begin(&mut self, rows: &Range<u32>, lists: &[usize]) -> Result<()> {
        self.designs.iter_mut().zip(lists).try_for_each(|(design, list)| {
            let uploads = design.lights.iter_mut().map(|light| light.set_band(rows, *list));
            design.sums.clear(rows, &uploads.collect::<Vec<_>>())
        })
    }

    /// Seconds of illumination and of gathering energies.
    pub(super) fn seconds(&self) -> f64 {
        self.illumination + self.gathering
    }

    /// Illuminates the first mask steps of the first design from here on, at most this many; number of the others for
    /// each of these.
    pub(super) fn leave_out_steps(&mut self, most: u32) -> f64 {
        let steps = &mut self.designs[0].steps;
        let all = std::mem::replace(steps, most.min(*steps));
        f64::from(all) / f64::from(*steps) - 1.0
    }

    /// Adds the light of cells; `tracer`: `None` for cells without a sample.
    ///
    /// # Errors
    /// Of the device or memory; [`beamlet_core::Error::Interrupted`].
    pub(super) fn add(&mut self, tracer: Option<&Tracer>, cells: &CellBatch) -> Result<()> {
        if self.designs.iter().all(|design| design.gatherer.is_none()) {
            return self.add_lists(std::slice::from_ref(cells));
        }
        for DesignLight { gatherer, lights, sums, steps } in &mut self.designs {
            let Some(gatherer) = gatherer else { continue };
            for part in cells.parts(gatherer.cells_at_once()) {
                let begin = Instant::now();
                let gathering = gatherer.plan(tracer, &part)?;
                self.gathering += begin.elapsed().as_secs_f64();
                let begin = Instant::now();
                self.illuminator.add_gathered(gatherer, &gathering, lights, sums, *steps)?;
                self.illumination += begin.elapsed().as_secs_f64();
            }
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

    /// Adds the light of lists of cells, one for each energy.
    ///
    /// # Errors
    /// As [`CellLight::add`].
    pub(super) fn add_lists(&mut self, lists: &[CellBatch]) -> Result<()> {
        let begin = Instant::now();
        for DesignLight { lights, sums, steps, .. } in &self.designs {
            self.illuminator.add(lights, lists, sums, *steps)?;
        }
        self.illumination += begin.elapsed().as_secs_f64();
        Ok(())
    }

    /// The sums of each design, `[step][row][column]`.
    ///
    /// # Errors
    /// Of the device or memory.
    pub(super) fn intensities(&self) -> Result<Vec<Array3<f32>>> {
        self.designs.iter().map(|design| design.sums.intensities()).collect()
    }
}
