//! Cells of lines: those of a line fill the heights that are nearer to it than to others.

use super::emission::Emitter;
use super::moment_recording::LinearModel;
use super::patch::PatchPlace;
use super::rectangle::Rectangle;
use crate::lines::{LinePatch, Piece};
use beamlet_core::numbers::single;

impl Emitter<'_> {
    /// The pieces of the lines of a patch, by height, then x.
    pub(super) fn rectangles_of_lines(&self, patch: &LinePatch) -> Vec<Rectangle> {
        let mut rectangles = Vec::new();
        for (at, line) in patch.heights.light().enumerate() {
            let z = patch.heights.nearest(at);
            let parts: Vec<_> = patch.heights.parts(at).collect();
            let mut known: Option<(f32, Option<[f32; 2]>)> = None;
            for piece in &line.pieces {
                let down = -piece.result.landing_z(self.gap) / self.row_pitch;
                let shares = match known {
                    Some((same, shares)) if same.to_bits() == down.to_bits() => shares,
                    _ => self.view.lattice.line_shares(&parts, down.into()),
                };
                known = Some((down, shares));
                rectangles.push(self.rectangle_of(piece, z, patch.heights.z(at), shares));
            }
        }
        rectangles
    }

    /// The cell of a piece of a line. `z`: its heights; `shares`: of its light in the rows above and below.
    fn rectangle_of(
        &self,
        piece: &Piece,
        z: [f64; 2],
        line: f64,
        shares: Option<[f32; 2]>,
    ) -> Rectangle {
        let landing_z = piece.result.landing_z(self.gap);
        Rectangle {
            x: piece.x.map(single),
            z: z.map(single),
            ray: [single(piece.middle()), single(line)],
            traced: None,
            ends: LinearModel {
                result: piece.result,
                depth: piece.depth,
                displacement: piece.displacement,
            },
            displacement_variance: self.view.variance_of(&piece.result),
            ends_z: [landing_z; 2],
            tilt: 0.0,
            shares,
        }
    }
}

/// Place of a patch of lines.
pub(super) fn place_of(patch: &LinePatch) -> PatchPlace {
    PatchPlace { beamlet: patch.beamlet, row: patch.row, shear: 0.0 }
}
