//! The estimators, their requirements and refusals.

use beamlet_core::options::{Choice, Word};
use beamlet_core::units::Dimension::Length;
use beamlet_core::{Error, Result};
use beamlet_model::optics::Optics;
use beamlet_model::scene::{ApertureShape, Scene};
use serde::{Deserialize, Serialize};
use std::fmt;

/// How curves become contrasts. Validity and bias of each: docs/retrieval.md.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Method {
    /// A Gaussian on a background, by least squares (eq. 1). Four steps or more.
    #[default]
    Gaussian,
    /// A Gaussian without background through three steps, in closed form.
    ThreeStep,
    /// The masks' own curve with the blur of the geometry and without background through two steps: no dark
    /// field.
    TwoStep,
    /// Area, centroid and variance of curves that fall to nothing within the scan.
    Moments,
    /// A triangle, for small spots and projected apertures of one width.
    Triangle,
    /// The masks' own curve behind a blur: no bias of a Gaussian. A trapezoid behind a point source.
    ExactCurve,
    /// Single mask: a blurred box per beamlet, integrated over neighbouring pixels (beam tracking).
    Beamlet,
}

/// How values of slits become a curve.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Estimator {
    /// Least squares on the device, of a Gaussian.
    Device,
    /// Least squares of [`super::model::Model::of`] on the host.
    LeastSquares,
    /// A curve of known width through two points.
    TwoPoints,
    /// A Gaussian through three points.
    ThreePoints,
    /// Sums over the values.
    Moments,
}

impl Choice for Method {
    const CHOICES: &'static [Self] = &Self::ALL;

    fn word(self) -> Word {
        let (name, help) = match self {
            Self::Gaussian => {
                ("gaussian", "Gaussian on a background by least squares; 4 steps or more")
            }
            Self::ThreeStep => ("three-step", "Gaussian without background through 3 steps"),
            Self::TwoStep => {
                ("two-step", "Curve of the masks without background through 2 steps: no dark field")
            }
            Self::Moments => {
                ("moments", "Area, centroid and variance of curves that reach zero within the scan")
            }
            Self::Triangle => {
                ("triangle", "Triangle, for small spots and apertures of one projected width")
            }
            Self::ExactCurve => {
                ("exact-curve", "The curve of the masks, blurred: without the bias of a Gaussian")
            }
            Self::Beamlet => (
                "beamlet",
                "Blurred box per beamlet, integrated over neighbouring pixels: single mask",
            ),
        };
        Word { name, help }
    }
}

/// Ratio of blur to half base from where on a triangle is no longer the curve's shape.
const SMALL_BLUR: f64 = 0.15;
/// Pixels of a beamlet that a fit of four unknowns needs; with fewer the geometry gives its blur.
pub(super) const BEAMLET_PIXELS: f64 = 5.0;
/// Relative difference of a period from a pixel that is rounding.
const SAME_PERIOD: f64 = 1e-6;
/// Fewest pixels from beamlet to beamlet: two of them share its light.
const LEAST_PIXELS: f64 = 1.5;

impl Method {
    /// All methods.
    pub const ALL: [Self; 7] = [
        Self::Gaussian,
        Self::ThreeStep,
        Self::TwoStep,
        Self::Moments,
        Self::Triangle,
        Self::ExactCurve,
        Self::Beamlet,
    ];

