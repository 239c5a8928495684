//! Pieces of an interval of a line.

use super::effects::{Change, Sums};
use super::{Interval, SurfaceLines};
use crate::lines::line::{MOST_DRAWS, NARROWEST, Piece, Source, open_share};
use crate::sampling::Opening;
use beamlet_core::numbers::{self, single};
use beamlet_interface::RayResult;

/// Change of the optical depth over a piece behind facets: light is linear in a cell.
const STEEPEST: f64 = 0.1;
/// Most of the light of a piece that lies elsewhere than that of the exponential whose change is 1: it grows with the
/// square of the change, which is small.
const OFF_LINEAR: f64 = 1.0 / 125.0;
/// Error by light of a piece that is not straight, share of the budget.
const CURVED: f64 = 0.01;
/// Error by light of a displacement that leaves a straight line, over that of the displacement at most.
const MOVED: f64 = 0.25;
/// Error by light of the change of a variance over a piece, which has its mean, share of the budget.
const WIDENED: f64 = 0.1;
/// Error by light of a piece near grazing that needs no exact ray, share of the budget.
const NEGLIGIBLE: f64 = 0.03;

/// The ray between two ends of a piece of curved surfaces.
pub(super) struct Middle {
    sums: Sums,
    /// Change of x over that of the share of the interval at the low end, at the ray and at the high end, up to a factor.
    densities: [f64; 3],
    /// True for each end of the piece that is a rim.
    rims: [bool; 2],
}

impl Middle {
    /// Ends of the change that is linear over the piece and has the mean of the exact one, by Simpson's rule over the share
    /// of the interval. At a rim displacements are infinite and depths steep: there the end follows from the other one.
    fn straighten(&self, ends: [Change; 2]) -> [Change; 2] {
        let [low, own, high] = self.densities;
        let all = low + 4.0 * own + high;
        let none = Change::default();
        let mean = none
            .plus(&ends[0], low / all)
            .plus(&self.sums.change, 4.0 * own / all)
            .plus(&ends[1], high / all);
        let opposite = |end: &Change| mean.plus(&mean, 1.0).plus(end, -1.0);
        match self.rims {
            [true, _] => [opposite(&ends[1]), ends[1]],
            [_, true] => [ends[0], opposite(&ends[0])],
            _ => {
                let off = mean.plus(&ends[0].towards(&ends[1], 0.5), -1.0);
                ends.map(|end| end.plus(&off, 1.0))
            }
        }
    }
}

