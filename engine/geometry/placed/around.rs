//! Least distance over the angle around an axis, in f64.

use std::f64::consts::TAU;

use glam::DVec3;

/// A distance, m, and a point where it is least.
pub(super) type Distance = (f64, DVec3);

/// Angles at which the search for the least distance begins.
const STARTS: u32 = 64;
/// Narrowings of an interval between three of them: to 1e-10 of it.
const NARROWINGS: usize = 48;

/// The least of distances at angles around an axis, and its point; `None` where none can be within a
/// limit, m. `radius`: of the circle on which a place moves as its angle grows, m.
pub(super) fn around(at: impl Fn(f64) -> Distance, radius: f64, limit: f64) -> Option<Distance> {
    let step = TAU / f64::from(STARTS);
    let starts: Vec<f64> = (0..STARTS).map(|k| at(f64::from(k) * step).0).collect();
    // Between two starts the distance changes by half a step of the circle at most.
    let may_be = |it: f64| it - 0.5 * step * radius <= limit;
    let count = starts.len();
    let mut least: Option<Distance> = None;
    for k in 0..count {
        let [before, here, after] = [k + count - 1, k, k + 1].map(|it| starts[it % count]);
        if here > before || here > after || !may_be(here) {
            continue;
        }
        let found = at(lowest(|angle| at(angle).0, [k as f64 - 1.0, k as f64 + 1.0], step));
        if least.is_none_or(|it| found.0 < it.0) {
            least = Some(found);
        }
    }
    least
}

/// Where a function of one minimum is least in an interval, by golden sections; the interval in
/// steps.
fn lowest(of: impl Fn(f64) -> f64, interval: [f64; 2], step: f64) -> f64 {
    let golden = (5.0_f64.sqrt() - 1.0) / 2.0;
    let [mut low, mut high] = interval.map(|it| it * step);
    let mut inner = [high - golden * (high - low), low + golden * (high - low)];
    let mut values = inner.map(&of);
    for _ in 0..NARROWINGS {
        if values[0] <= values[1] {
            high = inner[1];
            inner = [high - golden * (high - low), inner[0]];
            values = [of(inner[0]), values[0]];
        } else {
            low = inner[0];
            inner = [inner[1], low + golden * (high - low)];
            values = [values[1], of(inner[1])];
        }
    }
    low.midpoint(high)
}
