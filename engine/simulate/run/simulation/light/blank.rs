//! Light of a run without a sample: no ray is traced.

use super::cells::CellLight;
use super::{Light, LitRows, Pose, Report};
use crate::run::RunEstimate;
use crate::run::simulation::Simulation;
use crate::run::simulation::seconds::Seconds;
use beamlet_core::Result;
use beamlet_core::cancel::Cancel;
use beamlet_core::tally::Tally;
use beamlet_gpu::LazyKernel;
use beamlet_model::scene::Exposure;
use ndarray::Array3;
use std::ops::Range;
use std::time::Instant;

/// Rows that are timed.
const TIMED_ROWS: i64 = 8;
/// Times that they are timed.
const TIMES: u32 = 3;
/// Seconds after which they are not timed again.
const SECONDS: f64 = 1.0;
/// Mask steps that are illuminated for an estimate; others cost as much each.
const STEPS: u32 = 128;

/// Light through the masks alone, of each of some designs with one lattice.
pub(super) struct Blank<'s> {
    designs: &'s [Simulation],
    /// Sums of each design.
    cells: Vec<CellLight<'s>>,
}

impl<'s> Blank<'s> {
    pub(super) fn new(designs: &'s [Simulation], cancel: &Cancel) -> Result<Self> {
        LazyKernel::make_all(&[CellLight::kernel(&designs[0])], cancel)?;
        let cells = designs.iter().map(|design| CellLight::new(design, cancel));
        Ok(Self { designs, cells: cells.collect::<Result<_>>()? })
    }
}

impl CellLight<'_> {
    /// Adds the undeflected light of rows.
    ///
    /// # Errors
    /// As [`CellLight::add`].
    pub(super) fn add_undeflected(&mut self, simulation: &Simulation, lit: &LitRows) -> Result<()> {
        let direct = lit.direct(&simulation.lattice);
        self.add_blank(lit.rows.start.max(direct.start)..lit.rows.end.min(direct.end))
    }

    /// Illuminates a part of many mask steps from here on; number of the others for each of these.
    pub(super) fn leave_out_steps(&mut self) -> f64 {
        let all = self.steps();
        self.limit_steps(all.min(STEPS));
        f64::from(all) / f64::from(self.steps()) - 1.0
    }

    /// Seconds that the light of a view without a sample takes: the least of a few, since some rows
    /// stand for all and a pause of the machine would count as often. `left_out`: mask steps for each illuminated one.
    ///
    /// # Errors
    /// As [`CellLight::add`].
    pub(super) fn blank_seconds(&mut self, simulation: &Simulation, left_out: f64) -> Result<f64> {
        let band = simulation.band_of(0);
        self.begin(&band, 0)?;
        let first = i64::from(band.start);
        let rows = first..i64::from(band.end).min(first + TIMED_ROWS);
        let share = simulation.grid_rows() as f64 / (rows.end - rows.start).max(1) as f64;
        let mut least = f64::INFINITY;
        for _ in 0..TIMES {
            let (begin, before) = (Instant::now(), self.illumination);
            self.add_blank(rows.clone())?;
            let spent = begin.elapsed().as_secs_f64();
            least = least.min(spent + left_out * (self.illumination - before));
            if spent > SECONDS {
                break;
            }
        }
        Ok(least * share)
    }
}

impl Light for Blank<'_> {
    fn begin(&mut self, rows: &Range<u32>, view: Exposure) -> Result<()> {
        let list = |design: &Simulation| design.detector.optics().offsets.list_of(view);
        let mut own = self.cells.iter_mut().zip(self.designs);
        own.try_for_each(|(cells, design)| cells.begin(rows, list(design)))
    }

    fn items_of_row(&self, pose: &Pose) -> u64 {
        self.designs[0].cells_of_row(pose)
    }

    fn add(&mut self, _: &Pose, rows: &LitRows, _: Report<'_>) -> Result<Tally> {
        let first = &self.designs[0];
        self.cells.iter_mut().try_for_each(|cells| cells.add_undeflected(first, rows))?;
        Ok(Tally::default())
    }

    fn intensities(&self) -> Result<Vec<Array3<f32>>> {
        self.cells.iter().map(CellLight::intensities).collect()
    }

    fn tally(&self) -> Tally {
        Tally::default()
    }

    fn seconds(&self) -> Seconds {
        let illuminate = self.cells.iter().map(CellLight::seconds).sum();
        Seconds { illuminate, ..Seconds::default() }
    }

    fn estimate(&mut self) -> Result<RunEstimate> {
        let (first, cells) = (&self.designs[0], &mut self.cells[0]);
        let left_out = cells.leave_out_steps();
        let blank = cells.blank_seconds(first, left_out)?;
        let seconds = (first.pose_count() + 1.0) * blank;
        Ok(RunEstimate { seconds, ..RunEstimate::default() })
    }
}
