//! Corners, crossings, steep facets and creases of a mesh in the image from the source.

use super::{Change, Collector, ImagePoint, PatchChange, Patches};
use beamlet_model::optics::ends;
use rayon::prelude::*;
use std::sync::atomic::{AtomicU32, Ordering};

/// Height of a facet over its depth up to which it is steep.
const STEEP: f64 = 1.0 / 8.0;
/// Least change of the slope of light at a crease that counts alone, tolerances per row: half a row high, an interval errs
/// by a 32nd of it.
const CREASE: f64 = 4.0;
/// Height over which a crease along z counts at one place, rows.
const CREASE_HEIGHT: f64 = 1.0 / 32.0;
/// Mark of a corner that a selected facet has, among the number of its changes.
const USED: u32 = 1 << 31;
/// Facets that go together.
const FACETS: usize = 1 << 12;

/// A mesh in the image from the source.
pub(super) struct MeshImage<'a> {
    pub(super) corners: Vec<ImagePoint>,
    pub(super) triangles: &'a [[u32; 3]],
    /// Triangles across the edges of each.
    pub(super) across: &'a [[u32; 3]],
}

/// Edge in the image, from left to right.
struct Edge {
    ends: [ImagePoint; 2],
    /// The surface of the facet that decides lies below it in the image.
    is_above: bool,
}

impl Edge {
    /// Row coordinate at an x between the ends.
    fn row_at(&self, x: f64) -> f64 {
        let [a, b] = self.ends;
        a.row + (b.row - a.row) * (x - a.x) / (b.x - a.x)
    }
}

impl MeshImage<'_> {
    /// Changes of light by the facets of which `mu` is known, 1/m.
    pub(super) fn changes(
        &self,
        patches: &Patches<'_>,
        mu: &(impl Fn(usize) -> Option<f64> + Sync),
    ) -> Vec<PatchChange> {
        let mut all = patches.collect(|collector| self.add_corners(collector, mu));
        let parts = (0..self.triangles.len()).into_par_iter().step_by(FACETS);
        let of_part = |first: usize| {
            patches.collect(|collector| {
                for facet in first..(first + FACETS).min(self.triangles.len()) {
                    let Some(mu) = mu(facet) else { continue };
                    let corners = self.corners_of(facet);
                    if patches.touch(ends(&corners.map(|it| it.row))) {
                        collector.add_steep(corners);
                        self.add_edges(collector, facet, mu);
                    }
                }
            })
        };
        all.par_extend(parts.flat_map_iter(of_part));
        all
    }

    fn corners_of(&self, facet: usize) -> [ImagePoint; 3] {
        self.triangles[facet].map(|corner| self.corners[corner as usize])
    }

    /// Adds corners around which the surface changes between above and below other than twice (Banchoff 1967): a facet
    /// changes at its middle corner in the order of (row, number).
    fn add_corners(
        &self,
        collector: &mut Collector<'_>,
        mu: &(impl Fn(usize) -> Option<f64> + Sync),
    ) {
        let patches = collector.patches;
        let mut changes = Vec::new();
        changes.resize_with(self.corners.len(), || AtomicU32::new(0));
        let row = |corner: u32| self.corners[corner as usize].row;
        self.triangles.par_iter().with_min_len(FACETS).enumerate().for_each(|(facet, corners)| {
            if mu(facet).is_none() || !patches.touch(ends(&corners.map(row))) {
                return;
            }
            let mut order = *corners;
            order.sort_unstable_by(|a, b| row(*a).total_cmp(&row(*b)).then(a.cmp(b)));
            for corner in order {
                changes[corner as usize].fetch_or(USED, Ordering::Relaxed);
            }
            changes[order[1] as usize].fetch_add(1, Ordering::Relaxed);
        });
        for (corner, changes) in self.corners.iter().zip(&changes) {
            let changes = changes.load(Ordering::Relaxed);
            let is_critical = changes & USED != 0 && changes != USED | 2;
            if is_critical && patches.touch([corner.row; 2]) {
                collector.add_to_beamlets([corner.x; 2], Change::Critical(corner.row));
            }
        }
    }

    /// Adds crossings and creases of the edges of a facet, each edge by one of its facets.
    fn add_edges(&self, collector: &mut Collector<'_>, facet: usize, mu: f64) {
        let corners = self.corners_of(facet);
        let own = area(corners);
        for (slot, other) in self.across[facet].iter().enumerate() {
            let other = Some(*other as usize).filter(|it| *it < self.triangles.len());
            if other.is_some_and(|other| other < facet) {
                continue;
            }
            let [from, to] = [corners[(slot + 1) % 3], corners[(slot + 2) % 3]];
            if from.x.to_bits() == to.x.to_bits()
                || !collector.patches.touch(ends(&[from.row, to.row]))
            {
                continue;
            }
            let beside = other.map(|it| self.corners_of(it));
            let area_beside = beside.map_or(-own, area);
            // The larger facet says on which side of the edge the surface is; the other one runs along the edge the other
            // way.
            let is_right =
                if own.abs() > area_beside.abs() { own >= 0.0 } else { area_beside < 0.0 };
            let edge = if from.x < to.x {
                Edge { ends: [from, to], is_above: is_right }
            } else {
                Edge { ends: [to, from], is_above: !is_right }
            };
            if (own >= 0.0) != (area_beside >= 0.0) {
                collector.add_crossings(&edge, other.is_some());
            }
            let bend = mu.abs() * (slope(corners) - beside.map_or(0.0, slope)).abs();
            collector.add_crease(&edge, bend);
        }
    }
}

