//! Rays at random places of the cells of a patch of evenly spread rays.

use super::super::even::{EvenCell, EvenPatch};
use super::super::line::{NARROWEST, Piece};
use super::{Auditor, LandedLight};
use crate::trace::Tracer;
use beamlet_core::Result;
use beamlet_core::numbers::single;
use beamlet_core::random::Draws;
use beamlet_interface::{Ray, RayResult};
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
    /// Its cells with rays at random places, in the order in which they are traced.
    pub(super) fn random_cells(&self, patch: &EvenPatch, draws: &mut Draws) -> Vec<EvenCell> {
        let within = |[low, high]: [f32; 2], share: f64| low + (high - low) * single(share);
        let cell = |cell: EvenCell| {
            let [x, z] = draws.pair();
            EvenCell { ray: [within(cell.x, x), within(cell.z, z)], ..cell }
        };
        let cells: Vec<EvenCell> = patch.cells().map(cell).collect();
        patch.traced().map(|index| cells[index as usize]).collect()
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

    /// Light of a patch less that of rays at random places of its cells, at these places.
    pub(super) fn difference_of_even(&self, patch: &EvenPatch, cells: &[EvenCell]) -> LandedLight {
        let part = |cell: &EvenCell, result: RayResult, sign: f64| {
            let [x, z] = cell.ray.map(f64::from);
            let piece = Piece::plain([x - 0.5 * NARROWEST, x + 0.5 * NARROWEST], result);
            let [width, height] = [cell.x, cell.z].map(|[low, high]| f64::from(high - low));
            self.part(&piece, z, sign * height * width / NARROWEST)
        };
        let own = patch.traced().map(|index| patch.cell(index)).zip(cells);
        let own = own.map(|(own, cell)| part(cell, self.narrowed(own.result), 1.0));
        let fresh = cells.iter().map(|cell| part(cell, cell.result, -1.0));
        let mut sums = self.no_light();
        self.add_light(
            [patch.beamlet, patch.row],
            &own.chain(fresh).collect::<Vec<_>>(),
            &mut sums,
        );
        sums
    }
}
