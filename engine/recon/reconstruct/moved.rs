//! Tables of Joseph's projector, in f64, for views with motions of their own.

use super::joseph::Rays;
use beamlet_core::numbers::single;
use beamlet_interface::{MovedSheet, MovedView};

/// Least share of the speed along another axis at which rays may belong to an axis: a little more than do.
const NEARLY: f64 = 1.0 - 1e-4;

/// A ray (1, place, row).
type Law = [f64; 3];

fn sum(a: Law, b: Law, factor: f64) -> Law {
    [0, 1, 2].map(|n| a[n] + factor * b[n])
}

fn scaled(a: Law, factor: f64) -> Law {
    a.map(|value| value * factor)
}

fn at(law: Law, [place, row]: [f64; 2]) -> f64 {
    law[0] + law[1] * place + law[2] * row
}

/// Lines of a view in the volume: the ray through u and v on the plane of the rotation centre is at
/// `base` + t `direction` at the depth t, both linear in u and v.
struct Lines {
    /// Along x, y and z from the middle of the volume, m.
    base: [Law; 3],
    /// Change per depth.
    direction: [Law; 3],
}

impl Rays {
    /// Middle of the rows, and from a row to the next, on the plane of the rotation centre, m.
    fn rows(&self) -> [f64; 2] {
        let rows = &self.geometry.rows;
        let scale = self.geometry.magnification();
        [f64::midpoint(rows[0], rows[rows.len() - 1]) / scale, -self.geometry.row_pitch() / scale]
    }

    /// Middle of the places, and from a place to the next, there, m.
    fn columns(&self) -> [f64; 2] {
        let scale = self.geometry.magnification();
        [self.middle() / scale, self.pitch() / scale]
    }

    fn centre(&self, axis: usize) -> f64 {
        let [low, high] = self.grid.ends()[axis];
        f64::midpoint(low, high)
    }

    fn lines(&self, view: usize) -> Lines {
        let seen = self.geometry.motion(view).inverse();
        let [x, y, z] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
            .map(|direction| seen.direction(direction));
        let origin = seen.point([0.0; 3]);
        let ([u, by_place], [v, by_row]) = (self.columns(), self.rows());
        let per = self.geometry.per_distance();
        // u x + v z along an axis.
        let place = |n: usize| [u * x[n] + v * z[n], by_place * x[n], by_row * z[n]];
        let base = [0, 1, 2].map(|n| sum([origin[n] - self.centre(n), 0.0, 0.0], place(n), 1.0));
        let direction = [0, 1, 2].map(|n| sum([y[n], 0.0, 0.0], place(n), per));
        Lines { base, direction }
    }

    /// Three sheets of each view, for the slices across x, y and z.
    pub(super) fn moved_sheets(&self) -> Vec<MovedSheet> {
        let views = 0..self.geometry.angles.len();
        views.flat_map(|view| self.sheets_of(&self.lines(view))).collect()
    }

    /// Slices per depth along each axis.
    fn weights(&self, lines: &Lines) -> [Law; 3] {
        [0, 1, 2].map(|axis| scaled(lines.direction[axis], 1.0 / self.grid.voxel[axis]))
    }

    /// Slices per depth of the rays of a view along x, y and z.
    pub(super) fn moved_speeds(&self, view: usize) -> [Law; 3] {
        self.weights(&self.lines(view))
    }

