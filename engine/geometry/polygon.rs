//! Triangles of a polygon.

use super::delaunay;
use earcut::Earcut;
use glam::{DVec2, DVec3};

/// Polygons that `earcut` does not cut whole, those that cross themselves above all, are cut ear by
/// ear up to this many corners: that takes the square of their number. Larger ones are triangulated by
/// Delaunay's rule first.
const MOST_CORNERS: usize = 1000;
/// Largest number of corners for which `earcut` is the second choice.
const MOST_BY_EARCUT: usize = 50_000;
/// Share of the area that rounding may change.
const ROUNDING: f64 = 1e-9;

/// Cuts a polygon into triangles that wind as it does, two less than it has corners. Returns
/// indices of its corners. A small one that crosses itself, or is not flat, is cut all the same.
///
/// # Errors
/// A large polygon that crosses itself: its area does not follow from its corners.
pub(super) fn triangles(corners: &[DVec3]) -> Result<Vec<[usize; 3]>, String> {
    let n = corners.len();
    let all: Vec<usize> = (0..n).collect();
    // Newell's normal, of the whole polygon.
    let origin = corners.first().copied().unwrap_or_default();
    let sum: DVec3 = corners.windows(2).map(|it| (it[0] - origin).cross(it[1] - origin)).sum();
    let normal = if n > 3 { sum.try_normalize() } else { None };
    let Some(normal) = normal else { return Ok(fan(&all)) };
    let x = normal.any_orthonormal_vector();
    let y = normal.cross(x);
    let flat: Vec<DVec2> = corners
        .iter()
        .map(|corner| DVec2::new(x.dot(*corner - origin), y.dot(*corner - origin)))
        .collect();
    if n == 4 && (0..n).all(|k| turn(&flat, [k, (k + 1) % n, (k + 2) % n]) >= 0.0) {
        return Ok(fan(&all));
    }
    match cut(&flat) {
        Some(found) => Ok(found),
        None if n <= MOST_CORNERS => Ok(by_ears(&flat)),
        None => Err(format!(
            "a polygon of {n} corners that crosses itself; cut it into triangles, or leave no more \
             than {MOST_CORNERS} corners"
        )),
    }
}

fn fan(ring: &[usize]) -> Vec<[usize; 3]> {
    (2..ring.len()).map(|k| [ring[0], ring[k - 1], ring[k]]).collect()
}

/// Triangles that `earcut` makes of a polygon, with corners that it left out for they lie on a line.
fn earcut(flat: &[DVec2]) -> Vec<[usize; 3]> {
    let mut indices: Vec<u32> = Vec::new();
    Earcut::new().earcut(flat.iter().map(|point| point.to_array()), &[], &mut indices);
    let mut found: Vec<[usize; 3]> =
        indices.as_chunks::<3>().0.iter().map(|it| it.map(|corner| corner as usize)).collect();
    // All wind one way round, whatever the way of the polygon.
    if found.iter().map(|it| turn(flat, *it)).sum::<f64>() < 0.0 {
        found.iter_mut().for_each(|it| it.swap(1, 2));
    }
    if found.len() != flat.len() - 2 {
        put_back(&mut found, flat.len());
    }
    found
}

/// Twice the area of a triangle, if it winds as the polygon does.
fn turn(flat: &[DVec2], [a, b, c]: [usize; 3]) -> f64 {
    (flat[b] - flat[a]).perp_dot(flat[c] - flat[b])
}

/// Triangles, if they have the right number and cover the polygon.
fn cut(flat: &[DVec2]) -> Option<Vec<[usize; 3]>> {
    let ring: Vec<usize> = (0..flat.len()).collect();
    let around: f64 = fan(&ring).iter().map(|it| turn(flat, *it)).sum();
    let covers = |found: &Vec<[usize; 3]>| {
        let areas = found.iter().map(|it| turn(flat, *it));
        let (signed, whole) =
            areas.fold((0.0, 0.0), |(signed, whole), area| (signed + area, whole + f64::abs(area)));
        let off = (signed - around).abs().max(whole - signed);
        off <= ROUNDING * around.abs() && found.len() == flat.len() - 2
    };
    let large = || delaunay::inside(flat).filter(covers);
    let of_large = if flat.len() > MOST_CORNERS { large() } else { None };
    let by_earcut = || (flat.len() <= MOST_BY_EARCUT).then(|| earcut(flat)).filter(covers);
    of_large.or_else(by_earcut)
}

/// Puts corners back that `earcut` left out for lying on the line between their neighbours: the
/// triangle at that line is cut at each of them, or edges would be open there.
fn put_back(found: &mut Vec<[usize; 3]>, count: usize) {
    let mut used = vec![false; count];
    found.as_flattened().iter().for_each(|corner| used[*corner] = true);
    for at in 0..found.len() {
        // Cut at the corners of one edge; of another one, the last piece is cut on.
        let mut triangle = found[at];
        for k in 0..3 {
            let [from, to, across] = [triangle[k], triangle[(k + 1) % 3], triangle[(k + 2) % 3]];
            let mut last = from;
            loop {
                let next = (last + 1) % count;
                if next == to || used[next] {
                    break;
                }
                last = next;
            }
            // Only where all corners from one end to the other were left out.
            if (last + 1) % count != to {
                continue;
            }
            let mut last = from;
            while (last + 1) % count != to {
                let next = (last + 1) % count;
                found.push([last, next, across]);
                last = next;
            }
            if last != from {
                triangle = [last, to, across];
                triangle.rotate_right(k);
            }
        }
        found[at] = triangle;
    }
}

