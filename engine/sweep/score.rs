//! Scores of a design that need no sample.

use beamlet_core::{Error, Result};

/// A score of a design without a sample.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Score {
    /// 1σ of the transmission of a pixel.
    SigmaTransmission,
    /// 1σ of the refraction angle of a pixel along x, rad.
    SigmaAlpha,
    /// 1σ of the dark field of a pixel along x, rad².
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
}

/// A score with its name, the unit of its column, that unit in SI, and whether more is better.
struct Row {
    score: Score,
    name: &'static str,
    unit: &'static str,
    scale: f64,
    rises: bool,
}

const fn row(score: Score, name: &'static str, unit: &'static str, scale: f64) -> Row {
    let rises = matches!(score, Score::Visibility | Score::Photons);
    Row { score, name, unit, scale, rises }
}

const ROWS: [Row; 9] = [
    row(Score::SigmaTransmission, "sigma_transmission", "", 1.0),
    row(Score::SigmaAlpha, "sigma_alpha", "nrad", 1e-9),
    row(Score::SigmaDarkField, "sigma_dark_field", "urad2", 1e-12),
    row(Score::Visibility, "visibility", "%", 1e-2),
    row(Score::Photons, "photons", "", 1.0),
    row(Score::Time, "time", "s", 1.0),
    row(Score::Load, "load", "mA s", 1.0),
    row(Score::Kerma, "kerma", "mGy", 1e-3),
    row(Score::Dose, "dose", "mGy", 1e-3),
];

/// Beginnings of scores at a sample.
const AT_SAMPLE: [&str; 3] = ["bias", "cnr", "error"];

impl Score {
    /// Scores by their names, separated by commas or in several texts.
    ///
    /// # Errors
    /// [`Error::Argument`] for another name, a name twice, and none.
    pub fn of_list(texts: &[String]) -> Result<Vec<Self>> {
        let mut scores = Vec::new();
        for name in texts.iter().flat_map(|text| text.split(',')).map(str::trim) {
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
        if let Some(row) = ROWS.iter().find(|row| row.name == name) {
            return Ok(row.score);
        }
        let at_sample = AT_SAMPLE.iter().any(|begin| name.starts_with(begin));
        let found = match at_sample {
            true => format!("{name:?}, a score at a sample, which a sweep does not simulate"),
            false => format!("{name:?}"),
        };
        Err(Error::argument("score", found, format!("scores without a sample: {}", names())))
    }

    /// Every score.
    pub fn all() -> impl Iterator<Item = Self> {
        ROWS.iter().map(|row| row.score)
    }

    fn row(self) -> &'static Row {
        ROWS.iter().find(|row| row.score == self).unwrap_or(&ROWS[0])
    }

    /// Its name.
    #[must_use]
    pub fn name(self) -> &'static str {
        self.row().name
    }

    /// Unit of its column in tables; "" of a number.
    #[must_use]
    pub fn unit(self) -> &'static str {
        self.row().unit
    }

    /// SI unit of its values; "1" of a number.
    #[must_use]
    pub const fn si_unit(self) -> &'static str {
        match self {
            Self::SigmaTransmission | Self::Visibility | Self::Photons => "1",
            Self::SigmaAlpha => "rad",
            Self::SigmaDarkField => "rad²",
            Self::Time => "s",
            Self::Load => "mA s",
            Self::Kerma | Self::Dose => "Gy",
        }
    }

    /// A value in SI units in the unit of the column.
    #[must_use]
    pub fn in_unit(self, value: f64) -> f64 {
        value / self.row().scale
    }

    /// True if a larger value is better.
    #[must_use]
    pub fn rises(self) -> bool {
        self.row().rises
    }

    /// True if it comes from the illumination curve.
    #[must_use]
    pub const fn needs_curve(self) -> bool {
        matches!(
            self,
            Self::SigmaTransmission | Self::SigmaAlpha | Self::SigmaDarkField | Self::Visibility
        )
    }

    /// True if a scene without photons has no such score.
    #[must_use]
    pub const fn needs_photons(self) -> bool {
        !matches!(self, Self::Visibility)
    }
}

/// Names of all scores.
fn names() -> String {
    ROWS.map(|row| row.name).join(", ")
}
