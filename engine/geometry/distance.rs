//! Distance between two triangles.

use glam::DVec3;

/// Test of two triangles that come within `limit` of each other, m.
pub(super) fn meet(a: [DVec3; 3], b: [DVec3; 3], limit: f64) -> bool {
    if one_side(a, b, limit) || one_side(b, a, limit) {
        return false;
    }
    let edges = |t: [DVec3; 3]| [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])];
    let limit = limit * limit;
    let near = |p: DVec3, q: DVec3| p.distance_squared(q) <= limit;
    edges(a).into_iter().any(|edge| pierces(edge, b))
        || edges(b).into_iter().any(|edge| pierces(edge, a))
        || a.into_iter().any(|point| near(closest_on_triangle(point, b), point))
        || b.into_iter().any(|point| near(closest_on_triangle(point, a), point))
        || edges(a).into_iter().any(|first| {
            edges(b).into_iter().any(|second| {
                let (p, q) = closest_of_segments(first, second);
                near(p, q)
            })
        })
}

/// True if all of `b` lies beyond `limit` on one side of the plane of `a`.
fn one_side(a: [DVec3; 3], b: [DVec3; 3], limit: f64) -> bool {
    let normal = (a[1] - a[0]).cross(a[2] - a[0]);
    let reach = limit * normal.length();
    let heights = b.map(|point| normal.dot(point - a[0]));
    heights.iter().all(|height| *height > reach) || heights.iter().all(|height| *height < -reach)
}

/// Test of a segment that passes through the inside of a triangle. Passing through an edge or a
/// corner is left to the distances.
fn pierces((p, q): (DVec3, DVec3), triangle: [DVec3; 3]) -> bool {
    let [a, b, c] = triangle.map(|corner| corner - p);
    let along = q - p;
    let sides = [c.cross(b), a.cross(c), b.cross(a)].map(|normal| along.dot(normal));
    // Closer to an edge than rounding, or without area: distances decide.
    let size = a.length_squared().max(b.length_squared()).max(c.length_squared());
    let doubt = 1e-14 * size * along.length();
    let inside = sides.iter().all(|side| *side > doubt) || sides.iter().all(|side| *side < -doubt);
    if !inside {
        return false;
    }
    let normal = (b - a).cross(c - a);
    let t = a.dot(normal) / along.dot(normal);
    (0.0..=1.0).contains(&t)
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