/// Ears, one after the other, and a fan of the rest.
fn by_ears(flat: &[DVec2]) -> Vec<[usize; 3]> {
    let mut ring: Vec<usize> = (0..flat.len()).collect();
    let mut found = Vec::with_capacity(ring.len() - 2);
    while ring.len() > 3 {
        let n = ring.len();
        let of = |k: usize| [ring[(k + n - 1) % n], ring[k], ring[(k + 1) % n]];
        let ear = |k: &usize| {
            let [a, b, c] = of(*k);
            turn(flat, [a, b, c]) > 0.0
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
    fn whatever_the_polygon_it_has_two_triangles_less_than_corners() {
        let bow = flat(&[(0.0, 0.0), (1.0, 1.0), (1.0, 0.0), (0.0, 1.0)]);
        let line = flat(&[(0.0, 0.0), (1.0, 0.0), (2.0, 0.0), (3.0, 0.0), (1.0, 0.0)]);
        let nan = vec![DVec3::NAN; 5];
        for polygon in [bow, line, nan] {
            assert_eq!(triangles(&polygon).unwrap().len(), polygon.len() - 2);
        }
    }

    #[test]
    fn corners_on_straight_edges_are_kept() {
        // A square with corners on its edges, exactly and but for rounding, and a notch.
        for (each, tilt) in [(40, 0.0), (40, 0.1), (3_000, 0.0), (3_000, 0.1)] {
            let mut points = Vec::new();
            for (from, to) in [
                ((0.0, 0.0), (9.0, 0.0)),
                ((9.0, 0.0), (9.0, 9.0)),
                ((9.0, 9.0), (5.0, 1.0)),
                ((5.0, 1.0), (0.0, 9.0)),
                ((0.0, 9.0), (0.0, 0.0)),
            ] {
                for k in 0..each {
                    let t = f64::from(k) / f64::from(each);
                    let (x, y) = (from.0 + (to.0 - from.0) * t, from.1 + (to.1 - from.1) * t);
                    points.push((
                        x * f64::cos(tilt) - y * f64::sin(tilt),
                        x * f64::sin(tilt) + y * f64::cos(tilt),
                    ));
                }
            }
            let corners = flat(&points);
            let cut = triangles(&corners).unwrap();
            assert_eq!(cut.len(), corners.len() - 2);
            let (signed, whole) = area(&corners, &cut);
            assert!((signed - whole).abs() < 1e-9, "{signed} {whole}");
            // Every edge of the polygon bounds one triangle, once.
            let mut edges: Vec<[usize; 2]> =
                cut.iter().flat_map(|[a, b, c]| [[*a, *b], [*b, *c], [*c, *a]]).collect();
            edges.sort_unstable();
            for k in 0..corners.len() {
                assert!(edges.binary_search(&[k, (k + 1) % corners.len()]).is_ok(), "{k}");
            }
        }
    }

    #[test]
    fn many_corners_of_any_polygon_are_cut_without_turning_over() {
        let wave: Vec<(f64, f64)> = (0..65_000)
            .map(|k| {
                let angle = std::f64::consts::TAU * f64::from(k) / 65_000.0;
                let radius = 1.0 + 0.3 * f64::cos(40.0 * angle);
                (radius * angle.cos(), radius * angle.sin())
            })
            .collect();
        let arm = |radius: f64, k: i32| {
            let angle = f64::from(k) * 0.02;
            ((radius + 0.1 * angle) * angle.cos(), (radius + 0.1 * angle) * angle.sin())
        };
        let spiral: Vec<(f64, f64)> =
            (0..2000).map(|k| arm(1.3, k)).chain((0..2000).rev().map(|k| arm(1.0, k))).collect();
        // Teeth a thousand times as long as wide, and a ring that is cut open.
        let tooth = |k: i32| {
            let x = f64::from(k);
            [(x, 1e3), (x + 0.5, 1e3), (x + 0.5, 0.0), (x + 1.0, 0.0)]
        };
        let comb: Vec<(f64, f64)> =
            (0..2000).flat_map(tooth).chain([(2000.0, -1.0), (0.0, -1.0)]).collect();
        let circle = |radius: f64| {
            let angle = std::f64::consts::TAU / 3000.0;
            (0..=3000).map(move |k| {
                let angle = angle * f64::from(k % 3000);
                (radius * angle.cos(), radius * angle.sin())
            })
        };
        let open = circle(2.0).chain(circle(1.0).collect::<Vec<_>>().into_iter().rev());
        for points in [wave, spiral, comb, open.collect()] {
            let corners = flat(&points);
            let cut = triangles(&corners).unwrap();
            assert_eq!(cut.len(), corners.len() - 2);
            let (signed, whole) = area(&corners, &cut);
            assert!(whole - signed.abs() < 1e-9 * whole, "{signed} {whole}");
        }
    }

    #[test]
    fn large_polygon_that_crosses_itself_is_refused() {
        let star: Vec<(f64, f64)> = (0..2001)
            .map(|k| (std::f64::consts::TAU * f64::from(k * 700 % 2001) / 2001.0).sin_cos())
            .collect();
        assert!(triangles(&flat(&star)).unwrap_err().contains("2001 corners"));
    }
}
