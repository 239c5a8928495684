//! Results from facets: means and pieces in place of rays, or bounds between rays.

use super::super::patch::{Node, Patch, Rule};
use super::super::patch_error::KnownErrors;
use super::{COLUMNS_AT_RIMS, PatchWork, Refiner};
use beamlet_core::numbers;

/// Error of a mean, as a fraction of its light, above which the rectangle is cut into pieces: outlines of
/// pieces err by about as much.
const LEAST_ERROR_OF_PIECES: f32 = 0.02;
/// Largest number of its facets.
const MOST_FACETS_OF_PIECES: usize = 12;
/// Largest error of the pieces, as a fraction of its error.
const GAIN_OF_PIECES: f32 = 0.5;

impl Refiner<'_> {
    /// Lets means over facets take the place of rays in a patch that has not been split, unless
    /// its rays are enough.
    pub(super) fn take_facets(&self, work: &mut PatchWork) {
        let Some((lists, _)) = &self.facets else { return };
        if self.estimator.by_rays_alone {
            return;
        }
        let Patch { beamlet, row, .. } = work.patch;
        let silhouette = lists.has_silhouette(beamlet, row);
        if !silhouette {
            work.narrow.clear();
            let error = self.estimator.patch_error(
                &work.patch,
                silhouette,
                &self.openings(&work.patch),
                &[],
                &mut work.known_errors,
            );
            if error.splits.is_empty() {
                (work.errors, work.done) = ([error.light, error.displacement], true);
                return;
            }
        }
        let Some(facets) = lists.facets(beamlet, row) else { return };
        work.narrow.clear();
        work.known_errors = KnownErrors::default();
        let column = self.estimator.column(beamlet);
        let [cells, lines] = self.estimator.base.base;
        let rim = silhouette && self.view.optics.sample_mask.is_none();
        let finer = if rim { COLUMNS_AT_RIMS } else { 1 };
        let borders = self.view.response.edges(column, finer * cells);
        work.patch = Patch::slabs(beamlet, row, borders, lines);
        work.patch.set_facets(facets);
        for node in 0..numbers::count(work.patch.nodes.len()) {
            if !self.take_mean(work, node) {
                work.pending.push(node);
            }
        }
    }

    /// Bounds the space between the rays of a patch by its facets; slanting patches are skipped.
    pub(super) fn look_at_facets(&self, work: &mut PatchWork) {
        let Patch { beamlet, row, shear, .. } = work.patch;
        let Some((lists, _)) = &self.facets else { return };
        let Some(facets) = lists.facets(beamlet, row).filter(|_| shear.abs() <= 0.0) else {
            return;
        };
        work.patch.set_facets(facets);
        work.known_errors = KnownErrors::default();
        for node in 0..numbers::count(work.patch.nodes.len()) {
            self.take_mean(work, node);
        }
    }

    /// Sets the result of a rectangle to the mean over its facets, or cuts it into pieces. With rays
    /// alone it bounds the space between them.
    pub(super) fn take_mean(&self, work: &mut PatchWork, node: u32) -> bool {
        let Some((_, means)) = &self.facets else { return false };
        let patch = &mut work.patch;
        if patch.facets.is_none() {
            return false;
        }
        let Node { x, z, .. } = patch.nodes[node as usize];
        let mean = means.over(patch, patch.facets_of(node), x, z);
        patch.set_mean(node, &mean, self.estimator.by_rays_alone) || self.dissect(work, node)
    }

    /// Cuts a rectangle into the pieces that its facets make of it, where they are few and it is
    /// not known by them yet. Pieces that need rays wait for them.
    pub(super) fn dissect(&self, work: &mut PatchWork, node: u32) -> bool {
        let Some((_, means)) = &self.facets else { return false };
        let patch = &mut work.patch;
        let Node { x, z, rule, .. } = patch.nodes[node as usize];
        if patch.facets.is_none()
            || self.estimator.by_rays_alone
            || matches!(rule, Rule::Overlay(_))
        {
            return false;
        }
        let Some(pieces) = means.pieces(patch, patch.facets_of(node), x, z) else { return false };
        let first = numbers::count(patch.pieces.len());
        patch.set_pieces(node, &pieces);
        let by_ray = (first..).zip(&pieces).filter(|(_, piece)| piece.by_ray);
        work.pending_pieces.extend(by_ray.map(|(number, _)| number));
        true
    }

    /// Cuts a rectangle that is known as a mean into its pieces, where that errs less.
    pub(super) fn dissect_mean(&self, work: &mut PatchWork, node: u32) -> bool {
        let error = self.estimator.cell_error(&work.patch, node);
        let facets = work.patch.facets_of(node).len();
        if error.light * error.whole < LEAST_ERROR_OF_PIECES * error.through
            || facets > MOST_FACETS_OF_PIECES
        {
            return false;
        }
        let before = work.patch.nodes[node as usize];
        let waiting = work.pending_pieces.len();
        let pieces = work.patch.pieces.len();
        if !self.dissect(work, node) {
            return false;
        }
        let own = self.estimator.cell_error(&work.patch, node);
        let less = own.light < error.light
            && own.light * own.whole < GAIN_OF_PIECES * error.light * error.whole;
        if !less {
            work.patch.nodes[node as usize] = before;
            work.patch.pieces.truncate(pieces);
            work.pending_pieces.truncate(waiting);
        }
        less
    }
}
