//! Cells from refined patches: rectangles that stand side by side at the same heights are a strip.

use super::ViewContext;
use super::cell_batch::{CellBatch, empty_strip};
use super::cell_moments::{CellMoments, ExactCell};
use super::error_estimate::Estimator;
use super::moment_recording::LinearModel;
use super::neighbours::Slopes;
use super::patch::{Border, Known, Patch, alike, part};
use super::rectangle::Rectangle;
use crate::Result;
use crate::interface::{
    Cell, CellRow, FLAG_EXACT, FLAG_GRAZING, FLAG_NOT_FINITE, FLAG_REFLECTED, MOMENTS_PER_MATERIAL,
    RayResult,
};
use crate::numbers::{self, single};
use crate::trace::Tracer;
use rayon::prelude::*;
use std::ops::Range;

/// Slanting rectangles become strips that x moves over by this at most, m,
const SLANT_OF_A_STRIP: f32 = 0.7e-6;
/// and as many at most.
const MOST_HEIGHTS: f32 = 64.0;

/// Rectangles are joined up to this share of the period,
const WIDEST_JOINED: f32 = 1.0 / 20.0;
/// and up to this change of optical depth: light is linear in a cell.
const STEEPEST_JOINED: f32 = 0.02;
/// Optical depth may leave the straight line of a joined cell by this over a whole beamlet,
const DEPTH_JOINED: f32 = 2e-5;
/// displacement by this share of what the budget allows,
const DISPLACEMENT_JOINED: f64 = 0.1;
/// and narrower cells than this share of the period by more, in proportion.
const FULL_SHARE: f32 = 1.0 / 40.0;

/// Makes cells.
pub(super) struct Emitter<'a> {
    view: &'a ViewContext<'a>,
    estimator: &'a Estimator<'a>,
    lit: &'a Range<i64>,
    /// Analyser over detector distance.
    ratio: f32,
    /// Deviation of the displacement from a straight line that joined cells may have, m.
    joined: f32,
}

/// Flags that rays of joined rectangles share.
const KIND: u32 = FLAG_EXACT | FLAG_GRAZING | FLAG_REFLECTED;

impl<'a> Emitter<'a> {
    pub(super) fn new(
        view: &'a ViewContext<'a>,
        estimator: &'a Estimator<'a>,
        lit: &'a Range<i64>,
    ) -> Self {
        let optics = view.optics;
        Self {
            view,
            estimator,
            lit,
            ratio: single(optics.analyser / optics.detector.distance),
            joined: single(DISPLACEMENT_JOINED * view.budget.bounded_displacement()),
        }
    }

    /// The cells of patches, and the places (column, row) of those that no ray of meets the sample.
    pub(super) fn cells(
        &self,
        tracer: &mut Tracer,
        patches: &[&Patch],
    ) -> Result<(CellBatch, Vec<(i64, i64)>)> {
        let rectangles: Vec<Vec<Rectangle>> =
            patches.par_iter().map(|patch| self.rectangles(patch)).collect();
        let moments = match self.view.keep {
            Some(keep) => keep.record(tracer, self.view, patches, &rectangles)?,
            None => vec![Vec::new(); patches.len()],
        };
        let mut empty = Vec::new();
        let first = self.view.lattice.beamlets.start;
        for (patch, rectangles) in patches.iter().zip(&rectangles) {
            if rectangles.is_empty() {
                empty.push((patch.beamlet - first, patch.row));
            }
        }
        let words = tracer.materials() * MOMENTS_PER_MATERIAL;
        let parts: Vec<CellBatch> = (patches, rectangles, moments)
            .into_par_iter()
            .map(|(patch, rectangles, moments)| self.strips(patch, &rectangles, &moments, words))
            .collect();
        Ok((CellBatch::concat(parts), empty))
    }

