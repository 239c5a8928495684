//! Scales: values to colours, and the colour bar.

use super::axes::ticks;
use super::colour::{Map, NO_VALUE, Rgb, SMALL};
use super::drawing::{Anchor, Area, Drawing, INK, Paint, text_width};
use super::text::wrapped;
use crate::numbers;

/// Share of the values on either side that may lie beyond a scale.
const TAIL: f64 = 0.02;
/// Share of the range taken by all but the outermost values below which nothing is cut: the outermost are
/// the subject then.
const SPARSE: f64 = 0.05;
/// Least difference from the empty beam, share of the largest difference.
const LEAST: f64 = 0.01;
/// The same in standard deviations of the pixel.
const NOISE: f64 = 3.0;
/// Share of negative values above which they are shown.
const NEGATIVE: f64 = 0.01;
/// Largest share of the pixels that may be spikes, which are left out of the largest difference.
const SPIKES: f64 = 2e-4;
/// Least distance of spikes over the distance of all others.
const APART: f64 = 3.0;
/// Share of others below which nothing is a spike: a wire alone in the picture.
const ALONE: f64 = 1e-3;
/// Height on paper of a number beside the bar, with the room around it.
const NUMBER: f64 = 20.0;
/// Distance of lines of the bar's label.
const LINE: f64 = 15.0;
/// Values beyond a scale by less than this share of it are not counted as beyond.
const ROUNDING: f64 = 1e-3;

/// Values to colours.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Scale {
    pub(crate) map: Map,
    /// Value of the map's lower end.
    pub(crate) low: f64,
    /// Value of its upper end.
    pub(crate) high: f64,
    /// How many values lie below and above.
    pub(crate) beyond: [usize; 2],
}

/// True if more than [`NEGATIVE`] of the values lie below zero, by more than rounding of the largest.
fn has_negative(values: &[f64]) -> bool {
    let finite = || values.iter().filter(|value| value.is_finite());
    let most = finite().fold(0.0_f64, |most, value| most.max(value.abs()));
    let below = finite().filter(|value| **value < -ROUNDING * most).count();
    below as f64 > NEGATIVE * finite().count() as f64
}

impl Scale {
    /// The scale of some values (flagged pixels are left out by the caller): all of them, but for
    /// the outermost [`TAIL`] on a side where they would take more than a third as much as all
    /// others, as silhouettes do. With `empty`, the value of the empty beam, only pixels that
    /// differ from it count, so that a small part in a wide field has the whole scale. `sigma`:
    /// 1 sigma of each value. The diverging map is symmetric about zero. A dark field begins at zero, or has the
    /// diverging map where more than [`NEGATIVE`] of its values are negative.
    pub(crate) fn of(map: Map, values: &[f64], empty: Option<f64>, sigma: Option<&[f64]>) -> Self {
        let map = match map {
            Map::Inferno if has_negative(values) => Map::Diverging,
            map => map,
        };
        let mut own = match empty {
            Some(empty) => differing(values, empty, sigma),
            None => values.iter().copied().filter(|value| value.is_finite()).collect(),
        };
        match map {
            Map::Diverging => own.iter_mut().for_each(|value| *value = value.abs()),
            Map::Inferno => own.retain(|value| *value > 0.0),
            Map::Grey | Map::Viridis => {}
        }
        own.sort_by(f64::total_cmp);
        let [low, high] = inner(&own, empty.is_none()).unwrap_or(match (map, empty) {
            (Map::Inferno | Map::Diverging, _) | (_, None) => [0.0, 1.0],
            (_, Some(empty)) => [empty, empty],
        });
        let [low, high] = match map {
            Map::Diverging => [-high, high],
            Map::Inferno => [0.0, high],
            Map::Grey | Map::Viridis => {
                let [least, most] = empty.map_or([low, high], |empty| [empty; 2]);
                [low.min(least), high.max(most)]
            }
        };
        Self::between(map, widened(map, [low, high]), values.iter().copied())
    }

