//! Scores of a design: of the set-up alone, and at its sample.

use super::vary::separate;
use beamlet_core::{Error, Result};

/// A score of a design.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub enum Score {
    /// 1σ of the transmission of a pixel without a sample.
    SigmaTransmission,
    /// 1σ of the refraction angle of a pixel without a sample along x, rad.
    SigmaAlpha,
    /// 1σ of the dark field of a pixel without a sample along x, rad².
    SigmaDarkField,
    /// Visibility of the illumination curve.
    Visibility,
    /// Photons of an open pixel in a frame.
    Photons,
    /// Exposure time of all frames, s.
    Time,
    /// Charge through the tube, mA s.
    Load,
    /// Air kerma at the axis of rotation in the scan, Gy.
    Kerma,
    /// Absorbed dose in water at the axis of rotation in the scan, Gy.
    Dose,
    /// Of the retrieved images of the sample.
    Sample(SampleScore),
}

/// A score of the retrieved images of the first view.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SampleScore {
    pub(super) measure: Measure,
    pub(super) contrast: Contrast,
    /// Name of the object whose pixels count; `None`: of the whole sample.
    pub(super) object: Option<String>,
}

/// What is computed of the pixels of an image.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Measure {
    /// Root mean square of the difference from the ideal image, without noise.
    Bias,
    /// The same with noise.
    Error,
    /// Root mean square of the difference from the median beside the sample, over the noise.
    ContrastToNoise,
}

/// A retrieved image.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Contrast {
    Transmission,
    Refraction,
    DarkField,
}

impl Measure {
    pub(super) const fn needs_truth(self) -> bool {
        matches!(self, Self::Bias | Self::Error)
    }

    pub(super) const fn needs_photons(self) -> bool {
        matches!(self, Self::Error | Self::ContrastToNoise)
    }
}

impl Contrast {
    /// Name of the image.
    pub(super) const fn image(self) -> &'static str {
        match self {
            Self::Transmission => "transmission",
            Self::Refraction => "refraction",
            Self::DarkField => "dark_field",
        }
    }

    const fn unit(self) -> Unit {
        match self {
            Self::Transmission => NUMBER,
            Self::Refraction => Unit { name: "nrad", si_name: "rad", scale: 1e-9 },
            Self::DarkField => Unit { name: "urad2", si_name: "rad²", scale: 1e-12 },
        }
    }
}

/// Unit of a column, the SI unit, and the value of the first in the second.
#[derive(Debug, Clone, Copy)]
struct Unit {
    name: &'static str,
    si_name: &'static str,
    scale: f64,
}

const NUMBER: Unit = Unit { name: "", si_name: "1", scale: 1.0 };
const GRAY: Unit = Unit { name: "mGy", si_name: "Gy", scale: 1e-3 };

/// Names of the scores without a sample.
static SET_UP_SCORES: [(&str, Score); 9] = [
    ("sigma_transmission", Score::SigmaTransmission),
    ("sigma_alpha", Score::SigmaAlpha),
    ("sigma_dark_field", Score::SigmaDarkField),
    ("visibility", Score::Visibility),
    ("photons", Score::Photons),
    ("time", Score::Time),
    ("load", Score::Load),
    ("kerma", Score::Kerma),
    ("dose", Score::Dose),
];

/// Names of the scores at a sample, before the name of an object.
static SAMPLE_SCORES: [(&str, Measure, Contrast); 9] = [
    ("bias_transmission", Measure::Bias, Contrast::Transmission),
    ("bias_alpha", Measure::Bias, Contrast::Refraction),
    ("bias_dark_field", Measure::Bias, Contrast::DarkField),
    ("error_transmission", Measure::Error, Contrast::Transmission),
    ("error_alpha", Measure::Error, Contrast::Refraction),
    ("error_dark_field", Measure::Error, Contrast::DarkField),
    ("cnr", Measure::ContrastToNoise, Contrast::Transmission),
    ("cnr_alpha", Measure::ContrastToNoise, Contrast::Refraction),
    ("cnr_dark_field", Measure::ContrastToNoise, Contrast::DarkField),
];

impl SampleScore {
    fn of(name: &str) -> Option<Self> {
        let (word, object) = name.split_once(':').map_or((name, None), |(w, o)| (w, Some(o)));
        let (_, measure, contrast) = SAMPLE_SCORES.iter().find(|known| known.0 == word.trim())?;
        let object = object.map(|object| {
            let object = object.trim();
            let quoted = object.strip_prefix('"').and_then(|object| object.strip_suffix('"'));
            quoted.unwrap_or(object).to_owned()
        });
        Some(Self { measure: *measure, contrast: *contrast, object })
    }

