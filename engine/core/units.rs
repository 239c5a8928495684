//! Quantities with units: "150 um", "30 keV", "0.93 g/cm3", "12 deg".
//!
//! Every unit but the degree, minute and hour is a power of ten of the base unit, so a quantity is read by
//! moving the decimal point in its text: "150 um" is the double nearest to 150e-6, with one
//! rounding only, and what [`Dimension::format`] writes reads back to the same bits.

mod decimal;
mod memory;

pub use memory::memory_size;

use decimal::{decimal, shifted, split_number};
use std::borrow::Cow;
use std::fmt;

/// A text with hyphens in place of minus signs U+2212, which documents have.
pub fn plain_minus(text: &str) -> Cow<'_, str> {
    match text.contains('\u{2212}') {
        true => text.replace('\u{2212}', "-").into(),
        false => text.into(),
    }
}

/// A number as text, with either minus sign; `None` for other texts.
pub fn number(text: &str) -> Option<f64> {
    plain_minus(text.trim()).parse().ok()
}

/// Dimension of a quantity, with its units and the base unit of the result.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Dimension {
    /// Length in metres.
    Length,
    /// Photon energy in keV.
    Energy,
    /// Mass density in g/cm3.
    Density,
    /// Angle in radians.
    Angle,
    /// Linear attenuation coefficient in 1/m.
    Attenuation,
    /// Tube voltage in kV.
    Voltage,
    /// Tube current in mA.
    Current,
    /// Time in seconds.
    Time,
    /// Absorbed dose and kerma in gray.
    Dose,
    /// Variance of an angle per length in rad2/m.
    Scattering,
}

/// A text that is no quantity of the dimension.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct QuantityError {
    /// The text found.
    pub found: String,
    /// The allowed form, with the list of units.
    pub allowed: String,
}

impl fmt::Display for QuantityError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "found {}; allowed: {}", self.found, self.allowed)
    }
}

impl std::error::Error for QuantityError {}

#[derive(Clone, Copy)]
enum UnitScale {
    /// Power of ten of the base unit.
    Ten(i64),
    /// Multiple of the base unit.
    Times(f64),
    Degree,
}

use UnitScale::{Degree, Ten, Times};

/// Units in ASCII; [`variants`] has their other spellings.
const LENGTHS: &[(&str, UnitScale)] = &[
    ("m", Ten(0)),
    ("cm", Ten(-2)),
    ("mm", Ten(-3)),
    ("um", Ten(-6)),
    ("nm", Ten(-9)),
    ("pm", Ten(-12)),
];
const ENERGIES: &[(&str, UnitScale)] = &[("eV", Ten(-3)), ("keV", Ten(0)), ("MeV", Ten(3))];
const DENSITIES: &[(&str, UnitScale)] = &[("g/cm3", Ten(0)), ("g/cc", Ten(0)), ("kg/m3", Ten(-3))];
const ANGLES: &[(&str, UnitScale)] = &[
    ("deg", Degree),
    ("\u{b0}", Degree),
    ("degree", Degree),
    ("degrees", Degree),
    ("rad", Ten(0)),
    ("mrad", Ten(-3)),
    ("urad", Ten(-6)),
    ("nrad", Ten(-9)),
];
const VOLTAGES: &[(&str, UnitScale)] =
    &[("V", Ten(-3)), ("kV", Ten(0)), ("kVp", Ten(0)), ("MV", Ten(3))];
const CURRENTS: &[(&str, UnitScale)] = &[("A", Ten(3)), ("mA", Ten(0)), ("uA", Ten(-3))];
const TIMES: &[(&str, UnitScale)] =
    &[("s", Ten(0)), ("ms", Ten(-3)), ("us", Ten(-6)), ("min", Times(60.0)), ("h", Times(3600.0))];
const DOSES: &[(&str, UnitScale)] = &[("Gy", Ten(0)), ("mGy", Ten(-3)), ("uGy", Ten(-6))];
const SCATTERINGS: &[(&str, UnitScale)] = &[
    ("rad^2/m", Ten(0)),
    ("rad^2/cm", Ten(2)),
    ("rad^2/mm", Ten(3)),
    ("mrad^2/m", Ten(-6)),
    ("mrad^2/cm", Ten(-4)),
    ("mrad^2/mm", Ten(-3)),
    ("urad^2/m", Ten(-12)),
    ("urad^2/cm", Ten(-10)),
    ("urad^2/mm", Ten(-9)),
];