    fn sheets_of(&self, lines: &Lines) -> [MovedSheet; 3] {
        let weights = self.weights(lines);
        let last = self.places.len() - 1;
        let steps = self.steps();
        let half = (self.geometry.rows.len() - 1) as f64 / 2.0;
        let corners = [0, 1, 2, 3].map(|n| {
            let place = if n & 1 == 0 { steps[0] } else { steps[last] };
            [place, if n & 2 == 0 { -half } else { half }]
        });
        // Differences of speeds are linear where the speeds keep their sign; else rays may be anywhere.
        let is_signed = |axis: usize| {
            let signs = corners.map(|corner| at(weights[axis], corner) > 0.0);
            signs.iter().all(|sign| *sign) || signs.iter().all(|sign| !*sign)
        };
        let may_lead = |axis: usize, other: usize| {
            let leads = |corner: &[f64; 2]| {
                at(weights[axis], *corner).abs() >= NEARLY * at(weights[other], *corner).abs()
            };
            !is_signed(axis) || !is_signed(other) || corners.iter().any(leads)
        };
        let voxel = self.grid.voxel;
        [0, 1, 2].map(|axis| {
            let side = voxel[axis];
            let [first, second] = others(axis);
            // A ray meets slice s at t = (s − base)/direction; other coordinates there are
            // base' + t direction', over the same quotient. Products of two places cancel.
            let crossing = |other: usize| {
                let [b, d] = [lines.base[axis], lines.direction[axis]];
                let [c, e] = [lines.base[other], lines.direction[other]];
                let constant = c[0] * d[0] - b[0] * e[0];
                let linear = |n: usize| c[n] * d[0] + c[0] * d[n] - b[n] * e[0] - b[0] * e[n];
                let per = 1.0 / (side * voxel[other]);
                let at_zero = scaled([constant, linear(1), linear(2)], per);
                (at_zero, scaled(e, 1.0 / voxel[other]))
            };
            let [(at_first, by_first), (at_second, by_second)] = [first, second].map(crossing);
            let is_used = [first, second].into_iter().all(|other| may_lead(axis, other));
            let f32s = |law: Law| law.map(single);
            MovedSheet {
                first: f32s(at_first),
                first_by_slice: f32s(by_first),
                second: f32s(at_second),
                second_by_slice: f32s(by_second),
                weight: f32s(weights[axis]),
                depth: f32s(scaled(lines.base[axis], -1.0 / side)),
                depth_by_slice: 1.0,
                is_used: is_used.into(),
            }
        })
    }

    /// Where each view sees voxels.
    pub(super) fn moved_views(&self) -> Vec<MovedView> {
        let ([u, by_place], [v, by_row]) = (self.columns(), self.rows());
        let per = self.geometry.per_distance();
        let voxel = self.grid.voxel;
        let of_view = |view: usize| {
            let motion = self.geometry.motion(view);
            let middle = motion.point([0, 1, 2].map(|axis| self.centre(axis)));
            let sides = [0, 1, 2].map(|axis| {
                let mut side = [0.0; 3];
                side[axis] = voxel[axis];
                motion.direction(side)
            });
            // x, depth and z of a voxel in the frame of the set-up.
            let along = |n: usize| [sides[0][n], sides[1][n], sides[2][n], middle[n]];
            let [x, depth, z] = [0, 1, 2].map(along);
            let mut scale = depth.map(|value| value * per);
            scale[3] += 1.0;
            let over = |of: [f64; 4], zero: f64, by: f64| {
                [0, 1, 2, 3].map(|n| single((of[n] - zero * scale[n]) / by))
            };
            MovedView {
                place: over(x, u, by_place),
                row: over(z, v, by_row),
                scale: scale.map(single),
            }
        };
        (0..self.geometry.angles.len()).map(of_view).collect()
    }

    /// Depth from slice to slice on the ray through a place in a row of a view with a motion, m.
    pub(super) fn moved_steps(&self, view: usize, row: usize) -> Vec<f64> {
        let weights = self.moved_speeds(view);
        let row = row as f64 - (self.geometry.rows.len() - 1) as f64 / 2.0;
        let most =
            |place: f64| weights.iter().map(|law| at(*law, [place, row]).abs()).fold(0.0, f64::max);
        self.steps().into_iter().map(|place| 1.0 / most(place)).collect()
    }
}

const fn others(axis: usize) -> [usize; 2] {
    match axis {
        0 => [1, 2],
        1 => [0, 2],
        _ => [0, 1],
    }
}
