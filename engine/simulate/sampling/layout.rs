//! Layout of pieces in a rectangle: rectangles of their areas without gaps.

use super::piece::Piece;
use beamlet_core::numbers::single;

/// Number of pieces above which only cuts through the middle third are considered.
const MOST_CUTS: usize = 24;

/// Lays out the pieces named by `order` in their rectangle: cut in two where the smallest area lies on
/// the wrong side, recursively.
pub(super) fn stand(pieces: &mut [Piece], order: &mut [usize], x: [f32; 2], z: [f32; 2]) {
    if let [only] = order {
        (pieces[*only].x, pieces[*only].z) = (x, z);
        return;
    }
    if order.is_empty() {
        return;
    }
    let sides = [x, z];
    let cuts = [0, 1].map(|axis| {
        sort(pieces, order, axis);
        best_cut(pieces, order, axis, sides[axis])
    });
    let axis = usize::from(cuts[1].misfit < cuts[0].misfit);
    if axis == 0 {
        sort(pieces, order, axis);
    }
    let Cut { first, border, .. } = cuts[axis];
    let (before, after) = order.split_at_mut(first);
    let parts = [[sides[axis][0], border], [border, sides[axis][1]]];
    for (order, part) in [before, after].into_iter().zip(parts) {
        if axis == 0 {
            stand(pieces, order, part, z);
        } else {
            stand(pieces, order, x, part);
        }
    }
}

/// Sorts pieces by their centroids along an axis.
fn sort(pieces: &[Piece], order: &mut [usize], axis: usize) {
    let at = |piece: usize| pieces[piece].centroid[axis];
    order.sort_unstable_by(|a, b| at(*a).total_cmp(&at(*b)).then(a.cmp(b)));
}

/// A cut of a rectangle between its pieces.
struct Cut {
    /// Number of the pieces before it.
    first: usize,
    border: f32,
    /// Area that lies on the wrong side, share of the smaller part.
    misfit: f64,
}

/// The cut across an axis that has the least of its pieces on the wrong side. Of two or more, in
/// the order of their centroids along it.
fn best_cut(pieces: &[Piece], order: &[usize], axis: usize, [low, high]: [f32; 2]) -> Cut {
    // Share, and bounds along the axis: the first and the inverse of their distance.
    let reach = |piece: &usize| {
        let piece = &pieces[*piece];
        let [from, to] = piece.bounds[axis].map(f64::from);
        (f64::from(piece.share), from, to, 1.0 / (to - from).max(1e-300))
    };
    let reaches: Vec<(f64, f64, f64, f64)> = order.iter().map(reach).collect();
    let all: f64 = reaches.iter().map(|(share, ..)| share).sum();
    let (low, high) = (f64::from(low), f64::from(high));
    let mut best = Cut { first: 1, border: single(low), misfit: f64::INFINITY };
    let count = order.len();
    let cuts = if count > MOST_CUTS { count / 3..count - count / 3 } else { 1..count };
    let mut before: f64 = reaches[..cuts.start - 1].iter().map(|(share, ..)| share).sum();
    for first in cuts {
        before += reaches[first - 1].0;
        let border = low + (high - low) * before / all;
        let beyond = |share: f64, over: f64, inverse: f64| share * (over * inverse).clamp(0.0, 1.0);
        let (left, right) = reaches.split_at(first);
        let over = left.iter().map(|(share, _, to, inverse)| beyond(*share, to - border, *inverse));
        let under =
            right.iter().map(|(share, from, _, inverse)| beyond(*share, border - from, *inverse));
        // Of the smaller part: a sliver is not to be cut off where it does not lie.
        let smaller = before.min(all - before).max(f64::MIN_POSITIVE);
        let misfit = over.chain(under).sum::<f64>() / smaller;
        if misfit < best.misfit {
            best = Cut { first, border: single(border.clamp(low, high)), misfit };
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::super::row_spread::PieceRows;
    use super::*;

    fn piece(share: f32, x: [f32; 2], z: [f32; 2]) -> Piece {
        Piece {
            x: [0.0; 2],
            z: [0.0; 2],
            share,
            centroid: [x, z].map(|[low, high]| 0.5 * (low + high)),
            bounds: [x, z],
            variance: 0.0,
            result: bytemuck::Zeroable::zeroed(),
            rows: PieceRows {
                whole: [0.0, 1.0],
                centroid: 0.5,
                down: 0.0,
                shares: [0.0; 2],
                rises: [0.0; 2],
            },
            outline: [0.0; 2],
            slope_depth: 0.0,
            by_ray: false,
        }
    }

    #[test]
    fn pieces_that_stand_side_by_side_stay_where_they_are() {
        let all = [0.0, 1.0];
        let mut pieces = [
            piece(0.25, [5e-6, 7e-6], all),
            piece(0.5, [-1e-6, 3e-6], all),
            piece(0.25, [3e-6, 5e-6], all),
        ];
        stand(&mut pieces, &mut [0, 1, 2], [-1e-6, 7e-6], all);
        assert_eq!(pieces.map(|p| p.x), [[5e-6, 7e-6], [-1e-6, 3e-6], [3e-6, 5e-6]]);
        assert_eq!(pieces.map(|p| p.z), [all; 3]);
    }

    #[test]
    fn pieces_one_above_the_other_beside_a_third_stay_where_they_are() {
        let mut pieces = [
            piece(0.3, [0.0, 4e-6], [0.4, 1.0]),
            piece(0.5, [4e-6, 8e-6], [0.0, 1.0]),
            piece(0.2, [0.0, 4e-6], [0.0, 0.4]),
        ];
        stand(&mut pieces, &mut [0, 1, 2], [0.0, 8e-6], [0.0, 1.0]);
        assert_eq!(pieces.map(|p| p.x), [[0.0, 4e-6], [4e-6, 8e-6], [0.0, 4e-6]]);
        assert_eq!(pieces.map(|p| p.z), [[0.4, 1.0], [0.0, 1.0], [0.0, 0.4]]);
    }
}