    /// Its name on the command line and in files.
    #[must_use]
    pub fn name(self) -> &'static str {
        self.word().name
    }

    /// Refuses a set-up or offsets that it cannot serve.
    ///
    /// # Errors
    /// [`Error::Scene`] with found and allowed values, and where possible an alternative method.
    pub fn check(self, scene: &Scene, offsets: &[f64]) -> Result<()> {
        self.check_heights(scene)?;
        if self == Self::Beamlet {
            check_beamlets(scene)?;
            return self.check_offsets(offsets);
        }
        for (key, mask) in
            [("sample_mask", &scene.sample_mask), ("detector_mask", &scene.detector_mask)]
        {
            if mask.is_none() {
                let allowed = format!(
                    "{self} needs both masks: without one there is no illumination curve (a \
                     sample mask alone: method beamlet)"
                );
                return Err(Error::scene(key, "nothing", allowed));
            }
        }
        self.check_offsets(offsets)?;
        let shape = super::shape::CurveGeometry::of(scene)?;
        let blur = shape.blur / shape.half_base();
        match self {
            Self::Triangle if blur > SMALL_BLUR => Err(Error::scene(
                "source.spot",
                format!("{}, whose blur is {blur:.2} of half the base of the curve", spot(scene)),
                format!(
                    "{self} is valid up to a blur of {SMALL_BLUR}: use gaussian or exact-curve"
                ),
            )),
            Self::Triangle if shape.half_top() > 0.02 * shape.half_base() => Err(Error::scene(
                "detector_mask.aperture",
                format!(
                    "projected apertures of {} and {}",
                    Length.rounded(shape.projected[0]),
                    Length.rounded(shape.projected[1])
                ),
                "triangle needs projected apertures of one width: use exact-curve",
            )),
            Self::TwoStep if !scene.source.spot.is_gaussian(0) => Err(Error::scene(
                "source.spot",
                format!("a spot of {} Gaussians", scene.source.spot.parts().len()),
                format!("{self} needs a Gaussian spot across the slits: use gaussian"),
            )),
            Self::TwoStep | Self::Triangle => one_slit(self, scene),
            Self::ExactCurve => slits_of_every_pixel(scene),
            Self::Gaussian | Self::ThreeStep | Self::Moments | Self::Beamlet => Ok(()),
        }
    }

    /// Fewest different mask offsets that it serves.
    #[doc(hidden)]
    pub const fn least_offsets(self) -> usize {
        match self {
            Self::Gaussian => 4,
            Self::ThreeStep | Self::ExactCurve => 3,
            Self::TwoStep => 2,
            Self::Moments | Self::Triangle => 5,
            Self::Beamlet => 1,
        }
    }

    /// True for fits with a background that the masks or a number give.
    pub(super) const fn has_background(self) -> bool {
        match self {
            Self::Gaussian | Self::ExactCurve => true,
            Self::ThreeStep | Self::TwoStep | Self::Moments | Self::Triangle | Self::Beamlet => {
                false
            }
        }
    }

    /// How values of slits become a curve.
    pub(super) const fn estimator(self) -> Estimator {
        match self {
            Self::Gaussian => Estimator::Device,
            Self::ThreeStep => Estimator::ThreePoints,
            Self::TwoStep => Estimator::TwoPoints,
            Self::Moments => Estimator::Moments,
            Self::Triangle | Self::ExactCurve | Self::Beamlet => Estimator::LeastSquares,
        }
    }

    /// True for fits that weigh values by their noise.
    pub(super) const fn weighs(self) -> bool {
        match self {
            Self::Gaussian | Self::ExactCurve | Self::Beamlet => true,
            Self::ThreeStep | Self::TwoStep | Self::Moments | Self::Triangle => false,
        }
    }

    /// True for methods of beamlets on a lattice, and of steps along x and z.
    pub(super) const fn in_two_directions(self) -> [bool; 2] {
        match self {
            Self::Gaussian => [true, true],
            Self::Beamlet | Self::Moments => [true, false],
            Self::ExactCurve => [false, true],
            Self::ThreeStep | Self::TwoStep | Self::Triangle => [false, false],
        }
    }

    /// Curves are functions of the mask offset along x.
    fn check_heights(self, scene: &Scene) -> Result<()> {
        refuse_lists(scene)?;
        let along_z = &scene.scan.mask_offsets_z;
        if different_offsets(along_z) > 1 {
            let found = format!("{} different offsets along z", different_offsets(along_z));
            let allowed = format!("one offset along z: {self} fits curves of steps along x");
            return Err(Error::scene("scan.mask_offsets", found, allowed));
        }
        let knows = match self {
            Self::Gaussian | Self::ThreeStep | Self::Moments => true,
            Self::ExactCurve => scene.masks().all(|(_, mask)| {
                matches!(mask.shape, ApertureShape::Slit | ApertureShape::Rectangle)
            }),
            Self::TwoStep | Self::Beamlet | Self::Triangle => false,
        };
        if scene.has_heights() && !knows {
            let allowed = format!("slits: {self} knows no such apertures; use gaussian or moments");
            return Err(Error::scene("shape", "apertures that end along z", allowed));
        }
        Ok(())
    }

    fn check_offsets(self, offsets: &[f64]) -> Result<()> {
        let (count, different) = (offsets.len(), different_offsets(offsets));
        let least = self.least_offsets();
        let (served, allowed) = match self {
            Self::Gaussian => (
                different >= least,
                format!(
                    "at least {least} different offsets; with three use three-step, with two two-step"
                ),
            ),
            Self::ThreeStep => {
                (count == least && different == least, format!("exactly {least} different offsets"))
            }
            Self::TwoStep => (different == least, format!("exactly {least} different offsets")),
            Self::Beamlet => (count == least, format!("exactly {least} offset")),
            Self::Moments | Self::Triangle | Self::ExactCurve => {
                (different >= least, format!("at least {least} different offsets"))
            }
        };
        if served && offsets.iter().all(|offset| offset.is_finite()) {
            return Ok(());
        }
        Err(Error::scene(
            "scan.mask_offsets",
            format!("{count} offsets, {different} of them different"),
            format!("{self} needs {allowed}"),
        ))
    }
}

