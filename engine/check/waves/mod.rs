//! Limits of ray optics for a scene: criteria, and expected errors against waves (docs/physics.md, "Limits of
//! rays").

mod objects;
mod sizes;
mod text;
mod warnings;

use beamlet_core::{Error, Result};
use beamlet_geometry::Sample;
use beamlet_model::optics::waves::{FlatError, Node, Pixel, remedies, wavelength};
use beamlet_model::optics::{Optics, mean_leaks};
use beamlet_model::scene::{Blur, Scene, Transport};
use beamlet_model::spectrum::{self, Nodes};
use beamlet_simulate::wave::refuse_by_waves;
use serde::Serialize;
use std::f64::consts::TAU;

/// Error of a flat, share of its peak, beyond which a scene is outside ray optics.
pub(super) const FLAT: f64 = 0.01;
/// Relative error of a dark field beyond which a scene is outside ray optics.
pub(super) const DARK_FIELD: f64 = 0.1;

/// Slits in a period of a mask above which nothing is computed: the time grows with their square.
const MOST_SLITS: usize = 16;

/// Limits of ray optics for a scene: expected differences between waves and rays. A spectrum is the mean over its
/// energy nodes with their weights.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct RayLimits {
    /// Numbers that show where rays fail; `None` without a sample mask.
    pub criteria: Option<WaveCriteria>,
    /// Error of the flat; `None` without a sample mask, or where it is unknown.
    pub flat: Option<FlatLimits>,
    /// Reason why the error of the flat is unknown.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unknown_flat: Option<String>,
    /// Errors at the objects of the sample, in the order of the scene.
    pub objects: Vec<ObjectLimits>,
    /// Waves in place of rays.
    pub waves: WaveTransport,
}

/// Waves in place of rays, `sampling.transport = "wave"`, in a scene.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum WaveTransport {
    /// The scene is computed by waves.
    Used,
    /// The scene is computed by rays, and waves would do.
    Possible,
    /// Waves refuse the scene, with the reason.
    Refused(String),
}

impl WaveTransport {
    fn of(scene: &Scene) -> Result<Self> {
        if scene.sampling.transport == Transport::Wave {
            return Ok(Self::Used);
        }
        match refuse_by_waves(scene) {
            Ok(()) => Ok(Self::Possible),
            Err(Error::Scene { found, .. }) => {
                let what = found.strip_prefix("\"wave\" with ").unwrap_or(&found);
                Ok(Self::Refused(what.into()))
            }
            Err(other) => Err(other),
        }
    }
}

/// Numbers that show where rays fail. Lengths in the plane of the sample mask.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[non_exhaustive]
pub struct WaveCriteria {
    /// Fresnel number of the narrowest aperture, a²/(λz): rays fail near 1.
    pub fresnel_number: f64,
    /// Blur by the focal spot over the width of fringes, √(λz): fringes are visible below 1.
    pub blur_over_fringe: f64,
    /// Standard deviation of the illumination curve by the widths of apertures, window and blur, m.
    pub curve_width: f64,
    /// Shear λz/(2π curve width), m: bodies whose phase is not straight over it are not seen as by rays.
    pub shear: f64,
}

/// Error of the flat of ray optics with thin masks, share of open beam.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct FlatLimits {
    /// Mask offset (m), light by rays, light by waves less light by rays.
    pub steps: Vec<[f64; 3]>,
    /// Most that the unknown phase of the bars changes the light by waves.
    pub bars: f64,
    /// Greatest light of the curve by rays.
    pub peak: f64,
    /// Greatest difference of waves and rays over the peak.
    pub relative: f64,
    /// FWHM of the focal spot along x, m, above which the error is below 1 % of the peak, where it is larger.
    pub least_spot: Option<f64>,
    /// Factor of all distances below which the error is below 1 % of the peak, where it is larger.
    pub distance_factor: Option<f64>,
}

/// Errors of ray optics at an object.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct ObjectLimits {
    /// Name in the scene.
    pub name: String,
    /// Least and greatest diameter of its bodies, m; `None` where they have flat faces.
    pub diameters: Option<[f64; 2]>,
    /// True if the bodies are round; otherwise the diameters belong to an inscribed and an enclosing cylinder.
    pub round: bool,
    /// Dark field by waves over the dark field by rays, from the transform of the curve: least and greatest.
    /// `None` for bodies of 300 um or more, or where it is unknown.
    pub dark_field: Option<[f64; 2]>,
    /// Share of the volume of its box that its bodies have; above 0.1 they are not independent, as the estimate
    /// of the dark field assumes.
    pub fill: f64,
    /// True if its surface is rough. Rays take slopes without a length: the error of its dark field is unknown.
    pub rough: bool,
    /// Reasons why numbers are unknown or may not hold.
    pub unknown: Vec<String>,
}