impl SurfaceLines<'_> {
    /// Adds parts of a piece behind facets, over which depth, and the variance by materials, change little.
    pub(super) fn add_flat_pieces(
        &self,
        piece: Piece,
        openings: &[Opening],
        pieces: &mut Vec<Piece>,
    ) {
        let mut add = |piece: Piece| {
            let draws = self.draws_of(&piece, openings);
            pieces.extend(piece.parts(draws.max(self.parts_by_scattering(&piece, openings))));
        };
        if f64::from((piece.depth[1] - piece.depth[0]).abs()) <= STEEPEST {
            return add(piece);
        }
        let shares = self.shares_by_depth(&piece, openings);
        let count = numbers::count(shares.len() - 1);
        piece.cut(|part| shares[part as usize], count).for_each(add);
    }

    /// Shares of the width of a piece behind facets, from 0 to 1, between which the depth changes by [`STEEPEST`], or by
    /// more where less light is left: the total of each part is exact, and only part of its light at an edge counts.
    fn shares_by_depth(&self, piece: &Piece, openings: &[Opening]) -> Vec<f64> {
        let [low, high] = piece.depth.map(f64::from);
        let change = (high - low).abs();
        let response = self.view.responses.first();
        let open = self.open(piece, openings);
        // The error of a part is its light times the square of its change.
        let least = CURVED * self.view.budget.light * change / (OFF_LINEAR * open);
        let mut depths = vec![0.0];
        let mut depth = 0.0;
        while depth < change {
            let passed = response.hardening.light(single(low.min(high) + depth));
            depth += (least / f64::from(passed)).cbrt().clamp(STEEPEST, change);
            depths.push(depth);
        }
        // From the thin end, the last part as much shorter as the others.
        let shares = depths.into_iter().map(|it| it / depth);
        if low < high { shares.collect() } else { shares.rev().map(|it| 1.0 - it).collect() }
    }

    /// Pieces of an interval of curved surfaces, halved until they are straight.
    pub(super) fn curved_pieces(&self, interval: &Interval<'_>, pieces: &mut Vec<Piece>) {
        let rims = interval.rims();
        let place = |share: f64| interval.place(share, rims);
        let sums = |share: f64| self.sums(interval, place(share));
        let [low, middle, high] = [0.0, 0.5, 1.0].map(sums);
        let mut waiting = vec![([0.5, 1.0], [middle, high]), ([0.0, 0.5], [low, middle])];
        while let Some((shares, ends)) = waiting.pop() {
            let half = f64::midpoint(shares[0], shares[1]);
            let x = shares.map(place);
            let middle = sums(half);
            if self.bends(interval, x, [&ends[0], &middle, &ends[1]]) {
                waiting.push(([half, shares[1]], [middle, ends[1]]));
                waiting.push(([shares[0], half], [ends[0], middle]));
            } else {
                let densities = [shares[0], half, shares[1]].map(|it| interval.density(it, rims));
                let rims = [rims[0] && shares[0] <= 0.0, rims[1] && shares[1] >= 1.0];
                let middle = Middle { sums: middle, densities, rims };
                let piece = self.piece(interval, x, &ends, Some(&middle));
                pieces.extend(piece.parts(self.draws_of(&piece, interval.openings)));
            }
        }
    }

    /// True if light is not straight enough in a part of an interval.
    fn bends(&self, interval: &Interval<'_>, x: [f64; 2], at: [&Sums; 3]) -> bool {
        let responses = self.view.responses;
        let response = responses.first();
        let width = x[1] - x[0];
        if width < NARROWEST {
            return false;
        }
        let share = responses.lit(single(open_share(interval.openings, x)));
        let whole = width * f64::from(response.weight * share);
        let passed =
            at.map(|it| f64::from(response.hardening.light(single(it.change.depth.max(0.0)))));
        let off = |[low, middle, high]: [f64; 3]| (middle - f64::midpoint(low, high)).abs();
        let most = passed.into_iter().fold(0.0, f64::max);
        let moved = if self.matters(whole * most, at[1].remainder) {
            // Rays go on from here, where all of it is near grazing.
            f64::from(u8::from(at.iter().any(|it| it.remainder <= 0.0)))
        } else {
            MOVED * off(at.map(|it| it.change.displacement.x)) * responses.steepest
        };
        let error = whole * (off(passed) + most * moved.min(1.0));
        let widened = self.widening([0, 2].map(|end| at[end].change.scattering));
        error > CURVED * self.view.budget.light
            || whole * most * widened > WIDENED * self.view.budget.light
    }

    /// Largest change of light, share of it, by a change of the variance of the displacement between two values.
    fn widening(&self, [low, high]: [f64; 2]) -> f64 {
        ((high - low).abs() * self.view.responses.steepest.powi(2)).min(1.0)
    }

    /// Number of parts of a piece whose variances by materials are constant: the error falls with its square, since
    /// light and variance both belong to a part.
    fn parts_by_scattering(&self, piece: &Piece, openings: &[Opening]) -> u32 {
        let widened = self.widening(piece.scattering.map(f64::from));
        if widened <= 0.0 {
            return 1;
        }
        let error = self.light(piece, openings) * widened;
        let parts = (error / (WIDENED * self.view.budget.light)).sqrt().ceil();
        numbers::whole(parts.max(1.0))
    }

    /// The piece between two ends, with the sums of the rays there and, of curved surfaces, in the middle.
    pub(super) fn piece(
        &self,
        interval: &Interval<'_>,
        x: [f64; 2],
        ends: &[Sums; 2],
        middle: Option<&Middle>,
    ) -> Piece {
        let mut changes = ends.map(|it| it.change);
        let remainder = middle.map_or(&ends[0], |it| &it.sums).remainder;
        if ends.iter().any(|it| it.remainder > 0.0) {
            self.bound(&mut changes);
        }
        if let Some(middle) = middle {
            changes = middle.straighten(changes);
            if remainder > 0.0 {
                // A ray has the displacement in the middle.
                let own = middle.sums.change;
                changes = changes.map(|end| Change { depth: end.depth, ..own });
            }
        }
        // Rounded.
        let depth = changes.map(|end| single(end.depth.max(0.0)));
        let scattering = changes.map(|end| single(end.scattering.max(0.0)));
        let mean = changes[0].towards(&changes[1], 0.5);
        let crossed = || interval.crossed.iter();
        let result = RayResult {
            optical_depth: 0.5 * (depth[0] + depth[1]),
            displacement_x: single(mean.displacement.x),
            displacement_z: single(mean.displacement.y),
            slope_x: single(mean.slope.x),
            slope_z: single(mean.slope.y),
            signature: crossed().fold(0, |all, it| all.wrapping_add(it.hash)),
            flags: 0,
            crossings: crossed().map(|it| it.crossings).sum(),
            displacement_variance: single(mean.roughness) + 0.5 * (scattering[0] + scattering[1]),
            // Cells widen light along x alone.
            variance_z: 0.0,
            covariance: 0.0,
        };
        let displacement = changes.map(|end| single(end.displacement.x));
        let nearest = ends[0].distance[0].min(ends[1].distance[0]);
        let extent = single(ends[0].distance[1].max(ends[1].distance[1]) - nearest);
        let mut piece = Piece {
            x,
            depth,
            displacement,
            scattering,
            result,
            source: Source::FirstOrder,
            extent,
            interval: interval.number,
            draws: middle.is_none_or(|it| it.sums.draws) && ends.iter().any(|it| it.draws),
        };
        let is_exact = self.view.facets.is_exact && !interval.crossed.is_empty();
        let remainder = if is_exact { f64::INFINITY } else { remainder };
        if remainder > 0.0 && self.counts(&piece, interval.openings, remainder) {
            piece.source = Source::Wanted;
        }
        piece
    }

    /// Number of rays of a piece: of one whose rays draw normals about the root of those that its light needs, so
    /// that as many lines are.
    fn draws_of(&self, piece: &Piece, openings: &[Opening]) -> u32 {
        if !piece.draws || piece.source != Source::Wanted {
            return 1;
        }
        let light = self.light(piece, openings) / self.view.budget.light;
        numbers::whole(light.ceil().clamp(1.0, MOST_DRAWS))
    }

    /// Reduces displacements by the first order near grazing incidence to what total reflection makes.
    fn bound(&self, ends: &mut [Change; 2]) {
        let (lattice, pitch) = (self.view.lattice, self.view.optics.detector.pitch);
        let farthest = [lattice.halo_columns, lattice.halo].map(|halo| halo as f64);
        for end in ends {
            let over = |axis: usize| {
                let most = (farthest[axis] - 1.0).max(0.5) * pitch[axis];
                (end.displacement[axis].abs() / most).max(1.0)
            };
            let factor = over(0).max(over(1)).recip();
            end.displacement *= factor;
            end.slope *= factor;
        }
    }

    /// True if a first-order remainder of the displacement matters in a piece.
    fn counts(&self, piece: &Piece, openings: &[Opening], remainder: f64) -> bool {
        piece.width() >= NARROWEST && self.matters(self.light(piece, openings), remainder)
    }

    /// Light of a piece at the mask step that opens it most, share of open beam.
    fn light(&self, piece: &Piece, openings: &[Opening]) -> f64 {
        let passed = self.view.responses.first().hardening.light(piece.result.optical_depth);
        self.open(piece, openings) * f64::from(passed)
    }

    /// The same without the sample.
    fn open(&self, piece: &Piece, openings: &[Opening]) -> f64 {
        let responses = self.view.responses;
        let share = responses.lit(single(open_share(openings, piece.x)));
        piece.width() * f64::from(responses.first().weight * share)
    }

    /// True if light with this first-order remainder of its displacement errs by more than needs no exact ray.
    fn matters(&self, light: f64, remainder: f64) -> bool {
        let moved = (remainder * self.view.responses.steepest).min(1.0);
        light * moved > NEGLIGIBLE * self.view.budget.light
    }
}

