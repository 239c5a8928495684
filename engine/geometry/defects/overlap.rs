//! Do two triangles of a surface share more than corners and edges?
//!
//! Heights above the other's plane within what f32 resolves count as none, and corners that
//! the mesh shares have none, so that neighbours and touching parts are no crossings.

use glam::{DVec2, DVec3};

use super::triangles::width;
use crate::surface::Surface;

/// Intersection of two triangles.
#[derive(Debug, Clone, Copy)]
pub(super) enum TriangleContact {
    /// They pass through each other.
    Crossing(DVec3),
    /// They lie on each other, in one plane.
    Coplanar(DVec3),
    /// An edge of one runs inside the other, and all of the one is on one side.
    Graze {
        /// The edge, as its vertices in ascending order.
        edge: [u32; 2],
        /// The triangle that it runs in.
        through: u32,
        /// True if the triangle of the edge is in front of the other.
        side: bool,
        /// A point of the edge.
        place: DVec3,
    },
}

/// A triangle and its plane.
#[derive(Debug, Clone, Copy)]
pub(super) struct Facet {
    number: u32,
    vertices: [u32; 3],
    corners: [DVec3; 3],
    /// As long as twice the area.
    normal: DVec3,
    /// One over the length of the normal; 0 without area, for then there is no plane.
    per_metre: f64,
}

impl Facet {
    pub(super) fn new(surface: &Surface, number: u32) -> Self {
        let corners @ [a, b, c] = surface.corners(number as usize);
        let normal = (b - a).cross(c - a);
        let per_metre = normal.length_recip();
        let per_metre = if per_metre.is_finite() { per_metre } else { 0.0 };
        let vertices = surface.triangles[number as usize];
        Self { number, vertices, corners, normal, per_metre }
    }

    pub(super) const fn number(&self) -> u32 {
        self.number
    }

    /// Heights of its corners above the plane of `other`.
    fn above(&self, other: &Self, resolved: f64) -> [f64; 3] {
        let [p, q, r] = self.corners;
        let [i, j, k] = self.vertices;
        [(p, i), (q, j), (r, k)].map(|(corner, vertex)| {
            let height = other.normal.dot(corner - other.corners[0]) * other.per_metre;
            let shared = other.vertices.contains(&vertex);
            if shared || height.abs() <= resolved { 0.0 } else { height }
        })
    }
}

/// A triangle with its unit normal, and the heights of its corners above the other's plane.
struct TriangleSide {
    number: u32,
    vertices: [u32; 3],
    corners: [DVec3; 3],
    normal: DVec3,
    heights: [f64; 3],
}

impl TriangleSide {
    fn new(facet: &Facet, heights: [f64; 3]) -> Self {
        let Facet { number, vertices, corners, normal, .. } = *facet;
        Self { number, vertices, corners, normal: normal.normalize_or_zero(), heights }
    }

    /// Interval in which the intersection of both planes passes through the triangle.
    fn interval(&self, along: DVec3) -> [f64; 2] {
        let mut span = [f64::INFINITY, f64::NEG_INFINITY];
        let mut take = |point: DVec3| {
            let t = along.dot(point);
            span = [span[0].min(t), span[1].max(t)];
        };
        for k in 0..3 {
            let (p, q) = (self.corners[k], self.corners[(k + 1) % 3]);
            let (a, b) = (self.heights[k], self.heights[(k + 1) % 3]);
            if a.abs() <= 0.0 {
                take(p);
            } else if a * b < 0.0 {
                take(p + (q - p) * (a / (a - b)));
            }
        }
        span
    }

    /// True if a point of its plane lies inside by more than `margin`.
    fn holds(&self, point: DVec3, margin: f64) -> bool {
        (0..3).all(|k| {
            let (p, q) = (self.corners[k], self.corners[(k + 1) % 3]);
            let inward = self.normal.cross(q - p).normalize_or_zero();
            inward.dot(point - p) > margin
        })
    }

    /// The one edge in the other's plane, and whether the triangle is in front of that plane.
    fn edge_in_plane(&self) -> Option<([u32; 2], bool)> {
        let off = off_plane(self.heights)?;
        let [a, b] = [self.vertices[(off + 1) % 3], self.vertices[(off + 2) % 3]];
        Some(([a.min(b), a.max(b)], self.heights[off] > 0.0))
    }
}

/// True if a triangle lies wholly on one side of a plane, from the heights of its corners.
fn one_sided(heights: [f64; 3]) -> bool {
    heights.iter().all(|h| *h > 0.0) || heights.iter().all(|h| *h < 0.0)
}

/// True if the triangle lies in the plane.
fn level(heights: [f64; 3]) -> bool {
    heights.iter().all(|height| height.abs() <= 0.0)
}

/// True if it has corners on both sides.
fn straddles(heights: [f64; 3]) -> bool {
    heights.iter().any(|h| *h > 0.0) && heights.iter().any(|h| *h < 0.0)
}

/// The one corner that is not in the plane.
fn off_plane(heights: [f64; 3]) -> Option<usize> {
    let off = heights.iter().position(|height| height.abs() > 0.0)?;
    let (a, b) = ((off + 1) % 3, (off + 2) % 3);
    (heights[a].abs() <= 0.0 && heights[b].abs() <= 0.0).then_some(off)
}

