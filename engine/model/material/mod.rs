//! Materials: attenuation and refraction constants at an energy.
//!
//! A name stands for an entry of the scene's `materials` or, where there is none, for a
//! built-in material. Constants come from a formula and a density through tabulated cross
//! sections, from a table file, or as given.

mod activator;
pub mod builtin;
mod capitals;
mod designation;
mod formula;
mod grade;
mod letter_o;
mod lookup;
mod mixture;
mod notation;
mod number_table;
mod table;
mod unknown;

use std::borrow::Cow;

use crate::scene::{Beam, MaterialSpec, Microstructure, Scene, path};
use beamlet_core::error::{Error, Result};
use unknown::unknown;

pub use lookup::builtin;
pub(crate) use number_table::{Column, Fault, NumberTable};

/// Optical constants of a material at one energy.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Constants {
    /// Linear attenuation coefficient, 1/m.
    pub mu: f64,
    /// Refractive index decrement (n = 1 - delta + i beta).
    pub delta: f64,
    /// Variance of the refraction angle along one axis by structure that no object describes, per path length, rad2/m;
    /// of a microstructure, which depends on the set-up too, by [`crate::microstructure::variances`].
    pub scattering: f64,
}

/// Relative difference of energies by rounding: of a node, the exponential of a logarithm.
const ROUNDING: f64 = 1e-12;

/// An energy within a range, or its end that differs from the energy by rounding; `None` beyond it.
fn within([low, high]: [f64; 2], energy: f64) -> Option<f64> {
    let is_near = energy >= low * (1.0 - ROUNDING) && energy <= high * (1.0 + ROUNDING);
    is_near.then(|| energy.clamp(low, high))
}

/// Constants of the material `name` at the one energy of the scene's source.
///
/// # Errors
/// A source with a spectrum: ask [`constants_at`] for each of its nodes. An unknown name (with
/// the nearest known one), an energy outside the tables (with their range), a formula or a table
/// file that cannot be read.
pub fn constants(scene: &Scene, name: &str) -> Result<Constants> {
    match scene.source.beam.single_energy() {
        Some(energy) => {
            let of_scene = Asked { scene, name, key: None, of_scene: true };
            Ok(of_scene.constants(&[energy])?.first().copied().unwrap_or_default())
        }
        None => {
            Err(Error::scene("source.spectrum", "a spectrum", "source.energy, one photon energy"))
        }
    }
}

/// As [`constants_at`], at an energy of the scene's beam; an unknown name is an error at `key`, where
/// the scene names it.
///
/// # Errors
/// As [`constants_at`], for keys of the scene.
pub fn constants_at_for(scene: &Scene, name: &str, energy: f64, key: &str) -> Result<Constants> {
    Ok(constants_over_for(scene, name, &[energy], key)?.first().copied().unwrap_or_default())
}

/// Constants of the material `name` at `energy` keV. Constants given as numbers are returned
/// as they are, since nothing says how they change with energy.
///
/// # Errors
/// As [`constants`], but for a spectrum: constants given as numbers are refused under one.
///
/// # Example
///
/// ```no_run
/// use beamlet::{material::constants_at, scene::Scene};
///
/// let carbon = constants_at(&Scene::load("scene.toml")?, "carbon", 30.0)?;
/// println!("mu {} 1/m, delta {}", carbon.mu, carbon.delta);
/// # Ok::<(), beamlet::Error>(())
/// ```
pub fn constants_at(scene: &Scene, name: &str, energy: f64) -> Result<Constants> {
    Ok(constants_over(scene, name, &[energy])?.first().copied().unwrap_or_default())
}

/// As [`constants_at`], for many energies at once, in their order.
///
/// # Errors
/// As [`constants_at`].
pub fn constants_over(scene: &Scene, name: &str, energies: &[f64]) -> Result<Vec<Constants>> {
    Asked { scene, name, key: None, of_scene: false }.constants(energies)
}

