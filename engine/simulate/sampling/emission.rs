//! Cells from refined patches: their leaves as rectangles, those joined that are one straight line,
//! and rows of cells made of these (`cell_rows.rs`).

use super::cell_batch::CellBatch;
use super::error_estimate::Estimator;
use super::line_cells::place_of;
use super::moment_recording::LinearModel;
use super::patch::{Patch, PatchPlace, Slopes, alike};
use super::rectangle::Rectangle;
use super::row_spread::tilt_by_depth;
use super::view_context::ViewContext;
use crate::lines::LinePatch;
use crate::trace::Tracer;
use beamlet_core::Result;
use beamlet_core::numbers::single;
use beamlet_interface::{FLAG_EXACT, FLAG_GRAZING, FLAG_REFLECTED, RayResult};
use rayon::prelude::*;
use std::ops::Range;

/// Largest width of joined rectangles, fraction of the period.
const WIDEST_JOINED: f32 = 1.0 / 20.0;
/// Largest change of optical depth over joined rectangles: light is linear in a cell.
const STEEPEST_JOINED: f32 = 0.02;
/// Largest deviation of optical depth from the line of a joined cell over a whole beamlet.
const DEPTH_JOINED: f32 = 2e-5;
/// Largest deviation of displacement, fraction of the budget.
const DISPLACEMENT_JOINED: f64 = 0.1;
/// Cells narrower than this fraction of the period may deviate more, in proportion.
const FULL_SHARE: f32 = 1.0 / 40.0;

/// Makes cells.
pub(super) struct Emitter<'a> {
    pub(crate) view: &'a ViewContext<'a>,
    /// Rows whose light is recorded.
    pub(super) recorded_rows: &'a Range<i64>,
    /// Analyser over detector distance.
    pub(crate) ratio: f32,
    /// Distance from analyser to detector, m.
    pub(super) gap: f32,
    /// Row pitch on the detector, m.
    pub(super) row_pitch: f32,
    /// Deviation of the displacement from a straight line that joined cells may have, m.
    joined: f32,
}

/// Flags that rays of joined rectangles share.
const KIND: u32 = FLAG_EXACT | FLAG_GRAZING | FLAG_REFLECTED;

impl<'a> Emitter<'a> {
    pub(super) fn new(view: &'a ViewContext<'a>, recorded_rows: &'a Range<i64>) -> Self {
        let optics = view.optics;
        Self {
            view,
            recorded_rows,
            ratio: single(optics.analyser / optics.detector.distance),
            gap: single(optics.gap()),
            row_pitch: single(optics.detector.pitch[1]),
            joined: single(DISPLACEMENT_JOINED * view.budget.bounded_displacement()),
        }
    }

    /// The cells of patches, and the places (column, row) of patches that miss the sample.
    pub(super) fn cells(
        &self,
        tracer: &mut Tracer,
        estimator: &Estimator<'_>,
        patches: &[&Patch],
    ) -> Result<(CellBatch, Vec<(i64, i64)>)> {
        let rectangles = patches.par_iter().map(|patch| self.rectangles(estimator, patch));
        let rectangles = rectangles.collect();
        let places: Vec<PatchPlace> = patches.iter().map(|patch| patch.at()).collect();
        self.cells_of(tracer, &places, rectangles)
    }

    /// The cells of the rectangles of patches, by height, then x, those joined that are one straight line; and the
    /// places (column, row) of patches that miss the sample.
    pub(super) fn cells_of(
        &self,
        tracer: &mut Tracer,
        patches: &[PatchPlace],
        rectangles: Vec<Vec<Rectangle>>,
    ) -> Result<(CellBatch, Vec<(i64, i64)>)> {
        let joined = |rectangles| self.join(join_empty(rectangles));
        self.cells_of_joined(tracer, patches, rectangles.into_par_iter().map(joined).collect())
    }

    /// The cells of patches of lines, one for each piece, and the places (column, row) of patches that miss the sample.
    pub(super) fn cells_of_lines(
        &self,
        tracer: &mut Tracer,
        patches: &[LinePatch],
    ) -> Result<(CellBatch, Vec<(i64, i64)>)> {
        let places: Vec<PatchPlace> = patches.iter().map(place_of).collect();
        let rectangles = patches.par_iter().map(|it| join_empty(self.rectangles_of_lines(it)));
        self.cells_of_joined(tracer, &places, rectangles.collect())
    }

    fn cells_of_joined(
        &self,
        tracer: &mut Tracer,
        patches: &[PatchPlace],
        rectangles: Vec<Vec<Rectangle>>,
    ) -> Result<(CellBatch, Vec<(i64, i64)>)> {
        let moments = match self.view.recording {
            Some(recording) => recording.record(tracer, self.view, patches, &rectangles)?,
            None => vec![Vec::new(); patches.len()],
        };
        let mut empty = Vec::new();
        let first = self.view.lattice.beamlets.start;
        for (patch, rectangles) in patches.iter().zip(&rectangles) {
            if rectangles.is_empty() {
                empty.push((patch.beamlet - first, patch.row));
            }
        }
        let words = self.view.recording.as_ref().map_or(0, |recording| recording.words());
        let parts: Vec<CellBatch> = (patches, rectangles, moments)
            .into_par_iter()
            .map(|(patch, rectangles, moments)| {
                self.cell_rows(*patch, &rectangles, &moments, words)
            })
            .collect();
        Ok((CellBatch::concat(parts), empty))
    }

