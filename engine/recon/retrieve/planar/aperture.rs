//! Apertures of a mask as they are projected, and the strips that their light is fitted with.

use super::super::profile::Profile;
use super::super::strips::Strip;
use beamlet_core::units::Dimension::Length;
use beamlet_core::{Error, Result};

/// Strips of a round aperture: their second moments are exact, the light of a pixel of a tenth of the
/// diameter is to 2e-3 of the peak.
const STRIPS: usize = 12;

/// An aperture, m as it is projected on the detector, or on the detector mask.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum Aperture {
    /// Width and height.
    Rectangle([f64; 2]),
    /// Diameter.
    Round(f64),
}

impl Aperture {
    /// Reads `30 um, 20 um` (width and height), or `round 30 um`. `argument`: its name in errors.
    ///
    /// # Errors
    /// [`Error::Argument`] for other words and for lengths that are not above 0.
    pub fn parse(argument: &str, text: &str) -> Result<Self> {
        let allowed =
            "width and height as \"30 um, 20 um\", or \"round 30 um\", as they are on the detector";
        let length = |word: &str| match Length.parse(word.trim()) {
            Ok(length) if length > 0.0 && length.is_finite() => Ok(length),
            Ok(_) => Err(Error::argument(argument, word.trim(), allowed)),
            Err(error) => Err(Error::argument(argument, error.found, allowed)),
        };
        if let Some(diameter) = text.trim().strip_prefix("round ") {
            return Ok(Self::Round(length(diameter)?));
        }
        match text.split(',').collect::<Vec<_>>()[..] {
            [width, height] => Ok(Self::Rectangle([length(width)?, length(height)?])),
            _ => Err(Error::argument(argument, format!("{text:?}"), allowed)),
        }
    }

    /// Strips of its light over pixels of this size, m.
    pub(super) fn strips(self, pixel: [f64; 2]) -> Vec<Strip> {
        match self {
            Self::Rectangle(size) => {
                let along = [0, 1].map(|k| Profile { boxes: [size[k], pixel[k]], shift: 0.0 });
                vec![Strip { share: 1.0, along }]
            }
            Self::Round(diameter) => round(diameter, pixel),
        }
    }
}

/// Strips of a round aperture. Each has the light of its part of the disk, its centroid and its second moments.
fn round(diameter: f64, pixel: [f64; 2]) -> Vec<Strip> {
    let radius = diameter / 2.0;
    let height = diameter / STRIPS as f64;
    let integrals = |k: usize| integrals((k as f64 * height / radius - 1.0).clamp(-1.0, 1.0));
    let [whole, ..] = integrals(STRIPS);
    let [none, ..] = integrals(0);
    let strip = |k: usize| {
        let (low, high) = (integrals(k), integrals(k + 1));
        let [light, z, zz, xx]: [f64; 4] = std::array::from_fn(|n| high[n] - low[n]);
        let middle = z / light;
        let width = |second: f64| (12.0 * second).sqrt() * radius;
        let x = Profile { boxes: [width(xx / light), pixel[0]], shift: 0.0 };
        let deviation = zz / light - middle * middle;
        let z = Profile { boxes: [width(deviation), pixel[1]], shift: middle * radius };
        Strip { share: light / (whole - none), along: [x, z] }
    };
    (0..STRIPS).map(strip).collect()
}

/// Integrals over a unit disk below `z`: of 1, z, z^2 and x^2.
fn integrals(z: f64) -> [f64; 4] {
    let half = (1.0 - z * z).max(0.0).sqrt();
    let angle = z.asin();
    [
        angle + z * half,
        -2.0 / 3.0 * half.powi(3),
        (angle - z * half * (1.0 - 2.0 * z * z)) / 4.0,
        (z * half * (5.0 - 2.0 * z * z) + 3.0 * angle) / 12.0,
    ]
}

#[cfg(test)]
mod tests {
    use super::super::super::strips::own_variances;
    use super::*;

    /// A disk has the second moment d^2/16 along both axes.
    #[test]
    fn strips_of_a_disk_have_its_light_and_moments() {
        let strips = Aperture::Round(16.0).strips([0.0; 2]);
        let light: f64 = strips.iter().map(|strip| strip.share).sum();
        let [x, z] = own_variances(&strips);
        assert!((light - 1.0).abs() < 1e-12 && (x / 16.0 - 1.0).abs() < 1e-9, "{light} {x}");
        assert!((z / 16.0 - 1.0).abs() < 1e-9, "{z}");
    }

    #[test]
    fn apertures_are_read_with_units() {
        let parse = |text| Aperture::parse("aperture", text);
        assert_eq!(parse("30 um, 20 um").unwrap(), Aperture::Rectangle([30e-6, 20e-6]));
        assert_eq!(parse("round 15 um").unwrap(), Aperture::Round(15e-6));
        for wrong in ["30 um", "round", "30, 20", "30 um, 0 um", "-3 um, 2 um", ""] {
            assert!(parse(wrong).is_err(), "{wrong}");
        }
    }
}
