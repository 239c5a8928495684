//! Photons, exposure and scores of a design.

use super::fixed::exposure;
use super::sample::SampleLight;
use super::{Fixed, Score};
use crate::Engine;
use crate::check::{self, ScanExposure};
use beamlet_core::{Cancel, Error, Result};
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
    /// Visibility of the illumination curve; `None` where a mask is missing or apertures end along z.
    #[serde(default)]
    pub visibility: Option<f64>,
    /// Mean light of the bars of the sample mask and of the detector mask, share of what falls on them.
    #[serde(default)]
    pub leak: Option<[f64; 2]>,
    /// Greatest difference of the flat by waves and by rays with thin masks, over the peak; `None` where it is unknown.
    #[serde(default)]
    pub ray_error: Option<f64>,
    /// Why the scene of the design is refused, or a curve is not determined.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub refused: Option<String>,
}

/// The scene of a design with the exposure of the fixed quantity.
#[derive(Debug)]
pub(super) struct Design {
    pub(super) scene: Scene,
    scan: Option<ScanExposure>,
}

impl Design {
    /// # Errors
    /// [`Error::Argument`] for a scene without the fixed quantity; errors of the beam.
    pub(super) fn of(mut scene: Scene, fixed: Option<&Fixed>) -> Result<Self> {
        let scan = match fixed {
            Some(fixed) => Some(fixed.apply(&mut scene)?),
            None => scene.detector.counts.map(|_| exposure(&scene)).transpose()?,
        };
        Ok(Self { scene, scan })
    }
}

impl Outcome {
    /// Scores of a design. `light`: at its sample, where scores need it.
    ///
    /// # Errors
    /// Errors of the scene; as [`Engine::simulate`].
    pub(super) fn of(
        engine: &Engine,
        design: &Design,
        scores: &[Score],
        light: Option<&SampleLight>,
        cancel: &Cancel,
    ) -> Result<Self> {
        let Design { scene, scan } = design;
        let curve = check::design_curve(engine, scene)?;
        let images = light.map(|light| light.retrieve(engine, scene, cancel)).transpose()?;
        let mut refused = Vec::new();
        let mut values = Vec::new();
        for score in scores {
            let value = match (score.sample_score(), light, &images) {
                (Some(score), Some(light), Some(images)) => light.value(score, images).map(Some),
                _ => set_up_value(score, &curve, scan.as_ref()),
            };
            let value = value.unwrap_or_else(|reason| {
                refused.push(format!("{}: {reason}", score.name()));
                None
            });
            values.push(value.filter(|value| value.is_finite()));
        }
        Ok(Self {
            values,
            visibility: curve.visibility,
            leak: Some(curve.leak),
            ray_error: curve.ray_error,
            refused: (!refused.is_empty()).then(|| refused.join("; ")),
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

/// A score without a sample; `None` where the scene has no such quantity; else the reason why it is not determined.
fn set_up_value(
    score: &Score,
    curve: &check::DesignCurve,
    scan: Option<&ScanExposure>,
) -> std::result::Result<Option<f64>, String> {
    let expected = curve.expected;
    let value = match score {
        Score::SigmaTransmission => expected.map(|sigma| sigma.transmission),
        Score::SigmaAlpha => expected.map(|sigma| sigma.refraction),
        Score::SigmaDarkField => expected.map(|sigma| sigma.dark_field),
        Score::Visibility => curve.visibility,
        Score::Photons => scan.map(|scan| scan.photons),
        Score::Time => scan.and_then(|scan| scan.time),
        Score::Load => scan.and_then(|scan| scan.tube_load),
        Score::Kerma => scan.map(|scan| scan.air_kerma),
        Score::Dose => scan.map(|scan| scan.water_dose),
        Score::Sample(_) => None,
    };
    match score.needs_curve() && !value.is_some_and(f64::is_finite) {
        true => Err("no method of retrieval determines it for these masks and offsets".into()),
        false => Ok(value),
    }
}
