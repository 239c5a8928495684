//! Adaptive refinement of patches: estimate, split where the error is, trace or sum over facets, until
//! every budget holds. All patches request their rays together, so that the device gets many.

mod borders;
mod even;
mod facets;
mod held;
mod slanting;

use super::base_lattice::BaseLattice;
use super::error_estimate::Estimator;
use super::facet_lists::FacetLists;
use super::facet_means::FacetMeans;
use super::landing_edges::LandingEdges;
use super::lattice::Lattice;
use super::lit_heights::LitHeights;
use super::narrow_components::NarrowComponents;
use super::patch::{Known, Patch, alike};
use super::patch_error::{KnownErrors, NarrowComponent, error_of_pieces};
use super::response::Opening;
use super::view_context::ViewContext;
use crate::trace::Tracer;
use beamlet_core::Result;
use beamlet_core::cancel::Cancel;
use beamlet_core::numbers::{self, single};
use beamlet_interface::{Ray, RayResult};
use held::Held;
pub(super) use held::{Refined, bytes_of};
use rayon::prelude::*;
use std::ops::Range;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Least width of a rectangle, m: coordinates in f32 are as coarse across a detector.
const LEAST_WIDTH: f64 = 2e-9;
/// Least width of a rectangle, fraction of the period: light at a silhouette is known no better.
const LEAST_SHARE: f64 = 2e-5;
/// Least width of a rectangle, fraction of the sampled width: two steps of f32 coordinates.
const COARSENESS: f64 = 2.4e-7;
/// Least height of a rectangle, rows.
const LEAST_HEIGHT: f32 = 1.0 / 8192.0;
/// Without a sample mask no opening bounds rectangles, and light of a rim goes far: patches with
/// silhouettes begin with this many times the columns. At a tolerance of 1e-3 the error of the rims of
/// a coarse ball is 0.35 of it without, and 0.15 with three (`--test sampling -- truth::`).
const COLUMNS_AT_RIMS: u32 = 3;

/// A patch in refinement.
#[derive(Debug)]
pub(super) struct PatchWork {
    pub(super) patch: Patch,
    narrow: Vec<NarrowComponent>,
    pub(crate) rays: u32,
    /// Estimated errors: of the recorded value that has the largest, share of open beam, and of the
    /// displacement, share of the budget.
    pub(crate) errors: [f64; 2],
    /// Nodes that were made last, which others are compared with.
    changed: Vec<u32>,
    /// Nodes that wait for the rays through their centres.
    pending: Vec<u32>,
    /// Pieces that wait for the rays through their centroids.
    pending_pieces: Vec<u32>,
    known_errors: KnownErrors,
    pub(crate) done: bool,
}

/// Rays of a patch that are wanted in rounds, each after the results of those before.
pub(super) trait Rounds {
    /// Places of the rays wanted next: m from the middle of the beamlet, share of the row.
    fn pending(&self) -> Vec<[f32; 2]>;

    /// Takes the results of the rays wanted.
    fn accept(&mut self, results: &[RayResult]);
}

/// Least width of a rectangle of a lattice, m.
fn least_width(lattice: &Lattice) -> f32 {
    let middle = 0.5 * (lattice.beamlets.end - lattice.beamlets.start) as f64;
    let coarse = COARSENESS * middle * lattice.period;
    single((LEAST_SHARE * lattice.period).max(coarse).min(LEAST_WIDTH))
}

/// Refines patches.
pub(super) struct Refiner<'a> {
    view: &'a ViewContext<'a>,
    pub(super) estimator: Estimator<'a>,
    facets: Option<(FacetLists<'a>, FacetMeans<'a>)>,
    narrow: NarrowComponents,
    recorded_rows: &'a Range<i64>,
}

