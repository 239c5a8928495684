//! Cells of lines: those of a line fill the heights that are nearer to it than to others.

use super::emission::Emitter;
use super::moment_recording::LinearModel;
use super::rectangle::Rectangle;
use crate::lines::{EvenCell, EvenPatch, LinePatch, Piece, Slopes};
use beamlet_core::numbers::single;
use beamlet_interface::Ray;

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
                let row = patch.row as f64 + z;
                let ray = self.view.lattice.ray(patch.beamlet, piece.middle(), row, self.view.pose);
                let Piece { result, depth, displacement, .. } = *piece;
                let ends = LinearModel { result, depth, displacement };
                let mut rectangle =
                    self.rectangle([piece.x.map(single), heights.map(single)], ray, ends);
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

    /// A cell over intervals of x and z, whose light lands alike over its height.
    fn rectangle(&self, [x, z]: [[f32; 2]; 2], ray: Ray, ends: LinearModel) -> Rectangle {
        let displacement_variance = self.view.variance_of(&ends.result);
        let ends_z = [ends.result.landing_z(self.gap); 2];
        Rectangle { x, z, ray, ends, displacement_variance, ends_z, tilt: 0.0, shares: None }
    }

    /// The cells of a patch of rays that are spread evenly: nothing is interpolated between these.
    pub(super) fn rectangles_of_rays(&self, patch: &EvenPatch) -> Vec<Rectangle> {
        let of = |EvenCell { x, z, ray: at, result }: EvenCell| {
            let ray = self.view.ray(patch.beamlet, patch.row, at[0], at[1]);
            self.rectangle([x, z], ray, LinearModel::even(result))
        };
        patch.cells().map(of).collect()
    }
}
