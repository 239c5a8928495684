//! Doubts about the angles of a scan: views that repeat others, and gaps.

use beamlet_core::printed::number;
use beamlet_geometry::Sample;
use beamlet_model::optics::ends;
use beamlet_model::scene::{Scan, Scene};
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// Angles nearer to one another than this are the same view, rad.
const SAME: f64 = 1e-7;
/// Angles of a scan in which a gap is looked for.
const LEAST: usize = 8;
/// Gap beyond which angles are missing, in medians of the gaps; golden angles have gaps of 1 to 2.62.
const GAP: f64 = 3.0;

/// Share of the views that a volume needs below which streaks hide it.
const FEW: f64 = 1.0 / 3.0;

/// Largest step, in degrees, of which the steps of a range are whole multiples.
const ROUND: f64 = 0.05;
/// Distance from a whole multiple, as a share of the step, of rounded decimals.
const ROUNDING: f64 = 1e-6;

/// Doubt about even angles whose step would be round if the end of their range were included.
fn left_out(angles: &[f64]) -> Option<String> {
    let [first, .., last] = angles else { return None };
    let count = angles.len() as f64;
    let step = (last - first) / (count - 1.0);
    let is_even = |pair: &[f64]| (pair[1] - pair[0] - step).abs() <= ROUNDING * step.abs();
    if angles.len() < LEAST || step == 0.0 || !angles.windows(2).all(is_even) {
        return None;
    }
    let [step, included] = [step, step * count / (count - 1.0)].map(f64::to_degrees);
    let is_round = |value: f64| {
        let parts = value / ROUND;
        (parts - parts.round()).abs() <= ROUNDING * parts.abs() && parts.round() != 0.0
    };
    (is_round(included) && !is_round(step)).then(|| {
        let [from, to] = [*first, first + count * step.to_radians()].map(f64::to_degrees);
        format!(
            "scan.angles steps by {step:.4} deg from {from:.4} deg, because a range excludes its \
             end, {to:.4} deg; with to = \"{:.4} deg\" it steps by {included:.4} deg",
            from + count * included
        )
    })
}

/// Doubt about views at the angle of another, of which there is a pair.
fn repeats(scan: &Scan, [a, b]: [usize; 2], count: usize) -> String {
    let [a, b] = [a.min(b), a.max(b)];
    let degrees = |view: usize| scan.angles[view].to_degrees();
    let places = format!("at {:.4} and {:.4} deg", degrees(a), degrees(b));
    match count {
        1 => format!("views {a} and {b} of scan.angles are the same, {places}: is one too many?"),
        _ => format!(
            "{count} views of scan.angles repeat the angle of another, as views {a} and {b}, {places}: is \
             that intended?"
        ),
    }
}

/// Doubt about the number of views of a scan over half a turn or more: a slice of n pixels across has independent
/// values of all directions from n pi/2 views over half a turn on.
pub(super) fn few_views(scene: &Scene, sample: &Sample) -> Option<String> {
    let angles = &scene.scan.angles;
    let [low, high] = ends(angles);
    let count = angles.len() as f64;
    let span = (high - low) * count / (count - 1.0);
    if angles.len() < LEAST || !scene.scan.is_circle() || span < 0.9 * PI {
        return None;
    }
    let shrink = scene.axis_distance() / scene.detector.distance;
    let [pixel, field] = [scene.detector.pitch[0], scene.detector.size()[0]].map(|it| it * shrink);
    let across = |axis: usize| {
        let sides = sample.objects.iter().map(|object| object.bounds.map(|corner| corner[axis]));
        let [low, high] = sides.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], [a, b]| {
            [low.min(a), high.max(b)]
        });
        high - low
    };
    let width = across(0).max(across(1)).min(field) / pixel;
    let (found, needed) = (count * PI / span, FRAC_PI_2 * width);
    (found < 0.999 * needed).then(|| {
        let much = if found < FEW * needed { ", less than a third of them" } else { "" };
        format!(
            "scan.angles have {} views over half a turn{much}; a sample of {} pixels across needs {} for volumes \
             without streaks",
            number(found.round()),
            number(width.round()),
            number(needed.ceil())
        )
    })
}

