//! Least distance over the angle around an axis, in f64.

use std::f64::consts::TAU;

/// Angles at which the search for the least distance begins.
const STARTS: u32 = 64;
/// Narrowings of an interval between three of them: to 1e-10 of it.
const NARROWINGS: usize = 48;

/// The least of distances at angles around an axis, m.
pub(super) fn around(at: impl Fn(f64) -> f64) -> Option<f64> {
    let step = TAU / f64::from(STARTS);
    let starts: Vec<f64> = (0..STARTS).map(|k| at(f64::from(k) * step)).collect();
    let count = starts.len();
    let is_least = |k: &usize| {
        let [before, here, after] = [k + count - 1, *k, k + 1].map(|it| starts[it % count]);
        here <= before && here <= after
    };
    let found = (0..count)
        .filter(is_least)
        .map(|k| at(lowest(&at, [k as f64 - 1.0, k as f64 + 1.0], step)));
    found.min_by(f64::total_cmp)
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
