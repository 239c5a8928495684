//! Colours of values: perceptually uniform maps, a diverging one for signed values, and scales
//! with their bar.

use super::axes::ticks;
use super::drawing::{Anchor, Area, Drawing, INK, Paint};
use crate::numbers;

/// Red, green, blue (sRGB).
pub(crate) type Rgb = [u8; 3];

/// What is not a number.
pub(crate) const NO_VALUE: Rgb = [190, 70, 210];
/// Colours of lines and materials that differ clearly, also for the colour-blind
/// (Okabe and Ito).
pub(crate) const SET: [Rgb; 7] = [
    [0, 114, 178],
    [213, 94, 0],
    [0, 158, 115],
    [204, 121, 167],
    [230, 159, 0],
    [86, 180, 233],
    [150, 140, 40],
];
/// Where all but the outermost values take less than this share of the range, the outermost are
/// what the picture shows, and nothing is cut.
const SPARSE: f64 = 0.05;
/// Share of the values on either side that may lie beyond a scale.
const TAIL: f64 = 0.02;
/// Type size of numbers at bars and axes.
pub(crate) const SMALL: f64 = 12.0;

/// A colour map over 0..=1.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Map {
    /// Lightness (CIE L*) in equal steps.
    Grey,
    /// matplotlib's viridis.
    Viridis,
    /// matplotlib's inferno.
    Inferno,
    /// `ColorBrewer`'s blue to red through white, for signed values: white is zero.
    Diverging,
}

impl Map {
    pub(crate) fn colour(self, at: f64) -> Rgb {
        let at = at.clamp(0.0, 1.0);
        let of = |colour: colorous::Color| [colour.r, colour.g, colour.b];
        match self {
            Self::Grey => {
                let lightness = 100.0 * at;
                let linear = match lightness > 8.0 {
                    true => ((lightness + 16.0) / 116.0).powi(3),
                    false => lightness / 903.3,
                };
                let encoded = match linear > 0.003_130_8 {
                    true => 1.055 * linear.powf(1.0 / 2.4) - 0.055,
                    false => 12.92 * linear,
                };
                [numbers::whole::<u8>((encoded * 255.0).round()); 3]
            }
            Self::Viridis => of(colorous::VIRIDIS.eval_continuous(at)),
            Self::Inferno => of(colorous::INFERNO.eval_continuous(at)),
            Self::Diverging => of(colorous::RED_BLUE.eval_continuous(1.0 - at)),
        }
    }
}

/// Values to colours.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Scale {
    pub(crate) map: Map,
    /// Value of the map's lower end.
    pub(crate) low: f64,
    /// Value of its upper end.
    pub(crate) high: f64,
    /// Whether some values lie below or above.
    pub(crate) beyond: [bool; 2],
}

impl Scale {
    /// The scale of some values: all of them, but for the outermost [`TAIL`] on a side where
    /// they would take more than a third as much as all others, as silhouettes do. Symmetric
    /// about zero for the diverging map.
    /// A dark field is positive but for the bias of a fit; where its negative values matter it
    /// takes the diverging map, so that zero is seen.
    pub(crate) fn of(map: Map, values: impl Iterator<Item = f64>) -> Self {
        let mut values: Vec<f64> = values.filter(|value| value.is_finite()).collect();
        let map = match map {
            Map::Inferno if is_signed(&mut values) => Map::Diverging,
            map => map,
        };
        if map == Map::Diverging {
            values.iter_mut().for_each(|value| *value = value.abs());
        }
        values.sort_by(f64::total_cmp);
        let Some((&least, &most)) = values.first().zip(values.last()) else {
            return Self { map, low: 0.0, high: 1.0, beyond: [false; 2] };
        };
        let share = |share: f64| {
            values[numbers::whole::<usize>(((values.len() - 1) as f64 * share).round())]
        };
        let (mut low, mut high) = (least, most);
        if map == Map::Diverging {
            let inner = share(1.0 - TAIL);
            if most > 4.0 / 3.0 * inner && inner > SPARSE * most {
                high = inner;
            }
            low = -high;
        } else {
            let inner = [share(TAIL), share(1.0 - TAIL)];
            let third = (inner[1] - inner[0]) / 3.0;
            let is_sparse = inner[1] - inner[0] < SPARSE * (most - least);
            if inner[0] - least > third && !is_sparse {
                low = inner[0];
            }
            if most - inner[1] > third && !is_sparse {
                high = inner[1];
            }
        }
        // A flat picture still needs a scale, and rounding is no structure.
        let least_span = 1e-6 * high.abs().max(low.abs()).max(1e-30);
        if high - low < least_span {
            let middle = f64::midpoint(low, high);
            let half = match middle.abs() {
                size if size > 0.0 => 0.05 * size,
                _ => 1.0,
            };
            (low, high) = (middle - half, middle + half);
        }
        let beyond = match map {
            Map::Diverging => [most > high; 2],
            _ => [least < low, most > high],
        };
        Self { map, low, high, beyond }
    }

