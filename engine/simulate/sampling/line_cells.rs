//! Cells of lines: those of a line fill the heights that are nearer to it than to others.

use super::emission::Emitter;
use super::moment_recording::LinearModel;
use super::rectangle::Rectangle;
use super::row_spread::tilt_by_depth;
use crate::lines::{EvenCell, EvenPatch, LinePatch, Piece};
use beamlet_core::numbers::single;
use beamlet_interface::FLAG_REFLECTED;

impl Emitter<'_> {
    /// The pieces of the lines of a patch, by height, then x.
    pub(super) fn rectangles_of_lines(&self, patch: &LinePatch) -> Vec<Rectangle> {
        let mut rectangles = Vec::new();
        let lines: Vec<_> = patch.heights.light().collect();
        let at = |number: usize| {
            let line = lines.get(number)?;
            Some((patch.heights.z(number), &line.pieces[..]))
        };
        for (number, line) in lines.iter().enumerate() {
            let heights = patch.heights.nearest(number);
            let z = patch.heights.z(number);
            let parts: Vec<_> = patch.heights.parts(number).collect();
            let mut beside = [number.checked_sub(1).and_then(at), at(number + 1)]
                .map(|line| line.map(|(z, pieces)| Beside { z, pieces }));
            let mut known: Option<(f32, Option<[f32; 2]>)> = None;
            for piece in &line.pieces {
                let mut rectangle = self.rectangle_of(patch, piece, heights, z);
                if self.view.lattice.heights {
                    self.tilt(&mut rectangle, (piece, z), &mut beside);
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

    /// Gives a cell the slopes along z of displacement and depth that follow from the lines beside.
    fn tilt(
        &self,
        rectangle: &mut Rectangle,
        (own, z): (&Piece, f64),
        beside: &mut [Option<Beside<'_>>; 2],
    ) {
        let [top, bottom] = rectangle.z.map(f64::from);
        let [up, low] = [(0, top), (1, bottom)].map(|(side, end)| {
            let other = beside[side].as_mut().and_then(|line| Some((line.z, line.like(own)?)));
            other.map_or([0.0; 2], |(other_z, other)| {
                let share = (end - z) / (other_z - z);
                let landing = other.result.landing_z(self.gap) - own.result.landing_z(self.gap);
                let depth = other.depth_at(own.middle()) - own.depth_at(own.middle());
                [f64::from(landing), f64::from(depth)].map(|change| share * change)
            })
        });
        rectangle.ends_z[0] += single(up[0]);
        rectangle.ends_z[1] += single(low[0]);
        rectangle.tilt = single(tilt_by_depth(low[1] - up[1]));
    }
}

/// A line beside another one, whose pieces are looked at from left to right.
struct Beside<'a> {
    z: f64,
    pieces: &'a [Piece],
}

impl<'a> Beside<'a> {
    /// The piece behind the middle of another, if its rays cross the same surfaces.
    fn like(&mut self, other: &Piece) -> Option<&'a Piece> {
        let x = other.middle();
        self.pieces = &self.pieces[self.pieces.partition_point(|piece| piece.x[1] < x)..];
        let is_like = |it: &&Piece| {
            let (own, it) = (&other.result, &it.result);
            it.signature == own.signature && (it.flags ^ own.flags) & FLAG_REFLECTED == 0
        };
        self.pieces.first().filter(is_like)
    }
}
