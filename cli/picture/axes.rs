//! Axes: round numbers, tick marks, labels, and where values lie on the paper.

use super::colour::SMALL;
use super::drawing::{Anchor, Area, Drawing, FAINT, INK, Paint, text_width};
use crate::numbers;

/// Room that axes take to the left of and below their area.
pub(crate) const LEFT: f64 = 80.0;
/// As [`LEFT`], below.
pub(crate) const BELOW: f64 = 48.0;

/// Round values between two numbers (`low` < `high`), about `count` of them, with their texts.
pub(crate) fn ticks(low: f64, high: f64, count: usize) -> Vec<(f64, String)> {
    let span = high - low;
    if !(span.is_finite() && span > 0.0) {
        return Vec::new();
    }
    let rough = span / count.max(1) as f64;
    let power = 10.0_f64.powf(rough.log10().floor());
    let step = power
        * match rough / power {
            part if part < 1.5 => 1.0,
            part if part < 3.5 => 2.0,
            part if part < 7.5 => 5.0,
            _ => 10.0,
        };
    let first = numbers::whole::<i64>((low / step - 1e-9).ceil());
    let last = numbers::whole::<i64>((high / step + 1e-9).floor());
    let largest = low.abs().max(high.abs());
    let power = step.log10().floor();
    let plain = (-4.0..5.0).contains(&power) && largest < 1e6;
    let decimals = if plain { numbers::whole::<usize>((-power).max(0.0)) } else { 0 };
    let digits = numbers::whole::<usize>((largest.log10().floor() - power).max(0.0)).min(12);
    (first..=last)
        .map(|index| {
            let value = index as f64 * step;
            let text = match (plain, index) {
                (_, 0) => "0".to_owned(),
                (true, _) => format!("{value:.decimals$}"),
                (false, _) => format!("{value:.digits$e}"),
            };
            (value, text.replace('-', "−"))
        })
        .collect()
}

/// A rectangle of paper over a range of x and y; y grows upwards from `y[0]` to `y[1]`.
#[derive(Debug, Clone, Default)]
pub(crate) struct Axes {
    pub(crate) area: Area,
    pub(crate) x: [f64; 2],
    pub(crate) y: [f64; 2],
    /// Values of y with their texts, where they are not to be round numbers.
    pub(crate) marks: Vec<(f64, String)>,
}

impl Axes {
    pub(crate) fn across(&self, x: f64) -> f64 {
        self.area.left + (x - self.x[0]) / (self.x[1] - self.x[0]) * self.area.width
    }

    pub(crate) fn down(&self, y: f64) -> f64 {
        self.area.bottom() - (y - self.y[0]) / (self.y[1] - self.y[0]) * self.area.height
    }

    pub(crate) fn at(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        [self.across(x), self.down(y)]
    }

    /// Draws grid lines, below later drawings.
    pub(crate) fn grid(&self, drawing: &mut Drawing) {
        let area = self.area;
        for (x, _) in self.ticks_across() {
            let x = self.across(x);
            drawing.line([x, area.top], [x, area.bottom()], Paint::line(FAINT, 0.8));
        }
        for (y, _) in self.ticks_down() {
            let y = self.down(y);
            drawing.line([area.left, y], [area.right(), y], Paint::line(FAINT, 0.8));
        }
    }

    /// Draws frame, tick marks, numbers and labels; no numbers across without a label there.
    pub(crate) fn frame(&self, drawing: &mut Drawing, across: &str, down: &str) {
        let area = self.area;
        let ink = Paint::line(INK, 1.0);
        drawing.area(area, ink);
        for (x, text) in self.ticks_across() {
            let x = self.across(x);
            drawing.line([x, area.bottom()], [x, area.bottom() + 5.0], ink);
            if !across.is_empty() {
                drawing.text([x, area.bottom() + 18.0], text, SMALL, INK, Anchor::Middle);
            }
        }
        for (y, text) in self.ticks_down() {
            let y = self.down(y);
            drawing.line([area.left - 5.0, y], [area.left, y], ink);
            drawing.text([area.left - 8.0, y + 4.2], text, SMALL, INK, Anchor::End);
        }
        let middle = [area.left + area.width / 2.0, area.top + area.height / 2.0];
        drawing.text([middle[0], area.bottom() + 38.0], across, 13.0, INK, Anchor::Middle);
        drawing.text_upwards([area.left - 62.0, middle[1]], down, 13.0);
    }

