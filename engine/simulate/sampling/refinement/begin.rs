//! Patches before their first estimate: base rays, slants of silhouettes, rays along borders.

use super::{PatchWork, Refiner};
use crate::sampling::patch::{Patch, alike};
use crate::sampling::patch_error::KnownErrors;
use crate::sampling::response::Opening;
use crate::trace::Tracer;
use beamlet_core::Result;
use beamlet_core::numbers::{self, single};
use rayon::prelude::*;

impl Refiner<'_> {
    /// A patch with its base rays; nothing where no light of it can reach the recorded rows.
    fn begin(&self, (beamlet, row): (i64, i64)) -> Option<PatchWork> {
        let base = self.estimator.base;
        let results = base.patch(beamlet, row)?;
        let period = single(self.view.lattice.period);
        let patch = Patch::new(beamlet, row, period, base.base, results);
        let narrow = self.narrow.of(beamlet, row).to_vec();
        if narrow.is_empty() && self.cannot_reach(&patch) {
            return None;
        }
        Some(PatchWork {
            narrow,
            rays: numbers::count(results.len()),
            errors: [0.0; 2],
            changed: Vec::new(),
            pending: Vec::new(),
            known_errors: KnownErrors::default(),
            done: false,
            patch,
        })
    }

    pub(super) fn openings(&self, patch: &Patch) -> Vec<Opening> {
        self.view.response.openings(self.estimator.column(patch.beamlet))
    }

    /// Patches with their base rays, and the slants of their silhouettes.
    pub(in crate::sampling) fn begin_all(
        &self,
        tracer: &mut Tracer,
        patches: &[(i64, i64)],
    ) -> Result<Vec<PatchWork>> {
        let begun = patches.par_iter().filter_map(|at| self.begin(*at));
        let mut work: Vec<PatchWork> = begun.collect();
        self.align(tracer, &mut work)?;
        self.look_along_borders(tracer, &mut work)?;
        Ok(work)
    }

    /// True if a patch outside the recorded rows is seen to send no light into them: no silhouette there or
    /// beside it, and no ray that lands half as far off.
    fn cannot_reach(&self, patch: &Patch) -> bool {
        let row = patch.row;
        if self.recorded_rows.contains(&row) {
            return false;
        }
        let first = &patch.nodes[0].result;
        let smooth = patch.nodes.iter().all(|node| {
            let neighbours = self.estimator.neighbours(patch, node);
            neighbours.iter().flatten().all(|found| alike(&found.result, first))
        });
        let reach = patch.nodes.iter().map(|node| node.result.landing_z(self.estimator.gap).abs());
        let rows = f64::from(2.0 * reach.fold(0.0, f32::max) / self.estimator.row_pitch);
        let rows = numbers::whole::<i64>((rows * self.view.delta_ratio()).ceil());
        smooth && (row + rows < self.recorded_rows.start || row - rows >= self.recorded_rows.end)
    }
}