    /// The leaves by height, then x.
    fn rectangles(&self, estimator: &Estimator<'_>, patch: &Patch) -> Vec<Rectangle> {
        let mut leaves: Vec<u32> = patch.leaves().collect();
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
            // Rays that are spread evenly are not interpolated.
            let slopes = if patch.even.is_some() {
                Slopes::default()
            } else {
                estimator.slopes(node, &estimator.neighbours(patch, node))
            };
            let landing_z = node.result.landing_z(self.gap);
            let half = 0.5 * slopes.landing[1] * node.height();
            let rise = if self.view.lattice.heights { slopes.depth[1] } else { 0.0 };
            rectangles.push(Rectangle {
                x: node.x,
                z: node.z,
                ray: patch.ray_coordinates(leaf),
                traced: None,
                ends: LinearModel::new(&node.result, node.width(), &slopes),
                displacement_variance: self.view.variance_of(&node.result),
                ends_z: [landing_z - half, landing_z + half],
                tilt: single(tilt_by_depth((rise * node.height()).into())),
                shares: None,
            });
        }
        rectangles
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
            let x = [first.x[0], last.x[1]];
            let width = |r: &Rectangle| r.x[1] - r.x[0];
            let widest = group.iter().max_by(|a, b| width(a).total_cmp(&width(b))).unwrap_or(first);
            let mean = |of: fn(&Rectangle) -> f32| {
                group.iter().map(|r| width(r) * of(r)).sum::<f32>() / (x[1] - x[0])
            };
            let line = |of: fn(&LinearModel) -> [f32; 2]| {
                let middle = |r: &Rectangle| 0.5 * (of(&r.ends)[0] + of(&r.ends)[1]);
                let slope = (middle(&last) - middle(first)) / (last.ray[0] - first.ray[0]);
                x.map(|x| middle(first) + slope * (x - first.ray[0]))
            };
            let result = RayResult {
                displacement_x: mean(|r| r.ends.result.displacement_x),
                displacement_z: mean(|r| r.ends.result.displacement_z),
                slope_x: mean(|r| r.ends.result.slope_x),
                slope_z: mean(|r| r.ends.result.slope_z),
                ..widest.ends.result
            };
            let ends = LinearModel {
                result,
                depth: line(|e| e.depth),
                displacement: line(|e| e.displacement),
            };
            joined.push(Rectangle {
                x,
                ends,
                displacement_variance: mean(|r| r.displacement_variance),
                tilt: mean(|r| r.tilt),
                ends_z: [mean(|r| r.ends_z[0]), mean(|r| r.ends_z[1])],
                ..*widest
            });
        }
        joined
    }

    /// True if rectangles that follow one another are one straight line at all of their rays.
    fn is_one(&self, group: &[Rectangle]) -> bool {
        let (first, last) = (&group[0], &group[group.len() - 1]);
        let before = &group[group.len() - 2];
        let width = last.x[1] - first.x[0];
        let period = single(self.view.lattice.period);
        let (a, b) = (&first.ends.result, &last.ends.result);
        let stands = last.x[0].to_bits() == before.x[1].to_bits()
            && last.z.map(f32::to_bits) == first.z.map(f32::to_bits)
            && last.ray[1].to_bits() == first.ray[1].to_bits();
        if !stands
            || !alike(a, b)
            || (a.flags ^ b.flags) & KIND != 0
            || a.flags & FLAG_EXACT != 0
            || width > WIDEST_JOINED * period
            || (a.optical_depth - b.optical_depth).abs() > STEEPEST_JOINED
        {
            return false;
        }
        let tolerance_scale = (FULL_SHARE * period / width).max(1.0);
        let apart = last.ray[0] - first.ray[0];
        let straight = |of: fn(&RayResult) -> f32, limit: f32| {
            let slope = (of(b) - of(a)) / apart;
            group.iter().all(|r| {
                let line = of(a) + slope * (r.ray[0] - first.ray[0]);
                (of(&r.ends.result) - line).abs() <= limit * tolerance_scale
            })
        };
        straight(|result| result.displacement_x, self.joined)
            && straight(|result| result.displacement_z, 100.0 * self.joined)
            && straight(|result| result.optical_depth, DEPTH_JOINED)
    }
}

/// Empty neighbours as one; none where all are empty.
fn join_empty(rectangles: Vec<Rectangle>) -> Vec<Rectangle> {
    if rectangles.iter().all(Rectangle::is_empty) {
        return Vec::new();
    }
    let mut joined: Vec<Rectangle> = Vec::with_capacity(rectangles.len());
    for rectangle in rectangles {
        match joined.last_mut() {
            Some(last)
                if rectangle.is_empty()
                    && last.is_empty()
                    && last.x[1].to_bits() == rectangle.x[0].to_bits()
                    && last.z.map(f32::to_bits) == rectangle.z.map(f32::to_bits) =>
            {
                last.x[1] = rectangle.x[1];
            }
            _ => joined.push(rectangle),
        }
    }
    joined
}
