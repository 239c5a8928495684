//! Photons, exposure and scores of a design.

use super::fixed::exposure;
use super::{Fixed, Score};
use crate::Engine;
use crate::check::{self, ScanExposure};
use beamlet_core::{Error, Result};
use beamlet_model::scene::{Photons, Scene};
use serde::{Deserialize, Serialize};

/// A design with its scores.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Outcome {
    /// A value of each score in SI units; `None`: the design has none.
    pub values: Vec<Option<f64>>,
    /// Photons of an open pixel in a frame.
    pub photons: Option<f64>,
    /// Exposure of a frame, s.
    pub exposure: Option<f64>,
    /// Why the scene of the design is refused, or a curve is not determined.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub refused: Option<String>,
}

impl Outcome {
    /// Scores of a scene.
    ///
    /// # Errors
    /// Errors of the scene; as [`Engine::simulate`].
    pub(super) fn of(
        engine: &Engine,
        mut scene: Scene,
        scores: &[Score],
        fixed: Option<&Fixed>,
    ) -> Result<Self> {
        let scan = match fixed {
            Some(fixed) => Some(fixed.apply(&mut scene)?),
            None => scene.detector.counts.map(|_| exposure(&scene)).transpose()?,
        };
        let needs_curve = scores.iter().any(|score| score.needs_curve());
        let curve = match needs_curve {
            true => check::design_curve(engine, &scene)?,
            false => check::DesignCurve::default(),
        };
        let values: Vec<_> =
            scores.iter().map(|score| value(*score, &curve, scan.as_ref())).collect();
        let lacks = scores.iter().zip(&values).find(|(score, value)| {
            score.needs_curve() && value.is_none_or(|value| !value.is_finite())
        });
        Ok(Self {
            refused: lacks.map(|(score, _)| {
                format!(
                    "{}: no method of retrieval determines it for these masks and offsets",
                    score.name()
                )
            }),
            values: values.into_iter().map(|value| value.filter(|it| it.is_finite())).collect(),
            photons: scan.as_ref().map(|scan| scan.photons),
            exposure: match scene.detector.counts.map(|counts| counts.photons) {
                Some(Photons::Exposure(seconds)) => Some(seconds),
                Some(Photons::Number(_)) | None => None,
            },
        })
    }

    /// A design that the scene refuses.
    pub(super) fn refused(error: &Error, scores: usize) -> Self {
        let reasons: Vec<String> = error.each().iter().map(reason).collect();
        Self { values: vec![None; scores], refused: Some(reasons.join("; ")), ..Self::default() }
    }
}

/// An error in a line, without its place in the file.
fn reason(error: &Error) -> String {
    match error {
        Error::Scene { key, found, allowed, .. } => {
            format!("{key}: found {found}; allowed: {allowed}")
        }
        other => other.to_string(),
    }
}

fn value(score: Score, curve: &check::DesignCurve, scan: Option<&ScanExposure>) -> Option<f64> {
    match score {
        Score::SigmaTransmission => Some(curve.expected?.transmission),
        Score::SigmaAlpha => Some(curve.expected?.refraction),
        Score::SigmaDarkField => Some(curve.expected?.dark_field),
        Score::Visibility => curve.visibility,
        Score::Photons => Some(scan?.photons),
        Score::Time => scan?.time,
        Score::Load => scan?.tube_load,
        Score::Kerma => Some(scan?.air_kerma),
        Score::Dose => Some(scan?.water_dose),
    }
}
