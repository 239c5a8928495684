//! Rays at random places of the cells of a patch of evenly spread rays.

use super::super::even::{EvenCell, EvenPatch};
use super::super::line::{NARROWEST, Piece};
use super::{Auditor, LandedLight, Part, plain};
use crate::trace::Tracer;
use beamlet_core::Result;
use beamlet_core::numbers::single;
use beamlet_core::random::Draws;
use beamlet_interface::Ray;
use rayon::prelude::*;

/// Cells of a set of an even patch.
pub(super) struct FreshCells {
    /// Index of its patch.
    pub(super) drawn: usize,
    pub(super) set: usize,
    pub(super) beamlet: i64,
    pub(super) row: i64,
    pub(super) cells: Vec<EvenCell>,
}

/// Patches of evenly spread rays.
impl Auditor<'_> {
    fn light_of_even(&self, patch: &EvenPatch) -> LandedLight {
        let cells: Vec<EvenCell> = patch.cells().collect();
        let piece = |(at, cell): (u32, &EvenCell)| Piece {
            interval: at,
            ..plain(cell.x.map(f64::from), self.narrowed(cell.result))
        };
        let pieces: Vec<Piece> = (0..).zip(&cells).map(piece).collect();
        let part = |piece: &Piece| {
            let z = cells[piece.interval as usize].z.map(f64::from);
            Part { z, weight: z[1] - z[0] }
        };
        let mut sums = self.no_light();
        self.add_light([patch.beamlet, patch.row], &pieces, part, &mut sums);
        sums
    }

    /// As many cells, with rays at random places.
    pub(super) fn random_cells(&self, patch: &EvenPatch, draws: &mut Draws) -> Vec<EvenCell> {
        let place = [patch.beamlet, patch.row];
        let openings = &self.openings[self.view.lattice.column(patch.beamlet)];
        let mut cells = self.even.empty_cells(place, openings, patch.count());
        for cell in &mut cells {
            let within = |[low, high]: [f32; 2], share: f64| low + (high - low) * single(share);
            let [x, z] = draws.pair();
            cell.ray = [within(cell.x, x), within(cell.z, z)];
        }
        cells
    }

    /// Traces the rays of cells.
    pub(super) fn trace_cells(&self, tracer: &mut Tracer, sets: &mut [FreshCells]) -> Result<()> {
        let rays_of = |set: &FreshCells| {
            let FreshCells { beamlet, row, cells, .. } = set;
            let ray = |cell: &EvenCell| self.view.ray(*beamlet, *row, cell.ray[0], cell.ray[1]);
            cells.iter().map(ray).collect::<Vec<Ray>>()
        };
        let rays = sets.par_iter().map(rays_of).collect::<Vec<_>>().concat();
        let cells = sets.iter_mut().flat_map(|set| &mut set.cells);
        cells
            .zip(tracer.trace(&rays)?)
            .for_each(|(cell, result)| cell.result = self.narrowed(result));
        Ok(())
    }

    /// Light of a patch less that of rays at random places.
    pub(super) fn difference_of_even(&self, patch: &EvenPatch, cells: &[EvenCell]) -> LandedLight {
        let mut sums = self.light_of_even(patch);
        // Light at its place alone: a mask step may open a part of its cell.
        let piece = |(at, cell): (u32, &EvenCell)| {
            let x = f64::from(cell.ray[0]);
            Piece { interval: at, ..plain([x - 0.5 * NARROWEST, x + 0.5 * NARROWEST], cell.result) }
        };
        let pieces: Vec<Piece> = (0..).zip(cells).map(piece).collect();
        let part = |piece: &Piece| {
            let cell = &cells[piece.interval as usize];
            let [width, height] = [cell.x, cell.z].map(|[low, high]| f64::from(high - low));
            Part { z: [cell.ray[1].into(); 2], weight: -height * width / NARROWEST }
        };
        self.add_light([patch.beamlet, patch.row], &pieces, part, &mut sums);
        sums
    }
}