/// A set-up as the estimates take it.
#[derive(Debug)]
struct SetUp<'a> {
    scene: &'a Scene,
    nodes: Vec<Node>,
    /// The pixels that see the masks differently.
    pixels: Vec<Pixel>,
    /// Mask offsets within half a period, m.
    offsets: Vec<f64>,
}

impl<'a> SetUp<'a> {
    fn of(scene: &'a Scene, nodes: &Nodes) -> Result<Self> {
        // Columns of a group see the curve of masks without shifts.
        let groups = scene.of_groups();
        let optics = Optics::of(&groups);
        let masks = || optics.sample_mask.iter().chain(&optics.detector_mask);
        let slits = masks().map(|mask| mask.openings(mask.distance()).ends().count()).max();
        let has_many = slits.unwrap_or_default() > MOST_SLITS;
        let with_leaks = |(energy, weight): (&f64, &f64)| {
            Ok((*energy, *weight, mean_leaks(scene, &optics, (&[*energy], &[1.0]))?))
        };
        let nodes = nodes.energies.iter().zip(&nodes.weights).map(with_leaks);
        let period = optics.curve_period();
        let within = |offset: &f64| {
            if period.is_finite() { libm::remainder(*offset, period) } else { *offset }
        };
        Ok(Self {
            scene,
            nodes: nodes.collect::<Result<_>>()?,
            pixels: if has_many {
                Vec::new()
            } else {
                Pixel::around_axis(&optics, scene.axis_distance())
            },
            offsets: groups.scan.mask_offsets.iter().map(within).collect(),
        })
    }

    /// The pixel whose estimates of objects are shown.
    fn pixel(&self) -> Option<&Pixel> {
        self.pixels.first()
    }

    fn criteria(&self) -> Option<WaveCriteria> {
        let pixel = self.pixel()?;
        let length: f64 =
            self.nodes.iter().map(|(energy, weight, _)| weight * wavelength(*energy)).sum();
        let area = pixel.fringe_area(length);
        Some(WaveCriteria {
            fresnel_number: pixel.aperture().powi(2) / area,
            blur_over_fringe: pixel.spot_blur() / area.sqrt(),
            curve_width: pixel.curve_width(),
            shear: area / (TAU * pixel.curve_width()),
        })
    }

    fn flat(&self) -> Option<FlatLimits> {
        let error = FlatError::of(&self.pixels, &self.nodes, &self.offsets)?;
        let relative = error.relative();
        let [spot, distances] = match relative > FLAT {
            true => remedies(&self.pixels, &self.nodes, &self.offsets, FLAT),
            false => [None; 2],
        };
        let FlatError { steps, bars, peak } = error;
        let least_spot = spot.map(|factor| factor * self.scene.source.spot.fwhm()[0]);
        Some(FlatLimits { steps, bars, peak, relative, least_spot, distance_factor: distances })
    }

    /// Reason why the light of pixels is unknown.
    fn unknown_light(&self) -> Option<String> {
        if self.scene.has_heights() {
            return Some("waves behind apertures that end along z are not computed".into());
        }
        if self.pixels.is_empty() && self.scene.sample_mask.is_some() {
            return Some(format!("masks of more than {MOST_SLITS} slits in a period"));
        }
        let blur = matches!(self.scene.detector.blur, Some(Blur::Kernel(_)));
        (blur && self.scene.detector_mask.is_none())
            .then(|| "an image of the blur of pixels without a detector mask".into())
    }
}

/// Greatest difference of a flat by waves and by rays with thin masks over the peak; `None` where it is unknown.
///
/// # Errors
/// Errors of the materials of masks and beam.
pub(crate) fn flat_error(scene: &Scene, nodes: &Nodes) -> Result<Option<f64>> {
    let set_up = SetUp::of(scene, nodes)?;
    if set_up.unknown_light().is_some() {
        return Ok(None);
    }
    let error = FlatError::of(&set_up.pixels, &set_up.nodes, &set_up.offsets);
    Ok(error.map(|error| error.relative()))
}

impl RayLimits {
    /// Limits of ray optics for a scene and its sample.
    ///
    /// # Errors
    /// Errors of the materials of masks, beam and objects.
    pub fn of(scene: &Scene, sample: &Sample) -> Result<Self> {
        let set_up = SetUp::of(scene, &spectrum::nodes(scene)?)?;
        let unknown_flat = set_up.unknown_light();
        Ok(Self {
            criteria: set_up.criteria(),
            flat: if unknown_flat.is_none() { set_up.flat() } else { None },
            unknown_flat,
            objects: objects::of(&set_up, sample)?,
            waves: WaveTransport::of(scene)?,
        })
    }
}
