//! A material of a scene with bodies, as light of an energy sees it.

use super::loss::{Bodies, Loss};
use super::pairs::Pairs;
use super::set_up::SetUp;
use crate::material::host_and_bodies;
use crate::optics::waves::wavelength;
use crate::scene::{Microstructure, Scene};
use beamlet_core::Result;
use std::f64::consts::TAU;
use std::path::Path;

/// A material with bodies at an energy.
#[derive(Debug, Clone, PartialEq)]
pub struct Medium {
    bodies: Bodies,
    energy: f64,
    /// Delta of the bodies less that of the host.
    pub contrast: f64,
}

impl Medium {
    /// A material of a scene at energies of its beam, keV.
    ///
    /// # Errors
    /// As [`crate::material::constants_over`]; a table of a pair distribution that cannot be read or be right.
    pub fn of(
        scene: &Scene,
        name: &str,
        structure: &Microstructure,
        energies: &[f64],
    ) -> Result<Vec<Self>> {
        let [hosts, bodies] = host_and_bodies(scene, name, structure, energies)?;
        let contrasts = hosts.iter().zip(&bodies).map(|(host, body)| body.delta - host.delta);
        let bodies = Bodies::new(structure).with_pairs(Pairs::of(scene, name, structure)?);
        let medium = |(&energy, contrast)| Self { bodies: bodies.clone(), energy, contrast };
        Ok(energies.iter().zip(contrasts).map(medium).collect())
    }

    /// Table of the pair distribution, as the scene names it, and the distance that it reaches, diameters.
    pub(super) fn pairs(&self) -> Option<(&Path, f64)> {
        self.bodies.pairs().map(|pairs| (pairs.path.as_path(), pairs.reach))
    }

    /// Loss of contrast per path length at a shear, m.
    #[must_use]
    pub fn loss(&self, shear: f64) -> Loss {
        self.bodies.loss(2.0 * self.wavenumber() * self.contrast, shear)
    }

    /// Variance of the refraction angle per path length, rad²/m, of Gaussian angles that lose a contrast (1/m) at a
    /// shear, m.
    #[must_use]
    pub fn variance_of(&self, loss: f64, shear: f64) -> f64 {
        2.0 * loss / (self.wavenumber() * shear).powi(2)
    }

    /// Variance of the refraction angle per path length, rad²/m, of Gaussian angles that lose as much contrast at a
    /// shear, m.
    #[must_use]
    pub fn variance(&self, shear: f64) -> f64 {
        self.variance_of(self.loss(shear).value, shear)
    }

    fn wavenumber(&self) -> f64 {
        TAU / wavelength(self.energy)
    }
}

/// Variance of the refraction angle per path length of a material with bodies at energies of the beam, keV, that has
/// the contrast of waves at the frequency of the curve; rad²/m. `None` without bodies.
///
/// # Errors
/// As [`crate::material::constants_over`].
pub fn variances(scene: &Scene, name: &str, energies: &[f64]) -> Result<Option<Vec<f64>>> {
    let Some(structure) = scene.microstructures.get(name) else { return Ok(None) };
    let set_up = SetUp::of(scene);
    let media = Medium::of(scene, name, structure, energies)?;
    let variance = |(medium, energy): (&Medium, &f64)| {
        medium.variance(set_up.shear(*energy, set_up.frequency()))
    };
    Ok(Some(media.iter().zip(energies).map(variance).collect()))
}
