//! Error of one rectangle of a patch, represented by one ray (`ray_error.rs`): the result is linear, with slopes from
//! its neighbours. Its error is the largest change of recorded light if the rectangle were like a neighbour, times
//! 1 / sqrt(12), the standard deviation of a place spread evenly over a step. Errors of rectangles add as independent
//! ones.

use super::base_lattice::BaseLattice;
use super::edges_along_z::EdgesAlongZ;
use super::error_budget::ErrorBudget;
use super::lit_heights::LitHeights;
use super::patch::{Axis, Node, Patch};
use super::response::Response;
use super::row_spread::RowSpread;
use beamlet_core::numbers::single;
use beamlet_interface::RayResult;
use std::ops::Range;

/// Errors of rows beside the detector add to the errors of its rows; they must be smaller by this factor.
const BESIDE: f32 = 4.0;
/// Weight of the errors of a patch below which its rectangles do not slant as its silhouettes do.
const LITTLE: f32 = 0.25;
/// Share of the light at a silhouette that may land in recorded rows from outside.
pub(super) const THROWN: f32 = 0.05;
/// Standard deviation of a place spread evenly over an interval, share of the interval.
pub(super) const SPREAD: f32 = 0.288_675_13;

/// Error of one rectangle, for a mask step that opens all of it.
#[derive(Debug, Clone, Copy)]
pub(super) struct CellError {
    pub(crate) node: u32,
    /// Error of the recorded light, share of open beam.
    pub(crate) light: f32,
    /// Part of it by light that crosses a border of the row.
    pub(crate) over: f32,
    /// Light that passes the sample times the error of its displacement, m.
    pub(crate) moment: f32,
    /// Light that passes the sample, share of open beam.
    pub(crate) through: f32,
    /// Part of its height that the sample mask opens, at most.
    pub(crate) height: f32,
    /// A silhouette crosses it, or a neighbour crossed other objects.
    pub(crate) silhouette: bool,
    pub(crate) axis: Axis,
    /// Errors and variance by its neighbours, where its ray draws normals.
    pub(crate) draws: Option<Draws>,
}

impl CellError {
    /// Reduces light and errors to this share. The error by light that crosses a border is the change of
    /// one row already: it counts in full where the border is one of the `detector`.
    fn weigh(&mut self, share: f32, detector: bool) {
        self.light *= share;
        if detector {
            self.light = self.light.max(self.over);
        }
        self.moment *= share;
        self.through *= share;
        if let Some(draws) = &mut self.draws {
            draws.area *= share;
            draws.others *= share;
        }
    }
}

/// A rectangle whose ray draws its normals at a rough surface.
#[derive(Debug, Clone, Copy)]
pub(super) struct Draws {
    /// Its light without the sample, share of open beam.
    pub(super) area: f32,
    /// Error by neighbours that do not draw, share of open beam.
    pub(super) others: f32,
    /// Mean variance of the light of a ray among its neighbours that draw, share of its light
    /// squared; nothing where it has none.
    pub(super) variance: Option<f32>,
}

/// Judges the patches of a view.
#[derive(Debug)]
pub(super) struct Estimator<'a> {
    pub(super) response: &'a Response,
    pub(super) budget: ErrorBudget,
    pub(super) base: &'a BaseLattice,
    /// First beamlet of the lattice.
    pub(super) first_beamlet: i64,
    /// Least width (m) and height (rows) of a rectangle.
    pub(super) least: [f32; 2],
    /// Height of a row in the cell plane, m: what counts as square.
    pub(super) row_height: f32,
    /// Row pitch on the detector, m, and distance from analyser to detector, m.
    pub(super) row_pitch: f32,
    pub(super) gap: f32,
    /// Standard deviation of the blur over rows, rows.
    pub(super) row_blur: f32,
    /// Apertures of masks end along z.
    pub(super) heights: bool,
    /// Apertures of the sample mask along z.
    pub(super) lit_heights: Option<LitHeights>,
    /// Edges of the detector mask along z.
    pub(super) landing_edges: Option<EdgesAlongZ>,
    /// True if cells serve several energies, whose displacements differ.
    pub(super) other_energies: bool,
    /// Rays are traced exactly.
    pub(super) is_exact: bool,
    /// Rows whose light may be recorded.
    pub(super) recorded_rows: Range<i64>,
    /// Rows of the detector.
    pub(super) detector_rows: Range<i64>,
}

