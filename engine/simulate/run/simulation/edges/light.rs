//! Light of a line of rays through apertures and windows, from points of the spot.

use crate::run::edge_blur::{LightPath, Slits};
use std::collections::BTreeMap;

/// Steps of the sample mask that are looked at, at most.
const MOST_STEPS: usize = 32;
/// Largest distance of the landing points of two neighbouring rays, windows; light thrown farther is
/// ignored.
const WIDEST: f64 = 8.0;

/// A ray of a line: its place in the plane of the rotation centre, m, the light that passes the
/// sample, and its displacement on the plane of the windows, m.
#[derive(Debug, Clone, Copy)]
pub(super) struct LitPoint {
    pub(super) x: f64,
    pub(super) light: f64,
    pub(super) displacement: f64,
}

/// Largest difference in any window and step between the light of rays from their own points of the
/// spot (offset and share) and of those from the centre in their place.
pub(super) fn largest_error<'a>(
    path: &LightPath,
    steps: &[f64],
    centre: &[LitPoint],
    beside: impl Iterator<Item = (&'a [f64; 2], &'a Vec<LitPoint>)> + Clone,
) -> f64 {
    let steps: &[f64] = if path.apertures.is_some() { steps } else { &[0.0] };
    let every = steps.len().div_ceil(MOST_STEPS).max(1);
    let mut largest = 0.0_f64;
    for step in steps.iter().step_by(every) {
        let mut windows = BTreeMap::new();
        for ([offset, share], points) in beside.clone() {
            add_light(path, [*offset, *step], points, *share, &mut windows);
            add_light(path, [*offset, *step], centre, -share, &mut windows);
        }
        largest = windows.values().fold(largest, |most, value: &f64| most.max(value.abs()));
    }
    largest
}

/// Adds the light of a line to the windows where it lands, times `share`. `offset`: of the source,
/// `step`: of the sample mask, m.
fn add_light(
    path: &LightPath,
    [offset, step]: [f64; 2],
    points: &[LitPoint],
    share: f64,
    windows: &mut BTreeMap<i64, f64>,
) {
    for pair in points.windows(2) {
        let [a, b] = [pair[0], pair[1]];
        let width = b.x - a.x;
        let landing =
            [a, b].map(|p| p.x * (1.0 + path.lever) - offset * path.lever + p.displacement);
        if width <= 0.0 || (landing[1] - landing[0]).abs() > WIDEST * path.windows.period {
            continue;
        }
        let open = match &path.apertures {
            Some((slits, ratio)) => {
                let through = [a, b].map(|p| offset * (1.0 - ratio) + p.x * ratio - step);
                inside(slits, through)
            }
            None => vec![(0, [0.0, 1.0])],
        };
        for (window, seen) in inside(&path.windows, landing) {
            for (_, part) in &open {
                let [low, high] = [part[0].max(seen[0]), part[1].min(seen[1])];
                if high > low {
                    let light = a.light + (b.light - a.light) * 0.5 * (low + high);
                    let value = share * light * (high - low) * width * path.weight;
                    *windows.entry(window).or_default() += value;
                }
            }
        }
    }
}

/// Parts of the way between two places that lie in slits, with their numbers; the way is 0 to 1.
fn inside(slits: &Slits, [from, to]: [f64; 2]) -> Vec<(i64, [f64; 2])> {
    let number = |at: f64| (at - slits.centre) / slits.period;
    let half = 0.5 * slits.width / slits.period;
    let [first, last] = [from.min(to), from.max(to)].map(number);
    let numbers = beamlet_core::numbers::whole::<i64>((first - half).ceil())
        ..beamlet_core::numbers::whole::<i64>((last + half).floor()) + 1;
    numbers
        .filter_map(|index| {
            let centre = slits.centre + index as f64 * slits.period;
            let ends = [centre - 0.5 * slits.width, centre + 0.5 * slits.width];
            let way = to - from;
            if way == 0.0 {
                return (ends[0] <= from && from < ends[1]).then_some((index, [0.0, 1.0]));
            }
            let [p, q] = ends.map(|end| ((end - from) / way).clamp(0.0, 1.0));
            Some((index, [p.min(q), p.max(q)]))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ways_through_slits_are_cut_at_their_ends() {
        let slits = Slits { period: 10.0, width: 4.0, centre: 1.0 };
        let close = |found: Vec<(i64, [f64; 2])>, want: &[(i64, [f64; 2])]| {
            assert_eq!(found.len(), want.len(), "{found:?}");
            for ((i, a), (j, b)) in found.iter().zip(want) {
                assert!(i == j && (a[0] - b[0]).abs() + (a[1] - b[1]).abs() < 1e-12, "{found:?}");
            }
        };
        close(
            inside(&slits, [0.0, 20.0]),
            &[(0, [0.0, 0.15]), (1, [0.45, 0.65]), (2, [0.95, 1.0])],
        );
        close(inside(&slits, [12.0, 8.0]), &[(1, [0.0, 0.75])]);
        close(inside(&slits, [4.0, 6.0]), &[]);
        close(inside(&slits, [1.0, 1.0]), &[(0, [0.0, 1.0])]);
    }
}