impl Collector<'_> {
    /// Adds places where an outline crosses the borders of what counts of a beamlet and the surface within has an end.
    /// Every crossing counts where the edge is open (`is_closed` false).
    fn add_crossings(&mut self, edge: &Edge, is_closed: bool) {
        let [a, b] = edge.ends;
        let falls = b.row > a.row;
        for (beamlet, [low, high]) in self.patches.image.beamlets([a.x, b.x]) {
            for (border, is_low) in [(low, true), (high, false)] {
                if border <= a.x || border > b.x {
                    continue;
                }
                // A surface below its edge begins within where the edge falls inwards, and one above it ends there where
                // the edge rises inwards.
                if !is_closed || (falls == is_low) == edge.is_above {
                    self.add(beamlet, Change::Critical(edge.row_at(border)));
                }
            }
        }
    }

    /// Adds a crease over which the slope of the optical depth changes by `bend`, per row, if that counts.
    fn add_crease(&mut self, edge: &Edge, bend: f64) {
        let image = self.patches.image;
        let least = CREASE * image.tolerance;
        if bend <= least {
            return;
        }
        let [a, b] = edge.ends;
        for (beamlet, [low, high]) in image.beamlets([a.x, b.x]) {
            let [from, to] = [a.x.max(low), b.x.min(high)];
            if to <= from {
                continue;
            }
            let weight = bend * (to - from) / (high - low);
            let ends = [from, to].map(|x| edge.row_at(x));
            let height = (ends[1] - ends[0]).abs();
            if weight < least * (height / CREASE_HEIGHT).max(1.0) {
                continue;
            }
            if height < CREASE_HEIGHT {
                let row = f64::midpoint(ends[0], ends[1]);
                self.add(beamlet, Change::Crease { row, weight });
            } else {
                let weight = 0.5 * weight;
                ends.into_iter().for_each(|row| self.add(beamlet, Change::Crease { row, weight }));
            }
        }
    }

    /// Adds a facet of little height over its depth, as far as beamlets see it.
    fn add_steep(&mut self, corners: [ImagePoint; 3]) {
        let image = self.patches.image;
        if !is_steep(corners, image.rows_per_metre()) {
            return;
        }
        for (beamlet, borders) in image.beamlets(ends(&corners.map(|it| it.x))) {
            let Some(rows) = clipped_rows(corners, borders) else { continue };
            if rows[1] - rows[0] < 1.0 {
                self.add(beamlet, Change::Jump(rows));
            }
        }
    }
}

/// Twice the area of a facet in the image.
fn area([a, b, c]: [ImagePoint; 3]) -> f64 {
    (b.x - a.x) * (c.row - a.row) - (b.row - a.row) * (c.x - a.x)
}

/// Components along depth and row of the normal of a facet over x, row and depth.
fn normal([a, b, c]: [ImagePoint; 3]) -> [f64; 2] {
    let by_depth = area([a, b, c]);
    let by_row = (b.depth - a.depth) * (c.x - a.x) - (b.x - a.x) * (c.depth - a.depth);
    [by_depth, by_row]
}

/// Change of the depth of a facet per row, at one x, m; at most 1 m.
fn slope(corners: [ImagePoint; 3]) -> f64 {
    let [by_depth, by_row] = normal(corners);
    let slope = -by_row / by_depth;
    if slope.is_nan() { 0.0 } else { slope.clamp(-1.0, 1.0) }
}

/// True if a facet is of little height over its depth.
pub(super) fn is_steep(corners: [ImagePoint; 3], rows_per_metre: f64) -> bool {
    let [by_depth, by_row] = normal(corners);
    by_row.abs() > 0.0 && by_depth.abs() <= STEEP * rows_per_metre * by_row.abs()
}

/// Row coordinates of a facet between two x.
fn clipped_rows(corners: [ImagePoint; 3], [low, high]: [f64; 2]) -> Option<[f64; 2]> {
    let mut rows = [f64::INFINITY, f64::NEG_INFINITY];
    let mut take = |row: f64| rows = [rows[0].min(row), rows[1].max(row)];
    for at in 0..3 {
        let (a, b) = (corners[at], corners[(at + 1) % 3]);
        if a.x >= low && a.x <= high {
            take(a.row);
        }
        for border in [low, high] {
            if (a.x < border) != (b.x < border) {
                take(a.row + (b.row - a.row) * (border - a.x) / (b.x - a.x));
            }
        }
    }
    (rows[0] <= rows[1]).then_some(rows)
}