/// Refuses lists of apertures: their pixels have no curve of one peak.
pub(super) fn refuse_lists(scene: &Scene) -> Result<()> {
    match scene.masks().find_map(|(key, mask)| Some((key, mask.list_key()?))) {
        None => Ok(()),
        Some((key, list)) => {
            let found = "a list of apertures, whose pixels have no curve of one peak";
            let allowed = "exact-curve with steps along x and z over a period (pairs in scan.mask_offsets), or slits or \
                           apertures on a lattice";
            Err(Error::scene(format!("{key}.{list}"), found, allowed))
        }
    }
}

/// Refuses masks with several slits in a period: their curve is a sum of overlaps.
fn one_slit(method: Method, scene: &Scene) -> Result<()> {
    for (key, mask) in scene.masks() {
        if mask.apertures.len() > 1 {
            let found = format!("{} slits in a period", mask.apertures.len());
            let allowed = format!("{method} knows the curve of one slit in a period: use gaussian");
            return Err(Error::scene(format!("{key}.apertures"), found, allowed));
        }
    }
    Ok(())
}

/// Refuses several slits in a period where pixels see different ones: both masks have one period for each pixel.
fn slits_of_every_pixel(scene: &Scene) -> Result<()> {
    let optics = Optics::of(scene);
    let pitch = optics.detector.pitch[0] / optics.detector.distance;
    for ((key, mask), on_beam) in
        scene.masks().zip([&optics.sample_mask, &optics.detector_mask].into_iter().flatten())
    {
        let period = on_beam.without_shifts(on_beam.distance()).period[0] / on_beam.distance();
        if mask.apertures.len() > 1 && (period / pitch - 1.0).abs() > SAME_PERIOD {
            let found = format!(
                "{} slits in a period of {:.3} pixels",
                mask.apertures.len(),
                period / pitch
            );
            let allowed = "exact-curve needs the same slits before every pixel, a period of one pixel: use gaussian";
            return Err(Error::scene(format!("{key}.apertures"), found, allowed));
        }
    }
    Ok(())
}

impl fmt::Display for Method {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

fn spot(scene: &Scene) -> String {
    format!("a spot of {} across the slits", Length.rounded(scene.source.spot.fwhm()[0]))
}

/// Number of different values among mask offsets.
pub fn different_offsets(offsets: &[f64]) -> usize {
    let mut sorted = offsets.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted.dedup();
    sorted.len()
}

fn check_beamlets(scene: &Scene) -> Result<()> {
    let needs = "beamlet needs a sample mask and no detector mask";
    let optics = Optics::of(scene);
    if optics.detector_mask.is_some() {
        return Err(Error::scene("detector_mask", "a mask", format!("{needs}: use gaussian")));
    }
    let Some(mask) = &optics.sample_mask else {
        return Err(Error::scene("sample_mask", "nothing", needs));
    };
    let pixels = mask.openings_in_columns(&optics.detector, 0.0).period[0];
    if pixels < LEAST_PIXELS {
        return Err(Error::scene(
            "sample_mask.period",
            format!("{pixels:.2} pixels per beamlet"),
            format!(
                "at least {LEAST_PIXELS} pixels per beamlet: transmission and refraction need two pixels that \
                 share its light, the dark field {BEAMLET_PIXELS}"
            ),
        ));
    }
    Ok(())
}