/// All spellings of a unit: powers as `^2`, `2` and `\u{b2}`; micro as u, as the micro sign and as the Greek letter.
fn variants(unit: &'static str) -> impl Iterator<Item = String> {
    let powers: &[[&str; 2]] = match unit {
        _ if unit.contains("^2") => &[["^2", "^2"], ["^2", "2"], ["^2", "\u{b2}"]],
        _ if unit.ends_with('3') => &[["3", "3"], ["3", "^3"], ["3", "\u{b3}"]],
        _ => &[["", ""]],
    };
    let micro: &[&str] = match unit.strip_prefix('u') {
        Some(_) => &["u", "\u{b5}", "\u{3bc}"],
        None => &[""],
    };
    let rest = unit.strip_prefix('u').unwrap_or(unit);
    micro.iter().flat_map(move |micro| {
        powers.iter().map(move |[plain, power]| format!("{micro}{}", rest.replace(plain, power)))
    })
}

/// Names of the inch, a unit of mesh files: lengths in scenes are metric.
const INCHES: [&str; 2] = ["inch", "inches"];
/// Length of an inch, m.
const INCH: f64 = 0.0254;

/// Spellings that are accepted and not listed: each looks like one that is.
const UNLISTED: &[&str] = &["degree", "degrees"];
const ATTENUATIONS: &[(&str, UnitScale)] = &[
    ("1/m", Ten(0)),
    ("/m", Ten(0)),
    ("1/cm", Ten(2)),
    ("/cm", Ten(2)),
    ("1/mm", Ten(3)),
    ("/mm", Ten(3)),
];

