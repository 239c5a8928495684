//! Light of a run without a sample: no ray is traced.

use super::cells::CellLight;
use super::{Light, LitRows, Pose, Report, Seconds};
use crate::run::RunEstimate;
use crate::run::simulation::Simulation;
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
pub(super) const STEPS: u32 = 128;

/// Light through the masks alone, of each of some designs with one lattice.
pub(super) struct Blank<'s> {
    designs: &'s [Simulation],
    /// Sums of each design.
    cells: CellLight<'s>,
}

impl<'s> Blank<'s> {
    pub(super) fn new(designs: &'s [Simulation], cancel: &Cancel) -> Result<Self> {
        LazyKernel::make_all(&CellLight::kernels(&designs[0]), cancel)?;
        Ok(Self { designs, cells: CellLight::new(designs, cancel)? })
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

    /// Seconds that the light of a view without a sample takes: the least of a few, since some rows
    /// stand for all and a pause of the machine would count as often. `left_out`: mask steps for each illuminated one.
    ///
    /// # Errors
    /// As [`CellLight::add`].
    pub(super) fn blank_seconds(&mut self, simulation: &Simulation, left_out: f64) -> Result<f64> {
        let band = simulation.band_of(0);
        self.begin(&band, &[0])?;
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
        self.cells.begin(rows, &self.designs.iter().map(list).collect::<Vec<_>>())
    }

    fn items_of_row(&self, pose: &Pose) -> u64 {
        self.designs[0].cells_of_row(pose)
    }

    fn add(&mut self, _: &Pose, rows: &LitRows, _: Report<'_>) -> Result<Tally> {
        self.cells.add_undeflected(&self.designs[0], rows)?;
        Ok(Tally::default())
    }

    fn intensities(&self) -> Result<Vec<Array3<f32>>> {
        self.cells.intensities()
    }

    fn tally(&self) -> Tally {
        Tally::default()
    }

    fn seconds(&self) -> Seconds {
        Seconds { illuminate: self.cells.seconds(), ..Seconds::default() }
    }

    fn estimate(&mut self) -> Result<RunEstimate> {
        let (first, cells) = (&self.designs[0], &mut self.cells);
        let left_out = cells.leave_out_steps(STEPS);
        let blank = cells.blank_seconds(first, left_out)?;
        let seconds = (first.pose_count() + 1.0) * blank;
        Ok(RunEstimate { seconds, ..RunEstimate::default() })
    }
}