    fn name(&self) -> String {
        let is_own = |known: &&(&str, Measure, Contrast)| {
            known.1 == self.measure && known.2 == self.contrast
        };
        let word = SAMPLE_SCORES.iter().find(is_own).map_or("", |known| known.0);
        match &self.object {
            None => word.into(),
            Some(object) if object.contains(',') => format!("{word}:\"{object}\""),
            Some(object) => format!("{word}:{object}"),
        }
    }
}

impl Score {
    /// Scores by their names, separated by commas outside of quotes or in several texts.
    ///
    /// # Errors
    /// [`Error::Argument`] for another name, a name twice, and none.
    pub fn of_list(texts: &[String]) -> Result<Vec<Self>> {
        let mut scores = Vec::new();
        for name in texts.iter().flat_map(|text| separate(text)) {
            let score = Self::of(name)?;
            if scores.contains(&score) {
                return Err(Error::argument("score", format!("{name} twice"), "each score once"));
            }
            scores.push(score);
        }
        match scores.is_empty() {
            true => Err(Error::argument("score", "no score", names())),
            false => Ok(scores),
        }
    }

    fn of(name: &str) -> Result<Self> {
        if let Some((_, score)) = SET_UP_SCORES.iter().find(|known| known.0 == name) {
            return Ok(score.clone());
        }
        let found = SampleScore::of(name).map(Self::Sample);
        found.ok_or_else(|| Error::argument("score", format!("{name:?}"), names()))
    }

    /// Its name.
    #[must_use]
    pub fn name(&self) -> String {
        match self {
            Self::Sample(score) => score.name(),
            other => {
                let known = SET_UP_SCORES.iter().find(|known| known.1 == *other);
                known.map_or("", |known| known.0).to_owned()
            }
        }
    }

    const fn quantity(&self) -> Unit {
        match self {
            Self::SigmaTransmission | Self::Photons => NUMBER,
            Self::SigmaAlpha => Contrast::Refraction.unit(),
            Self::SigmaDarkField => Contrast::DarkField.unit(),
            Self::Visibility => Unit { name: "%", si_name: "1", scale: 1e-2 },
            Self::Time => Unit { name: "s", si_name: "s", scale: 1.0 },
            Self::Load => Unit { name: "mA s", si_name: "mA s", scale: 1.0 },
            Self::Kerma | Self::Dose => GRAY,
            Self::Sample(score) => match score.measure {
                Measure::Bias | Measure::Error => score.contrast.unit(),
                Measure::ContrastToNoise => NUMBER,
            },
        }
    }

    /// Unit of its column in tables; "" of a number.
    #[must_use]
    pub const fn unit(&self) -> &'static str {
        self.quantity().name
    }

    /// SI unit of its values; "1" of a number.
    #[must_use]
    pub const fn si_unit(&self) -> &'static str {
        self.quantity().si_name
    }

    /// A value in SI units in the unit of the column.
    #[must_use]
    pub fn in_unit(&self, value: f64) -> f64 {
        value / self.quantity().scale
    }

    /// True if a larger value is better.
    #[must_use]
    pub const fn rises(&self) -> bool {
        match self {
            Self::Visibility | Self::Photons => true,
            Self::Sample(score) => matches!(score.measure, Measure::ContrastToNoise),
            Self::SigmaTransmission
            | Self::SigmaAlpha
            | Self::SigmaDarkField
            | Self::Time
            | Self::Load
            | Self::Kerma
            | Self::Dose => false,
        }
    }

    /// True if it comes from the illumination curve.
    #[must_use]
    pub const fn needs_curve(&self) -> bool {
        matches!(
            self,
            Self::SigmaTransmission | Self::SigmaAlpha | Self::SigmaDarkField | Self::Visibility
        )
    }

    /// True if a scene without photons has no such score.
    #[must_use]
    pub const fn needs_photons(&self) -> bool {
        match self {
            Self::Visibility => false,
            Self::Sample(score) => score.measure.needs_photons(),
            _ => true,
        }
    }

    /// The score at a sample; `None` of the set-up alone.
    pub(super) const fn sample_score(&self) -> Option<&SampleScore> {
        match self {
            Self::Sample(score) => Some(score),
            _ => None,
        }
    }
}

/// Names of all scores.
fn names() -> String {
    let without = SET_UP_SCORES.each_ref().map(|known| known.0).join(", ");
    let at_sample = SAMPLE_SCORES.map(|known| known.0).join(", ");
    format!(
        "{without}; at a sample {at_sample}, alone or with an object as cnr:OBJECT, in \
         quotes where it has a comma"
    )
}
