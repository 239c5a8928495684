//! A piece of a rectangle: a part that the same facets cover.

use super::row_spread::PieceRows;
use beamlet_core::numbers::single;
use beamlet_interface::RayResult;

/// Part of a rectangle covered by the same facets. Parts lie in the rectangle by their centroids, as
/// rectangles of their areas without gaps, so that together they cover it evenly; the landing position of
/// a part has the exact mean and variance.
#[derive(Debug, Clone, Copy)]
pub(super) struct Piece {
    /// Its rectangle: m from the beamlet's centre, and share of the row.
    pub(crate) x: [f32; 2],
    pub(crate) z: [f32; 2],
    /// Share of the rectangle's area.
    pub(crate) share: f32,
    /// x from the beamlet's centre, m, and share of the row.
    pub(crate) centroid: [f32; 2],
    /// Bounds of x and z.
    pub(crate) bounds: [[f32; 2]; 2],
    /// Variance of x, m2.
    pub(crate) variance: f32,
    pub(super) result: RayResult,
    /// Where in the row its light comes from.
    pub(crate) rows: PieceRows,
    /// Difference between the light of the part and of an interval of its variance, along x and z: 1 for
    /// a triangle.
    pub(crate) outline: [f32; 2],
    /// Change of the optical depth along x, 1/m.
    pub(super) slope_depth: f32,
    /// The first order is insufficient: take the result of the ray through the centroid.
    pub(super) by_ray: bool,
}

/// The interval of this height about a centre, moved into another one.
fn about(centre: f32, height: f32, [top, bottom]: [f32; 2]) -> [f32; 2] {
    let first = (centre - 0.5 * height).min(bottom - height).max(top);
    [first, (first + height).min(bottom)]
}

impl Piece {
    /// Moves its rectangle to its centroid along z, inside the one that it is of: light that lands
    /// far off is spread from there.
    pub(super) fn move_down(&mut self, ends: [f32; 2]) {
        self.z = about(self.centroid[1], self.z[1] - self.z[0], ends);
    }

    /// Heights of its row about the centroid of its light.
    pub(super) fn about_centroid(&self) -> [f32; 2] {
        about(single(self.rows.centroid), self.z[1] - self.z[0], [0.0, 1.0])
    }
}