/// Intersection of two triangles beyond their common corners, if any. Either may come first.
///
/// Most pairs that are looked at are neighbours, and most of the rest pass each other: these are
/// decided by the heights alone.
pub(super) fn contact(one: &Facet, other: &Facet, resolved: f64) -> Option<TriangleContact> {
    let (a, b) = if one.number < other.number { (one, other) } else { (other, one) };
    if a.vertices.iter().all(|vertex| b.vertices.contains(vertex)) {
        // The same triangle twice is another kind of defect.
        return None;
    }
    let of_b = b.above(a, resolved);
    if one_sided(of_b) {
        return None;
    }
    let of_a = a.above(b, resolved);
    if one_sided(of_a) {
        return None;
    }
    let in_one_plane = level(of_a) || level(of_b);
    let (through_a, through_b) = (straddles(of_b), straddles(of_a));
    if !(in_one_plane || through_a && through_b) {
        // An edge of the one lies in the other, or a corner touches it and nothing more.
        let edge_of = match (through_a, through_b) {
            (true, _) => of_a,
            (_, true) => of_b,
            _ => return None,
        };
        off_plane(edge_of)?;
    }
    // A sliver is a line to the device; whatever crosses it crosses its neighbours as well.
    if width(a.corners) <= resolved || width(b.corners) <= resolved {
        return None;
    }
    let (a, b) = (TriangleSide::new(a, of_a), TriangleSide::new(b, of_b));
    if in_one_plane {
        let plane = if level(of_a) { b.normal } else { a.normal };
        return common_area(a.corners, b.corners, plane, resolved).map(TriangleContact::Coplanar);
    }
    let along = a.normal.cross(b.normal).normalize_or_zero();
    let (of_a, of_b) = (a.interval(along), b.interval(along));
    let (from, to) = (of_a[0].max(of_b[0]), of_a[1].min(of_b[1]));
    // NaN: planes that are parallel but for rounding.
    if (to - from).is_nan() || to - from <= resolved {
        return None;
    }
    let place = on_line(if through_b { &a } else { &b }, along, from.midpoint(to));
    if through_a && through_b {
        return Some(TriangleContact::Crossing(place));
    }
    let (edge_of, through) = if through_a { (&a, &b) } else { (&b, &a) };
    let (edge, side) = edge_of.edge_in_plane()?;
    let place = on_line(edge_of, along, from.midpoint(to));
    let through_number = through.number;
    through.holds(place, resolved).then_some(TriangleContact::Graze {
        edge,
        through: through_number,
        side,
        place,
    })
}

/// The point at `t` of the intersection of both planes: it passes through a corner of `side` or one of
/// its edges.
fn on_line(side: &TriangleSide, along: DVec3, t: f64) -> DVec3 {
    let point = (0..3).find_map(|k| {
        let (p, q) = (side.corners[k], side.corners[(k + 1) % 3]);
        let (a, b) = (side.heights[k], side.heights[(k + 1) % 3]);
        if a.abs() <= 0.0 { Some(p) } else { (a * b < 0.0).then(|| p + (q - p) * (a / (a - b))) }
    });
    let point = point.unwrap_or(side.corners[0]);
    point + along * (t - along.dot(point))
}

/// The middle of the area that two triangles of about one plane have in common, if it is wider
/// than `resolved`.
fn common_area(a: [DVec3; 3], b: [DVec3; 3], normal: DVec3, resolved: f64) -> Option<DVec3> {
    let x = normal.any_orthonormal_vector();
    let y = normal.cross(x);
    let origin = a[0];
    let flat = |corner: DVec3| DVec2::new(x.dot(corner - origin), y.dot(corner - origin));
    let [mut a, mut b] = [a.map(flat), b.map(flat)];
    for t in [&mut a, &mut b] {
        if (t[1] - t[0]).perp_dot(t[2] - t[0]) < 0.0 {
            t.swap(1, 2);
        }
    }
    if apart(&a, &b) || apart(&b, &a) {
        return None;
    }
    let mut polygon = b.to_vec();
    for k in 0..3 {
        polygon = cut(&polygon, a[k], a[(k + 1) % 3]);
    }
    let (mut area, mut around) = (0.0, 0.0);
    for (k, p) in polygon.iter().enumerate() {
        let q = polygon[(k + 1) % polygon.len()];
        area += (p - polygon[0]).perp_dot(q - polygon[0]) / 2.0;
        around += p.distance(q);
    }
    // Area over half the way around is about the width.
    (area > resolved * around / 2.0).then(|| {
        let middle = polygon.iter().sum::<DVec2>() / polygon.len() as f64;
        origin + x * middle.x + y * middle.y
    })
}

/// True if all of `b` lies beyond one side of `a`, which runs counter-clockwise.
fn apart(a: &[DVec2; 3], b: &[DVec2; 3]) -> bool {
    (0..3).any(|k| {
        let (from, along) = (a[k], a[(k + 1) % 3] - a[k]);
        b.iter().all(|point| along.perp_dot(point - from) <= 0.0)
    })
}

/// The part of a convex polygon to the left of a line.
fn cut(polygon: &[DVec2], from: DVec2, to: DVec2) -> Vec<DVec2> {
    let height = |point: DVec2| (to - from).perp_dot(point - from);
    let mut kept = Vec::with_capacity(polygon.len() + 1);
    for (k, p) in polygon.iter().enumerate() {
        let q = polygon[(k + 1) % polygon.len()];
        let (a, b) = (height(*p), height(q));
        if a >= 0.0 {
            kept.push(*p);
        }
        if a * b < 0.0 {
            kept.push(p + (q - p) * (a / (a - b)));
        }
    }
    kept
}
