//! Small ears of large polygons.
//!
//! Ears that are cut one by one from one end leave triangles as long as the polygon, and the search
//! for what lies in them takes the square of the number of corners. Here a round goes all the way
//! around and cuts about every second corner whose triangle holds no other: triangles grow with
//! the rounds, and corners get fewer as fast.

use super::polygon::turn;
use super::tree::{Query, Tree};
use glam::{DVec2, DVec3};

/// Corners from which on rounds are worth it, and which they leave about.
const LARGE: usize = 5_000;
/// Share of the corners that a round has to cut.
const WORTH: f64 = 0.05;
/// Corners that are looked at for an ear.
const LOOKS: usize = 1_024;

/// Ears of a polygon that winds to the left, and the corners that are left, in their order.
pub(super) fn small(flat: &[DVec2]) -> (Vec<[usize; 3]>, Vec<usize>) {
    let mut ring: Vec<usize> = (0..flat.len()).collect();
    let mut found = Vec::new();
    while ring.len() > LARGE {
        let (ears, left) = round(flat, &ring);
        let worth = ears.len() as f64 > WORTH * ring.len() as f64;
        found.extend(ears);
        ring = left;
        if !worth {
            break;
        }
    }
    (found, ring)
}

/// Ears of one round, no two of them side by side, and the corners that it leaves.
fn round(flat: &[DVec2], ring: &[usize]) -> (Vec<[usize; 3]>, Vec<usize>) {
    let corners = Corners::new(flat, ring);
    let n = ring.len();
    let (mut ears, mut left) = (Vec::new(), Vec::with_capacity(n));
    let mut before_is_cut = false;
    for at in 0..n {
        let ear = [ring[(at + n - 1) % n], ring[at], ring[(at + 1) % n]];
        // The first corner stays, for the last one is beside it.
        let cuts = at > 0 && !before_is_cut && turn(flat, ear) > 0.0 && corners.leave_free(ear);
        match cuts {
            true => ears.push(ear),
            false => left.push(ring[at]),
        }
        before_is_cut = cuts;
    }
    (ears, left)
}

/// Corners that may lie in ears.
struct Corners<'a> {
    flat: &'a [DVec2],
    ring: &'a [usize],
    /// Over the ring: long thin ears look along them, not through their boxes.
    tree: Tree,
}

impl<'a> Corners<'a> {
    fn new(flat: &'a [DVec2], ring: &'a [usize]) -> Self {
        let points: Vec<[DVec3; 2]> =
            ring.iter().map(|corner| [flat[*corner].extend(0.0); 2]).collect();
        Self { flat, ring, tree: Tree::of_boxes(&points) }
    }

    /// Whether no other corner lies in the triangle or on its edge; not where the search is long.
    fn leave_free(&self, ear: [usize; 3]) -> bool {
        let [a, b, c] = ear.map(|corner| self.flat[corner]);
        let inside = |point: DVec2| {
            [(a, b), (b, c), (c, a)]
                .iter()
                .all(|(from, to)| (*to - *from).perp_dot(point - *from) >= 0.0)
        };
        let (mut looks, mut free) = (0, true);
        self.tree.near(&Query::new([a, b, c].map(|it| it.extend(0.0)), None, 0.0), |at| {
            let corner = self.ring[at as usize];
            looks += 1;
            free = looks <= LOOKS && (ear.contains(&corner) || !inside(self.flat[corner]));
            free
        });
        free
    }
}

#[cfg(test)]
mod tests {
    use super::super::polygon::triangles;
    use super::*;
    use std::f64::consts::TAU;

    /// Area of the triangles, with and without their sign, and that of the polygon.
    fn areas(corners: &[DVec3]) -> [f64; 3] {
        let cut = triangles(corners).unwrap();
        assert_eq!(cut.len(), corners.len() - 2);
        let of = |[a, b, c]: [usize; 3]| {
            (corners[b] - corners[a]).cross(corners[c] - corners[a]).z / 2.0
        };
        let n = corners.len();
        let whole = (0..n).map(|at| corners[at].cross(corners[(at + 1) % n]).z / 2.0).sum();
        [cut.iter().map(|it| of(*it)).sum(), cut.iter().map(|it| of(*it).abs()).sum(), whole]
    }

    #[test]
    fn long_teeth_are_cut_off_whatever_their_direction() {
        for depth in [0.05, 0.5] {
            let at = |k: u32| {
                let radius = if k.is_multiple_of(2) { 1.0 } else { 1.0 - depth };
                DVec2::from_angle(TAU * f64::from(k) / 40_000.0) * radius
            };
            let flat: Vec<DVec2> = (0..40_000).map(at).collect();
            let (found, left) = small(&flat);
            assert!(left.len() <= LARGE, "{depth}: {} are left", left.len());
            assert_eq!(found.len() + left.len(), flat.len());
        }
    }

    #[test]
    fn large_polygons_are_covered_without_turning_over_and_soon() {
        let begin = std::time::Instant::now();
        for count in [6_000_u32, 100_000] {
            let at = |k: u32, radius: f64| {
                let angle = TAU * f64::from(k) / f64::from(count);
                // Rounded as texts are: no longer convex.
                let [x, y] = [angle.cos(), angle.sin()].map(|it| (it * radius * 1e9).round() / 1e9);
                DVec3::new(x, y, 0.0)
            };
            let circle = |_: u32| 1.0;
            let teeth = |k: u32| if k.is_multiple_of(2) { 1.0 } else { 0.95 };
            let comb = |k: u32| if k % 64 < 32 { 1.0 } else { 0.5 };
            let waves = |k: u32| 1.0 + 0.3 * (f64::from(k) * 0.003).sin();
            let shapes: [fn(u32) -> f64; 4] = [circle, teeth, comb, waves];
            for shape in shapes {
                let corners: Vec<DVec3> = (0..count).map(|k| at(k, shape(k))).collect();
                let [signed, unsigned, whole] = areas(&corners);
                assert!((signed - whole).abs() < 1e-9 && unsigned - signed < 1e-9, "{signed}");
            }
        }
        // Some seconds; the square of 100,000 took twelve for the teeth alone.
        assert!(begin.elapsed().as_secs() < 60, "{:?}", begin.elapsed());
    }
}
