//! Light of cells of rows.

use super::{ViewWork, share};
use crate::illuminate::EnergyBinning;
use crate::refine::{CellMaker, DeviceRefiner, MadeCells, Take};
use crate::run::Control;
use crate::sampling::{self, BaseLattice, CellBatch, ProjectedBounds};
use crate::trace::Tracer;
use beamlet_core::tally::Tally;
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
        (rows, base): (&Range<i64>, &mut Option<BaseLattice>),
        inner: &Range<i64>,
        own: bool,
        control: &mut Control<'_>,
    ) -> Result<()> {
        let makes_cells = |it: &DeviceRefiner<'_>| it.maker() != CellMaker::Host;
        if self.refiner.as_ref().is_some_and(makes_cells)
            && matches!(view, Exposure::Sample(_))
            && !projected_bounds.is_empty()
        {
            return self.device_rows(view, projected_bounds, rows, inner, own, control);
        }
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
                self.tally.split += cell_rows.splits;
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
        let mut found = Tally::default();
        match view {
            Exposure::Sample(_) if !projected_bounds.is_empty() => {
                let view = simulation.pose_context(self.pose, projected_bounds, &self.response.1);
                let tracer = &mut self.tracer;
                if let Some(refiner) = &mut self.refiner {
                    let from = (self.response.0, simulation.refine_room(&self.memory));
                    let rows = (rows, &lit);
                    found =
                        refiner.sample_rows(&view, tracer, from, rows, &mut add, &mut advance)?;
                } else {
                    let room = simulation.room(&self.memory);
                    let (rows, lit) = (rows.clone(), (&lit, base));
                    sampling::sample_rows(&view, tracer, rows, lit, &room, &mut add, &mut advance)?;
                }
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
        if own {
            self.tally = self.tally + found;
        }
        let illuminating = illuminating.get();
        self.seconds.trace += begin.elapsed().as_secs_f64() - illuminating;
        self.seconds.illuminate += illuminating;
        Ok(())
    }

    /// Sums the light of cells of some rows that the device refines.
    fn device_rows(
        &mut self,
        view: Exposure,
        projected_bounds: &[ProjectedBounds],
        rows: &Range<i64>,
        inner: &Range<i64>,
        own: bool,
        control: &mut Control<'_>,
    ) -> Result<()> {
        let Some(refiner) = &mut self.refiner else { return Ok(()) };
        let begin = Instant::now();
        let simulation = self.simulation;
        let blur_rows = simulation.lattice.blur_rows;
        let lit = inner.start - blur_rows..inner.end + blur_rows;
        let steps = numbers::count(simulation.scene.scan.mask_offsets.len());
        let counted = [self.rows_done, self.rows_total];
        let mut advance = share::advance(&mut control.progress, &self.share, (view, rows), counted);
        let illuminating = Cell::new(0.0);
        let context = simulation.pose_context(self.pose, projected_bounds, &self.response.1);
        let room = simulation.refine_room(&self.memory);
        let (lights, sums, cells) = (&self.lights, &self.sums, &mut self.cells);
        let mut light = |made: &MadeCells<'_>| {
            timed(&illuminating, || cells.add_made(lights, made, sums, steps))
        };
        let mut take = Take::Cells(&mut light);
        let (found, missed) = refiner.refine(
            &context,
            &mut self.tracer,
            (self.response.0, room),
            (rows, &lit),
            &mut take,
            &mut advance,
        )?;
        if own {
            self.tally = self.tally + found.tally;
            self.tally.landed_off += found.landed_off;
        }
        let mut blank = sampling::blank_cells(&simulation.lattice, missed);
        let lists = match &simulation.spectral {
            Some(spectral) => {
                blank.keep_nothing(simulation.moment_words());
                spectral.lists(&mut self.tracer, &mut self.bars, &blank)?
            }
            None => vec![blank],
        };
        timed(&illuminating, || cells.add(lights.iter().zip(&lists), sums, steps))?;
        self.seconds.trace += begin.elapsed().as_secs_f64() - illuminating.get();
        self.seconds.illuminate += illuminating.get();
        Ok(())
    }
}
