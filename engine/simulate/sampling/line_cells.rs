//! Cells of lines: those of a line fill the heights that are nearer to it than to others.

use super::emission::Emitter;
use super::moment_recording::LinearModel;
use super::rectangle::Rectangle;
use crate::lines::{EvenCell, EvenPatch, LinePatch, Piece, Slopes};
use beamlet_core::numbers::single;

impl Emitter<'_> {
    /// The pieces of the lines of a patch, by height, then x.
    pub(super) fn rectangles_of_lines(&self, patch: &LinePatch) -> Vec<Rectangle> {
        let mut rectangles = Vec::new();
        for (number, line) in patch.heights.light().enumerate() {
            let heights = patch.heights.nearest(number);
            let z = patch.heights.z(number);
            let parts: Vec<_> = patch.heights.parts(number).collect();
            let slopes = match self.view.lattice.heights {
                true => patch.slopes(number, self.gap),
                false => Vec::new(),
            };
            let mut known: Option<(f32, Option<[f32; 2]>)> = None;
            for (at, piece) in line.pieces.iter().enumerate() {
                let mut rectangle = self.rectangle_of(patch, piece, heights, z);
                if let Some(Slopes { landing, tilt }) = slopes.get(at) {
                    (rectangle.ends_z, rectangle.tilt) = (*landing, *tilt);
                } else {
                    let down = self.view.down(&piece.result);
                    rectangle.shares = match known {
                        Some((same, shares)) if same.to_bits() == down.to_bits() => shares,
                        _ => self.view.lattice.line_shares(&parts, down.into()),
                    };
                    known = Some((down, rectangle.shares));
                }
                rectangles.push(rectangle);
            }
        }
        rectangles
    }

    /// The cell of a piece of a line at a height. `heights`: of the cell.
    fn rectangle_of(
        &self,
        patch: &LinePatch,
        piece: &Piece,
        heights: [f64; 2],
        z: f64,
    ) -> Rectangle {
        let landing_z = piece.result.landing_z(self.gap);
        let row = patch.row as f64 + z;
        Rectangle {
            x: piece.x.map(single),
            z: heights.map(single),
            ray: self.view.lattice.ray(patch.beamlet, piece.middle(), row, self.view.pose),
            ends: LinearModel {
                result: piece.result,
                depth: piece.depth,
                displacement: piece.displacement,
            },
            displacement_variance: self.view.variance_of(&piece.result),
            ends_z: [landing_z; 2],
            tilt: 0.0,
            shares: None,
        }
    }

    /// The cells of a patch of rays that are spread evenly: nothing is interpolated between these.
    pub(super) fn rectangles_of_rays(&self, patch: &EvenPatch) -> Vec<Rectangle> {
        let of = |cell: EvenCell| {
            let [x, z] = cell.ray;
            Rectangle {
                x: cell.x,
                z: cell.z,
                ray: self.view.ray(patch.beamlet, patch.row, x, z),
                ends: LinearModel::even(cell.result),
                displacement_variance: self.view.variance_of(&cell.result),
                ends_z: [cell.result.landing_z(self.gap); 2],
                tilt: 0.0,
                shares: None,
            }
        };
        patch.cells().map(of).collect()
    }
}
