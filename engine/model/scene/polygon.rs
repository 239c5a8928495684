//! Polygons that do not cross or touch themselves.

use super::keys::faults::{Faults, too_long};
use super::limits;
use beamlet_core::Error;
use beamlet_core::units::Dimension::Length;

/// Most pairs of edges in a report: one edge across a polygon may cross all others.
const PAIRS: usize = 8;

/// Refuses polygons without area, and those whose edges cross or touch one another: each pair, up to
/// [`PAIRS`], at the corner where its second edge begins.
pub(super) fn validate(key: &str, points: &[[f64; 2]], faults: &mut Faults) {
    let n = points.len();
    if n < 3 || n > limits::CORNERS as usize {
        let allowed = format!("3 to {} corners", limits::CORNERS);
        faults.add(Error::scene(key, format!("{n} corners"), allowed));
        return;
    }
    for (index, point) in points.iter().enumerate() {
        for (axis, length) in point.iter().enumerate() {
            if !limits::is_length(*length) {
                let key = format!("{key}[{index}][{axis}]");
                faults.add(Error::scene(key, Length.rounded(*length), too_long()));
            }
        }
    }
    let mut pairs = 0;
    // Edges by the x where they begin: only edges that overlap along x can cross.
    let ends = |edge: usize| [points[edge], points[(edge + 1) % n]];
    let x = |edge: usize| ends(edge).map(|end| end[0]);
    let [left, right] = [f64::min, f64::max].map(|of| move |[a, b]: [f64; 2]| of(a, b));
    let mut order: Vec<usize> = (0..n).collect();
    order.sort_by(|a, b| left(x(*a)).total_cmp(&left(x(*b))));
    for (at, first) in order.iter().enumerate() {
        let near = order[at + 1..].iter().take_while(|it| left(x(**it)) <= right(x(*first)));
        for second in near {
            let [low, high] = [*first.min(second), *first.max(second)];
            if meet(ends(low), ends(high), high == low + 1, low == 0 && high == n - 1) {
                let found = format!(
                    "edges {low} and {high} that touch or cross (edge 0 begins at corner 0)"
                );
                let allowed = "a polygon that does not cross or touch itself, \
                               corners in their order around it";
                faults.add(Error::scene(format!("{key}[{high}]"), found, allowed));
                pairs += 1;
                if pairs == PAIRS {
                    return;
                }
            }
        }
    }
}

/// True if two edges touch beyond their common corner: `after`, the first ends where the second begins;
/// `before`, the other way round.
fn meet(first: [[f64; 2]; 2], second: [[f64; 2]; 2], after: bool, before: bool) -> bool {
    let [a, b] = first;
    let [c, d] = second;
    // Side of a line that a point is on.
    let side = |[from, to]: [[f64; 2]; 2], point: [f64; 2]| {
        let [u, v] = [0, 1].map(|axis| to[axis] - from[axis]);
        let cross = u * (point[1] - from[1]) - v * (point[0] - from[0]);
        if cross == 0.0 { 0.0 } else { cross.signum() }
    };
    // Of a point on the line of an edge: whether it lies on the edge.
    let on = |[from, to]: [[f64; 2]; 2], point: [f64; 2]| {
        (0..2).all(|axis| {
            (from[axis].min(to[axis])..=from[axis].max(to[axis])).contains(&point[axis])
        })
    };
    if after || before {
        // Neighbours touch beyond it only if one folds back onto the other, or has no length.
        let [shared, one, other] = if after { [b, a, d] } else { [a, b, c] };
        let along = |point: [f64; 2]| [0, 1].map(|axis| point[axis] - shared[axis]);
        let [one, other] = [one, other].map(along);
        let folded = side(first, if after { d } else { c }) == 0.0
            && one[0] * other[0] + one[1] * other[1] > 0.0;
        let no_length = [one, other].iter().any(|it| it.iter().all(|part| *part == 0.0));
        return folded || no_length || (after && before);
    }
    let [sc, sd] = [side(first, c), side(first, d)];
    let [sa, sb] = [side(second, a), side(second, b)];
    (sc * sd < 0.0 && sa * sb < 0.0)
        || (sc == 0.0 && on(first, c))
        || (sd == 0.0 && on(first, d))
        || (sa == 0.0 && on(second, a))
        || (sb == 0.0 && on(second, b))
}
