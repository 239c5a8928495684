//! Light of cells of rows.

use super::{ViewWork, share};
use crate::illuminate::EnergyBinning;
use crate::run::Control;
use crate::sampling::{self, CellBatch, ProjectedBounds};
use crate::trace::Tracer;
use beamlet_core::{Result, numbers};
use beamlet_model::scene::Exposure;
use std::cell::Cell;
use std::ops::Range;
use std::time::Instant;

/// Cells whose energies are gathered at once: exact transport at each node takes 2 KiB and more a cell.
const GATHERED: usize = 1 << 15;

/// Does work and adds the time that it takes to `seconds`.
fn timed<T>(seconds: &Cell<f64>, work: impl FnOnce() -> T) -> T {
    let begin = Instant::now();
    let done = work();
    seconds.set(seconds.get() + begin.elapsed().as_secs_f64());
    done
}

impl ViewWork<'_> {
    /// Sums the light of cells of some rows: sampled ones, or none.
    pub(super) fn cell_rows(
        &mut self,
        view: Exposure,
        projected_bounds: &[ProjectedBounds],
        rows: &Range<i64>,
        inner: &Range<i64>,
        own: bool,
        control: &mut Control<'_>,
    ) -> Result<()> {
        let begin = Instant::now();
        let blur_rows = self.simulation.lattice.blur_rows;
        let lit = inner.start - blur_rows..inner.end + blur_rows;
        let steps = numbers::count(self.simulation.scene.scan.mask_offsets.len());
        let simulation = self.simulation;
        let counted = [self.rows_done, self.rows_total];
        let mut advance = share::advance(&mut control.progress, &self.share, (view, rows), counted);
        let illuminating = Cell::new(0.0);
        // Cell rows as lists, one for each record of light.
        let mut gather = |tracer: &mut Tracer, spectral: &EnergyBinning, cell_rows: &CellBatch| {
            timed(&illuminating, || spectral.lists(tracer, &mut self.bars, cell_rows))
        };
        let mut light = |lists: &[CellBatch]| {
            self.cancel.check()?;
            let lists = self.lights.iter().zip(lists);
            timed(&illuminating, || self.cells.add(lists, &self.sums, steps))
        };
        let mut add = |tracer: &mut Tracer, cell_rows: &CellBatch| {
            if own {
                self.tally.landed_off += cell_rows.landed_off;
                self.tally = self.tally + cell_rows.tally;
            }
            match &simulation.spectral {
                Some(spectral) => cell_rows
                    .parts(GATHERED)
                    .try_for_each(|part| light(&gather(tracer, spectral, &part)?)),
                None => light(std::slice::from_ref(cell_rows)),
            }
        };
        match view {
            Exposure::Sample(_) if !projected_bounds.is_empty() => {
                let view = simulation.pose_context(self.pose, projected_bounds, &self.response.1);
                let tracer = &mut self.tracer;
                let room = simulation.room(&self.memory);
                let lit = (&lit, &room);
                sampling::sample_rows(&view, tracer, rows.clone(), lit, &mut add, &mut advance)?;
            }
            _ => {
                let rows = rows.start.max(lit.start)..rows.end.min(lit.end);
                let mut cell_rows = sampling::empty_cell_rows(&simulation.lattice, rows);
                if simulation.spectral.is_some() {
                    cell_rows.keep_nothing(simulation.moment_words());
                }
                add(&mut self.tracer, &cell_rows)?;
            }
        }
        let illuminating = illuminating.get();
        self.seconds.trace += begin.elapsed().as_secs_f64() - illuminating;
        self.seconds.illuminate += illuminating;
        Ok(())
    }
}