    pub(crate) fn colour(&self, value: f64) -> Rgb {
        match value.is_finite() {
            true => self.map.colour((value - self.low) / (self.high - self.low)),
            false => NO_VALUE,
        }
    }

    /// Draws the bar of the scale with its numbers and label to the right. Ends are pointed
    /// where values lie beyond them.
    pub(crate) fn bar(&self, drawing: &mut Drawing, area: Area, label: &str) {
        let steps = 256;
        let colours = (0..steps).rev().map(|i| self.map.colour(f64::from(i) / 255.0)).collect();
        drawing.pixels(area, 1, colours);
        let middle = area.left + area.width / 2.0;
        let ends = [
            (self.beyond[1], area.top, -0.7 * area.width, 1.0),
            (self.beyond[0], area.bottom(), 0.7 * area.width, 0.0),
        ];
        for (_, y, tip, at) in ends.into_iter().filter(|(beyond, ..)| *beyond) {
            let triangle = vec![[area.left, y], [middle, y + tip], [area.right(), y]];
            let fill = Some((self.map.colour(at), 1.0));
            drawing.path(triangle, true, Paint { fill, ..Paint::line(INK, 0.8) });
        }
        drawing.area(area, Paint::line(INK, 0.8));
        let mut widest = 0.0_f64;
        for (value, text) in ticks(self.low, self.high, 6) {
            let y = area.bottom() - area.height * (value - self.low) / (self.high - self.low);
            drawing.line([area.right(), y], [area.right() + 4.0, y], Paint::line(INK, 0.8));
            widest = widest.max(super::drawing::text_width(&text, SMALL));
            drawing.text([area.right() + 7.0, y + 4.2], text, SMALL, INK, Anchor::Start);
        }
        let x = area.right() + 7.0 + widest + 17.0;
        drawing.text_upwards([x, area.top + area.height / 2.0], label, 13.0);
    }
}

/// Whether negative values are more than a quarter of the positive ones.
fn is_signed(values: &mut [f64]) -> bool {
    values.sort_by(f64::total_cmp);
    let share = |share: f64| values.get(numbers::whole::<usize>(values.len() as f64 * share));
    match (share(TAIL), share(1.0 - TAIL)) {
        (Some(low), Some(high)) => *low < -0.25 * high.abs(),
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_signed_scale_is_symmetric_and_white_at_zero() {
        let scale = Scale::of(Map::Diverging, [-1.0, 0.5, 3.0].into_iter());
        assert!((scale.low + 3.0).abs() < 1e-12 && (scale.high - 3.0).abs() < 1e-12);
        let [r, g, b] = scale.colour(0.0);
        assert!(r > 235 && g > 235 && b > 235);
        let (negative, positive) = (scale.colour(-3.0), scale.colour(3.0));
        assert!(negative[2] > negative[0] && positive[0] > positive[2], "blue below, red above");
    }

    #[test]
    fn outliers_do_not_take_the_range_and_the_bar_tells() {
        let values = (0..10_000).map(|i| f64::from(i % 100)).chain([900.0]);
        let scale = Scale::of(Map::Viridis, values);
        assert!(scale.high < 100.0 && scale.beyond == [false, true], "{scale:?}");
        // A thin wire alone in the picture is no outlier.
        let wire = (0..10_000).map(|i| if i < 50 { 3e-6 } else { 1e-9 });
        let scale = Scale::of(Map::Diverging, wire);
        assert!(scale.high > 2e-6 && scale.beyond == [false; 2], "{scale:?}");
        assert!(Scale::of(Map::Viridis, [2.0; 5].into_iter()).low < 2.0);
        assert_eq!(scale.colour(f64::NAN), NO_VALUE);
    }

    #[test]
    fn grey_has_equal_steps_of_lightness() {
        assert_eq!(Map::Grey.colour(0.0), [0; 3]);
        assert_eq!(Map::Grey.colour(1.0), [255; 3]);
        // L* = 50 is sRGB 119 (119.0 by the CIE and sRGB definitions).
        assert_eq!(Map::Grey.colour(0.5), [119; 3]);
    }
}
