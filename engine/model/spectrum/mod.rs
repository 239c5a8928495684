//! Spectra: photons by energy, from a file or the built-in tube, through filters, and the few
//! energies that stand for them.
//!
//! A [`Spectrum`] is a list of energies with weights in photons. A run does not walk through
//! all of them: [`nodes`] picks the few energies, with weights, that give the same transmission
//! and refraction (docs/spectra.md).

mod absorption;
mod edges;
mod emission;
mod excess;
mod file;
mod gauss;
mod known_nodes;
mod nodes;
mod probes;
mod quality;
mod response;
mod tube;

use std::path::Path;

use serde::Serialize;

use crate::material;
use crate::scene::{Anode, Filter, Scene, SpectrumOrigin, SpectrumSpec};
use beamlet_core::{Error, Result};

pub use absorption::Absorbing;
pub use emission::{Emission, emission, photons};
pub use excess::{excess_noise, open_beam, variance_per_value};
pub use nodes::{Nodes, TOLERANCE, nodes, nodes_with};
pub use response::response;

/// Photons by energy.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Spectrum {
    /// Photon energies, keV, strictly ascending, at least one.
    pub energies_kev: Vec<f64>,
    /// Photons at each energy, on any scale; >= 0, and not all 0.
    pub weights: Vec<f64>,
}

impl Spectrum {
    /// A spectrum file: CSV or TSV with energy in keV and weight in photons, or what SpekPy
    /// exports.
    ///
    /// # Errors
    /// [`Error::File`] if it cannot be read; [`Error::Scene`] with line and column if it is no spectrum:
    /// no rows, energies that do not ascend, weights that are negative or no numbers, all of them 0.
    ///
    /// # Example
    ///
    /// ```no_run
    /// let spectrum = beamlet::spectrum::Spectrum::read("tube.csv")?;
    /// println!("{} keV", spectrum.mean_energy());
    /// # Ok::<(), beamlet::Error>(())
    /// ```
    pub fn read(path: impl AsRef<Path>) -> Result<Self> {
        file::read(path.as_ref())
    }

    /// The built-in tube without any filter but its own target: `kvp` in kV and `anode_angle` in
    /// rad, within the ranges of the scene's `source.spectrum`.
    ///
    /// # Errors
    /// [`Error::Scene`] for a voltage or an angle out of range.
    ///
    /// # Example
    ///
    /// ```no_run
    /// use beamlet::{scene::Anode, spectrum::Spectrum};
    ///
    /// let spectrum = Spectrum::of_tube(Anode::Tungsten, 60.0, 12_f64.to_radians())?;
    /// println!("{} keV", spectrum.mean_energy());
    /// # Ok::<(), beamlet::Error>(())
    /// ```
    pub fn of_tube(anode: Anode, kvp: f64, anode_angle: f64) -> Result<Self> {
        tube::spectrum(anode, kvp, anode_angle)
    }

    /// Emission of the source before `filters`: the rows of the file, or the tube behind its inherent
    /// filters. `scene` holds materials and the directory of files.
    ///
    /// # Errors
    /// As [`Self::read`], [`Self::of_tube`] and [`Self::filtered`].
    pub fn before_filters(scene: &Scene, spec: &SpectrumSpec) -> Result<Self> {
        match &spec.origin {
            SpectrumOrigin::File { path } => Self::read(scene.checked(path)?),
            SpectrumOrigin::Tube { anode, kvp, anode_angle, inherent_filters } => Self::of_tube(
                *anode,
                *kvp,
                *anode_angle,
            )?
            .filtered(scene, inherent_filters, "inherent_filters"),
        }
    }

    /// Emission of the source behind all filters, and behind the material of the path to the detector.
    ///
    /// # Errors
    /// As [`Self::before_filters`].
    pub fn after_filters(scene: &Scene, spec: &SpectrumSpec) -> Result<Self> {
        let filtered =
            Self::before_filters(scene, spec)?.filtered(scene, &spec.filters, "filters")?;
        filtered.through_path(scene, scene.detector.distance)
    }

    /// The spectrum behind the material of the path from the source, over a distance in m.
    ///
    /// # Errors
    /// [`Error::Scene`] for an unknown material, energies out of its table, and where nothing passes.
    pub fn through_path(mut self, scene: &Scene, distance: f64) -> Result<Self> {
        let (name, key) = (&scene.path_material, "surroundings.path_material");
        let constants = material::constants_over_for(scene, name, &self.energies_kev, key)?;
        for (weight, constants) in self.weights.iter_mut().zip(constants) {
            *weight *= (-constants.mu * distance).exp();
        }
        if self.total() <= f64::MIN_POSITIVE {
            let found = format!("\"{name}\", which lets nothing through");
            return Err(Error::scene(key, found, "a material such as \"air\" or \"helium\""));
        }
        Ok(self)
    }

    /// The photons that `filters` let through. `list` is the key of the scene that names them.
    ///
    /// # Errors
    /// [`Error::Scene`] for unknown materials, energies out of their tables, and filters that
    /// let nothing through.
    pub fn filtered(mut self, scene: &Scene, filters: &[Filter], list: &str) -> Result<Self> {
        for (index, filter) in filters.iter().enumerate() {
            let key = format!("source.spectrum.{list}[{index}].material");
            let energies = &self.energies_kev;
            let constants = material::constants_over_for(scene, &filter.material, energies, &key)?;
            for (weight, constants) in self.weights.iter_mut().zip(constants) {
                *weight *= (-constants.mu * filter.thickness).exp();
            }
        }
        // Far below what any detector counts: the rows would only cost accuracy.
        if self.total() <= f64::MIN_POSITIVE {
            let key = format!("source.spectrum.{list}");
            return Err(Error::scene(key, "filters that absorb everything", "thinner filters"));
        }
        Ok(self)
    }

    /// Checks whether neighbouring energies are equally far apart, to a tenth of their mean distance: weights per
    /// keV and photons of rows are then the same but for a factor.
    pub fn is_even(&self) -> bool {
        let gaps = || self.energies_kev.windows(2).map(|pair| pair[1] - pair[0]);
        let (least, most) =
            gaps().fold((f64::INFINITY, 0.0_f64), |(a, b), gap| (a.min(gap), b.max(gap)));
        let mean = gaps().sum::<f64>() / (self.energies_kev.len().max(2) - 1) as f64;
        most - least <= 0.1 * mean
    }

    /// Sum of the weights.
    pub fn total(&self) -> f64 {
        self.weights.iter().sum()
    }

    /// Mean energy of the photons, keV.
    pub fn mean_energy(&self) -> f64 {
        let energy: f64 = self.energies_kev.iter().zip(&self.weights).map(|(e, w)| e * w).sum();
        energy / self.total()
    }

    /// First half-value layer: the thickness of aluminium that halves the air kerma, m.
    ///
    /// # Errors
    /// [`Error::Scene`] for energies outside the tables of aluminium.
    pub fn half_value_layer(&self) -> Result<f64> {
        quality::half_value_layer(self)
    }

    /// The rows that carry weight: rows below 1e-12 of the heaviest are dropped.
    #[must_use]
    pub fn significant(&self) -> Self {
        let most = self.weights.iter().fold(0.0_f64, |most, weight| most.max(*weight));
        let rows = self.energies_kev.iter().zip(&self.weights);
        let (energies_kev, weights) = rows.filter(|(_, weight)| **weight > 1e-12 * most).unzip();
        Self { energies_kev, weights }
    }
}
