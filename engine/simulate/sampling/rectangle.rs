//! Rectangles of a patch as cells are made of them.

use super::moment_recording::LinearModel;
use super::patch::{Border, PatchPlace, Slopes};
use super::piece::Piece;
use super::row_spread::{PieceRows, tilt_by_centroid};
use super::view_context::ViewContext;
use beamlet_core::numbers::single;
use beamlet_interface::Ray;

/// Over less, m, no depth rises: f32 does not resolve it.
const THINNEST: f32 = 1e-12;

/// A rectangle as a cell: its result at both ends of x.
#[derive(Clone, Copy)]
pub(super) struct Rectangle {
    pub(crate) x: [f32; 2],
    pub(crate) z: [f32; 2],
    /// Coordinates of its ray.
    pub(crate) ray: [f32; 2],
    /// Its ray, where the device chose it: another one beside it may draw another normal.
    pub(super) traced: Option<Ray>,
    pub(super) ends: LinearModel,
    /// Variance of the displacement about the result, m2.
    pub(crate) displacement_variance: f32,
    /// Variance of the places of a piece beyond its rectangle, as seen on the analyser, m2.
    pub(crate) place_variance: f32,
    /// Displacement on the detector along z at both ends of z, m.
    pub(super) ends_z: [f32; 2],
    /// Change of its light over its height, relative to the mean light.
    pub(crate) tilt: f32,
    /// Light that crosses the borders of the row, of a mean.
    pub(crate) borders: [Option<Border>; 2],
    /// Where its light comes from in the row, of a piece.
    pub(crate) rows: Option<PieceRows>,
}

impl Rectangle {
    /// True if all its rays miss the sample.
    pub(super) fn is_empty(&self) -> bool {
        self.ends.result.crossings == 0 && self.rows.is_none()
    }

    /// Its ray, in a patch.
    pub(super) fn ray(&self, view: &ViewContext<'_>, patch: PatchPlace) -> Ray {
        self.traced.unwrap_or_else(|| {
            let [x, z] = patch.place(self.ray);
            view.ray(patch.beamlet, patch.row, x, z)
        })
    }

    /// A piece, whose cell has the heights `z`. `gap`: from analyser to detector, m; `magnification`: from
    /// the cell plane to the analyser, nothing where displacements follow the energy.
    pub(super) fn of_piece(
        piece: &Piece,
        z: [f32; 2],
        gap: f32,
        magnification: Option<f32>,
    ) -> Self {
        let width = piece.x[1] - piece.x[0];
        // Depth rises by as much as over the part.
        let own = (12.0 * piece.variance).sqrt().max(width);
        let slopes = Slopes { depth: [piece.slope_depth, 0.0], ..Slopes::default() };
        let mut ends = LinearModel::new(&piece.result, own.max(THINNEST), &slopes);
        // Where its light lands has the mean and the variance of the part.
        let magnification = magnification.unwrap_or(0.0);
        let apart = piece.centroid[0] - 0.5 * (piece.x[0] + piece.x[1]);
        ends.displacement = ends.displacement.map(|d| d + magnification * apart);
        let [top, bottom] = z.map(f64::from);
        let aside = piece.rows.centroid - 0.5 * (top + bottom);
        let wider = (piece.variance - width * width / 12.0).max(0.0);
        Self {
            x: piece.x,
            z,
            ray: piece.centroid,
            traced: None,
            ends,
            displacement_variance: 0.0,
            place_variance: magnification * magnification * wider,
            ends_z: [piece.result.landing_z(gap); 2],
            tilt: single(tilt_by_centroid(aside, bottom - top)),
            borders: [None; 2],
            rows: Some(piece.rows),
        }
    }
}
