//! A material with bodies in words: what it loses, what is assumed, and where that may not hold.

use super::loss::FLUID;
use super::medium::Medium;
use super::set_up::SetUp;
use crate::scene::{BodyShape, Microstructure, Scene, Transport};
use beamlet_core::Result;
use beamlet_core::printed::number;
use beamlet_core::units::Dimension;
use serde::Serialize;
use std::fmt::{self, Display, Formatter};
use std::path::PathBuf;

/// Diameter over the width of a pixel from which on pixels show single bodies.
const COARSE: f64 = 0.1;
/// Relative change of the variance over the frequencies of a curve from which on contrast is not that of Gaussian
/// angles.
const BENT: f64 = 0.25;
/// Relative error that is warned of.
const UNSURE: f64 = 0.1;

/// A material of bodies in a host, at one energy and at the frequency of the illumination curve.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Description {
    /// Name in the scene.
    pub material: String,
    /// Material of the bodies.
    pub of: String,
    /// Shape of the bodies, in the plural.
    pub shape: &'static str,
    /// Median diameter, m.
    pub diameter: f64,
    /// Standard deviation of ln(diameter).
    pub spread: f64,
    /// Fraction of the volume.
    pub fraction: f64,
    /// Photon energy, keV.
    pub energy: f64,
    /// Delta of the bodies less that of the host.
    pub contrast: f64,
    /// Shear at the frequency 1/(2π σ) of an illumination curve of the width σ, m.
    pub shear: f64,
    /// Variance of the refraction angle per path length by waves at half of this frequency, at it, and at twice, rad²/m.
    pub variances: [f64; 3],
    /// The same at the frequency, of as many bodies at independent places.
    pub independent: f64,
    /// The same by rays.
    pub rays: f64,
    /// Error of the variance by assumptions about sizes, phases and cylinders, as a fraction.
    pub error: f64,
    /// Table of the pair distribution, and the distance that it reaches, diameters.
    pub pair_distribution: Option<(PathBuf, f64)>,
    /// True if the fraction of the volume is above that of fluids of hard spheres, without a table.
    pub is_extrapolated: bool,
    /// Diameter over the width of a pixel at the sample.
    pub per_pixel: f64,
    /// True if the scene takes the contrast at every shear.
    pub by_waves: bool,
}

impl Description {
    /// Describes a material of a scene at an energy, keV; `None` without bodies.
    ///
    /// # Errors
    /// As [`Medium::of`].
    pub fn of(scene: &Scene, name: &str, energy: f64) -> Result<Option<Self>> {
        let Some(structure) = scene.microstructures.get(name) else { return Ok(None) };
        let set_up = SetUp::of(scene);
        let media = Medium::of(scene, name, structure, &[energy])?;
        Ok(media.first().map(|medium| Self::at(scene, name, structure, medium, &set_up, energy)))
    }

    fn at(
        scene: &Scene,
        name: &str,
        structure: &Microstructure,
        medium: &Medium,
        set_up: &SetUp,
        energy: f64,
    ) -> Self {
        let shear = set_up.shear(energy, set_up.frequency());
        let loss = medium.loss(shear);
        let is_sphere = structure.shape != BodyShape::Cylinders;
        Self {
            material: name.into(),
            of: structure.of.clone(),
            shape: match structure.shape {
                BodyShape::Spheres => "spheres",
                BodyShape::Voids => "voids",
                BodyShape::Cylinders => "cylinders",
            },
            diameter: structure.diameter,
            spread: structure.spread,
            fraction: structure.fraction,
            energy,
            contrast: medium.contrast,
            shear,
            variances: [0.5, 1.0, 2.0].map(|factor| medium.variance(factor * shear)),
            independent: medium.variance_of(loss.independent, shear),
            rays: medium.variance_of(loss.rays, shear),
            error: loss.error,
            pair_distribution: medium.pairs().map(|(path, reach)| (path.to_owned(), reach)),
            is_extrapolated: is_sphere && structure.fraction > FLUID && medium.pairs().is_none(),
            per_pixel: structure.diameter / set_up.pixel(),
            by_waves: scene.sampling.transport == Transport::Wave,
        }
    }

