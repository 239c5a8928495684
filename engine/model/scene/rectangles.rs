//! Masks whose openings are a list: the pixels of a pattern, or rectangles. Widths of their openings and bars.

use super::{MaskSpec, Strip};
use beamlet_core::units::Dimension::Length;
use beamlet_core::{Error, Result};

/// Gap between edges that touch over the period: rounding of lengths in decimals.
const ROUNDING: f64 = 1e-9;

/// A rectangular aperture of a period of a mask, in the plane of the mask.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rectangle {
    /// Middle along x and z from the middle of the period, m.
    pub centre: [f64; 2],
    /// Width along x and height along z, m.
    pub size: [f64; 2],
}

impl Rectangle {
    /// Ends along x (0) or z (1) from the middle of the period, m.
    #[must_use]
    pub fn ends(&self, axis: usize) -> [f64; 2] {
        [-0.5, 0.5].map(|part| self.centre[axis] + part * self.size[axis])
    }
}

/// Intervals in ascending order; intervals that overlap or are at most `gap` apart become one.
fn joined(mut intervals: Vec<[f64; 2]>, gap: f64) -> Vec<[f64; 2]> {
    intervals.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let mut all: Vec<[f64; 2]> = Vec::with_capacity(intervals.len());
    for [low, high] in intervals {
        match all.last_mut() {
            Some(last) if low <= last[1] + gap => last[1] = last[1].max(high),
            _ => all.push([low, high]),
        }
    }
    all
}

/// Strips of rectangles: intervals along the other axis, ascending, with the openings along `axis`.
fn strips_of(rectangles: &[Rectangle], axis: usize, gap: [f64; 2]) -> Vec<Strip> {
    let across = 1 - axis;
    let mut edges: Vec<f64> = rectangles.iter().flat_map(|it| it.ends(across)).collect();
    edges.sort_by(f64::total_cmp);
    edges.dedup_by(|next, last| *next <= *last + gap[across]);
    let mut strips: Vec<Strip> = Vec::new();
    for pair in edges.windows(2) {
        let middle = f64::midpoint(pair[0], pair[1]);
        let covers = |it: &&Rectangle| {
            let [low, high] = it.ends(across);
            low < middle && middle < high
        };
        let openings = rectangles.iter().filter(covers).map(|it| it.ends(axis)).collect();
        let openings = joined(openings, gap[axis]);
        let (low, high) = (pair[0], pair[1]);
        match strips.last_mut() {
            Some(last) if last.z[1].to_bits() == low.to_bits() && last.x == openings => {
                *last = Strip::between([last.z[0], high], openings);
            }
            _ if openings.is_empty() => {}
            _ => strips.push(Strip::between([low, high], openings)),
        }
    }
    strips
}

/// Width of the narrowest opening of strips (or bar, if `open` is false) whose openings repeat after `period`; the
/// period where none has an end. Openings without width do not count.
fn narrowest(strips: &[Strip], period: f64, open: bool) -> f64 {
    let rounding = ROUNDING * period;
    let of_strip = |strip: &Strip| {
        let mut ends = strip.x.clone();
        let across = |first: &[f64; 2], last: &[f64; 2]| first[0] + period <= last[1] + rounding;
        if let ([first, .., last], true) = (&ends[..], ends.len() > 1)
            && across(first, last)
        {
            // An opening that crosses the end of the period.
            let whole = [last[0], first[1] + period];
            ends.pop();
            ends[0] = whole;
            ends.rotate_left(1);
        }
        let first = ends.first().map(|[low, _]| low + period);
        let next = ends.iter().skip(1).map(|[low, _]| *low).chain(first);
        let width = |([low, high], next): (&[f64; 2], f64)| match open {
            _ if next - high <= rounding || high <= low => f64::INFINITY,
            true => high - low,
            false => next - high,
        };
        ends.iter().zip(next).map(width).fold(f64::INFINITY, f64::min)
    };
    let least = strips.iter().map(of_strip).fold(f64::INFINITY, f64::min);
    if least.is_finite() { least } else { period }
}

impl MaskSpec {
    /// The mask with rectangular apertures in each period, whose lengths along x and z are `period`, m in the plane of
    /// the mask.
    #[must_use]
    pub fn with_rectangles(mut self, rectangles: Vec<Rectangle>, period: [f64; 2]) -> Self {
        (self.pattern, self.pattern_pixel) = (None, None);
        self.rectangles = rectangles;
        self.period = period[0];
        self.period_z = Some(period[1]);
        self.take_widths();
        self
    }

    /// Takes the narrowest openings of a list as width and height of the apertures.
    pub(super) fn take_widths(&mut self) {
        self.shape = super::ApertureShape::Rectangle;
        let period = self.periods();
        let of =
            |axis: usize| narrowest(&self.listed(axis).unwrap_or_default(), period[axis], true);
        let [x, z] = [of(0), of(1)];
        (self.aperture, self.aperture_z) = (x, Some(z));
    }

    /// Periods along x and z, m; infinite along z of slits.
    fn periods(&self) -> [f64; 2] {
        [self.period, self.period_z.unwrap_or(f64::INFINITY)]
    }

