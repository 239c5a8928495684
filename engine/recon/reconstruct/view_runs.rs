//! Views in the order of their angles about z, and runs of them.

use super::geometry::ScanGeometry;
use std::f64::consts::TAU;

/// Gap between angles beyond which views do not go all the way round, in median steps.
const GAP: f64 = 5.0;
/// Angle up to which views have one direction, rad.
const SAME: f64 = 1e-6;
/// Largest difference of heights, m, and of directions that count as equal.
const EQUAL: f64 = 1e-9;

/// Views in the order of their angles modulo a turn. In a scan over less than a turn the first is behind the gap.
#[derive(Debug, Clone)]
pub(super) struct Circle {
    /// Numbers of the views.
    pub(crate) order: Vec<usize>,
    /// Angles in this order, ascending from the first, rad.
    angles: Vec<f64>,
    /// Median step, rad.
    pub(super) step: f64,
    is_turn: bool,
}

impl Circle {
    /// # Errors
    /// Why views see different slices, in words.
    pub(super) fn of(geometry: &ScanGeometry) -> Result<Self, &'static str> {
        let angles = angles(geometry)?;
        if geometry.columns_of_half_fan() > 0 {
            return Err("views of a half-fan see a part of the slice");
        }
        let mut sorted: Vec<(f64, usize)> = angles.iter().copied().zip(0..).collect();
        sorted.sort_by(|a, b| a.0.total_cmp(&b.0));
        let count = sorted.len();
        let next = |n: usize| if n + 1 < count { sorted[n + 1].0 } else { sorted[0].0 + TAU };
        let gaps: Vec<f64> = (0..count).map(|n| next(n) - sorted[n].0).collect();
        // Repeated exposures have no gap.
        let mut ascending: Vec<f64> = gaps.iter().copied().filter(|gap| *gap > SAME).collect();
        ascending.sort_by(f64::total_cmp);
        let widest = (0..count).max_by(|a, b| gaps[*a].total_cmp(&gaps[*b])).unwrap_or(0);
        let step = ascending.get(ascending.len() / 2).copied().unwrap_or(f64::MIN_POSITIVE);
        sorted.rotate_left((widest + 1) % count);
        let first = sorted[0].0;
        let from_first = |(angle, _): &(f64, usize)| first + (angle - first).rem_euclid(TAU);
        Ok(Self {
            angles: sorted.iter().map(from_first).collect(),
            order: sorted.iter().map(|(_, view)| *view).collect(),
            step,
            is_turn: gaps[widest] <= GAP * step,
        })
    }

    /// Angle of a place, which may be beyond the last by a turn.
    fn angle(&self, at: usize) -> f64 {
        let count = self.angles.len();
        self.angles[at % count] + TAU * (at / count) as f64
    }

    /// Runs of marked places, first and last; over the end of the list in whole turns.
    fn runs(&self, marked: &[bool]) -> Vec<[usize; 2]> {
        let count = marked.len();
        // A whole turn begins behind a place that is not marked.
        let start = match marked.iter().position(|marked| !marked) {
            _ if !self.is_turn => 0,
            Some(at) => at,
            None => return vec![[0, count - 1]],
        };
        let mut runs: Vec<[usize; 2]> = Vec::new();
        for at in start..start + count {
            match runs.last_mut() {
                _ if !marked[at % count] => {}
                Some([_, last]) if *last + 1 == at => *last = at,
                _ => runs.push([at, at]),
            }
        }
        runs
    }

    /// Takes the marks of runs that are wider than a width, rad, by more than a step.
    pub(super) fn keep_wide_runs(&self, marked: &mut [bool], width: f64) {
        let count = marked.len();
        for [first, last] in self.runs(marked) {
            if self.angle(last) - self.angle(first) > width + 1.01 * self.step {
                (first..=last).for_each(|at| marked[at % count] = false);
            }
        }
    }
}

/// Marked places between two others in a circle, with these and their shares by angle.
pub(super) fn between(circle: &Circle, marked: &[bool]) -> Vec<(usize, [(usize, f64); 2])> {
    let count = marked.len();
    let mut all = Vec::new();
    for [first, last] in circle.runs(marked) {
        let is_inside = first > 0 && last + 1 < count;
        if last - first + 1 == count || !(circle.is_turn || is_inside) {
            continue;
        }
        // Places count from the second turn, so that the place before is not below 0.
        let [before, behind] = [first + count - 1, last + count + 1];
        let width = (circle.angle(behind) - circle.angle(before)).max(f64::MIN_POSITIVE);
        for at in first..=last {
            let share = (circle.angle(at + count) - circle.angle(before)) / width;
            let beside = [(before % count, 1.0 - share), (behind % count, share)];
            all.push((at % count, beside));
        }
    }
    all
}