#[cfg(test)]
mod tests {
    use super::super::THINNEST;
    use super::*;
    use crate::lines::line::LinePlace;
    use glam::DVec2;

    /// Behind a rim depths grow with the root of the distance and displacements fall with it: over a piece the means are
    /// those of the integrals, next to the rim and farther from it.
    #[test]
    fn means_of_pieces_at_a_rim_are_those_of_integrals() {
        let width = 1e-6;
        let place = LinePlace { beamlet: 0, row: 0.0 };
        let x = [0.0, width];
        let interval = Interval { x, crossed: &[], openings: &[], place: &place, number: 0 };
        for rims in [[true, false], [false, true]] {
            for [near, far] in [[0.0, 0.125], [0.125, 0.25], [0.75, 1.0]] {
                let shares = if rims[0] { [near, far] } else { [1.0 - far, 1.0 - near] };
                let half = f64::midpoint(shares[0], shares[1]);
                let change = |share: f64| {
                    let at = interval.place(share, rims);
                    let from_rim = if rims[0] { at } else { width - at };
                    let root = (from_rim.max(THINNEST) / width).sqrt();
                    let displacement = DVec2::new(1.0 / root, -0.5 / root);
                    Change { depth: root, displacement, ..Change::default() }
                };
                let middle = Middle {
                    sums: Sums { change: change(half), ..Sums::default() },
                    densities: [shares[0], half, shares[1]].map(|it| interval.density(it, rims)),
                    rims: rims.map(|it| it && near <= 0.0),
                };
                let [low, high] = middle.straighten(shares.map(change));
                let mean = low.towards(&high, 0.5);
                let area = far * far - near * near;
                let want = 2.0 * (far - near) / area;
                // A ray at a rim is computed inside, 3e-4 of the root of the width.
                assert!((mean.displacement.x / want - 1.0).abs() < 2e-3, "{rims:?} {near}");
                assert!((mean.displacement.y / want + 0.5).abs() < 2e-3, "{rims:?} {near}");
                let want = 2.0 / 3.0 * (far.powi(3) - near.powi(3)) / area;
                assert!((mean.depth / want - 1.0).abs() < 2e-3, "{rims:?} {near}");
            }
        }
    }
}