    /// Key of the list of openings; `None` of slits and lattices.
    #[must_use]
    pub const fn list_key(&self) -> Option<&'static str> {
        match (&self.pattern, self.rectangles.is_empty()) {
            (Some(_), _) => Some("pattern"),
            (None, false) => Some("rectangles"),
            (None, true) => None,
        }
    }

    /// Strips of a period of a list whose openings lie along x (`axis` 0), or with x and z exchanged (1).
    fn listed(&self, axis: usize) -> Option<Vec<Strip>> {
        if let Some((pattern, pixel)) = self.pattern.as_ref().zip(self.pattern_pixel) {
            return Some(match axis {
                0 => pattern.strips(pixel),
                _ => pattern.transposed().strips([pixel[1], pixel[0]]),
            });
        }
        let gap = self.periods().map(|period| ROUNDING * period);
        (!self.rectangles.is_empty()).then(|| strips_of(&self.rectangles, axis, gap))
    }

    /// Strips of a period of a list; `None` without one.
    pub(crate) fn listed_strips(&self) -> Option<Vec<Strip>> {
        self.listed(0)
    }

    /// Ends along x of the columns of a list with an opening: two intervals at least.
    pub(crate) fn listed_columns(&self) -> Option<Vec<[f64; 2]>> {
        let openings = self.listed(0)?.into_iter().flat_map(|strip| strip.x).collect();
        let ends = joined(openings, ROUNDING * self.period);
        Some(match ends[..] {
            [[low, high]] => {
                let middle = f64::midpoint(low, high);
                vec![[low, middle], [middle, high]]
            }
            _ => ends,
        })
    }

    /// Ends along x of the openings of the strip of a list with most of them.
    pub(crate) fn listed_row(&self) -> Option<Vec<[f64; 2]>> {
        let strips = self.listed(0)?.into_iter().map(|strip| strip.x);
        Some(strips.max_by_key(Vec::len).unwrap_or_default())
    }

    /// Width along x of the narrowest bar of a list, m; its period where no bar ends.
    pub(crate) fn listed_bar(&self) -> Option<f64> {
        Some(narrowest(&self.listed(0)?, self.period, false))
    }

    /// Share of a list that is open; `None` without one.
    pub(crate) fn listed_share(&self) -> Option<f64> {
        let period = self.periods();
        let area: f64 = self.rectangles.iter().map(|it| it.size[0] * it.size[1]).sum();
        let of_pattern = self.pattern.as_ref().map(super::Pattern::open_share);
        of_pattern.or_else(|| self.list_key().map(|_| area / (period[0] * period[1])))
    }

    /// Refuses rectangles beyond the period and rectangles that overlap; `key` makes paths of the names of keys.
    pub(super) fn check_rectangles(&self, key: &dyn Fn(&str) -> String) -> Result<()> {
        let name = |index: usize| key(&format!("rectangles[{index}]"));
        let lengths =
            |of: &[f64]| of.iter().map(|it| Length.rounded(*it)).collect::<Vec<_>>().join(" x ");
        for (index, it) in self.rectangles.iter().enumerate() {
            if !it.size.iter().all(|size| *size > 0.0 && size.is_finite()) {
                return Err(Error::scene(name(index), lengths(&it.size), "width and height > 0"));
            }
            for (axis, period) in self.periods().into_iter().enumerate() {
                let [low, high] = it.ends(axis);
                let half = period * (0.5 + ROUNDING);
                if !(low >= -half && high <= half) {
                    let letter = ["x", "z"][axis];
                    let of = |[low, high]: [f64; 2]| {
                        format!("{letter} = {} to {}", Length.rounded(low), Length.rounded(high))
                    };
                    let allowed = format!("within a period, {}", of([-period / 2.0, period / 2.0]));
                    return Err(Error::scene(name(index), of([low, high]), allowed));
                }
            }
            let gap = self.periods().map(|period| ROUNDING * period);
            let overlaps = |other: &Rectangle| {
                (0..2).all(|axis| {
                    let ([low, high], [from, to]) = (it.ends(axis), other.ends(axis));
                    high.min(to) - low.max(from) > gap[axis]
                })
            };
            if let Some(other) = self.rectangles[..index].iter().position(overlaps) {
                let found = format!("a rectangle that overlaps rectangles[{other}]");
                return Err(Error::scene(name(index), found, "rectangles side by side or apart"));
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rectangle(centre: [f64; 2], size: [f64; 2]) -> Rectangle {
        Rectangle { centre, size }
    }

    /// An upright rectangle beside two that touch each other: strips change where one begins or ends.
    #[test]
    fn strips_have_the_openings_of_the_rectangles_at_their_height() {
        let list = [
            rectangle([-3.0, 0.0], [2.0, 8.0]),
            rectangle([1.0, 1.0], [2.0, 2.0]),
            rectangle([3.0, 1.0], [2.0, 2.0]),
        ];
        let tall = [-4.0, -2.0];
        let want = [
            Strip::between([-4.0, 0.0], vec![tall]),
            Strip::between([0.0, 2.0], vec![tall, [0.0, 4.0]]),
            Strip::between([2.0, 4.0], vec![tall]),
        ];
        assert_eq!(strips_of(&list, 0, [1e-9; 2]), want);
        let exchanged = strips_of(&list, 1, [1e-9; 2]);
        assert_eq!(
            exchanged,
            [
                Strip::between([-4.0, -2.0], vec![[-4.0, 4.0]]),
                Strip::between([0.0, 4.0], vec![[0.0, 2.0]]),
            ]
        );
    }

    /// Openings at both ends of a period are one; a strip without bars has no ends.
    #[test]
    fn widths_are_taken_across_the_end_of_the_period() {
        let strips = [
            Strip::between([0.0, 1.0], vec![[-5.0, -4.5], [-2.0, 0.0], [4.0, 5.0]]),
            Strip::between([1.0, 2.0], vec![[-5.0, 5.0]]),
        ];
        assert!((narrowest(&strips, 10.0, true) - 1.5).abs() < 1e-12);
        assert!((narrowest(&strips, 10.0, false) - 2.5).abs() < 1e-12);
        assert!((narrowest(&strips[1..], 10.0, true) - 10.0).abs() < 1e-12);
    }
}
