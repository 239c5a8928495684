//! Convex polygons: cut by lines and rectangles, areas and their moments.

use arrayvec::ArrayVec;

/// A corner of a polygon.
pub(super) type Corner = [f64; 2];
/// Corners nearer to an edge than this share of the rectangle lie on it.
pub(super) const NEAR: f64 = 1e-11;
/// Most corners of a polygon.
const MOST_CORNERS: usize = 12;

/// Area of a polygon, its centroid, and its second moments about it: of x with x and with z, of z
/// with z.
#[derive(Debug, Clone, Copy)]
pub(super) struct Area {
    pub(crate) area: f64,
    pub(crate) centroid: Corner,
    pub(crate) moments: [f64; 3],
}

impl Area {
    pub(super) const NONE: Self = Self { area: 0.0, centroid: [0.0; 2], moments: [0.0; 3] };

    /// Area of a rectangle, by centre and half size.
    pub(super) fn of_rectangle(centre: Corner, half: [f64; 2]) -> Self {
        let area = 4.0 * half[0] * half[1];
        let square = |half: f64| area * half * half / 3.0;
        Self { area, centroid: centre, moments: [square(half[0]), 0.0, square(half[1])] }
    }

    /// The part of a triangle inside a rectangle.
    pub(super) fn within(triangle: &[Corner; 3], centre: Corner, half: [f64; 2]) -> Self {
        // From the centre: corners may be far off, and areas small.
        let corners = triangle.map(|c| [c[0] - centre[0], c[1] - centre[1]]);
        let (mut even, mut odd) = (Polygon::default(), Polygon::default());
        even.corners.extend(corners);
        let (mut polygon, mut kept) = (&mut even, &mut odd);
        for axis in 0..2 {
            let [a, b, c] = corners.map(|corner| corner[axis]);
            if a.min(b).min(c) < -half[axis] {
                polygon.cut(axis, -half[axis], 1.0, kept);
                std::mem::swap(&mut polygon, &mut kept);
            }
            if a.max(b).max(c) > half[axis] {
                polygon.cut(axis, half[axis], -1.0, kept);
                std::mem::swap(&mut polygon, &mut kept);
            }
        }
        let mut area = polygon.area();
        area.centroid = [area.centroid[0] + centre[0], area.centroid[1] + centre[1]];
        area
    }
}

/// A convex polygon.
#[derive(Debug, Clone, Default)]
pub(super) struct Polygon {
    corners: ArrayVec<Corner, MOST_CORNERS>,
}

/// On which side of a line a polygon lies.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Side {
    Inside,
    Outside,
    Across,
}

/// A line a x + b z + c = 0, positive inside, and how near to it corners count as on it.
#[derive(Debug, Clone, Copy)]
pub(super) struct CuttingLine {
    pub(super) numbers: [f64; 3],
    pub(super) near: f64,
}

impl CuttingLine {
    /// Positive inside, 0 on the line.
    fn at(&self, [x, z]: Corner) -> f64 {
        let [a, b, c] = self.numbers;
        let value = a * x + b * z + c;
        if value.abs() <= self.near { 0.0 } else { value }
    }
}

impl Polygon {
    /// A rectangle about the origin, by half its size.
    pub(super) fn rectangle([x, z]: [f64; 2]) -> Self {
        Self { corners: [[-x, -z], [x, -z], [x, z], [-x, z]].into_iter().collect() }
    }

    pub(super) fn corners(&self) -> &[Corner] {
        &self.corners
    }

    pub(super) fn side(&self, line: &CuttingLine) -> Side {
        let (mut inside, mut outside) = (false, false);
        for corner in self.corners() {
            let at = line.at(*corner);
            inside |= at > 0.0;
            outside |= at < 0.0;
        }
        match (inside, outside) {
            (true, true) => Side::Across,
            (true, false) => Side::Inside,
            _ => Side::Outside,
        }
    }

