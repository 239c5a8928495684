//! Do two triangles of a surface share more than corners and edges?
//!
//! Heights above the other's plane within what f32 resolves count as none, and corners that
//! the mesh shares have none, so that neighbours and touching parts are no crossings.

use glam::{DVec2, DVec3};

use super::triangles::width;
use crate::geometry::surface::Surface;

/// How two triangles meet.
#[derive(Debug, Clone, Copy)]
pub(super) enum Contact {
    /// They pass through each other, or lie on each other.
    Crossing(DVec3),
    /// An edge of one runs inside the other, and all of the one is on one side.
    Graze {
        /// The edge, as its vertices in ascending order.
        edge: [u32; 2],
        /// The triangle that it runs in.
        through: u32,
        /// Whether the triangle of the edge is in front of the other.
        side: bool,
        /// A point of the edge.
        place: DVec3,
    },
}

/// A triangle with its normal, of unit length where planes meet, and the heights of its corners
/// above the other's plane.
struct Side {
    number: u32,
    vertices: [u32; 3],
    corners: [DVec3; 3],
    normal: DVec3,
    heights: [f64; 3],
}

impl Side {
    fn new(surface: &Surface, number: u32) -> Self {
        let corners @ [a, b, c] = surface.corners(number as usize);
        let normal = (b - a).cross(c - a);
        let vertices = surface.triangles[number as usize];
        Self { number, vertices, corners, normal, heights: [0.0; 3] }
    }

    /// Measures the corners above the plane of `other`.
    fn measure(&mut self, other: &Self, resolved: f64) {
        // Triangles without area have no plane: all heights are 0.
        let per_metre = other.normal.length_recip();
        let per_metre = if per_metre.is_finite() { per_metre } else { 0.0 };
        for (k, vertex) in self.vertices.iter().enumerate() {
            let height = other.normal.dot(self.corners[k] - other.corners[0]) * per_metre;
            let shared = other.vertices.contains(vertex);
            self.heights[k] = if shared || height.abs() <= resolved { 0.0 } else { height };
        }
    }

    fn one_sided(&self) -> bool {
        self.heights.iter().all(|h| *h > 0.0) || self.heights.iter().all(|h| *h < 0.0)
    }

    fn level(&self) -> bool {
        self.heights.iter().all(|height| height.abs() <= 0.0)
    }

    fn straddles(&self) -> bool {
        self.heights.iter().any(|h| *h > 0.0) && self.heights.iter().any(|h| *h < 0.0)
    }

    /// Where the line in which the planes meet passes through the triangle.
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

    /// Whether a point of its plane lies inside by more than `margin`.
    fn holds(&self, point: DVec3, margin: f64) -> bool {
        (0..3).all(|k| {
            let (p, q) = (self.corners[k], self.corners[(k + 1) % 3]);
            let inward = self.normal.cross(q - p).normalize_or_zero();
            inward.dot(point - p) > margin
        })
    }

    /// The one edge in the other's plane, and whether the triangle is in front of that plane.
    fn edge_in_plane(&self) -> Option<([u32; 2], bool)> {
        let off = self.heights.iter().position(|height| height.abs() > 0.0)?;
        let (a, b) = ((off + 1) % 3, (off + 2) % 3);
        let level = self.heights[a].abs() <= 0.0 && self.heights[b].abs() <= 0.0;
        let [a, b] = [self.vertices[a], self.vertices[b]];
        level.then_some(([a.min(b), a.max(b)], self.heights[off] > 0.0))
    }
}

/// How two triangles meet beyond the corners that they share, if they do.
pub(super) fn contact(surface: &Surface, a: u32, b: u32, resolved: f64) -> Option<Contact> {
    let (mut a, mut b) = (Side::new(surface, a), Side::new(surface, b));
    if a.vertices.iter().all(|vertex| b.vertices.contains(vertex)) {
        // The same triangle twice is another kind of defect.
        return None;
    }
    b.measure(&a, resolved);
    if b.one_sided() {
        return None;
    }
    a.measure(&b, resolved);
    // A sliver is a line to the device; whatever crosses it crosses its neighbours as well.
    if a.one_sided() || width(a.corners) <= resolved || width(b.corners) <= resolved {
        return None;
    }
    for side in [&mut a, &mut b] {
        side.normal = side.normal.normalize_or_zero();
    }
    if a.level() || b.level() {
        let plane = if a.level() { b.normal } else { a.normal };
        return common_area(a.corners, b.corners, plane, resolved).map(Contact::Crossing);
    }
    let (through_a, through_b) = (b.straddles(), a.straddles());
    if !through_a && !through_b {
        return None;
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
        return Some(Contact::Crossing(place));
    }
    let (edge_of, through) = if through_a { (&a, &b) } else { (&b, &a) };
    let (edge, side) = edge_of.edge_in_plane()?;
    let place = on_line(edge_of, along, from.midpoint(to));
    let through_number = through.number;
    through.holds(place, resolved).then_some(Contact::Graze {
        edge,
        through: through_number,
        side,
        place,
    })
}

/// The point at `t` of the line in which the planes meet: it passes through a corner of `side`
/// or through one of its edges.
fn on_line(side: &Side, along: DVec3, t: f64) -> DVec3 {
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

/// Whether all of `b` lies beyond one side of `a`, which runs counter-clockwise.
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
