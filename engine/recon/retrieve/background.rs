//! Background of an illumination curve.

use super::background_term::BackgroundTerm;
use super::method::{Method, different_offsets};
use super::shape::CurveGeometry;
use beamlet_core::{Error, Result};
use beamlet_model::optics::{Optics, leak_over_mean};
use beamlet_model::scene::{MaskBody, Scene};
use beamlet_model::spectrum;
use serde::{Serialize, Serializer};
use std::fmt;
use std::str::FromStr;

/// Light that bars of a material leak at several energies, over the mean of the curve, from which on a sample that
/// hardens the beam changes its share: hard light passes bars and their slanted edges.
const HARDENED: f64 = 1e-4;
/// Offsets that determine a free background.
const MANY: usize = 5;

/// Background of curves, for the methods `gaussian` and `exact-curve`.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum Background {
    /// An unknown of the fit of each curve.
    Free,
    /// Light that the bars of the masks let pass, a share of the area of each curve.
    Leak,
    /// This value, in the unit of the frames.
    Value(f64),
}

impl Background {
    /// The background for a method and the masks of a scene: the light that they leak where they are known, unless the scene
    /// scatters light, or a sample hardens the light that they leak otherwise than the rest.
    ///
    /// # Errors
    /// Errors of the materials of the masks and of the beam.
    pub(super) fn of(method: Method, scene: &Scene) -> Result<Self> {
        let masks = scene.masks().count();
        // Curves of a sample mask alone before pixels are no Gaussians.
        let least = if method == Method::ExactCurve { 1 } else { 2 };
        let is_known = masks >= least && !Self::depends_on_rows(scene);
        if !method.has_background() || !is_known || scene.detector.scatter.is_some() {
            return Ok(Self::Free);
        }
        let is_separate = different_offsets(&scene.scan.mask_offsets) >= MANY
            && CurveGeometry::of(scene)?.is_separate();
        let hardens = is_separate && Self::hardens(scene)?;
        Ok(if hardens { Self::Free } else { Self::Leak })
    }

    /// True if a sample changes the share of the light that the masks leak.
    fn hardens(scene: &Scene) -> Result<bool> {
        let has_sheets = scene.masks().all(|(_, mask)| matches!(mask.body, MaskBody::Sheet { .. }));
        Ok(!has_sheets
            && spectrum::nodes(scene)?.energies.len() > 1
            && leak_share(scene)? > HARDENED)
    }

    /// True where steps along x alone move apertures that end along z: light between them depends on the row.
    fn depends_on_rows(scene: &Scene) -> bool {
        let z = &scene.scan.mask_offsets_z;
        scene.has_heights() && z.windows(2).all(|pair| pair[0].to_bits() == pair[1].to_bits())
    }

    /// Refuses a background that a method has no term for, and a value that is none.
    ///
    /// # Errors
    /// [`Error::Argument`] with the background and what is allowed.
    pub(super) fn check(self, method: Method) -> Result<()> {
        if self != Self::Free && !method.has_background() {
            let allowed = format!("no background with {method}; or gaussian or exact-curve");
            return Err(Error::argument("background", self.to_string(), allowed));
        }
        match self {
            Self::Value(value) if !value.is_finite() => {
                Err(Error::argument("background", value.to_string(), "free, leak or a number"))
            }
            _ => Ok(()),
        }
    }

    /// Fewest different mask offsets along x for a method with this background.
    pub(super) fn least_offsets(self, method: Method) -> usize {
        let is_free = self == Self::Free && method == Method::ExactCurve;
        if is_free { 5 } else { method.least_offsets() }
    }

    /// The term of a model whose curve has an area of 1 in a period of this size, m or m2.
    ///
    /// # Errors
    /// Errors of the materials of the masks and of the beam.
    pub(super) fn term(self, scene: &Scene, period: f64) -> Result<BackgroundTerm> {
        Ok(match self {
            Self::Free => BackgroundTerm::Free,
            Self::Value(value) => BackgroundTerm::Value(value),
            Self::Leak => BackgroundTerm::PerArea(leak_share(scene)? / period),
        })
    }
}

/// Light that the masks of a scene leak, over the mean of the curve of their apertures.
fn leak_share(scene: &Scene) -> Result<f64> {
    let nodes = spectrum::nodes(scene)?;
    leak_over_mean(scene, &Optics::of(scene), (&nodes.energies, &nodes.weights))
}

impl FromStr for Background {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let refused =
            || Error::argument("background", format!("{text:?}"), "free, leak or a number");
        match text.trim() {
            "free" => Ok(Self::Free),
            "leak" => Ok(Self::Leak),
            number => {
                let value: f64 = number.parse().map_err(|_| refused())?;
                if value.is_finite() { Ok(Self::Value(value)) } else { Err(refused()) }
            }
        }
    }
}

impl fmt::Display for Background {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Free => f.write_str("free"),
            Self::Leak => f.write_str("leak"),
            Self::Value(value) => value.fmt(f),
        }
    }
}

impl Serialize for Background {
    fn serialize<S: Serializer>(&self, serializer: S) -> std::result::Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}
