//! Rays along the borders of patches: a body that enters by a corner stands between all others.

use super::{PatchWork, Refiner};
use crate::Result;
use crate::numbers::{self, single};
use crate::sampling::patch::{Patch, Witness, no_silhouette_between};
use crate::sampling::unresolved::cross_many;
use crate::trace::Tracer;
use rayon::prelude::*;

/// Rays along each border.
const ALONG: u16 = 16;
/// Within the border, parts of the patch.
const INSIDE: f32 = 1e-6;

/// Places of the rays along the borders of a patch: m from the middle of its beamlet, share of the row.
fn places(period: f32) -> Vec<[f32; 2]> {
    let ends = [INSIDE, 1.0 - INSIDE];
    let all = (0..ALONG).flat_map(|index| {
        let along = (f32::from(index) + 0.5) / f32::from(ALONG);
        ends.into_iter().flat_map(move |end| [[along, end], [end, along]])
    });
    all.map(|[x, z]| [period * (x - 0.5), z]).collect()
}

impl Refiner<'_> {
    /// Whether a silhouette stands in a patch or beside it, as far as base rays tell. Where they cross many
    /// surfaces, bodies stand everywhere.
    fn is_near_silhouette(&self, patch: &Patch) -> bool {
        let base = self.estimator.base;
        let Some(own) = base.patch(patch.beamlet, patch.row) else { return false };
        let Some(first) = own.first() else { return false };
        if cross_many(own.iter()) {
            return false;
        }
        let mut around = (-1..=1).flat_map(|row| (-1..=1).map(move |beamlet| (beamlet, row)));
        around.any(|(beamlet, row)| match base.patch(patch.beamlet + beamlet, patch.row + row) {
            Some(results) => results.iter().any(|it| !no_silhouette_between(it, first)),
            None => first.crossings > 0,
        })
    }

    /// Traces rays along the borders of patches near silhouettes that rays alone know. Each that met other
    /// surfaces than the rectangle that it stands in is a witness.
    pub(super) fn look_along_borders(
        &self,
        tracer: &mut Tracer,
        work: &mut [PatchWork],
    ) -> Result<()> {
        let period = single(self.view.lattice.period);
        let mut near: Vec<&mut PatchWork> = work
            .par_iter_mut()
            .filter(|work| !work.done && work.patch.facets.is_none())
            .filter(|work| self.is_near_silhouette(&work.patch))
            .collect();
        let places = vec![places(period); near.len()];
        let patches = near.iter().map(|work| &work.patch).collect();
        let results = self.trace(tracer, patches, &places)?;
        near.par_iter_mut().zip(&places).zip(&results).for_each(|((work, places), results)| {
            work.rays += numbers::count(results.len());
            let patch = &work.patch;
            let witness = |(place, result): (&[f32; 2], _)| {
                let at = patch.coordinates(*place);
                let leaf = &patch.nodes[patch.leaf_at(at[0], at[1]) as usize];
                let unlike = patch.holds(at) && !no_silhouette_between(&leaf.result, result);
                unlike.then_some(Witness { at, result: *result })
            };
            let witnesses = places.iter().zip(results).filter_map(witness).collect();
            work.patch.witnesses = witnesses;
        });
        Ok(())
    }
}
