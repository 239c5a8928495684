//! Lines: a beamlet at one height, cut where the surfaces that its rays cross change.

use crate::sampling::Opening;
use beamlet_core::numbers::single;
use beamlet_interface::RayResult;
use std::cmp::Ordering;

/// Error of a jump of light at a random place of an interval over light and width, 1/√12: the standard deviation of the
/// place (`errors_of_random_light_are_within_the_estimate`, `measured_errors_are_true_ones`).
pub(super) const PER_JUMP: f64 = 0.29;
/// Least width of a part of a line with a ray of its own, m: coordinates of rays in f32 are as coarse across a detector.
pub(super) const NARROWEST: f64 = 2e-9;

/// Place of a line.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct LinePlace {
    pub beamlet: i64,
    /// Row coordinate on the detector, downwards.
    pub row: f64,
}

impl LinePlace {
    /// Order by row, then beamlet.
    pub(crate) fn order(&self, other: &Self) -> Ordering {
        self.row.total_cmp(&other.row).then(self.beamlet.cmp(&other.beamlet))
    }
}

/// Source of the result of a piece.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Source {
    /// The first order, which is enough.
    FirstOrder,
    /// A ray through its middle, which is not traced yet.
    Wanted,
    /// A ray through its middle. `displacement`: along x by the first order, m.
    Ray { displacement: f32 },
}

/// Part of a line whose rays cross the same surfaces: optical depth and displacement are linear in x.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Piece {
    /// Ends, m from the centre of the beamlet.
    pub x: [f64; 2],
    /// Optical depth at both ends.
    pub depth: [f32; 2],
    /// Displacement along x on the analyser at both ends, m.
    pub displacement: [f32; 2],
    /// Part of the variance of the displacement by materials that scatter, at both ends, m2.
    pub scattering: [f32; 2],
    /// The ray through its middle.
    pub result: RayResult,
    pub source: Source,
    /// Distance from its first surface to its last one, m.
    pub extent: f32,
    /// Number of the interval of the line between ends of facets that it is part of.
    pub interval: u32,
    /// True if its rays cross curved surfaces.
    pub is_curved: bool,
    /// True if its rays draw normals of rough surfaces: they are independent samples.
    pub draws: bool,
}

impl Piece {
    /// Width, m.
    pub(crate) fn width(&self) -> f64 {
        self.x[1] - self.x[0]
    }

    /// Its middle, m from the centre of the beamlet.
    pub(crate) fn middle(&self) -> f64 {
        f64::midpoint(self.x[0], self.x[1])
    }

    /// Optical depth at a place, m from the centre of the beamlet.
    pub(crate) fn depth_at(&self, x: f64) -> f32 {
        let [low, high] = self.depth;
        low + (high - low) * single((x - self.x[0]) / self.width())
    }

    /// Takes the exact ray through its middle: the slope of the depth stays.
    pub(crate) fn take(&mut self, ray: &RayResult) {
        let more = ray.optical_depth - self.result.optical_depth;
        self.depth = self.depth.map(|depth| (depth + more).max(0.0));
        self.source = Source::Ray { displacement: self.result.displacement_x };
        self.displacement = [ray.displacement_x; 2];
        let more = ray.displacement_variance - self.result.displacement_variance;
        self.scattering =
            self.scattering.map(|it| if it > 0.0 { (it + more).max(0.0) } else { it });
        let RayResult { signature, crossings, .. } = self.result;
        self.result = RayResult { signature, crossings, ..*ray };
    }

    /// Equal parts of it: one in the middle keeps its ray, the others want theirs.
    pub(crate) fn parts(self, count: u32) -> impl Iterator<Item = Self> {
        let between = |[low, high]: [f32; 2], share: f32| low + (high - low) * share;
        (0..count).map(move |part| {
            let shares = [part, part + 1].map(|at| f64::from(at) / f64::from(count));
            let ends = |of: [f32; 2]| shares.map(|share| between(of, single(share)));
            let x = [shares[0], shares[1]].map(|share| self.x[0] + self.width() * share);
            let x = if part + 1 == count { [x[0], self.x[1]] } else { x };
            let (depth, displacement) = (ends(self.depth), ends(self.displacement));
            let scattering = ends(self.scattering);
            let mut piece = Self { x, depth, displacement, scattering, ..self };
            let [own, mean] = [scattering, self.scattering].map(|[low, high]| 0.5 * (low + high));
            piece.result.displacement_variance += own - mean;
            piece.result.optical_depth = 0.5 * (depth[0] + depth[1]);
            match self.source {
                Source::Ray { .. } if 2 * part + 1 == count => {}
                Source::Ray { displacement } => {
                    piece.result.displacement_x = displacement;
                    piece.source = Source::Wanted;
                }
                Source::FirstOrder | Source::Wanted => {
                    piece.result.displacement_x = 0.5 * (displacement[0] + displacement[1]);
                }
            }
            piece
        })
    }
}

/// Largest share of an interval of x (m from the centre of the beamlet) that a mask step opens.
pub(crate) fn open_share(openings: &[Opening], x: [f64; 2]) -> f64 {
    let open = |it: &Opening| x[1].min(it.x[1].into()) - x[0].max(it.x[0].into());
    (openings.iter().map(open).fold(0.0, f64::max) / (x[1] - x[0])).min(1.0)
}
