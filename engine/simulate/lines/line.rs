//! Lines: a beamlet at one height, cut where the surfaces that its rays cross change.

use crate::sampling::Opening;
use beamlet_core::numbers::single;
use beamlet_interface::{FLAG_NOT_FINITE, FLAG_REFLECTED, RayResult};
use std::cmp::Ordering;

/// Error of a jump of light at a random place of an interval over light and width, 1/√12: the standard deviation of the
/// place (`errors_of_random_light_are_within_the_estimate`, `measured_errors_are_true_ones`).
pub(super) const PER_JUMP: f64 = 0.29;
/// Error of light that is linear between three rays, over what the middle one is off the line through the others: it is
/// off by a quarter between two, on average by two thirds of that.
pub(super) const PER_BEND: f64 = 1.0 / 6.0;
/// Least width of a part of a line with a ray of its own, m: coordinates of rays in f32 are as coarse across a detector.
pub(super) const NARROWEST: f64 = 2e-9;

/// Most rays of a piece or of a line of an audit that draw normals: more lines have more rays (`tests/physics/rough`).
pub(super) const MOST_DRAWS: f64 = 64.0;
/// Most pieces of a line by splits, 0.4 MB, and rays of a line of an audit: rays that all differ would divide it to the
/// narrowest pieces, 50 times as many, before the memory of lines is counted.
pub(super) const MOST_PIECES: usize = 4096;

/// Place of a line.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct LinePlace {
    pub beamlet: i64,
    /// Row coordinate on the detector, downwards.
    pub row: f64,
}

impl LinePlace {
    /// Order by row, then beamlet.
    fn order(&self, other: &Self) -> Ordering {
        self.row.total_cmp(&other.row).then(self.beamlet.cmp(&other.beamlet))
    }

    /// The distinct ones of some places, by row, then beamlet.
    pub(crate) fn distinct(mut places: Vec<Self>) -> Vec<Self> {
        places.sort_unstable_by(Self::order);
        places.dedup();
        places
    }

    /// Index among [`Self::distinct`] places.
    pub(crate) fn index(&self, places: &[Self]) -> Option<usize> {
        places.binary_search_by(|it| it.order(self)).ok()
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
    /// True if its rays draw normals of rough surfaces: they are independent samples.
    pub draws: bool,
}

impl Piece {
    /// A piece whose light is that of one ray of the first order.
    pub(super) fn plain(x: [f64; 2], result: RayResult) -> Self {
        Self {
            x,
            depth: [result.optical_depth; 2],
            displacement: [result.displacement_x; 2],
            scattering: [result.displacement_variance; 2],
            result,
            source: Source::FirstOrder,
            extent: 0.0,
            interval: 0,
            draws: false,
        }
    }

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

    /// True if its ray is of the same interval as another and took the same way: both pass or are reflected, and neither
    /// draws normals.
    pub(super) fn is_like(&self, other: &Self) -> bool {
        let differ = (self.result.flags ^ other.result.flags) & FLAG_REFLECTED != 0;
        self.is_plain() && !differ && self.interval == other.interval
    }

    /// True if its ray is finite and draws no normals.
    fn is_plain(&self) -> bool {
        self.result.flags & FLAG_NOT_FINITE == 0 && !self.draws
    }

    /// Displacement of its ray along x at its middle, and the middle, m.
    fn place(&self) -> RayPlace {
        RayPlace { x: self.middle(), displacement: self.result.displacement_x.into() }
    }

    /// Equal parts of it: one in the middle keeps its ray, the others want theirs.
    pub(crate) fn parts(self, count: u32) -> impl Iterator<Item = Self> {
        self.cut(move |part| f64::from(part) / f64::from(count), count)
    }