/// As [`constants_over`], at energies of the scene's beam; an unknown name is an error at `key`, where
/// the scene names it.
///
/// # Errors
/// As [`constants_over`], for keys of the scene.
pub(crate) fn constants_over_for(
    scene: &Scene,
    name: &str,
    energies: &[f64],
    key: &str,
) -> Result<Vec<Constants>> {
    Asked { scene, name, key: Some(key), of_scene: true }.constants(energies)
}

/// Constants of a built-in material at `energies`, keV, whatever a scene calls by its name.
///
/// # Errors
/// An unknown name; an energy outside the tables.
pub fn of_builtin(name: &str, energies: &[f64]) -> Result<Vec<Constants>> {
    let Some(found) = builtin(name) else {
        return Err(Error::argument("material", format!("{name:?}"), "a built-in material"));
    };
    match &*found.formula {
        "" => Ok(vec![Constants::default(); energies.len()]),
        formula => {
            let outside = |found, allowed| Error::argument("energy", found, allowed);
            formula::constants(name, formula, found.density, energies, outside)
        }
    }
}

/// Energies, keV, at which the constants of a material jump; for a table file, where its attenuation
/// rises with energy.
///
/// # Errors
/// As `constants_over_for`.
pub(crate) fn edges(scene: &Scene, name: &str, key: &str) -> Result<Vec<f64>> {
    let of = |name: &str, key: &str| match &Law::of(scene, name, Some(key))? {
        Law::Numbers(_) => Ok(Vec::new()),
        Law::Formula { formula, density } => formula::edges(name, formula, *density),
        Law::Table(table) => Ok(table.edges()),
    };
    let mut edges = of(name, key)?;
    if let Some(structure) = scene.microstructures.get(name) {
        edges.extend(of(&structure.of, &key_of_bodies(name))?);
    }
    Ok(edges)
}

/// Key of the material of the bodies of a microstructure.
fn key_of_bodies(name: &str) -> String {
    format!("{}.microstructure.of", path::join("materials", name))
}

/// Least and greatest energy, keV, at which a material has constants.
///
/// # Errors
/// As [`constants_over`].
pub fn range(scene: &Scene, name: &str) -> Result<[f64; 2]> {
    let of = |name: &str, key: Option<&str>| match &Law::of(scene, name, key)? {
        Law::Numbers(_) => Ok([0.0, f64::INFINITY]),
        Law::Formula { formula, density } => formula::range(name, formula, *density),
        Law::Table(table) => Ok(table.range()),
    };
    let host = of(name, None)?;
    let Some(structure) = scene.microstructures.get(name) else { return Ok(host) };
    let bodies = of(&structure.of, Some(&key_of_bodies(name)))?;
    Ok([host[0].max(bodies[0]), host[1].min(bodies[1])])
}

/// Checks that a scene may name a material, at `key`.
///
/// # Errors
/// An unknown name, with a suggestion.
pub fn known(scene: &Scene, name: &str, key: &str) -> Result<()> {
    if scene.materials.contains_key(name) || builtin(name).is_some() {
        return Ok(());
    }
    Err(unknown(scene, name, Some(key)))
}

/// A material whose constants are needed, and the context of an error about it.
struct Asked<'a> {
    scene: &'a Scene,
    name: &'a str,
    /// Key of the scene that names it; the first one is looked up where it is not known.
    key: Option<&'a str>,
    /// The energies belong to the scene's beam, not to the caller.
    of_scene: bool,
}

/// Constants of the host and of the bodies of a microstructure of the scene, at energies of its beam, keV.
///
/// # Errors
/// As [`constants_over`].
pub(crate) fn host_and_bodies(
    scene: &Scene,
    name: &str,
    structure: &Microstructure,
    energies: &[f64],
) -> Result<[Vec<Constants>; 2]> {
    let host = Asked { scene, name, key: None, of_scene: true };
    Ok([host.bulk(energies)?, host.of_bodies(structure, energies)?])
}

