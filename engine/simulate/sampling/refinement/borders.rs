//! Rays along the borders of patches: a body that enters through a corner lies between all other rays.

use super::{PatchWork, Refiner, Rounds};
use crate::sampling::patch::{Patch, Witness, no_silhouette_between};
use crate::sampling::unresolved::cross_many;
use crate::trace::Tracer;
use beamlet_core::Result;
use beamlet_core::numbers::single;
use beamlet_interface::RayResult;
use rayon::prelude::*;

/// Rays along each border.
const ALONG: u16 = 16;
/// Bisections of an interval between two rays that crossed different surfaces.
const HALVINGS: u32 = 6;
/// Within the border, parts of the patch.
const INSIDE: f32 = 1e-6;
/// Axis of each border, and the coordinate across it, fractions of the patch.
const BORDERS: [(usize, f32); 4] = [(0, INSIDE), (0, 1.0 - INSIDE), (1, INSIDE), (1, 1.0 - INSIDE)];

/// Rays along the borders of a patch, in the order of the place along each.
struct BorderRays {
    period: f32,
    /// Part of the border, and the result.
    rays: [Vec<(f32, RayResult)>; 4],
    /// Border, and the part of it.
    pending: Vec<(usize, f32)>,
    halvings: u32,
}

impl BorderRays {
    fn new(period: f32) -> Self {
        let along = |index: u16| (f32::from(index) + 0.5) / f32::from(ALONG);
        let pending = (0..4).flat_map(|border| (0..ALONG).map(move |i| (border, along(i))));
        Self { period, rays: Default::default(), pending: pending.collect(), halvings: 0 }
    }

    /// The place of a ray: m from the middle of the beamlet, share of the row.
    fn place(&self, border: usize, part: f32) -> [f32; 2] {
        let (axis, across) = BORDERS[border];
        let mut place = [across; 2];
        place[axis] = part;
        [self.period * (place[0] - 0.5), place[1]]
    }

    /// Rays that crossed other surfaces than the rectangles that contain them, and rays on both sides of
    /// a silhouette at a border: rectangles split there may differ from them.
    fn witnesses(&self, patch: &Patch) -> Vec<Witness> {
        let mut witnesses = Vec::new();
        for (border, rays) in self.rays.iter().enumerate() {
            let mut before: Option<&RayResult> = None;
            for (index, (part, result)) in rays.iter().enumerate() {
                let after = rays.get(index + 1).map(|ray| &ray.1);
                let at = patch.coordinates(self.place(border, *part));
                let leaf = &patch.nodes[patch.leaf_at(at[0], at[1]) as usize];
                let unlike = |other: &RayResult| !no_silhouette_between(other, result);
                let near = before.is_some_and(unlike) || after.is_some_and(unlike);
                if patch.holds(at) && (near || unlike(&leaf.result)) {
                    witnesses.push(Witness { at, result: *result });
                }
                before = Some(result);
            }
        }
        witnesses
    }
}

impl Rounds for BorderRays {
    fn pending(&self) -> Vec<[f32; 2]> {
        self.pending.iter().map(|(border, part)| self.place(*border, *part)).collect()
    }

    /// Halves the intervals where a silhouette crosses a border, too.
    fn accept(&mut self, results: &[RayResult]) {
        for ((border, part), result) in std::mem::take(&mut self.pending).into_iter().zip(results) {
            let rays = &mut self.rays[border];
            let at = rays.partition_point(|ray| ray.0 < part);
            rays.insert(at, (part, *result));
        }
        if self.halvings == HALVINGS {
            return;
        }
        self.halvings += 1;
        for (border, rays) in self.rays.iter().enumerate() {
            let crossed =
                rays.windows(2).filter(|pair| !no_silhouette_between(&pair[0].1, &pair[1].1));
            self.pending.extend(crossed.map(|pair| (border, 0.5 * (pair[0].0 + pair[1].0))));
        }
    }
}

impl Refiner<'_> {
    /// True if a silhouette lies in a patch or beside it, according to base rays. If they cross many
    /// surfaces, bodies are everywhere.
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

    /// Traces rays along the borders of patches near silhouettes that only rays know. Each that crossed
    /// other surfaces than its rectangle is a witness.
    pub(super) fn look_along_borders(
        &self,
        tracer: &mut Tracer,
        work: &mut [PatchWork],
    ) -> Result<()> {
        let period = single(self.view.lattice.period);
        let mut near: Vec<(&mut PatchWork, BorderRays)> = work
            .par_iter_mut()
            .filter(|work| !work.done)
            .filter(|work| self.is_near_silhouette(&work.patch))
            .map(|work| (work, BorderRays::new(period)))
            .collect();
        self.trace_rounds(tracer, &mut near)?;
        near.par_iter_mut()
            .for_each(|(work, borders)| work.patch.witnesses = borders.witnesses(&work.patch));
        Ok(())
    }
}
