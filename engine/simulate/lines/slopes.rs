//! Slopes of light over the height of a cell, by the lines beside its own.

use super::line::Piece;
use super::patches::LinePatch;
use crate::sampling::tilt_by_depth;
use beamlet_core::numbers::single;
use beamlet_interface::FLAG_REFLECTED;

/// Light of a piece of a line over the heights that are nearer to the line than to others.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Slopes {
    /// Displacement on the detector along z at both ends, m.
    pub(crate) landing: [f32; 2],
    /// Change of the light, relative to its mean.
    pub(crate) tilt: f32,
}

/// A line next to another one, and its pieces from a place on, which moves from left to right.
struct NeighbourLine<'a> {
    z: f64,
    pieces: &'a [Piece],
}

impl<'a> NeighbourLine<'a> {
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

impl LinePatch {
    /// Slopes of the pieces of a line. `gap`: from the analyser to the detector, m.
    pub(crate) fn slopes(&self, number: usize, gap: f32) -> Vec<Slopes> {
        let Some(line) = self.heights.line(number) else { return Vec::new() };
        let (z, ends) = (self.heights.z(number), self.heights.nearest(number));
        let beside = |number: usize| {
            let line = self.heights.line(number)?;
            Some(NeighbourLine { z: self.heights.z(number), pieces: &line.pieces })
        };
        let mut beside = [number.checked_sub(1).and_then(beside), beside(number + 1)];
        // The straight line through the line's own light that is nearest, in the mean square, to the light towards the lines
        // beside: a jump over little height does not count. Towards a line of other surfaces light is taken as constant.
        let cubes = [0, 1].map(|side| (ends[side] - z).abs().powi(3));
        let both = (cubes[0] + cubes[1]).max(f64::MIN_POSITIVE);
        let of_piece = |own: &Piece| {
            let mut slopes = [0.0; 2];
            for side in 0..2 {
                let other = beside[side].as_mut().and_then(|line| Some((line.z, line.like(own)?)));
                let Some((other_z, other)) = other else { continue };
                let landing = other.result.landing_z(gap) - own.result.landing_z(gap);
                let depth = other.depth_at(own.middle()) - own.depth_at(own.middle());
                let part = cubes[side] / both / (other_z - z);
                slopes[0] += part * f64::from(landing);
                slopes[1] += part * f64::from(depth);
            }
            let landing = ends.map(|end| own.result.landing_z(gap) + single((end - z) * slopes[0]));
            let depth = (ends[1] - ends[0]) * slopes[1];
            Slopes { landing, tilt: single(tilt_by_depth(depth)) }
        };
        line.pieces.iter().map(of_piece).collect()
    }
}