/// Doubts about the angles; none where the sample moves otherwise, for angles may repeat then.
pub(super) fn doubts(scan: &Scan) -> Vec<String> {
    if !scan.is_circle() || !scan.view_offsets.is_empty() {
        return Vec::new();
    }
    let mut angles: Vec<(f64, usize)> = (0..scan.angles.len())
        .map(|view| (libm::remainder(scan.angles[view], TAU).rem_euclid(TAU), view))
        .collect();
    angles.sort_by(|a, b| a.0.total_cmp(&b.0));
    let gap = |pair: &[(f64, usize)]| pair[1].0 - pair[0].0;
    let around = |a: &(f64, usize), b: &(f64, usize)| a.0 + TAU - b.0;
    let mut doubts: Vec<String> = left_out(&scan.angles).into_iter().collect();
    let same = angles.windows(2).find(|pair| gap(pair) < SAME).map(|pair| [pair[0].1, pair[1].1]);
    let ends = match angles[..] {
        [first, .., last] if around(&first, &last) < SAME => Some([first.1, last.1]),
        _ => None,
    };
    // Gaps lie between angles, however many views one has.
    angles.dedup_by(|next, kept| next.0 - kept.0 < SAME);
    if ends.is_some() && angles.len() > 1 {
        angles.pop();
    }
    if let Some(pair) = same.or(ends) {
        doubts.push(repeats(scan, pair, scan.angles.len() - angles.len()));
    }
    let mut gaps: Vec<f64> = angles.windows(2).map(gap).collect();
    gaps.sort_by(f64::total_cmp);
    if angles.len() >= LEAST
        && let Some(widest) = angles.windows(2).max_by(|a, b| gap(a).total_cmp(&gap(b)))
        // Behind the last angle of half a turn there is none.
        && gap(widest) < TAU / 4.0
        && gap(widest) > GAP * gaps[gaps.len() / 2]
    {
        doubts.push(format!(
            "scan.angles have a gap of {:.4} deg between views {} and {}, {:.1} times the median: are \
             views missing?",
            gap(widest).to_degrees(),
            widest[0].1,
            widest[1].1,
            gap(widest) / gaps[gaps.len() / 2]
        ));
    }
    doubts
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(degrees: impl Iterator<Item = f64>) -> Vec<String> {
        doubts(&Scan::new(vec![0.0], degrees.map(f64::to_radians).collect()))
    }

    #[test]
    fn repeats_and_gaps_are_found_and_even_and_golden_angles_have_none() {
        let even = || (0..36).map(f64::from);
        assert!(of(even().map(|k| 10.0 * k)).is_empty());
        assert!(of(even().map(|k| -90.0 + 5.0 * k)).is_empty());
        for count in [9, 50, 100] {
            let golden = (0..count).map(|k| 180.0 * (f64::from(k) * 0.618_033_988_75).fract());
            assert!(of(golden).is_empty());
        }
        // 0 to 359 deg in 360 views, and 0 to 180 deg in 181.
        for (count, to, words) in
            [(360, 359.0, "steps by 0.9972 deg"), (181, 180.0, "to = \"181.0000 deg\"")]
        {
            let found = of((0..count).map(|k| to * f64::from(k) / f64::from(count)));
            assert!(found.len() == 1 && found[0].contains(words), "{found:?}");
        }
        assert!(of((0..7).map(|k| 360.0 / 7.0 * f64::from(k))).is_empty());
        assert!(of((0..192).map(|k| 360.0 / 192.0 * f64::from(k))).is_empty());
        let closed = of((0..=36).map(|k| 10.0 * f64::from(k)));
        assert!(closed.len() == 1 && closed[0].contains("views 0 and 36"), "{closed:?}");
        // Two turns of 45 angles, whose angles differ by rounding; a full turn may end as the first angle.
        for angles in [(0..90).map(|k| 8.0 * f64::from(k)).collect::<Vec<_>>(), {
            (0..90).map(|k| 8.0 * f64::from(k % 45) + 1e-9 * f64::from(k)).collect()
        }] {
            let found = of(angles.into_iter());
            assert!(found.len() == 1 && found[0].starts_with("45 views"), "{found:?}");
        }
        let ten = || (0..36).map(|k| 10.0 * f64::from(k)).filter(|k| !(120.0..150.0).contains(k));
        let gap = of(ten().chain(ten()).chain([359.999_999_999_9]));
        assert!(gap.len() == 2 && gap[1].contains("40.0000 deg"), "{gap:?}");
        assert!(gap[1].contains("4.0 times the median"), "{gap:?}");
        let gap = of(even().filter(|k| !(12.0..15.0).contains(k)).map(|k| 10.0 * k));
        assert!(gap.len() == 1 && gap[0].contains("gap of 40.0000 deg between views 11 and 12"));
    }
}
