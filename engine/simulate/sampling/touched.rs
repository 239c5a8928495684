//! Rows and beamlets that a polygon touches.

use super::lattice::Lattice;
use beamlet_core::numbers;
use std::ops::Range;

/// Calls `visit` with the rows that a segment or triangle touches, and the beamlets in each.
/// `corners`: x in the cell plane and row coordinate.
pub(super) fn touched(
    lattice: &Lattice,
    rows: &Range<i64>,
    corners: &[[f64; 2]],
    mut visit: impl FnMut(i64, Range<i64>),
) {
    let z = corners.iter().map(|corner| corner[1]);
    let top =
        numbers::whole::<i64>(z.clone().fold(f64::INFINITY, f64::min).floor()).max(rows.start);
    let bottom =
        (numbers::whole::<i64>(z.fold(f64::NEG_INFINITY, f64::max).floor()) + 1).min(rows.end);
    for row in top..bottom {
        let (low, high) = (row as f64, (row + 1) as f64);
        let mut x = [f64::INFINITY, f64::NEG_INFINITY];
        let mut take = |at: f64| x = [x[0].min(at), x[1].max(at)];
        for (i, a) in corners.iter().enumerate() {
            if a[1] >= low && a[1] <= high {
                take(a[0]);
            }
            let b = corners[(i + 1) % corners.len()];
            for border in [low, high] {
                if (a[1] < border) != (b[1] < border) {
                    take(a[0] + (b[0] - a[0]) * (border - a[1]) / (b[1] - a[1]));
                }
            }
        }
        if x[0] <= x[1] {
            visit(row, lattice.beamlets_of(x));
        }
    }
}
