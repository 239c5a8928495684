//! Triangles of a polygon.

use glam::{DVec2, DVec3};

/// Concave polygons with more corners are cut into fans: looking for ears takes the square of
/// their number, and more for a hostile one.
const MOST_CORNERS: usize = 1000;

/// Cuts a polygon into triangles that wind as it does: a fan where it is convex, or else ears.
/// Returns indices of its corners; one that crosses itself, or is not flat, is cut all the same.
pub(super) fn triangles(corners: &[DVec3]) -> Vec<[usize; 3]> {
    let fan = |ring: &[usize]| -> Vec<[usize; 3]> {
        (2..ring.len()).map(|k| [ring[0], ring[k - 1], ring[k]]).collect()
    };
    let mut ring: Vec<usize> = (0..corners.len()).collect();
    if ring.len() <= 3 || ring.len() > MOST_CORNERS {
        return fan(&ring);
    }
    // Newell's normal: that of the whole polygon, whatever its corners.
    let origin = corners[0];
    let sum: DVec3 =
        (1..corners.len() - 1).map(|k| (corners[k] - origin).cross(corners[k + 1] - origin)).sum();
    let Some(normal) = sum.try_normalize() else { return fan(&ring) };
    let x = normal.any_orthonormal_vector();
    let y = normal.cross(x);
    let flat: Vec<DVec2> = corners
        .iter()
        .map(|corner| DVec2::new(x.dot(*corner - origin), y.dot(*corner - origin)))
        .collect();
    let turn = |[a, b, c]: [usize; 3]| (flat[b] - flat[a]).perp_dot(flat[c] - flat[b]);
    let n = ring.len();
    if (0..n).all(|k| turn([k, (k + 1) % n, (k + 2) % n]) >= 0.0) {
        return fan(&ring);
    }
    let mut found = Vec::with_capacity(n - 2);
    while ring.len() > 3 {
        let n = ring.len();
        let of = |k: usize| [ring[(k + n - 1) % n], ring[k], ring[(k + 1) % n]];
        let ear = |k: &usize| {
            let [a, b, c] = of(*k);
            turn([a, b, c]) > 0.0
                && ring.iter().filter(|it| ![a, b, c].contains(*it)).all(|other| {
                    let point = flat[*other];
                    let inside = [(a, b), (b, c), (c, a)].iter().all(|(from, to)| {
                        (flat[*to] - flat[*from]).perp_dot(point - flat[*from]) >= 0.0
                    });
                    !inside || [a, b, c].iter().any(|it| flat[*it] == point)
                })
        };
        let Some(k) = (0..n).find(ear) else { break };
        found.push(of(k));
        ring.remove(k);
    }
    found.extend(fan(&ring));
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    fn area(corners: &[DVec3], triangles: &[[usize; 3]]) -> (f64, f64) {
        let each = triangles
            .iter()
            .map(|[a, b, c]| (corners[*b] - corners[*a]).cross(corners[*c] - corners[*a]).z / 2.0);
        (each.clone().sum(), each.map(f64::abs).sum())
    }

    fn flat(points: &[(f64, f64)]) -> Vec<DVec3> {
        points.iter().map(|(x, y)| DVec3::new(*x, *y, 0.0)).collect()
    }

    #[test]
    fn concave_polygon_is_cut_without_turning_over() {
        // A comb, which no fan covers.
        let comb = flat(&[
            (0.0, 0.0),
            (5.0, 0.0),
            (5.0, 3.0),
            (4.0, 3.0),
            (4.0, 1.0),
            (3.0, 1.0),
            (3.0, 3.0),
            (2.0, 3.0),
            (2.0, 1.0),
            (1.0, 1.0),
            (1.0, 3.0),
            (0.0, 3.0),
        ]);
        for start in 0..comb.len() {
            let turned: Vec<DVec3> = comb[start..].iter().chain(&comb[..start]).copied().collect();
            let cut = triangles(&turned);
            assert_eq!(cut.len(), comb.len() - 2);
            let (signed, whole) = area(&turned, &cut);
            assert!((signed - 11.0).abs() < 1e-12 && (whole - 11.0).abs() < 1e-12, "{cut:?}");
        }
    }

    #[test]
    fn whatever_the_polygon_it_has_two_triangles_less_than_corners() {
        let bow = flat(&[(0.0, 0.0), (1.0, 1.0), (1.0, 0.0), (0.0, 1.0)]);
        let line = flat(&[(0.0, 0.0), (1.0, 0.0), (2.0, 0.0), (3.0, 0.0), (1.0, 0.0)]);
        let nan = vec![DVec3::NAN; 5];
        for polygon in [bow, line, nan] {
            assert_eq!(triangles(&polygon).len(), polygon.len() - 2);
        }
    }
}