/// Angle of each view about z, modulo a turn, rad.
///
/// # Errors
/// Why views see different slices, in words.
fn angles(geometry: &ScanGeometry) -> Result<Vec<f64>, &'static str> {
    let Some(motions) = &geometry.motions else {
        return Ok(geometry.angles.iter().map(|angle| angle.rem_euclid(TAU)).collect());
    };
    let height = motions.first().map_or(0.0, |motion| motion.point([0.0; 3])[2]);
    let keeps = |[x, y, _]: [f64; 3], z: f64| {
        x.abs() < EQUAL && y.abs() < EQUAL && (z - height).abs() < EQUAL
    };
    let is_flat = motions
        .iter()
        .all(|motion| keeps(motion.direction([0.0, 0.0, 1.0]), motion.point([0.0; 3])[2]));
    if !is_flat {
        return Err("motions of the sample along or about another axis than z change the slice");
    }
    let angle = |motion: &beamlet_model::scene::Motion| {
        let [x, y, _] = motion.direction([1.0, 0.0, 0.0]);
        (-libm::atan2(y, x)).rem_euclid(TAU)
    };
    Ok(motions.iter().map(angle).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn circle(degrees: &[f64]) -> Circle {
        let columns = (0..8).map(|n| (f64::from(n) - 3.5) * 1e-4).collect();
        let angles = degrees.iter().map(|angle| angle.to_radians()).collect();
        Circle::of(&ScanGeometry::new([1.0, 2.0], columns, vec![0.0], angles)).unwrap()
    }

    #[test]
    fn places_between_others_have_shares_by_angle_and_runs_go_over_the_end_of_a_turn() {
        let turn = circle(&[0.0, 30.0, 60.0, 90.0, 180.0, 240.0, 300.0, 330.0]);
        let begin = turn.order[0];
        let marked: Vec<bool> = turn.order.iter().map(|view| [0, 3].contains(view)).collect();
        let found = between(&turn, &marked);
        let of = |wanted: usize| {
            let (_, beside) = found.iter().find(|(at, _)| turn.order[*at] == wanted).unwrap();
            beside.map(|(at, share)| (turn.order[at], share))
        };
        assert_eq!(found.len(), 2);
        let near = |found: [(usize, f64); 2], expected: [(usize, f64); 2]| {
            found.iter().zip(expected).all(|(a, b)| a.0 == b.0 && (a.1 - b.1).abs() < 1e-12)
        };
        assert!(near(of(0), [(7, 0.5), (1, 0.5)]), "{begin}: {:?}", of(0));
        assert!(near(of(3), [(2, 0.75), (4, 0.25)]), "{:?}", of(3));
        // The first and the last of half a turn have none on one side.
        let degrees: Vec<f64> = (0..19).map(|n| 10.0 * f64::from(n)).collect();
        let half = circle(&degrees);
        let marked: Vec<bool> = half.order.iter().map(|view| [0, 9, 18].contains(view)).collect();
        assert_eq!(between(&half, &marked), [(9, [(8, 0.5), (10, 0.5)])]);
    }

    #[test]
    fn wide_runs_lose_their_marks_and_narrow_ones_keep_them() {
        let degrees: Vec<f64> = (0..72).map(|n| 5.0 * f64::from(n)).collect();
        let turn = circle(&degrees);
        let marks = |views: &[usize]| -> Vec<bool> {
            let mut marked: Vec<bool> =
                turn.order.iter().map(|view| views.contains(view)).collect();
            turn.keep_wide_runs(&mut marked, 0.1);
            let mut kept: Vec<bool> = vec![false; 72];
            turn.order.iter().zip(marked).for_each(|(view, mark)| kept[*view] = mark);
            kept
        };
        // A step of 0.087 rad is narrow, four steps are not.
        let kept = marks(&[71, 0, 20, 21, 40, 41, 42, 43, 44]);
        let found: Vec<usize> = (0..72).filter(|view| kept[*view]).collect();
        assert_eq!(found, [0, 20, 21, 71]);
    }
}