    /// The scale of frames without and with the sample, which is one for both: the range of the
    /// flat and of the pixels that the sample changes.
    pub(crate) fn of_frames(map: Map, flat: &[f64], sample: &[f64]) -> Self {
        let of_flat = Self::of(map, flat, None, None);
        let steps = flat.len().max(1);
        let change: Vec<f64> =
            sample.iter().enumerate().map(|(at, value)| value - flat[at % steps]).collect();
        let least = threshold(&change);
        let changed: Vec<f64> = sample
            .iter()
            .zip(&change)
            .filter(|(_, change)| change.abs() > least)
            .map(|(value, _)| *value)
            .collect();
        let mut scale = of_flat;
        if !changed.is_empty() {
            let of_sample = Self::of(map, &changed, None, None);
            scale.low = scale.low.min(of_sample.low);
            scale.high = scale.high.max(of_sample.high);
        }
        let values = flat.iter().chain(sample).copied();
        Self::between(map, [scale.low, scale.high], values)
    }

    /// A scale between two values, which counts `values` beyond it.
    pub(crate) fn between(
        map: Map,
        [low, high]: [f64; 2],
        values: impl Iterator<Item = f64>,
    ) -> Self {
        let room = ROUNDING * (high - low);
        let mut beyond = [0; 2];
        for value in values.filter(|value| value.is_finite()) {
            beyond[0] += usize::from(value < low - room);
            beyond[1] += usize::from(value > high + room);
        }
        Self { map, low, high, beyond }
    }

    /// Where a value lies on the map, 0..=1 within the scale; white of the diverging map is zero,
    /// whatever the ends.
    fn place(&self, value: f64) -> f64 {
        match self.map {
            Map::Diverging => 0.5 + 0.5 * value / self.low.abs().max(self.high.abs()),
            _ => (value - self.low) / (self.high - self.low),
        }
    }

    pub(crate) fn colour(&self, value: f64) -> Rgb {
        match value.is_finite() {
            true => self.map.colour(self.place(value.clamp(self.low, self.high))),
            false => NO_VALUE,
        }
    }

    /// 256 colours from the lower to the upper end.
    pub(crate) fn colours(&self) -> Vec<Rgb> {
        let at = |i: i32| self.low + (self.high - self.low) * f64::from(i) / 255.0;
        (0..256).map(|i| self.colour(at(i))).collect()
    }

    /// How many values have the colour of an end and lie beyond it, in words; empty where none do.
    pub(crate) fn words_beyond(&self, unit: &str) -> String {
        let [below, above] = self.beyond;
        let end = |value: f64| match unit {
            "" => super::text::short(value),
            unit => format!("{} {unit}", super::text::short(value)),
        };
        let zero = self.map == Map::Inferno && self.low == 0.0;
        let mut parts = Vec::new();
        if below > 0 && zero {
            parts.push(format!("{} below 0, drawn black", pixels(below)));
        } else if below > 0 {
            parts.push(format!("{} below {}", pixels(below), end(self.low)));
        }
        if above > 0 {
            parts.push(format!("{} above {}", pixels(above), end(self.high)));
        }
        parts.join(" · ")
    }

    /// Draws the bar of the scale with its numbers and label to the right. Ends are pointed
    /// where values lie beyond them.
    pub(crate) fn bar(&self, drawing: &mut Drawing, area: Area, label: &str) {
        let mut colours = self.colours();
        colours.reverse();
        let ends = [
            (self.beyond[1], area.top, -0.7 * area.width, colours[0]),
            (self.beyond[0], area.bottom(), 0.7 * area.width, colours[255]),
        ];
        drawing.pixels(area, 1, colours);
        let middle = area.left + area.width / 2.0;
        for (_, y, tip, colour) in ends.into_iter().filter(|(beyond, ..)| *beyond > 0) {
            let triangle = vec![[area.left, y], [middle, y + tip], [area.right(), y]];
            let fill = Some((colour, 1.0));
            drawing.path(triangle, true, Paint { fill, ..Paint::line(INK, 0.8) });
        }
        drawing.area(area, Paint::line(INK, 0.8));
        let mut widest = 0.0_f64;
        let most = numbers::whole::<usize>(area.height / NUMBER).clamp(1, 6);
        // Round steps may give more numbers than wanted.
        let choices = (1..=most).rev().map(|count| ticks(self.low, self.high, count));
        let mut numbers = choices.into_iter().find(|it| it.len() <= most + 1).unwrap_or_default();
        if numbers.len() < 2 {
            // One number gives no range: the first, the middle and the last of a finer step do.
            let finer = ticks(self.low, self.high, 4);
            let last = finer.len().saturating_sub(1);
            let kept = |at: usize| at == 0 || 2 * at == last || at == last;
            numbers = (0..).zip(finer).filter(|(at, _)| kept(*at)).map(|(_, it)| it).collect();
        }
        for (value, text) in numbers {
            let y = area.bottom() - area.height * (value - self.low) / (self.high - self.low);
            drawing.line([area.right(), y], [area.right() + 4.0, y], Paint::line(INK, 0.8));
            widest = widest.max(text_width(&text, SMALL));
            drawing.text([area.right() + 7.0, y + 4.2], text, SMALL, INK, Anchor::Start);
        }
        let x = area.right() + 7.0 + widest + 17.0;
        let lines = wrapped(label, area.height + 24.0, 13.0);
        for (at, line) in lines.into_iter().enumerate() {
            let at = [x + LINE * at as f64, area.top + area.height / 2.0];
            drawing.text_upwards(at, line, 13.0);
        }
    }
}

