//! Distance between two triangles.

use glam::DVec3;

/// Where two triangles come within `limit` of each other, if they do: a point on the first.
pub(super) fn meet(a: [DVec3; 3], b: [DVec3; 3], limit: f64) -> Option<DVec3> {
    if one_side(a, b, limit) || one_side(b, a, limit) {
        return None;
    }
    let edges = |t: [DVec3; 3]| [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])];
    for edge in edges(a) {
        if let Some(point) = pierce(edge, b) {
            return Some(point);
        }
    }
    for edge in edges(b) {
        if let Some(point) = pierce(edge, a) {
            return Some(point);
        }
    }
    let limit = limit * limit;
    for point in a {
        if closest_on_triangle(point, b).distance_squared(point) <= limit {
            return Some(point);
        }
    }
    for point in b {
        let nearest = closest_on_triangle(point, a);
        if nearest.distance_squared(point) <= limit {
            return Some(nearest);
        }
    }
    for first in edges(a) {
        for second in edges(b) {
            let (p, q) = closest_of_segments(first, second);
            if p.distance_squared(q) <= limit {
                return Some(p);
            }
        }
    }
    None
}

/// Distance of two triangles that do not cross, and a point of the first where it is least.
pub(super) fn distance(a: [DVec3; 3], b: [DVec3; 3]) -> (f64, DVec3) {
    let edges = |t: [DVec3; 3]| [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])];
    let corners = a.into_iter().map(|point| (point.distance(closest_on_triangle(point, b)), point));
    let others = b.into_iter().map(|point| {
        let nearest = closest_on_triangle(point, a);
        (point.distance(nearest), nearest)
    });
    let sides = edges(a).into_iter().flat_map(|first| {
        edges(b).into_iter().map(move |second| {
            let (p, q) = closest_of_segments(first, second);
            (p.distance(q), p)
        })
    });
    let all = corners.chain(others).chain(sides);
    all.fold((f64::INFINITY, a[0]), |least, it| if it.0 < least.0 { it } else { least })
}

/// Whether all of `b` lies beyond `limit` on one side of the plane of `a`.
fn one_side(a: [DVec3; 3], b: [DVec3; 3], limit: f64) -> bool {
    let normal = (a[1] - a[0]).cross(a[2] - a[0]);
    let reach = limit * normal.length();
    let heights = b.map(|point| normal.dot(point - a[0]));
    heights.iter().all(|height| *height > reach) || heights.iter().all(|height| *height < -reach)
}

/// Where a segment passes through the inside of a triangle. Passing through an edge or a
/// corner is left to the distances.
fn pierce((p, q): (DVec3, DVec3), triangle: [DVec3; 3]) -> Option<DVec3> {
    let [a, b, c] = triangle.map(|corner| corner - p);
    let along = q - p;
    let sides = [c.cross(b), a.cross(c), b.cross(a)].map(|normal| along.dot(normal));
    // Closer to an edge than rounding, or without area: distances decide.
    let size = a.length_squared().max(b.length_squared()).max(c.length_squared());
    let doubt = 1e-14 * size * along.length();
    let inside = sides.iter().all(|side| *side > doubt) || sides.iter().all(|side| *side < -doubt);
    if !inside {
        return None;
    }
    let normal = (b - a).cross(c - a);
    let t = a.dot(normal) / along.dot(normal);
    (0.0..=1.0).contains(&t).then(|| p + along * t)
}

/// Closest point of a triangle (Ericson, Real-Time Collision Detection, 5.1.5).
pub(super) fn closest_on_triangle(p: DVec3, [a, b, c]: [DVec3; 3]) -> DVec3 {
    let (ab, ac, ap) = (b - a, c - a, p - a);
    let (d1, d2) = (ab.dot(ap), ac.dot(ap));
    if d1 <= 0.0 && d2 <= 0.0 {
        return a;
    }
    let bp = p - b;
    let (d3, d4) = (ab.dot(bp), ac.dot(bp));
    if d3 >= 0.0 && d4 <= d3 {
        return b;
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        return a + ab * (d1 / (d1 - d3));
    }
    let cp = p - c;
    let (d5, d6) = (ab.dot(cp), ac.dot(cp));
    if d6 >= 0.0 && d5 <= d6 {
        return c;
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        return a + ac * (d2 / (d2 - d6));
    }
    let va = d3 * d6 - d5 * d4;
    if va <= 0.0 && d4 >= d3 && d5 >= d6 {
        return b + (c - b) * ((d4 - d3) / ((d4 - d3) + (d5 - d6)));
    }
    let sum = va + vb + vc;
    a + ab * (vb / sum) + ac * (vc / sum)
}

/// Closest points of two segments (Ericson, 5.1.9); segments have a length.
fn closest_of_segments(first: (DVec3, DVec3), second: (DVec3, DVec3)) -> (DVec3, DVec3) {
    let (d1, d2, r) = (first.1 - first.0, second.1 - second.0, first.0 - second.0);
    let (a, e, b) = (d1.length_squared(), d2.length_squared(), d1.dot(d2));
    let (c, f) = (d1.dot(r), d2.dot(r));
    let below = a * e - b * b;
    // Parallel segments: any point of the first will do to begin with.
    let mut s = if below > 0.0 { ((b * f - c * e) / below).clamp(0.0, 1.0) } else { 0.0 };
    let mut t = (b * s + f) / e;
    if !(0.0..=1.0).contains(&t) {
        t = t.clamp(0.0, 1.0);
        s = ((b * t - c) / a).clamp(0.0, 1.0);
    }
    (first.0 + d1 * s, second.0 + d2 * t)
}