impl Asked<'_> {
    /// Constants of the material; of a microstructure the mean of host and bodies.
    fn constants(&self, energies: &[f64]) -> Result<Vec<Constants>> {
        let mut constants = self.bulk(energies)?;
        if let Some(structure) = self.scene.microstructures.get(self.name) {
            let mean = |host: f64, body: f64| host + structure.fraction * (body - host);
            for (host, body) in constants.iter_mut().zip(self.of_bodies(structure, energies)?) {
                host.mu = mean(host.mu, body.mu);
                host.delta = mean(host.delta, body.delta);
            }
        }
        Ok(constants)
    }

    /// Constants of the bodies in the material.
    fn of_bodies(&self, structure: &Microstructure, energies: &[f64]) -> Result<Vec<Constants>> {
        let key = key_of_bodies(self.name);
        Asked { name: &structure.of, key: Some(&key), ..*self }.bulk(energies)
    }

    /// Constants of the material without bodies.
    fn bulk(&self, energies: &[f64]) -> Result<Vec<Constants>> {
        let Self { scene, name, key, .. } = *self;
        let bad = energies.iter().find(|energy| !(energy.is_finite() && **energy > 0.0));
        if let Some(energy) = bad {
            return Err(self.outside(format!("{energy} keV"), "an energy above 0".into()));
        }
        let outside = |found, allowed| self.outside(found, allowed);
        let mut constants = match &Law::of(scene, name, key)? {
            Law::Numbers(constants) => vec![*constants; energies.len()],
            Law::Formula { formula, density } => {
                formula::constants(name, formula, *density, energies, outside)?
            }
            Law::Table(table) => {
                let at = |energy: &f64| table.at(name, *energy, outside);
                energies.iter().map(at).collect::<Result<_>>()?
            }
        };
        if let Some(scattering) = scene.scattering.get(name) {
            for (constants, energy) in constants.iter_mut().zip(energies) {
                constants.scattering = scattering.at(*energy);
            }
        }
        Ok(constants)
    }

    /// An energy without constants.
    fn outside(&self, found: String, allowed: String) -> Error {
        match &self.scene.source.beam {
            _ if !self.of_scene => Error::argument("energy", found, allowed),
            Beam::Energy(_) => Error::scene("source.energy", found, allowed),
            Beam::Spectrum(_) => Error::scene("source.spectrum", found, allowed),
        }
    }
}

/// Where the constants of a material come from.
enum Law<'a> {
    /// The same at each of the energies.
    Numbers(Constants),
    Formula {
        formula: Cow<'a, str>,
        density: f64,
    },
    Table(table::ConstantsTable),
}

impl<'a> Law<'a> {
    fn of(scene: &'a Scene, name: &str, key: Option<&str>) -> Result<Self> {
        let Some(spec) = scene.materials.get(name) else {
            let found = builtin(name).map_or_else(|| Err(unknown(scene, name, key)), Ok)?;
            return Ok(match found.formula.is_empty() {
                true => Self::Numbers(Constants::default()),
                false => Self::Formula { formula: found.formula, density: found.density },
            });
        };
        match spec {
            MaterialSpec::Constants { mu, delta } => match &scene.source.beam {
                Beam::Energy(_) => {
                    Ok(Self::Numbers(Constants { mu: *mu, delta: *delta, ..Constants::default() }))
                }
                Beam::Spectrum(_) => Err(Error::scene(
                    path::join("materials", name),
                    "mu and delta as numbers under source.spectrum",
                    "formula and density, or a table: numbers hold at one energy only",
                )),
            },
            MaterialSpec::Formula { formula, density } => {
                Ok(Self::Formula { formula: formula.into(), density: *density })
            }
            MaterialSpec::Mixture { parts, density } => {
                let (formula, lightness) = mixture::formula(scene, name, parts)?;
                Ok(Self::Formula { formula: formula.into(), density: *density * lightness })
            }
            MaterialSpec::Table { path } => {
                Ok(Self::Table(table::ConstantsTable::read(&scene.checked(path)?)?))
            }
        }
    }
}