    /// Parts of it: one in the middle keeps its ray, the others want theirs. `share`: of its width before a part.
    pub(super) fn cut(self, share: impl Fn(u32) -> f64, count: u32) -> impl Iterator<Item = Self> {
        let between = |[low, high]: [f32; 2], share: f32| low + (high - low) * share;
        (0..count).map(move |part| {
            let shares = [part, part + 1].map(&share);
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

/// Displacement of a ray.
#[derive(Debug, Clone, Copy)]
struct RayPlace {
    /// m from the centre of the beamlet.
    x: f64,
    /// Along x on the analyser, m.
    displacement: f64,
}

impl RayPlace {
    /// Change of the displacement per x to another ray.
    fn slope(&self, to: &Self) -> f64 {
        (to.displacement - self.displacement) / (to.x - self.x)
    }

    /// Displacement at x of the straight line through another ray.
    fn along(&self, to: &Self, x: f64) -> f64 {
        self.displacement + self.slope(to) * (x - self.x)
    }
}

/// Rays next to a piece that took the same way through the sample: pieces of its interval of a line, reflected ones apart.
#[derive(Debug)]
pub(super) struct Neighbours {
    before: Option<RayPlace>,
    after: Option<RayPlace>,
    /// The ray after the next one, to the side that has rays, where only one side does.
    second: Option<RayPlace>,
}

impl Neighbours {
    /// Those of the piece at an index.
    pub(super) fn of(pieces: &[Piece], at: usize) -> Self {
        let own = &pieces[at];
        let place = |at: Option<usize>| {
            Some(pieces.get(at?)?).filter(|it| it.is_like(own)).map(Piece::place)
        };
        let (before, after) = (place(at.checked_sub(1)), place(Some(at + 1)));
        let second = match (before, after) {
            (Some(_), None) => place(at.checked_sub(2)),
            (None, Some(_)) => place(Some(at + 2)),
            _ => None,
        };
        Self { before, after, second }
    }

    /// Change of the displacement per x at the piece: the harmonic mean of those from ray to ray to either side, or of the
    /// next two to one side, which no jump makes steeper than twice the lesser; 0 at an extremum.
    fn slope(&self, own: &Piece) -> f64 {
        let own = own.place();
        let slopes = match (self.before, self.after, self.second) {
            (Some(before), Some(after), _) => [own.slope(&before), own.slope(&after)],
            (Some(next), None, Some(second)) | (None, Some(next), Some(second)) => {
                [own.slope(&next), next.slope(&second)]
            }
            (Some(next), None, None) | (None, Some(next), None) => [own.slope(&next); 2],
            (None, None, _) => return 0.0,
        };
        let [a, b] = slopes;
        if a * b > 0.0 { 2.0 * a * b / (a + b) } else { 0.0 }
    }

    /// Displacement of the ray of a piece by its neighbours: on the straight line through two of them, or that of the
    /// only one.
    pub(super) fn predict(&self, own: &Piece) -> Option<f32> {
        let x = own.middle();
        let of_one =
            |it: RayPlace| self.second.map_or(it.displacement, |other| it.along(&other, x));
        Some(single(match (self.before, self.after) {
            (Some(low), Some(high)) => low.along(&high, x),
            (Some(it), None) | (None, Some(it)) => of_one(it),
            (None, None) => return None,
        }))
    }
}

/// Gives pieces with rays the slope of the displacement that their neighbours show.
pub(super) fn incline(pieces: &mut [Piece]) {
    for at in 0..pieces.len() {
        let piece = &pieces[at];
        if matches!(piece.source, Source::Ray { .. }) && piece.is_plain() {
            let slope = Neighbours::of(pieces, at).slope(piece);
            let half = single(0.5 * slope * piece.width());
            let middle = piece.result.displacement_x;
            pieces[at].displacement = [middle - half, middle + half];
        }
    }
}

/// Largest share of an interval of x (m from the centre of the beamlet) that a mask step opens.
pub(crate) fn open_share(openings: &[Opening], x: [f64; 2]) -> f64 {
    let open = |it: &Opening| x[1].min(it.x[1].into()) - x[0].max(it.x[0].into());
    (openings.iter().map(open).fold(0.0, f64::max) / (x[1] - x[0])).min(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Pieces of 1 um of one interval with rays displaced by this function of x, um.
    fn pieces(displacement: impl Fn(f64) -> f64) -> Vec<Piece> {
        let of = |at: u32| {
            let displacement_x = single(displacement(f64::from(at) + 0.5));
            let result = RayResult { displacement_x, ..bytemuck::Zeroable::zeroed() };
            let piece = Piece::plain([at, at + 1].map(|x| 1e-6 * f64::from(x)), result);
            Piece { source: Source::Ray { displacement: 0.0 }, ..piece }
        };
        (0..5).map(of).collect()
    }

    #[test]
    fn pieces_follow_the_rays_beside_them_but_no_jump() {
        let mut straight = pieces(|x| 3.0 * x);
        incline(&mut straight);
        let mut jumps = [1.0, 2.0].map(|at| pieces(|x| if x < at { 0.0 } else { 100.0 + x }));
        jumps.iter_mut().for_each(|it| incline(it));
        for at in 0..5 {
            let rise = straight[at].displacement.map(f64::from);
            assert!((rise[1] - rise[0] - 3.0).abs() < 1e-5, "{rise:?}");
            let predicted = Neighbours::of(&straight, at).predict(&straight[at]);
            let off = predicted.map(|it| it - straight[at].result.displacement_x);
            assert!(off.is_some_and(|it| it.abs() < 1e-5), "{off:?}");
            for jump in &jumps {
                let rise = jump[at].displacement.map(f64::from);
                assert!((0.0..2.1).contains(&(rise[1] - rise[0])), "{rise:?}");
            }
        }
        // The middle of three rays of a parabola lies below the line through the others.
        let bent = pieces(|x| x * x);
        let predicted = Neighbours::of(&bent, 2).predict(&bent[2]);
        assert!(predicted.is_some_and(|it| (it - 7.25).abs() < 1e-5), "{predicted:?}");
        // At an end the line through the next two.
        let predicted = Neighbours::of(&bent, 4).predict(&bent[4]);
        assert!(predicted.is_some_and(|it| (it - 18.25).abs() < 1e-5), "{predicted:?}");
    }
    #[test]
    fn rays_that_are_reflected_or_lost_are_no_neighbours() {
        for flag in [FLAG_REFLECTED, FLAG_NOT_FINITE] {
            let mut pieces = pieces(|x| 3.0 * x);
            pieces[0].result.flags = flag;
            pieces[0].result.displacement_x = f32::NAN;
            incline(&mut pieces);
            for piece in &pieces[1..] {
                let rise = f64::from(piece.displacement[1] - piece.displacement[0]);
                assert!((rise - 3.0).abs() < 1e-5, "{piece:?}");
            }
        }
    }
}
