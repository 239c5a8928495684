//! Colours: perceptually uniform maps of values, a diverging one for signed values, and a set for
//! lines and materials.

use crate::numbers;

/// Red, green, blue (sRGB).
pub(crate) type Rgb = [u8; 3];

/// Pixels without a number.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn grey_has_equal_steps_of_lightness() {
        assert_eq!(Map::Grey.colour(0.0), [0; 3]);
        assert_eq!(Map::Grey.colour(1.0), [255; 3]);
        // L* = 50 is sRGB 119 (119.0 by the CIE and sRGB definitions).
        assert_eq!(Map::Grey.colour(0.5), [119; 3]);
    }
}