impl Dimension {
    const fn table(self) -> &'static [(&'static str, UnitScale)] {
        match self {
            Self::Length => LENGTHS,
            Self::Energy => ENERGIES,
            Self::Density => DENSITIES,
            Self::Angle => ANGLES,
            Self::Attenuation => ATTENUATIONS,
            Self::Voltage => VOLTAGES,
            Self::Current => CURRENTS,
            Self::Time => TIMES,
            Self::Dose => DOSES,
            Self::Scattering => SCATTERINGS,
        }
    }

    /// Spellings of its units.
    pub fn units(self) -> impl Iterator<Item = String> {
        self.table().iter().flat_map(|unit| variants(unit.0))
    }

    /// The allowed form, in words, with an example and the list of units.
    pub fn allowed(self) -> String {
        let (noun, example) = match self {
            Self::Length => ("a length", "150 um"),
            Self::Energy => ("an energy", "30 keV"),
            Self::Density => ("a density", "0.93 g/cm3"),
            Self::Angle => ("an angle", "12 deg"),
            Self::Attenuation => ("an attenuation coefficient", "0.25 /cm"),
            Self::Voltage => ("a voltage", "60 kV"),
            Self::Current => ("a current", "10 mA"),
            Self::Time => ("a time", "2 s"),
            Self::Dose => ("a dose", "5 mGy"),
            Self::Scattering => ("a variance of angles per length", "2e-9 rad^2/m"),
        };
        let mut units: Vec<_> = self.table().iter().map(|unit| unit.0).collect();
        units.retain(|unit| !UNLISTED.contains(unit));
        format!("{noun} with its unit, such as \"{example}\"; units: {}", units.join(", "))
    }

    fn error<T>(self, found: impl Into<String>) -> Result<T, QuantityError> {
        Err(QuantityError { found: found.into(), allowed: self.allowed() })
    }

    fn scale(self, unit: &str) -> Option<UnitScale> {
        let is_meant = |name: &'static str| name == unit || variants(name).any(|it| it == unit);
        self.table().iter().find(|entry| is_meant(entry.0)).map(|entry| entry.1)
    }

    /// Reads a quantity into the base unit of its dimension. The result is finite.
    ///
    /// # Errors
    ///
    /// [`QuantityError`] if there is no number, no unit, an unknown unit, or an overflow.
    pub fn parse(self, text: &str) -> Result<f64, QuantityError> {
        let text = &*plain_minus(text.trim());
        let Some((mantissa, exponent, unit)) = split_number(text) else {
            return self.error(format!("{text:?}, which does not start with a number"));
        };
        if unit.is_empty() {
            return self.error(format!("{text:?}, a number without a unit"));
        }
        if let Some(decimals) = unit.strip_prefix(',')
            && decimals.starts_with(|c: char| c.is_ascii_digit())
        {
            let pointed = format!("{mantissa}.{decimals}");
            let allowed = format!("a decimal point, as in {pointed:?}; {}", self.allowed());
            return Err(QuantityError { found: format!("{text:?}, with a comma"), allowed });
        }
        let Some(scale) = self.scale(unit) else {
            return self.error(format!("the unit {unit:?} in {text:?}{}", self.suggestion(unit)));
        };
        let value = match scale {
            Ten(power) => shifted(mantissa, exponent.saturating_add(power)),
            Times(factor) => shifted(mantissa, exponent).map(|value| value * factor),
            Degree => shifted(mantissa, exponent).map(f64::to_radians),
        };
        match value {
            Some(value) if value.is_finite() => Ok(value),
            _ => self.error(format!("{text:?}, which is too large")),
        }
    }

    /// The size of a unit given by its bare name ("mm"; of lengths also "inch") or as a quantity
    /// ("25.4 mm").
    ///
    /// # Errors
    ///
    /// [`QuantityError`] if it is neither.
    pub fn parse_unit(self, text: &str) -> Result<f64, QuantityError> {
        match self.scale(text.trim()) {
            Some(_) => self.parse(&format!("1 {text}")),
            None if text.trim().starts_with(|c: char| c.is_ascii_digit() || c == '.') => {
                self.parse(text)
            }
            None if self == Self::Length && INCHES.contains(&text.trim()) => Ok(INCH),
            None => self.error(format!("the unit {text:?}{}", self.suggestion(text))),
        }
    }

    fn suggestion(self, unit: &str) -> String {
        let same = self.table().iter().find(|entry| entry.0.eq_ignore_ascii_case(unit));
        same.map_or_else(String::new, |entry| format!(" (did you mean {:?}?)", entry.0))
    }

    /// Writes a value as [`Dimension::format`] does, rounded to 12 significant digits: for messages,
    /// where a computed 99.99999999999999 um is 100 um. Degrees where they have nine decimals at
    /// most.
    pub fn rounded(self, value: f64) -> String {
        if self == Self::Angle {
            let degrees = (value.to_degrees() * 1e9).round() / 1e9;
            if (degrees.to_radians() - value).abs() <= 1e-12 * value.abs() {
                return format!("{} deg", decimal(degrees, 0));
            }
        }
        // Values that are not finite read back as they are.
        self.format(format!("{value:.11e}").parse().unwrap_or(value))
    }

    /// Writes a value in the base unit of its dimension so that it reads back to the same bits. Lengths get the largest of m, mm, um, nm that leaves at least 1.
    pub fn format(self, value: f64) -> String {
        let (power, unit) = match self {
            Self::Length if value.abs() >= 1.0 || value.abs() <= 0.0 => (0, "m"),
            Self::Length if value.abs() >= 1e-3 => (-3, "mm"),
            Self::Length if value.abs() >= 1e-6 => (-6, "um"),
            Self::Length => (-9, "nm"),
            Self::Energy => (0, "keV"),
            Self::Density => (0, "g/cm3"),
            Self::Attenuation => (0, "1/m"),
            Self::Voltage => (0, "kV"),
            Self::Current => (0, "mA"),
            Self::Time => (0, "s"),
            Self::Dose if value.abs() >= 1.0 => (0, "Gy"),
            Self::Dose => (-3, "mGy"),
            Self::Scattering => (0, "rad^2/m"),
            Self::Angle => {
                let degrees = (value.to_degrees() * 1e9).round() / 1e9;
                if degrees.to_radians().to_bits() == value.to_bits() {
                    return format!("{} deg", decimal(degrees, 0));
                }
                (0, "rad")
            }
        };
        format!("{} {unit}", decimal(value, power))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn length(text: &str) -> f64 {
        Dimension::Length.parse(text).unwrap()
    }

    #[test]
    fn every_unit_reads_to_the_double_nearest_to_its_text() {
        let cases = [
            (Dimension::Length, "1.21 m", 1.21),
            (Dimension::Length, "15 cm", 0.15),
            (Dimension::Length, "150um", 150e-6),
            (Dimension::Length, "150 \u{b5}m", 150e-6),
            (Dimension::Length, "150 \u{3bc}m", 150e-6),
            (Dimension::Length, "-.5e1 nm", -5e-9),
            (Dimension::Length, "7 pm", 7e-12),
            (Dimension::Length, "\u{2212}10 um", -10e-6),
            (Dimension::Length, "\u{2212}1e\u{2212}2 m", -0.01),
            (Dimension::Energy, "1eV", 1e-3),
            (Dimension::Energy, "5e3eV", 5.0),
            (Dimension::Energy, "80.725 keV", 80.725),
            (Dimension::Energy, "0.1 MeV", 100.0),
            (Dimension::Density, "0.93 g/cm3", 0.93),
            (Dimension::Density, "930 kg/m3", 0.93),
            (Dimension::Angle, "180 deg", std::f64::consts::PI),
            (Dimension::Angle, "3 urad", 3e-6),
            (Dimension::Attenuation, "0.25 /cm", 25.0),
            (Dimension::Attenuation, "0.25 1/cm", 25.0),
            (Dimension::Attenuation, "2 /mm", 2000.0),
            (Dimension::Voltage, "60 kV", 60.0),
            (Dimension::Voltage, "25000 V", 25.0),
            (Dimension::Current, "250 uA", 0.25),
            (Dimension::Time, "1.5 min", 90.0),
            (Dimension::Time, "20 ms", 0.02),
            (Dimension::Dose, "5 mGy", 0.005),
            (Dimension::Scattering, "2e-9 rad^2/m", 2e-9),
            (Dimension::Scattering, "2.5 urad^2/mm", 2.5e-9),
            (Dimension::Scattering, "40 urad^2/cm", 40e-10),
            (Dimension::Scattering, "10 urad\u{b2}/mm", 1e-8),
            (Dimension::Scattering, "10 \u{b5}rad\u{b2}/mm", 1e-8),
            (Dimension::Scattering, "10 \u{3bc}rad^2/mm", 1e-8),
            (Dimension::Scattering, "10 urad2/mm", 1e-8),
            (Dimension::Scattering, "1e-2 mrad2/m", 1e-8),
            (Dimension::Time, "20 \u{b5}s", 20e-6),
            (Dimension::Current, "250 \u{3bc}A", 0.25),
            (Dimension::Density, "930 kg/m\u{b3}", 0.93),
            (Dimension::Density, "0.93 g/cm^3", 0.93),
        ];
        for (dimension, text, expected) in cases {
            assert_eq!(dimension.parse(text).unwrap().to_bits(), f64::to_bits(expected), "{text}");
        }
    }

    #[test]
    fn no_text_gives_an_infinite_or_undefined_value() {
        for text in ["inf m", "nan m", "NaN", "1e999 m", "1e99999999999999999999 m", "", "-", "."] {
            assert!(Dimension::Length.parse(text).is_err(), "{text}");
        }
    }

    #[test]
    fn mesh_units_are_names_or_quantities() {
        let unit = |text| Dimension::Length.parse_unit(text);
        assert_eq!(unit("mm").unwrap().to_bits(), 1e-3_f64.to_bits());
        assert_eq!(unit("25.4 mm").unwrap().to_bits(), 25.4e-3_f64.to_bits());
        for inch in ["inch", "inches", "25.4 mm", "2.54cm"] {
            assert_eq!(unit(inch).unwrap().to_bits(), 0.0254_f64.to_bits(), "{inch}");
        }
        assert!(unit("foot").unwrap_err().found.contains("foot"));
        assert!(unit("1").unwrap_err().found.contains("without a unit"));
    }

    #[test]
    fn formatted_lengths_are_readable() {
        let texts = [150e-6, 1.21, 0.0, 4e-3, 20.5e-6, -25e-6, 1e-9, 3e-11, 1200.0, 1e30];
        let written = texts.map(|value| Dimension::Length.format(value));
        let expected = [
            "150 um", "1.21 m", "0 m", "4 mm", "20.5 um", "-25 um", "1 nm", "0.03 nm", "1200 m",
            "1e30 m",
        ];
        assert_eq!(written, expected);
        assert_eq!(Dimension::Angle.format(30_f64.to_radians()), "30 deg");
        assert_eq!(length("0.1 mm").to_bits(), 1e-4_f64.to_bits());
    }

    #[test]
    fn messages_round_what_was_computed() {
        let lengths =
            [1.5e-4 / 1.5, 0.1 + 0.2, 99.99999999999999e-6, 100.000000001e-6, 1.0 - 1e-14];
        let written = lengths.map(|value| Dimension::Length.rounded(value));
        assert_eq!(written, ["100 um", "300 mm", "100 um", "100.000000001 um", "1 m"]);
        let angles = [0.1_f64.to_radians() * 300.0, 1e-7, 0.0];
        let written = angles.map(|value| Dimension::Angle.rounded(value));
        assert_eq!(written, ["30 deg", "1e-7 rad", "0 deg"]);
        assert_eq!(Dimension::Energy.rounded(f64::INFINITY), "inf keV");
    }

    proptest! {
        #[test]
        fn every_finite_value_reads_back_to_the_same_bits(value in proptest::num::f64::NORMAL) {
            for dimension in [
                Dimension::Length, Dimension::Energy, Dimension::Density, Dimension::Angle,
                Dimension::Attenuation, Dimension::Voltage, Dimension::Current, Dimension::Time,
                Dimension::Dose, Dimension::Scattering,
            ] {
                let text = dimension.format(value);
                prop_assert_eq!(dimension.parse(&text).unwrap().to_bits(), value.to_bits());
            }
        }

        #[test]
        fn random_text_never_panics(text in "\\PC*") {
            let _ = Dimension::Length.parse(&text);
            let _ = Dimension::Angle.parse_unit(&text);
        }
    }
}