impl Estimator<'_> {
    /// Column of a beamlet in the lattice.
    pub(super) fn column(&self, beamlet: i64) -> usize {
        usize::try_from(beamlet - self.first_beamlet).unwrap_or(0)
    }

    pub(super) fn cell_error(&self, patch: &Patch, index: u32) -> CellError {
        let node = &patch.nodes[index as usize];
        let mut error = self.ray_error(patch, index);
        if let Some(lit) = &self.lit_heights {
            error.height = lit.open(patch.row, node.z);
        }
        if !self.counts_in_full(patch.row) {
            let least = if error.silhouette { THROWN } else { 0.0 };
            let detector = self.may_enter(patch.row, node);
            error.weigh(self.weight_beside(patch, node).max(least), detector);
        }
        error
    }

    /// True if errors of a patch beside the detector count so little that its rectangles need no care.
    pub(super) fn counts_little(&self, patch: &Patch) -> bool {
        !self.counts_in_full(patch.row)
            && patch.nodes.iter().all(|node| self.weight_beside(patch, node) <= LITTLE)
    }

    /// True if light of a rectangle, or of one of its height beside it, crosses a border of the detector.
    fn may_enter(&self, row: i64, node: &Node) -> bool {
        let (down, height) = (self.down(&node.result), node.height());
        let lands = [node.z[0] + down - height, node.z[1] + down + height];
        let rows = &self.detector_rows;
        [rows.start, rows.end].iter().any(|border| {
            let border = (border - row) as f32;
            lands[0] <= border && border <= lands[1]
        })
    }

    /// Weight of the error of a rectangle beside the detector.
    fn weight_beside(&self, patch: &Patch, node: &Node) -> f32 {
        let of = |result: &RayResult| self.weight(patch.row, node.z, self.down(result));
        let neighbours = self.neighbours(patch, node);
        let beside = neighbours.iter().flatten().map(|found| of(&found.result));
        beside.fold(of(&node.result), f32::max)
    }

    /// Share of the light that passes the sample along a ray.
    pub(super) fn light(&self, result: &RayResult) -> f32 {
        self.response.hardening.light(result.optical_depth)
    }

    /// How far light lands below its place, rows.
    pub(super) fn down(&self, result: &RayResult) -> f32 {
        -result.landing_z(self.gap) / self.row_pitch
    }

    /// True if all light of a row counts: in rows of the detector, and where the effect of other energies
    /// is not known.
    fn counts_in_full(&self, row: i64) -> bool {
        self.other_energies || self.detector_rows.contains(&row)
    }

    /// Weight of errors of the light of these heights of a row that lands `down` rows below its place:
    /// from rows beside the detector [`BESIDE`] times the share that lands in it.
    pub(super) fn weight(&self, row: i64, [top, bottom]: [f32; 2], down: f32) -> f32 {
        if self.counts_in_full(row) {
            return 1.0;
        }
        let rows = &self.detector_rows;
        let [low, high] = [top + down, bottom + down].map(f64::from);
        let spread = RowSpread { blur: self.row_blur.into() };
        let before = |border: i64| spread.share_below((border - row) as f64, low, high);
        (BESIDE * single(before(rows.end) - before(rows.start))).min(1.0)
    }

    /// True if an edge of the detector mask along z lies between two places of a row.
    pub(super) fn lands_at_edge(&self, row: i64, ends: [f32; 2]) -> bool {
        self.landing_edges.as_ref().is_some_and(|edges| edges.crossed(row, ends))
    }
}