impl<'a> Refiner<'a> {
    pub(super) fn new(
        view: &'a ViewContext<'a>,
        base: &'a BaseLattice,
        rows: &Range<i64>,
        narrow: NarrowComponents,
        recorded_rows: &'a Range<i64>,
    ) -> Self {
        let optics = view.optics;
        let detector = &optics.detector;
        let estimator = Estimator {
            response: view.response,
            budget: view.budget,
            base,
            first_beamlet: view.lattice.beamlets.start,
            least: [least_width(view.lattice), LEAST_HEIGHT],
            row_height: single(detector.pitch_at(1, view.lattice.plane)),
            row_pitch: single(detector.pitch[1]),
            row_blur: single(view.lattice.row_spread.blur),
            wide_blur: view.lattice.row_spread.is_wide(),
            heights: view.lattice.heights,
            lit_heights: LitHeights::of(optics, view.response.leak),
            landing_edges: LandingEdges::of(optics),
            gap: single(optics.gap()),
            other_energies: view.recording.is_some(),
            pieces: error_of_pieces(optics, view.budget.tolerance),
            by_rays_alone: view.facets.by_rays_alone,
            recorded_rows: view.recorded_rows(),
            detector_rows: 0..i64::from(detector.pixels[1]),
        };
        let facets = FacetLists::new(view, rows)
            .map(|lists| (lists, FacetMeans::new(view, &view.facets.steps)));
        Self { view, estimator, facets, narrow, recorded_rows }
    }

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
        let mut work = PatchWork {
            narrow,
            rays: numbers::count(results.len()),
            errors: [0.0; 2],
            changed: Vec::new(),
            pending: Vec::new(),
            pending_pieces: Vec::new(),
            known_errors: KnownErrors::default(),
            done: false,
            patch,
        };
        self.take_facets(&mut work);
        Some(work)
    }

    fn openings(&self, patch: &Patch) -> Vec<Opening> {
        self.view.response.openings(self.estimator.column(patch.beamlet))
    }

    /// Patches with their base rays, and the slants of their silhouettes.
    pub(super) fn begin_all(
        &self,
        tracer: &mut Tracer,
        patches: &[(i64, i64)],
    ) -> Result<Vec<PatchWork>> {
        let begun = patches.par_iter().filter_map(|at| self.begin(*at));
        let mut work: Vec<PatchWork> = begun.collect();
        self.align(tracer, &mut work)?;
        if self.estimator.by_rays_alone {
            work.par_iter_mut().for_each(|work| self.look_at_facets(work));
        }
        self.look_along_borders(tracer, &mut work)?;
        Ok(work)
    }

    /// Number of the facets of a patch that means may be taken over.
    pub(super) fn facets_of(&self, (beamlet, row): (i64, i64)) -> usize {
        self.facets.as_ref().map_or(0, |(lists, _)| lists.count(beamlet, row))
    }

    /// True if a silhouette of the facets of a patch crosses it.
    pub(super) fn has_silhouette(&self, (beamlet, row): (i64, i64)) -> bool {
        self.facets.as_ref().is_none_or(|(lists, _)| lists.has_silhouette(beamlet, row))
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

    /// Traces the rays that patches wait for.
    fn trace_pending(&self, tracer: &mut Tracer, work: &mut [PatchWork]) -> Result<()> {
        let places = |work: &PatchWork| -> Vec<[f32; 2]> {
            let of_piece = |piece: &u32| work.patch.pieces[*piece as usize].centroid;
            let rays = work.pending.iter().map(|node| work.patch.ray(*node));
            rays.chain(work.pending_pieces.iter().map(of_piece)).collect()
        };
        let places: Vec<Vec<[f32; 2]>> = work.par_iter().map(places).collect();
        let patches = work.iter().map(|work| &work.patch).collect();
        let results = self.trace(tracer, patches, &places)?;
        for (work, own) in work.iter_mut().zip(&results) {
            let (of_nodes, of_pieces) = own.split_at(work.pending.len());
            for (node, result) in std::mem::take(&mut work.pending).into_iter().zip(of_nodes) {
                work.patch.set_result(node, result);
            }
            for (piece, result) in
                std::mem::take(&mut work.pending_pieces).into_iter().zip(of_pieces)
            {
                work.patch.pieces[piece as usize].result = *result;
            }
            work.rays += numbers::count(own.len());
        }
        Ok(())
    }

    /// Traces rays of patches in rounds until none want more.
    fn trace_rounds<R: Rounds + Send + Sync>(
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

    /// Refines patches until several hold more than `most` rectangles together or any would hold more
    /// than `bytes`. `advance` gets how many are done.
    pub(super) fn refine(
        &self,
        tracer: &mut Tracer,
        work: &mut [PatchWork],
        (most, bytes): (usize, u64),
        advance: &mut dyn FnMut(&Tracer, usize),
    ) -> Result<Refined> {
        let most = if work.len() > 1 { most } else { usize::MAX };
        let cancel = tracer.cancel().clone();
        let rectangles = AtomicUsize::new(work.iter().map(|work| work.patch.size()).sum());
        loop {
            let held = Held::new(work, bytes);
            let undone = work.par_iter_mut().filter(|work| !work.done);
            undone.for_each(|work| self.accept_or_split(work, (&rectangles, most), &held, &cancel));
            cancel.check()?;
            let done = work.iter().filter(|work| work.done).count();
            advance(tracer, done);
            if done == work.len() {
                return Ok(Refined::Done);
            }
            match held.full() {
                0 if rectangles.load(Ordering::Relaxed) > most => return Ok(Refined::Crowded),
                0 => self.trace_pending(tracer, work)?,
                full => return Ok(Refined::Full(full)),
            }
        }
    }

    /// Judges a patch and splits the rectangles that it is wrong in, until it needs rays or all
    /// patches together have `most` of them.
    fn accept_or_split(
        &self,
        work: &mut PatchWork,
        (rectangles, most): (&AtomicUsize, usize),
        held: &Held,
        cancel: &Cancel,
    ) {
        while work.pending.is_empty()
            && work.pending_pieces.is_empty()
            && !work.done
            && rectangles.load(Ordering::Relaxed) <= most
            && !cancel.is_cancelled()
        {
            let before = [work.patch.size() as u64, bytes_of(std::slice::from_ref(work))];
            if !self.split_once(work, held) {
                return;
            }
            let after = [work.patch.size() as u64, bytes_of(std::slice::from_ref(work))];
            let [size, bytes] = [0, 1].map(|i: usize| after[i].saturating_sub(before[i]));
            rectangles.fetch_add(numbers::length(size), Ordering::Relaxed);
            held.add(bytes);
        }
    }

    /// Splits a patch once, begins even rays or marks it as done; false if memory has no room.
    fn split_once(&self, work: &mut PatchWork, held: &Held) -> bool {
        // Not kept: of many patches with many steps they would take more than all else.
        let openings = self.openings(&work.patch);
        let PatchWork { patch, narrow, known_errors, .. } = work;
        // Errors of neighbours of new rectangles are found anew.
        for node in std::mem::take(&mut work.changed) {
            let node = &patch.nodes[node as usize];
            self.estimator.leaves_beside(patch, node).for_each(|leaf| known_errors.forget(leaf));
        }
        let crossed = self.has_silhouette((patch.beamlet, patch.row));
        let error = self.estimator.patch_error(patch, crossed, &openings, narrow, known_errors);
        work.errors = [error.light, error.displacement];
        let most = self.view.budget.max_rays;
        let left = most.saturating_sub(work.rays.max(2 * work.patch.splits)) / 2;
        if let Some(needed) = error.even {
            return self.begin_even(work, needed, &openings, held);
        }
        if error.splits.is_empty() || left == 0 {
            work.done = true;
            return true;
        }
        if !held.takes(error.splits.len().min(left as usize)) {
            return false;
        }
        // Rays in the order of x: neighbours cross the same triangles.
        let mut splits = error.splits;
        splits.truncate(left as usize);
        let place = |node: u32| work.patch.nodes[node as usize].x[0];
        splits.sort_unstable_by(|a, b| place(a.0).total_cmp(&place(b.0)).then(a.0.cmp(&b.0)));
        for (node, axis) in splits {
            let mean = matches!(work.patch.nodes[node as usize].known, Known::Mean(_));
            let dissected =
                if mean { self.dissect_mean(work, node) } else { self.dissect(work, node) };
            if dissected {
                work.patch.splits += 1;
                work.known_errors.forget(node);
                continue;
            }
            let parent = work.patch.nodes[node as usize].known;
            for (number, part) in work.patch.split(node, axis).enumerate() {
                let dissected = matches!(parent, Known::Pieces(_)) && self.dissect(work, part);
                let known = dissected || self.take_mean(work, part);
                // The middle part keeps the ray.
                let keeps = number == 1 && matches!(parent, Known::Ray(_));
                if !known && !keeps {
                    work.pending.push(part);
                }
                // Parts of a mean say little that it did not.
                if matches!(parent, Known::Ray(_)) {
                    work.changed.push(part);
                }
            }
        }
        true
    }
}