    /// The leaves by height, then x, empty neighbours as one; none where all are empty.
    fn rectangles(&self, patch: &Patch) -> Vec<Rectangle> {
        let mut leaves: Vec<u32> = patch.leaves().collect();
        if leaves.iter().all(|leaf| patch.nodes[*leaf as usize].is_empty()) {
            return Vec::new();
        }
        let key = |leaf: u32| {
            let node = &patch.nodes[leaf as usize];
            (node.z[0], node.z[1], node.x[0])
        };
        leaves.sort_unstable_by(|a, b| {
            let (a, b) = (key(*a), key(*b));
            a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)).then(a.2.total_cmp(&b.2))
        });
        let mut rectangles: Vec<Rectangle> = Vec::with_capacity(leaves.len());
        for leaf in leaves {
            let node = &patch.nodes[leaf as usize];
            if node.is_empty()
                && let Some(last) = rectangles.last_mut()
                && last.rows.is_none()
                && last.ends.result.crossings == 0
                && last.x[1].to_bits() == node.x[0].to_bits()
                && last.z.map(f32::to_bits) == node.z.map(f32::to_bits)
            {
                last.x[1] = node.x[1];
                continue;
            }
            if let Some(pieces) = patch.pieces(node) {
                let magnification =
                    self.view.keep.is_none().then_some(self.estimator.response.magnification);
                let of_piece =
                    |piece| Rectangle::of_piece(piece, self.estimator.gap, magnification);
                rectangles.extend(pieces.iter().map(of_piece));
                continue;
            }
            let (slopes, spread, ends_z, borders) = if let Known::Mean(fit) = node.known {
                let slopes =
                    Slopes { depth: [fit.slope_depth, 0.0], displacement: [fit.slope, 0.0] };
                (slopes, fit.displacement.powi(2) + fit.across.powi(2), fit.ends_z, fit.borders)
            } else {
                let neighbours = self.estimator.neighbours(patch, node);
                let slopes = self.estimator.slopes(node, &neighbours);
                (slopes, 0.0, [node.result.landing_z(self.estimator.gap); 2], [None; 2])
            };
            rectangles.push(Rectangle {
                x: node.x,
                z: node.z,
                ray: node.centre(),
                ends: LinearModel::new(&node.result, node.width(), &slopes),
                spread,
                ends_z,
                borders,
                rows: None,
            });
        }
        self.join(rectangles)
    }

    /// Neighbours that are one straight line as one: splits towards a jump leave chains of them.
    fn join(&self, rectangles: Vec<Rectangle>) -> Vec<Rectangle> {
        let mut joined: Vec<Rectangle> = Vec::with_capacity(rectangles.len());
        let mut rest = &rectangles[..];
        while let Some(first) = rest.first() {
            let mut count = 1;
            while count < rest.len() && self.is_one(&rest[..=count]) {
                count += 1;
            }
            let (group, after) = rest.split_at(count);
            rest = after;
            if count == 1 {
                joined.push(*first);
                continue;
            }
            let last = group[count - 1];
            let width = |r: &&Rectangle| r.x[1] - r.x[0];
            let widest = group.iter().max_by(|a, b| width(a).total_cmp(&width(b))).unwrap_or(first);
            let x = [first.x[0], last.x[1]];
            let line = |of: fn(&LinearModel) -> [f32; 2]| {
                let middle = |r: &Rectangle| 0.5 * (of(&r.ends)[0] + of(&r.ends)[1]);
                let slope = (middle(&last) - middle(first)) / (last.ray[0] - first.ray[0]);
                x.map(|x| middle(first) + slope * (x - first.ray[0]))
            };
            let ends = LinearModel {
                result: widest.ends.result,
                depth: line(|e| e.depth),
                displacement: line(|e| e.displacement),
            };
            let borders = std::array::from_fn(|end| {
                let light = |r: &Rectangle| Some((r.x[1] - r.x[0], r.borders[end]?));
                Border::mean(group.iter().filter_map(light))
            });
            joined.push(Rectangle { x, ends, borders, ..*widest });
        }
        joined
    }

    /// Whether rectangles that follow one another are one straight line at all of their rays.
    fn is_one(&self, group: &[Rectangle]) -> bool {
        let (first, last) = (&group[0], &group[group.len() - 1]);
        let before = &group[group.len() - 2];
        let width = last.x[1] - first.x[0];
        let period = single(self.view.lattice.period);
        let (a, b) = (&first.ends.result, &last.ends.result);
        let piece = group.iter().any(|r| r.rows.is_some());
        let stands = last.x[0].to_bits() == before.x[1].to_bits()
            && last.z.map(f32::to_bits) == first.z.map(f32::to_bits)
            && last.ray[1].to_bits() == first.ray[1].to_bits();
        if !stands
            || piece
            || !alike(a, b)
            || (a.flags ^ b.flags) & KIND != 0
            || a.flags & FLAG_EXACT != 0
            || width > WIDEST_JOINED * period
            || (a.optical_depth - b.optical_depth).abs() > STEEPEST_JOINED
        {
            return false;
        }
        let room = (FULL_SHARE * period / width).max(1.0);
        let apart = last.ray[0] - first.ray[0];
        let straight = |of: fn(&RayResult) -> f32, limit: f32| {
            let slope = (of(b) - of(a)) / apart;
            group.iter().all(|r| {
                let line = of(a) + slope * (r.ray[0] - first.ray[0]);
                (of(&r.ends.result) - line).abs() <= limit * room
            })
        };
        straight(|result| result.displacement_x, self.joined)
            && straight(|result| result.displacement_z, 100.0 * self.joined)
            && straight(|result| result.optical_depth, DEPTH_JOINED)
    }

    /// The strips of a patch; `moments`: `[rectangle][end][material][moment]`, where they are kept.
    fn strips(
        &self,
        patch: &Patch,
        rectangles: &[Rectangle],
        moments: &[f32],
        words: usize,
    ) -> CellBatch {
        let mut out = CellBatch::default();
        let words = if moments.is_empty() { 0 } else { 2 * words };
        let mut begin = 0;
        while begin < rectangles.len() {
            let first = &rectangles[begin];
            let runs_on = |pair: &[Rectangle]| {
                pair[0].x[1].to_bits() == pair[1].x[0].to_bits()
                    && pair[1].z.map(f32::to_bits) == first.z.map(f32::to_bits)
            };
            let more = rectangles[begin..].windows(2).take_while(|pair| runs_on(pair)).count();
            let run = begin..begin + more + 1;
            let z = first.z;
            let slant = (patch.shear * (z[1] - z[0])).abs();
            let heights = numbers::whole::<u32>(f64::from(
                (slant / SLANT_OF_A_STRIP).ceil().clamp(1.0, MOST_HEIGHTS),
            ));
            for height in 0..heights {
                let z = part(z, height, heights);
                let shift = patch.shear * (0.5 * (z[0] + z[1]) - 0.5);
                let moments = &moments[words * run.start..words * run.end];
                self.push_strip(&mut out, patch, &rectangles[run.clone()], z, shift, moments);
            }
            begin = run.end;
        }
        out
    }

    /// Sets what lands above and below a rectangle by what crosses the borders of the row.
    fn set_border_shares(&self, borders: &[Option<Border>; 2], z: [f32; 2], shares: &mut [f32; 2]) {
        let [top, bottom] = z.map(f64::from);
        for (end, border) in borders.iter().enumerate() {
            let Some(border) = border else { continue };
            let down = -f64::from(border.landing / self.estimator.row_pitch);
            let own = self.view.lattice.row_shares(top, bottom, down);
            if own[0] >= 0.0 {
                shares[end] = (border.light * own[end]).min(1.0 - shares[1 - end]);
            }
        }
    }

    #[allow(clippy::too_many_arguments, reason = "all describe one strip")]
    /// A strip of rectangles, moved along x by a shift and cut to the period.
    fn push_strip(
        &self,
        out: &mut CellBatch,
        patch: &Patch,
        rectangles: &[Rectangle],
        z: [f32; 2],
        shift: f32,
        moments: &[f32],
    ) {
        if z[1] <= z[0] {
            return;
        }
        let lattice = self.view.lattice;
        let half = single(0.5 * lattice.period);
        let words = moments.len() / rectangles.len();
        let column = patch.beamlet - lattice.beamlets.start;
        let [top, bottom] = z.map(f64::from);
        let mut lands = 0..1_i64;
        let mut cells = Vec::with_capacity(rectangles.len());
        let mut kept = CellMoments::default();
        for (index, rectangle) in rectangles.iter().enumerate() {
            let LinearModel { result, depth, displacement } = &rectangle.ends;
            let whole = rectangle.x.map(|x| x + shift);
            let x = whole.map(|x| x.clamp(-half, half));
            if x[1] <= x[0] {
                continue;
            }
            // The tally has its ray.
            if result.flags & FLAG_NOT_FINITE != 0 {
                continue;
            }
            let share = x.map(|x| (x - whole[0]) / (whole[1] - whole[0]));
            let between = |[low, high]: [f32; 2]| share.map(|share| low + (high - low) * share);
            let (depth, displacement) = (between(*depth), between(*displacement));
            let displacement_z = result.landing_z(self.estimator.gap);
            if displacement_z.abs() > lattice.halo as f32 * self.estimator.row_pitch {
                out.landed_off += 1;
            }
            let pixel_shift = result.displacement_x * (1.0 - self.ratio)
                - result.slope_x * self.estimator.gap * self.ratio;
            let down = -f64::from(displacement_z / self.estimator.row_pitch);
            let farthest = down * self.view.delta_ratio();
            lands.start = lands.start.min(numbers::whole::<i64>(farthest.floor()));
            lands.end = lands.end.max(numbers::whole::<i64>(farthest.ceil()) + 1);
            // Its upper end may land otherwise than its lower one.
            let own = rectangle.z.map(f64::from);
            let at = |z: f64| {
                let [up, low] = rectangle.ends_z.map(f64::from);
                -(up + (low - up) * (z - own[0]) / (own[1] - own[0]))
                    / f64::from(self.estimator.row_pitch)
            };
            let landing = [top + at(top), bottom + at(bottom)];
            let mut shares = if let Some(rows) = &rectangle.rows {
                lattice.piece_shares(rows, down)
            } else if landing[1] - landing[0] > 0.2 * (bottom - top) {
                lattice.row_shares(landing[0], landing[1], 0.0)
            } else {
                lattice.row_shares(top, bottom, down)
            };
            if shares[0] >= 0.0 {
                self.set_border_shares(&rectangle.borders, z, &mut shares);
            }
            let [above, below] = shares;
            if result.flags & FLAG_EXACT != 0 && self.view.keep.is_some() {
                let [x, z] = patch.place(rectangle.ray);
                kept.exact.push(ExactCell {
                    cell: numbers::count(cells.len()),
                    ends: [self.view.ray(patch.beamlet, patch.row, x, z); 2],
                    results: rectangle.ends.results(),
                    range: share,
                });
            }
            let of_cell = &moments[words * index..words * (index + 1)];
            let (low, high) = of_cell.split_at(words / 2);
            for share in share {
                let ends = low.iter().zip(high);
                kept.ends.extend(ends.map(|(low, high)| low + (high - low) * share));
            }
            cells.push(Cell {
                x_low: x[0],
                x_high: x[1],
                depth_low: depth[0],
                depth_high: depth[1],
                displacement_low: displacement[0],
                displacement_high: displacement[1],
                displacement_z,
                above,
                below,
                pixel_shift,
                spread: rectangle.spread,
                ..bytemuck::Zeroable::zeroed()
            });
        }
        if patch.row + lands.end > self.lit.start && patch.row + lands.start < self.lit.end {
            let strip = CellRow { top: z[0], bottom: z[1], ..empty_strip(column, patch.row) };
            out.push(strip, &cells, &kept);
        }
    }
}