/// A count of pixels, in words.
pub(crate) fn pixels(count: usize) -> String {
    match count {
        1 => "1 pixel".into(),
        count => format!("{} pixels", beamlet::cli_support::count(count as u64)),
    }
}

/// The values that differ from the empty beam, or all where none does.
fn differing(values: &[f64], empty: f64, sigma: Option<&[f64]>) -> Vec<f64> {
    let off: Vec<f64> = values.iter().map(|value| value - empty).collect();
    let least = threshold(&off);
    let noise = |at: usize| {
        let own = sigma.and_then(|sigma| sigma.get(at)).filter(|sigma| sigma.is_finite());
        own.map_or(0.0, |sigma| NOISE * sigma)
    };
    let found: Vec<f64> = (0..values.len())
        .filter(|at| off[*at].is_finite() && off[*at].abs() > least.max(noise(*at)))
        .map(|at| values[at])
        .collect();
    match found.is_empty() {
        true => values.iter().copied().filter(|value| value.is_finite()).collect(),
        false => found,
    }
}

/// The least difference that counts as one, from all differences.
fn threshold(off: &[f64]) -> f64 {
    let mut off: Vec<f64> = off.iter().map(|off| off.abs()).filter(|off| off.is_finite()).collect();
    off.sort_by(|a, b| b.total_cmp(a));
    let Some(mut most) = off.first().copied() else { return 0.0 };
    let few = numbers::whole::<usize>((SPIKES * off.len() as f64).ceil());
    if let Some(others) = off.get(few)
        && *others * APART < most
        && *others > ALONE * most
    {
        most = *others;
    }
    LEAST * most
}

/// The range of sorted values without the tails that would take too much of it.
fn inner(sorted: &[f64], may_be_sparse: bool) -> Option<[f64; 2]> {
    let (least, most) = (*sorted.first()?, *sorted.last()?);
    let share =
        |share: f64| sorted[numbers::whole::<usize>(((sorted.len() - 1) as f64 * share).round())];
    let [low, high] = [share(TAIL), share(1.0 - TAIL)];
    if may_be_sparse && high - low < SPARSE * (most - least) {
        return Some([least, most]);
    }
    let third = (high - low) / 3.0;
    Some([
        if low - least > third { low } else { least },
        if most - high > third { high } else { most },
    ])
}

