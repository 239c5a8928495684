//! Rays that patches wait for, traced together so that the device gets many.

use super::{PatchWork, Refiner};
use crate::sampling::patch::Patch;
use crate::trace::Tracer;
use beamlet_core::{Result, numbers};
use beamlet_interface::{Ray, RayResult};
use rayon::prelude::*;

/// Rays of a patch that are wanted in rounds, each after the results of those before.
pub(in crate::sampling) trait Rounds {
    /// Places of the rays wanted next: m from the middle of the beamlet, share of the row.
    fn pending(&self) -> Vec<[f32; 2]>;

    /// Takes the results of the rays wanted.
    fn accept(&mut self, results: &[RayResult]);
}

impl Refiner<'_> {
    /// Traces the rays that patches wait for.
    pub(super) fn trace_pending(&self, tracer: &mut Tracer, work: &mut [PatchWork]) -> Result<()> {
        let places = |work: &PatchWork| -> Vec<[f32; 2]> {
            work.pending.iter().map(|node| work.patch.ray(*node)).collect()
        };
        let places: Vec<Vec<[f32; 2]>> = work.par_iter().map(places).collect();
        let patches = work.iter().map(|work| &work.patch).collect();
        let results = self.trace(tracer, patches, &places)?;
        for (work, own) in work.iter_mut().zip(&results) {
            for (node, result) in std::mem::take(&mut work.pending).into_iter().zip(own) {
                work.patch.set_result(node, result);
            }
            work.rays += numbers::count(own.len());
        }
        Ok(())
    }

    /// Traces rays of patches in rounds until none want more.
    pub(super) fn trace_rounds<R: Rounds + Send + Sync>(
        &self,
        tracer: &mut Tracer,
        work: &mut [(&mut PatchWork, R)],
    ) -> Result<()> {
        loop {
            let places: Vec<Vec<[f32; 2]>> =
                work.par_iter().map(|(_, rounds)| rounds.pending()).collect();
            if places.iter().all(Vec::is_empty) {
                return Ok(());
            }
            let patches = work.iter().map(|(work, _)| &work.patch).collect();
            let results = self.trace(tracer, patches, &places)?;
            for ((work, rounds), own) in work.iter_mut().zip(&results) {
                rounds.accept(own);
                work.rays += numbers::count(own.len());
            }
        }
    }

    /// Results of the rays through places of patches, by patch. All go to the device together.
    fn trace(
        &self,
        tracer: &mut Tracer,
        patches: Vec<&Patch>,
        places: &[Vec<[f32; 2]>],
    ) -> Result<Vec<Vec<RayResult>>> {
        let rays = |(patch, places): (&Patch, &Vec<[f32; 2]>)| -> Vec<Ray> {
            let ray = |[x, z]: &[f32; 2]| self.view.ray(patch.beamlet, patch.row, *x, *z);
            places.iter().map(ray).collect()
        };
        let rays: Vec<Vec<Ray>> = patches.into_par_iter().zip(places).map(rays).collect();
        let results = tracer.trace(&beamlet_core::parallel::concat(&rays))?;
        let mut rest = &results[..];
        let of_patch = |rays: &Vec<Ray>| {
            let (own, after) = rest.split_at(rays.len());
            rest = after;
            own.to_vec()
        };
        Ok(rays.iter().map(of_patch).collect())
    }
}