    /// Leaves what lies inside a line that it is across of, and gives what lies outside.
    pub(super) fn split(&mut self, line: &CuttingLine) -> Self {
        let (mut inside, mut outside) = (Self::default(), Self::default());
        let Some(mut a) = self.corners().last().copied() else { return outside };
        let mut from = line.at(a);
        for &b in self.corners() {
            let to = line.at(b);
            if from * to < 0.0 {
                let share = from / (from - to);
                let between = [a[0] + (b[0] - a[0]) * share, a[1] + (b[1] - a[1]) * share];
                inside.push(between);
                outside.push(between);
            }
            if to >= 0.0 {
                inside.push(b);
            }
            if to <= 0.0 {
                outside.push(b);
            }
            (a, from) = (b, to);
        }
        self.corners.clear();
        self.corners.extend(inside.corners);
        outside
    }

    /// Copies into `kept` the part on one side of a line: `sign` times the coordinate is at least `sign`
    /// times `limit`.
    fn cut(&self, axis: usize, limit: f64, sign: f64, kept: &mut Self) {
        kept.corners.clear();
        let Some(mut a) = self.corners.last().copied() else { return };
        let mut from = sign * (a[axis] - limit);
        for &b in &self.corners {
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
    }

    /// Adds a corner; where there are too many the area is not whole, which callers see.
    fn push(&mut self, corner: Corner) {
        let _full = self.corners.try_push(corner);
    }

    /// Its area and moments.
    pub(super) fn area(&self) -> Area {
        if self.corners.len() < 3 {
            return Area::NONE;
        }
        let origin = self.corners[0];
        let (mut twice, mut x, mut z) = (0.0, 0.0, 0.0);
        let (mut xx, mut xz, mut zz) = (0.0, 0.0, 0.0);
        for pair in self.corners[1..].windows(2) {
            let [a, b] = [pair[0], pair[1]].map(|c| [c[0] - origin[0], c[1] - origin[1]]);
            let cross = a[0] * b[1] - a[1] * b[0];
            twice += cross;
            x += cross * (a[0] + b[0]);
            z += cross * (a[1] + b[1]);
            xx += cross * (a[0] * a[0] + a[0] * b[0] + b[0] * b[0]);
            zz += cross * (a[1] * a[1] + a[1] * b[1] + b[1] * b[1]);
            xz += cross * (2.0 * (a[0] * a[1] + b[0] * b[1]) + a[0] * b[1] + a[1] * b[0]);
        }
        if twice == 0.0 {
            return Area::NONE;
        }
        let area = 0.5 * twice;
        let centre = [x / (3.0 * twice), z / (3.0 * twice)];
        let moments = [
            xx / 12.0 - area * centre[0] * centre[0],
            xz / 24.0 - area * centre[0] * centre[1],
            zz / 12.0 - area * centre[1] * centre[1],
        ];
        Area {
            area: area.abs(),
            centroid: [origin[0] + centre[0], origin[1] + centre[1]],
            moments: moments.map(|moment| moment * area.signum()),
        }
    }
}

/// Sums over polygons.
#[derive(Debug, Clone, Copy)]
pub(super) struct AreaMoments {
    pub(crate) area: f64,
    x: f64,
    z: f64,
    xx: f64,
    zz: f64,
    /// Bounds of x and z.
    pub(crate) reach: [[f64; 2]; 2],
}

impl AreaMoments {
    pub(super) const NONE: Self = Self {
        area: 0.0,
        x: 0.0,
        z: 0.0,
        xx: 0.0,
        zz: 0.0,
        reach: [[f64::INFINITY, f64::NEG_INFINITY]; 2],
    };

    /// Adds a polygon.
    pub(super) fn add(&mut self, polygon: &Polygon, area: &Area) {
        let Area { area, centroid: [x, z], moments: [xx, _, zz] } = *area;
        self.area += area;
        self.x += area * x;
        self.z += area * z;
        self.xx += xx + area * x * x;
        self.zz += zz + area * z * z;
        for corner in polygon.corners() {
            for (reach, at) in self.reach.iter_mut().zip(corner) {
                *reach = [reach[0].min(*at), reach[1].max(*at)];
            }
        }
    }

    /// Centroid, and variances of x and z.
    pub(super) fn about_centroid(&self) -> ([f64; 2], [f64; 2]) {
        let [x, z] = [self.x / self.area, self.z / self.area];
        let of = |sum: f64, square: f64| sum / self.area - square;
        ([x, z], [of(self.xx, x * x).max(0.0), of(self.zz, z * z).max(0.0)])
    }
}

/// True if a segment has a point inside a rectangle or on its border.
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
