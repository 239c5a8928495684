//! The corrections that a caller chooses, and their results.

use beamlet_core::options::Word;
use beamlet_core::{Error, Result};
use serde::{Deserialize, Serialize};

/// Corrections of a retrieval by pixels with nothing in the beam.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[non_exhaustive]
pub struct Corrections {
    /// Subtract the refraction angle of the empty beam.
    pub offset: bool,
    /// Subtract a plane of the refraction angle through the empty beam.
    pub plane: bool,
    /// Divide each frame by its dose relative to the flat.
    pub dose: bool,
    /// Fit curves at the mask offsets of the frames as they are found.
    pub steps: bool,
}

impl Corrections {
    /// Names, as [`Self::parse`] reads them.
    pub const NAMES: [&str; 4] = ["offset", "plane", "dose", "steps"];

    /// Names with their meanings.
    #[must_use]
    pub fn words() -> Vec<Word> {
        let helps = [
            "Subtract the refraction angle found there",
            "Subtract a plane of the refraction angle through it",
            "Divide each frame by its dose",
            "Fit curves with the mask offset found for each frame",
        ];
        Self::NAMES.into_iter().zip(helps).map(|(name, help)| Word { name, help }).collect()
    }

    /// Reads names with commas between them, such as `plane,dose,steps`.
    ///
    /// # Errors
    /// [`Error::Argument`] for other names, and for none.
    pub fn parse(text: &str) -> Result<Self> {
        let mut chosen = Self::default();
        for word in text.split(',').map(str::trim) {
            let Some(at) = Self::NAMES.iter().position(|name| *name == word) else {
                let allowed = "offset, plane, dose and steps, with commas between them";
                return Err(Error::argument("correct", format!("{word:?}"), allowed));
            };
            let Self { offset, plane, dose, steps } = &mut chosen;
            *[offset, plane, dose, steps][at] = true;
        }
        Ok(chosen)
    }

    /// Names of the chosen corrections.
    #[must_use]
    pub fn names(&self) -> Vec<String> {
        let chosen = [self.offset, self.plane, self.dose, self.steps];
        let names = Self::NAMES.into_iter().zip(chosen).filter(|(_, chosen)| *chosen);
        names.map(|(name, _)| name.to_owned()).collect()
    }

    /// True if none is chosen.
    #[must_use]
    pub fn is_none(&self) -> bool {
        *self == Self::default()
    }

    /// True if frames are corrected before curves are fitted.
    pub(in crate::retrieve) const fn of_frames(self) -> bool {
        self.dose || self.steps
    }

    /// True if the refraction angle is corrected.
    pub(super) const fn of_refraction(self) -> bool {
        self.offset || self.plane
    }
}

/// Corrections of a view. Each value has its one-sigma uncertainty behind it; `None` is unknown.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct ViewCorrection {
    /// Rectangles of empty beam: first column, end of the columns, first row, end of the rows, in pixels of
    /// the images.
    pub empty_beam: Vec<[usize; 4]>,
    /// Dose of each frame relative to the flat, by which its values were divided; empty where doses were
    /// not corrected.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub dose: Vec<Option<[f64; 2]>>,
    /// Displacement of each frame from its mask offset, relative to the flat, m; empty where offsets were
    /// not corrected.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub steps: Vec<Option<[f64; 2]>>,
    /// The same along z; empty of slits.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub steps_z: Vec<Option<[f64; 2]>>,
    /// Refraction angle that was subtracted, on the optical axis, rad.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub offset: Option<[f64; 2]>,
    /// Slopes of the refraction angle that was subtracted.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub plane: Option<Plane>,
    /// Refraction angle along z that was subtracted, on the optical axis, rad.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub offset_z: Option<[f64; 2]>,
    /// Slopes of the refraction angle along z that was subtracted.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub plane_z: Option<Plane>,
}

impl ViewCorrection {
    /// Frames, and those of which a dose or a displacement along x is unknown where both were to be found.
    pub(super) fn unknown(&self) -> [usize; 2] {
        let pairs = self.dose.iter().zip(&self.steps);
        let unknown = pairs.filter(|(dose, shift)| dose.is_none() || shift.is_none());
        [self.dose.len().min(self.steps.len()), unknown.count()]
    }
}

/// A warning of frames whose doses and displacements the empty beam does not both determine; `None` without any.
pub(in crate::retrieve) fn undetermined(views: &[ViewCorrection]) -> Option<String> {
    let all = views.iter().map(ViewCorrection::unknown);
    let [frames, unknown] = all.fold([0; 2], |[a, b], [frames, unknown]| [a + frames, b + unknown]);
    (unknown > 0).then(|| {
        format!(
            "dose and mask offset of {unknown} of {frames} frames are not both determined: they need columns of empty beam \
             whose curves have different centres, as a fringe of the masks has; choose --correct dose or --correct steps"
        )
    })
}

/// Slopes of a plane of the refraction angle.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Plane {
    /// Along +x on the detector, rad/m.
    pub x: [f64; 2],
    /// Along +z on the detector, rad/m; `None` for images of one row.
    pub z: Option<[f64; 2]>,
}
