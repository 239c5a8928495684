//! Triangles cut by rectangles: areas and their moments.

/// A corner of a polygon.
pub(super) type Corner = [f64; 2];

/// Area of a polygon, its centroid, and its second moments about it: of x with x and with z.
#[derive(Debug, Clone, Copy)]
pub(super) struct Area {
    pub(super) area: f64,
    pub(super) centroid: Corner,
    pub(super) moments: [f64; 2],
}

impl Area {
    pub(super) const NONE: Self = Self { area: 0.0, centroid: [0.0; 2], moments: [0.0; 2] };

    /// Of a rectangle, by centre and half size.
    pub(super) fn of_rectangle(centre: Corner, half: [f64; 2]) -> Self {
        let area = 4.0 * half[0] * half[1];
        Self { area, centroid: centre, moments: [area * half[0] * half[0] / 3.0, 0.0] }
    }

    /// Of what a triangle has in a rectangle.
    pub(super) fn within(triangle: &[Corner; 3], centre: Corner, half: [f64; 2]) -> Self {
        // From the centre: corners may be far off, and areas small.
        let corners = triangle.map(|c| [c[0] - centre[0], c[1] - centre[1]]);
        let mut polygon = Polygon { corners: [[0.0; 2]; 8], count: 3 };
        polygon.corners[..3].copy_from_slice(&corners);
        for axis in 0..2 {
            let [a, b, c] = corners.map(|corner| corner[axis]);
            if a.min(b).min(c) < -half[axis] {
                polygon = polygon.cut(axis, -half[axis], 1.0);
            }
            if a.max(b).max(c) > half[axis] {
                polygon = polygon.cut(axis, half[axis], -1.0);
            }
        }
        let mut area = polygon.area();
        area.centroid = [area.centroid[0] + centre[0], area.centroid[1] + centre[1]];
        area
    }
}

/// A convex polygon: a triangle has at most seven corners in a rectangle.
#[derive(Clone, Copy)]
struct Polygon {
    corners: [Corner; 8],
    count: usize,
}

impl Polygon {
    /// What lies on one side of a line: `sign` times the coordinate is at least `sign` times
    /// `limit`.
    fn cut(&self, axis: usize, limit: f64, sign: f64) -> Self {
        let mut kept = Self { corners: [[0.0; 2]; 8], count: 0 };
        let Some(mut a) = self.count.checked_sub(1).map(|last| self.corners[last]) else {
            return kept;
        };
        let mut from = sign * (a[axis] - limit);
        for &b in &self.corners[..self.count] {
            let to = sign * (b[axis] - limit);
            if (from >= 0.0) != (to >= 0.0) {
                let share = from / (from - to);
                let mut between = [a[0] + (b[0] - a[0]) * share, a[1] + (b[1] - a[1]) * share];
                between[axis] = limit;
                kept.push(between);
            }
            if to >= 0.0 {
                kept.push(b);
            }
            (a, from) = (b, to);
        }
        kept
    }

    fn push(&mut self, corner: Corner) {
        if self.count < self.corners.len() {
            self.corners[self.count] = corner;
            self.count += 1;
        }
    }

    fn area(&self) -> Area {
        if self.count < 3 {
            return Area::NONE;
        }
        let origin = self.corners[0];
        let (mut twice, mut x, mut z, mut xx, mut xz) = (0.0, 0.0, 0.0, 0.0, 0.0);
        for pair in self.corners[1..self.count].windows(2) {
            let [a, b] = [pair[0], pair[1]].map(|c| [c[0] - origin[0], c[1] - origin[1]]);
            let cross = a[0] * b[1] - a[1] * b[0];
            twice += cross;
            x += cross * (a[0] + b[0]);
            z += cross * (a[1] + b[1]);
            xx += cross * (a[0] * a[0] + a[0] * b[0] + b[0] * b[0]);
            xz += cross * (2.0 * (a[0] * a[1] + b[0] * b[1]) + a[0] * b[1] + a[1] * b[0]);
        }
        if twice == 0.0 {
            return Area::NONE;
        }
        let area = 0.5 * twice;
        let centre = [x / (3.0 * twice), z / (3.0 * twice)];
        let moments =
            [xx / 12.0 - area * centre[0] * centre[0], xz / 24.0 - area * centre[0] * centre[1]];
        Area {
            area: area.abs(),
            centroid: [origin[0] + centre[0], origin[1] + centre[1]],
            moments: moments.map(|moment| moment * area.signum()),
        }
    }
}

/// Whether a segment has a point inside a rectangle or on its border.
pub(super) fn crosses([a, b]: [Corner; 2], x: [f64; 2], z: [f64; 2]) -> bool {
    let (mut from, mut to) = (0.0_f64, 1.0_f64);
    for (axis, range) in [x, z].into_iter().enumerate() {
        let along = b[axis] - a[axis];
        if along == 0.0 {
            if a[axis] < range[0] || a[axis] > range[1] {
                return false;
            }
            continue;
        }
        let ends = range.map(|limit| (limit - a[axis]) / along);
        from = from.max(ends[0].min(ends[1]));
        to = to.min(ends[0].max(ends[1]));
    }
    from <= to
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_of_a_triangle_add_up_to_it() {
        let triangle = [[-1.3, 0.2], [2.1, -0.7], [0.4, 1.9]];
        let whole = Area::within(&triangle, [0.0, 0.0], [10.0, 10.0]);
        assert!((whole.area - 0.5 * (3.4 * 1.7 + 0.9 * 1.7)).abs() < 1e-12, "{whole:?}");
        let (mut area, mut x, mut xx) = (0.0, 0.0, 0.0);
        for i in -8..8 {
            for k in -8..8 {
                let centre = [0.4 * f64::from(i) + 0.13, 0.4 * f64::from(k) + 0.07];
                let part = Area::within(&triangle, centre, [0.2, 0.2]);
                area += part.area;
                x += part.area * part.centroid[0];
                xx += part.moments[0] + part.area * part.centroid[0].powi(2);
            }
        }
        assert!((area - whole.area).abs() < 1e-12, "{area}");
        assert!((x / area - whole.centroid[0]).abs() < 1e-12);
        let own = whole.moments[0] + whole.area * whole.centroid[0].powi(2);
        assert!((xx - own).abs() < 1e-12, "{xx} {own}");
    }

    #[test]
    fn moments_of_a_rectangle_are_those_of_its_halves() {
        let (centre, half) = ([0.3, -0.2], [0.5, 0.25]);
        let [x, z] = [[-0.2, 0.8], [-0.45, 0.05]];
        let halves = [
            [[x[0], z[0]], [x[1], z[0]], [x[1], z[1]]],
            [[x[0], z[0]], [x[1], z[1]], [x[0], z[1]]],
        ];
        let sum: [f64; 3] = halves.iter().fold([0.0; 3], |sum, triangle| {
            let part = Area::within(triangle, centre, half);
            let off = [part.centroid[0] - centre[0], part.centroid[1] - centre[1]];
            [
                sum[0] + part.area,
                sum[1] + part.moments[0] + part.area * off[0] * off[0],
                sum[2] + part.moments[1] + part.area * off[0] * off[1],
            ]
        });
        let whole = Area::of_rectangle(centre, half);
        assert!((sum[0] - whole.area).abs() < 1e-12);
        assert!((sum[1] - whole.moments[0]).abs() < 1e-12 && sum[2].abs() < 1e-12, "{sum:?}");
    }
}