    /// Assumptions about places and sizes, and where the contrast is taken.
    #[must_use]
    pub fn assumptions(&self) -> Vec<String> {
        let places = match (self.shape, self.is_extrapolated) {
            ("cylinders", _) => "long cylinders of all directions, between independent places and places that exclude \
                                 one another"
                .into(),
            (_, false) => "hard spheres in equilibrium (Percus-Yevick, Verlet-Weis)".to_owned(),
            (_, true) => format!(
                "hard spheres in equilibrium, extrapolated beyond a fraction of {FLUID}, where packings jam"
            ),
        };
        let by_table = self.pair_distribution.as_ref().map(|(path, reach)| {
            let path = path.display();
            format!("places by the pair distribution of {path}, up to {} diameters", number(*reach))
        });
        let mut all = vec![by_table.unwrap_or(places)];
        if self.spread > 0.0 && self.shape != "cylinders" {
            all.push("sizes lie among their own (local monodisperse mixing)".into());
        }
        all.push(if self.by_waves {
            "contrast at each shear of the rotation centre; along the beam it follows the square of the lever".into()
        } else {
            "one variance, of the contrast at 1/(2 pi sigma) of the curve and at the rotation centre".into()
        });
        all
    }

    /// Where the medium is not what pixels or fits see.
    #[must_use]
    pub fn warnings(&self) -> Vec<String> {
        let name = format!("materials.{}.microstructure", self.material);
        let mut all = Vec::new();
        if self.is_extrapolated {
            all.push(format!(
                "{name}: a fraction of {} is beyond {FLUID}, up to which the order of hard spheres is known: its dark \
                 field is extrapolated, between {} and that of independent bodies, {}",
                number(self.fraction),
                scattering(self.variances[1]),
                scattering(self.independent)
            ));
        }
        if self.error > UNSURE {
            all.push(format!(
                "{name}: the dark field is known to {:.0} % only, by assumptions about sizes and phases",
                100.0 * self.error
            ));
        }
        if self.per_pixel > COARSE {
            all.push(format!(
                "{name}: bodies of {} are {:.2} of a pixel at the sample: pixels of a real sample differ from one \
                 another, where the medium has their mean",
                Dimension::Length.rounded(self.diameter),
                self.per_pixel
            ));
        }
        let [half, one, twice] = self.variances;
        if one > 0.0 && (half / one - 1.0 > BENT || 1.0 - twice / one > BENT) {
            let found = format!(
                "{name}: the contrast is not that of Gaussian angles: its variance is {:.2} at half and {:.2} at twice \
                 the frequency 1/(2 pi sigma) of the curve, where it is 1",
                half / one,
                twice / one
            );
            all.push(match self.by_waves {
                true => format!(
                    "{found}; a Gaussian fit finds a value within them, which depends on its steps"
                ),
                false => format!(
                    "{found}; rays take 1, and a fit of a real curve finds a value within them, which depends on \
                     its steps; sampling.transport = \"wave\" has the contrast at every frequency"
                ),
            });
        }
        all
    }
}

fn scattering(value: f64) -> String {
    let digits = format!("{value:.3e}").parse().unwrap_or(value);
    Dimension::Scattering.rounded(digits)
}

impl Display for Description {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let mut line = |label: &str, text: String| writeln!(f, "  {label:<18}{text}");
        let spread = if self.spread > 0.0 {
            format!(" (standard deviation of ln {})", number(self.spread))
        } else {
            String::new()
        };
        let size = Dimension::Length.rounded(self.diameter);
        line(
            &self.material,
            format!(
                "{} of {}, {size}{spread}, {} of the volume",
                self.shape,
                self.of,
                number(self.fraction)
            ),
        )?;
        let shear = Dimension::Length.rounded(format!("{:.3e}", self.shear).parse().unwrap_or(0.0));
        line(
            "",
            format!(
                "at {} keV delta {:.3e} more than the host; shear {shear}",
                number(self.energy),
                self.contrast
            ),
        )?;
        let [half, one, twice] = self.variances;
        let error = match 100.0 * self.error {
            small if small < 0.1 => "less than 0.1 %".to_owned(),
            error => format!("up to {error:.1} %"),
        };
        line("scattering", format!("{} by waves", scattering(one)))?;
        line("", format!("mixing of sizes, large phases or directions may change it by {error}"))?;
        if one > 0.0 {
            let ratio = |value: f64| number(format!("{:.3}", value / one).parse().unwrap_or(value));
            line(
                "",
                format!(
                    "times {} at half, {} at twice the frequency; {} of independent bodies, {} by rays",
                    ratio(half),
                    ratio(twice),
                    ratio(self.independent),
                    ratio(self.rays)
                ),
            )?;
        }
        for (at, text) in self.assumptions().into_iter().enumerate() {
            line(if at == 0 { "assumes" } else { "" }, text)?;
        }
        Ok(())
    }
}