    fn ticks_across(&self) -> Vec<(f64, String)> {
        let most = numbers::whole::<usize>(self.area.width / 75.0).clamp(3, 10);
        let wide = |text: &str| text_width(text, SMALL) + 12.0;
        // The largest number that fits beside each other.
        let fit = |ticks: &Vec<(f64, String)>| {
            ticks.windows(2).all(|pair| {
                let apart = self.across(pair[1].0) - self.across(pair[0].0);
                apart.abs() >= (wide(&pair[0].1) + wide(&pair[1].1)) / 2.0
            })
        };
        let choices = (1..=most).rev().map(|count| between(self.x, count));
        choices.into_iter().find(fit).unwrap_or_default()
    }

    fn ticks_down(&self) -> Vec<(f64, String)> {
        let most = numbers::whole::<usize>(self.area.height / 50.0).clamp(3, 10);
        if self.marks.is_empty() {
            return between(self.y, most);
        }
        let every = self.marks.len().div_ceil(2 * most);
        self.marks.iter().step_by(every).cloned().collect()
    }

    /// Draws a line through points, cut at the frame.
    pub(crate) fn curve(
        &self,
        drawing: &mut Drawing,
        points: impl Iterator<Item = [f64; 2]>,
        paint: Paint,
    ) {
        drawing.clip(Some(self.area));
        let mut part = Vec::new();
        for point in points {
            if point.iter().all(|value| value.is_finite()) {
                part.push(self.at(point));
            } else {
                drawing.path(std::mem::take(&mut part), false, paint);
            }
        }
        drawing.path(part, false, paint);
        drawing.clip(None);
    }

    /// Draws a dot at each point within the frame.
    pub(crate) fn dots(
        &self,
        drawing: &mut Drawing,
        points: impl Iterator<Item = [f64; 2]>,
        paint: Paint,
    ) {
        for point in points {
            let [x, y] = self.at(point);
            if x >= self.area.left - 0.5
                && x <= self.area.right() + 0.5
                && y >= self.area.top - 0.5
                && y <= self.area.bottom() + 0.5
            {
                drawing.disc([x, y], 3.6, paint);
            }
        }
    }
}

/// Ticks of an axis, which may run downwards.
fn between([a, b]: [f64; 2], count: usize) -> Vec<(f64, String)> {
    ticks(a.min(b), a.max(b), count)
}

/// A range with a twentieth of room on either side; never empty.
pub(crate) fn roomy(values: impl Iterator<Item = f64>) -> [f64; 2] {
    let [low, high] = values
        .filter(|value| value.is_finite())
        .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], v| [low.min(v), high.max(v)]);
    if low > high {
        return [0.0, 1.0];
    }
    let room = match high - low {
        span if span > 1e-9 * low.abs().max(high.abs()) => 0.05 * span,
        _ => (0.1 * high.abs()).max(1e-12),
    };
    [low - room, high + room]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn texts(low: f64, high: f64, count: usize) -> Vec<String> {
        ticks(low, high, count).into_iter().map(|(_, text)| text).collect()
    }

    #[test]
    fn ticks_are_round_and_told_with_the_digits_they_need() {
        assert_eq!(texts(-9.6, 9.6, 8), ["−8", "−6", "−4", "−2", "0", "2", "4", "6", "8"]);
        assert_eq!(texts(0.0, 0.17, 4), ["0", "0.05", "0.10", "0.15"]);
        assert_eq!(texts(0.9, 1.0, 2), ["0.90", "0.95", "1.00"]);
        assert_eq!(texts(0.0, 2e-9, 2), ["0", "1e−9", "2e−9"]);
        assert!(texts(1.0, 1.0, 3).is_empty() && texts(f64::NAN, 1.0, 3).is_empty());
    }

    #[test]
    fn y_grows_upwards_on_the_paper() {
        let axes = Axes {
            area: Area::new(10.0, 20.0, 100.0, 50.0),
            x: [0.0, 1.0],
            y: [-1.0, 1.0],
            ..Axes::default()
        };
        let near = |a: [f64; 2], b: [f64; 2]| (a[0] - b[0]).hypot(a[1] - b[1]) < 1e-12;
        assert!(near(axes.at([0.0, 1.0]), [10.0, 20.0]));
        assert!(near(axes.at([1.0, -1.0]), [110.0, 70.0]));
    }
}
