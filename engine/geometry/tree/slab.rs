//! Slabs: what lies between two parallel planes.

use glam::{DVec3, Vec3};

/// A slab must be this much narrower than the box, seen along its direction.
const WORTH: f64 = 4.0;
/// Share of the coordinates by which slabs are wider, against rounding.
pub(super) const ROUNDING: f64 = 1e-14;

/// Space between two planes.
#[derive(Debug, Clone)]
pub(super) struct Slab {
    /// Unit vector across it.
    across: DVec3,
    /// Where it is along that, m.
    reach: [f64; 2],
}

impl Slab {
    /// The slab of points of a box, widened by `margin`, if it is narrower than the box.
    pub(super) fn around(
        across: DVec3,
        points: impl IntoIterator<Item = DVec3>,
        [low, high]: [Vec3; 2],
        margin: f64,
    ) -> Option<Self> {
        let largest = f64::from(low.abs().max(high.abs()).max_element());
        let slab = Self { across, reach: range(across, points) }.widened(ROUNDING * largest);
        let [from, to] = slab.reach;
        let worth = WORTH * (to - from) < across.abs().dot((high - low).as_dvec3());
        worth.then(|| slab.widened(margin))
    }

    pub(super) fn widened(&self, by: f64) -> Self {
        let [low, high] = self.reach;
        Self { across: self.across, reach: [low - by, high + by] }
    }

    /// Unit vector between the vectors of two slabs, either way round.
    pub(super) fn between(&self, other: &Self) -> DVec3 {
        let way = self.across.dot(other.across).signum();
        (self.across + other.across * way).normalize_or_zero()
    }

    /// True if a box lies outside.
    pub(super) fn misses_box(&self, [low, high]: [Vec3; 2]) -> bool {
        let (low, high) = (low.as_dvec3(), high.as_dvec3());
        let middle = self.across.dot(low.midpoint(high));
        let half = self.across.abs().dot(high - low) / 2.0;
        middle - half > self.reach[1] || middle + half < self.reach[0]
    }

    /// True if points lie on one side, farther than `margin`.
    pub(super) fn misses(&self, points: &[DVec3], margin: f64) -> bool {
        let [low, high] = range(self.across, points.iter().copied());
        low > self.reach[1] + margin || high < self.reach[0] - margin
    }

    /// Where a line enters and leaves, or leaves and enters.
    pub(super) fn along(&self, point: DVec3, direction: DVec3) -> [f64; 2] {
        let (start, slope) = (self.across.dot(point), self.across.dot(direction));
        self.reach.map(|at| (at - start) / slope)
    }
}

/// Unit vector in the plane of a long thin triangle across its longest side.
pub(super) fn across(corners: [DVec3; 3]) -> Option<DVec3> {
    let [a, b, c] = corners;
    let longest = [b - a, c - b, a - c]
        .into_iter()
        .max_by(|p, q| p.length_squared().total_cmp(&q.length_squared()))?;
    let normal = (b - a).cross(c - a);
    let thin = WORTH * normal.length() < longest.length_squared();
    if thin { normal.cross(longest).try_normalize() } else { None }
}

fn range(across: DVec3, points: impl IntoIterator<Item = DVec3>) -> [f64; 2] {
    points.into_iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], point| {
        let at = across.dot(point);
        [low.min(at), high.max(at)]
    })
}
