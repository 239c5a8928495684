//! Adaptive quadrature of patches, as hcubature does it:
//! 1. [`Refiner::judge`] estimates the error of each rectangle, by its [`Rule`].
//! 2. A patch is done when the sums of errors are within the budget ([`Refiner::turn`]).
//! 3. Otherwise [`Refiner::split`] splits the rectangles with the largest errors. Repeat.
//!
//! All patches request their rays together, so that the device gets many ([`Refiner::refine`]).

mod begin;
mod borders;
mod even;
mod held;
mod rays;
mod slanting;

use super::base_lattice::BaseLattice;
use super::edges_along_z::EdgesAlongZ;
use super::error_estimate::Estimator;
use super::lattice::Lattice;
use super::lit_heights::LitHeights;
use super::narrow_components::NarrowComponents;
use super::patch::{Axis, Patch};
use super::patch_error::{KnownErrors, NarrowComponent, PatchError};
use super::response::Opening;
use super::view_context::ViewContext;
use crate::trace::Tracer;
use beamlet_core::Result;
use beamlet_core::cancel::Cancel;
use beamlet_core::numbers::{self, single};
use held::Held;
pub(super) use held::{Refined, bytes_of};
use rayon::prelude::*;
pub(super) use rays::Rounds;
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
    known_errors: KnownErrors,
    pub(crate) done: bool,
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
    narrow: NarrowComponents,
    recorded_rows: &'a Range<i64>,
}

impl<'a> Refiner<'a> {
    pub(super) fn new(
        view: &'a ViewContext<'a>,
        base: &'a BaseLattice,
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
            heights: view.lattice.heights,
            lit_heights: LitHeights::of(optics, view.response.list),
            landing_edges: EdgesAlongZ::landing(optics),
            gap: single(optics.gap()),
            other_energies: view.recording.is_some(),
            is_exact: view.facets.is_exact,
            recorded_rows: view.recorded_rows(),
            detector_rows: 0..i64::from(detector.pixels[1]),
        };
        Self { view, estimator, narrow, recorded_rows }
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

    /// Takes turns with a patch until it needs rays or all patches together have `most` rectangles.
    fn accept_or_split(
        &self,
        work: &mut PatchWork,
        (rectangles, most): (&AtomicUsize, usize),
        held: &Held,
        cancel: &Cancel,
    ) {
        while work.pending.is_empty()
            && !work.done
            && rectangles.load(Ordering::Relaxed) <= most
            && !cancel.is_cancelled()
        {
            let before = [work.patch.size() as u64, bytes_of(std::slice::from_ref(work))];
            if !self.turn(work, held) {
                return;
            }
            let after = [work.patch.size() as u64, bytes_of(std::slice::from_ref(work))];
            let [size, bytes] = [0, 1].map(|i: usize| after[i].saturating_sub(before[i]));
            rectangles.fetch_add(numbers::length(size), Ordering::Relaxed);
            held.add(bytes);
        }
    }

    /// Estimates the errors of a patch. It is done if they are within the budget; else its rectangles with the
    /// largest errors are split, or all replaced by evenly spread rays. False if memory has no room.
    fn turn(&self, work: &mut PatchWork, held: &Held) -> bool {
        // Not kept: of many patches with many steps they would take more than all else.
        let openings = self.openings(&work.patch);
        let error = self.judge(work, &openings);
        work.errors = [error.light, error.displacement];
        let most = self.view.budget.max_rays;
        let left = most.saturating_sub(work.rays.max(2 * work.patch.splits)) / 2;
        if let Some(needed) = error.even {
            return self.begin_even(work, needed, &openings, held);
        }
        let mut splits = error.splits;
        splits.truncate(left as usize);
        work.done = splits.is_empty();
        let fits = work.done || held.takes(splits.len());
        if fits {
            self.split(work, splits);
        }
        fits
    }

    /// Errors of a patch. Errors of neighbours of new rectangles are estimated anew.
    fn judge(&self, work: &mut PatchWork, openings: &[Opening]) -> PatchError {
        let PatchWork { patch, narrow, known_errors, .. } = work;
        for node in std::mem::take(&mut work.changed) {
            let node = &patch.nodes[node as usize];
            self.estimator.leaves_beside(patch, node).for_each(|leaf| known_errors.forget(leaf));
        }
        self.estimator.patch_error(patch, openings, narrow, known_errors)
    }

    /// Splits rectangles along these axes, in three.
    fn split(&self, work: &mut PatchWork, mut splits: Vec<(u32, Axis)>) {
        // Rays in the order of x: neighbours cross the same triangles.
        let place = |node: u32| work.patch.nodes[node as usize].x[0];
        splits.sort_unstable_by(|a, b| place(a.0).total_cmp(&place(b.0)).then(a.0.cmp(&b.0)));
        for (node, axis) in splits {
            for (number, part) in work.patch.split(node, axis).enumerate() {
                // The middle part keeps the ray.
                if number != 1 {
                    work.pending.push(part);
                }
                work.changed.push(part);
            }
        }
    }
}