/// A flat picture still needs a scale, and rounding is no structure.
fn widened(map: Map, [low, high]: [f64; 2]) -> [f64; 2] {
    if high - low >= 1e-6 * high.abs().max(low.abs()).max(1e-30) {
        return [low, high];
    }
    let middle = f64::midpoint(low, high);
    let half = match middle.abs() {
        size if size > 0.0 => 0.05 * size,
        _ => 1.0,
    };
    match map {
        Map::Inferno => [0.0, 1.0],
        _ => [middle - half, middle + half],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_signed_scale_is_symmetric_and_white_at_zero() {
        let scale = Scale::of(Map::Diverging, &[-1.0, 0.5, 3.0], Some(0.0), None);
        assert!((scale.low + 3.0).abs() < 1e-12 && (scale.high - 3.0).abs() < 1e-12);
        let [r, g, b] = scale.colour(0.0);
        assert!(r > 235 && g > 235 && b > 235);
        let (negative, positive) = (scale.colour(-3.0), scale.colour(3.0));
        assert!(negative[2] > negative[0] && positive[0] > positive[2], "blue below, red above");
        // A range of the user's need not be symmetric; zero stays white.
        let range = Scale::between(Map::Diverging, [-1.0, 10.0], std::iter::empty());
        assert_eq!(range.colour(0.0), scale.colour(0.0));
        assert_eq!(range.colour(10.0), scale.colour(3.0));
    }

    #[test]
    fn outliers_do_not_take_the_range_and_are_counted() {
        let values: Vec<f64> = (0..10_000).map(|i| f64::from(i % 100)).chain([900.0]).collect();
        let scale = Scale::of(Map::Viridis, &values, None, None);
        assert!(scale.high < 100.0 && scale.beyond == [0, 101], "{scale:?}");
        // A thin wire alone in the picture is no outlier.
        let wire: Vec<f64> = (0..10_000).map(|i| if i < 50 { 3e-6 } else { 1e-10 }).collect();
        let scale = Scale::of(Map::Diverging, &wire, Some(0.0), None);
        assert!((scale.high - 3e-6).abs() < 1e-12 && scale.beyond == [0; 2], "{scale:?}");
        assert!(Scale::of(Map::Viridis, &[2.0; 5], None, None).low < 2.0);
        assert_eq!(scale.colour(f64::NAN), NO_VALUE);
    }

    #[test]
    fn a_small_part_has_the_whole_scale_and_a_spike_none_of_it() {
        // 1 % of the field is the part, up to 6.3; one pixel without a flag has 770.
        let mut values = vec![1e-4; 10_000];
        (0..100).for_each(|i| values[i] = 0.063 * (i + 1) as f64);
        values[5000] = 770.0;
        let scale = Scale::of(Map::Diverging, &values, Some(0.0), None);
        assert!(scale.high > 6.0 && scale.high <= 6.3, "{scale:?}");
        assert_eq!(scale.beyond[1], values.iter().filter(|v| **v > 1.002 * scale.high).count());
        // Noise of the empty beam is not the part.
        let noise = |i: usize| if i.is_multiple_of(2) { 0.5 } else { -0.5 };
        let noisy: Vec<f64> = (0..10_000).map(|i| values[i].min(6.3) + noise(i)).collect();
        let scale = Scale::of(Map::Diverging, &noisy, Some(0.0), Some(&[0.5; 10_000]));
        assert!(scale.high > 6.0 && scale.high < 6.9, "{scale:?}");
    }

    #[test]
    fn a_dark_field_is_black_at_zero_unless_many_values_are_negative() {
        let values: Vec<f64> = (-5..=1000).map(f64::from).collect();
        let scale = Scale::of(Map::Inferno, &values, Some(0.0), None);
        assert_eq!((scale.low, scale.beyond[0]), (0.0, 4), "{scale:?}");
        let black = scale.colour(0.0);
        assert!(black.iter().all(|part| *part < 8), "{black:?}");
        assert_eq!(scale.colour(-5.0), black);
        assert_eq!(scale.words_beyond("µrad²"), "4 pixels below 0, drawn black");
        let values: Vec<f64> = (-20..=100).map(f64::from).collect();
        let scale = Scale::of(Map::Inferno, &values, Some(0.0), None);
        assert!(scale.map == Map::Diverging && scale.low + scale.high == 0.0, "{scale:?}");
        assert_eq!(scale.beyond[0], 0);
    }

    #[test]
    fn frames_take_the_range_that_the_sample_reaches() {
        let flat: Vec<f64> = (0..1000).map(|i| 0.165 + 1e-6 * f64::from(i % 7)).collect();
        let mut sample = flat.clone();
        (0..10).for_each(|i| sample[i] = 0.02 * (i + 1) as f64);
        let scale = Scale::of_frames(Map::Viridis, &flat, &sample);
        assert!(scale.low <= 0.021 && scale.high >= 0.19, "{scale:?}");
    }
}
