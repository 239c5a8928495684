//! Materials: attenuation and refraction constants at an energy.
//!
//! A name stands for an entry of the scene's `materials` or, where there is none, for a
//! built-in material. Constants come from a formula and a density through tabulated cross
//! sections, from a table file, or as given.

mod builtin;
mod formula;
mod table;

use crate::error::{Error, Result};
use crate::scene::{Beam, MaskBody, MaskSpec, MaterialSpec, Scene};
use crate::suggestion;

pub use builtin::{Builtin, builtin, builtin_names, builtins};

/// Optical constants of a material at one energy.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Constants {
    /// Linear attenuation coefficient, 1/m.
    pub mu: f64,
    /// Refractive index decrement (n = 1 - delta + i beta).
    pub delta: f64,
}

/// Constants of the material `name` at the one energy of the scene's source.
///
/// # Errors
/// A source with a spectrum: ask [`constants_at`] for each of its nodes. An unknown name (with
/// the nearest known one), an energy outside the tables (with their range), a formula or a table
/// file that cannot be read.
pub fn constants(scene: &Scene, name: &str) -> Result<Constants> {
    match scene.source.beam.single_energy() {
        Some(energy) => constants_at(scene, name, energy),
        None => Err(Error::scene("source.spectrum", "a spectrum", "one energy for this")),
    }
}

/// As [`constants_at`]; an unknown name is an error at `key`, where the scene names it.
///
/// # Errors
/// As [`constants_at`].
pub fn constants_at_for(scene: &Scene, name: &str, energy: f64, key: &str) -> Result<Constants> {
    constants_at(scene, name, energy).map_err(|error| named_at(error, key))
}

/// The error for an unknown name belongs to the key that has the name.
fn named_at(error: Error, key: &str) -> Error {
    match &error {
        Error::Scene { key: own, .. } if own == "material" => error.at_key(key),
        _ => error,
    }
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
    over(scene, name, energies).map_err(|error| match (&error, &scene.source.beam) {
        (Error::Scene { key, .. }, Beam::Spectrum(_)) if key == "source.energy" => {
            error.at_key("source.spectrum")
        }
        _ => error,
    })
}

/// As [`constants_over`]; an unknown name is an error at `key`, where the scene names it.
///
/// # Errors
/// As [`constants_over`].
pub fn constants_over_for(
    scene: &Scene,
    name: &str,
    energies: &[f64],
    key: &str,
) -> Result<Vec<Constants>> {
    constants_over(scene, name, energies).map_err(|error| named_at(error, key))
}

/// Constants of a built-in material at `energies`, keV, whatever a scene calls by its name.
///
/// # Errors
/// An unknown name; an energy outside the tables.
pub fn of_builtin(name: &str, energies: &[f64]) -> Result<Vec<Constants>> {
    let Some(found) = builtin(name) else {
        return Err(Error::scene("material", format!("{name:?}"), "a built-in material"));
    };
    match found.formula {
        "" => Ok(vec![Constants::default(); energies.len()]),
        formula => formula::constants(name, formula, found.density, energies),
    }
}

/// Energies, keV, at which the constants of a material jump; those of a table file lie where
/// its attenuation rises with energy.
///
/// # Errors
/// As [`constants_over_for`].
pub fn edges(scene: &Scene, name: &str, key: &str) -> Result<Vec<f64>> {
    let law = Law::of(scene, name).map_err(|error| named_at(error, key))?;
    match &law {
        Law::Numbers(_) => Ok(Vec::new()),
        Law::Formula { formula, density } => formula::edges(name, formula, *density),
        Law::Table(table) => Ok(table.edges()),
    }
}

/// Least and greatest energy, keV, at which a material has constants.
///
/// # Errors
/// As [`constants_over`].
pub fn range(scene: &Scene, name: &str) -> Result<[f64; 2]> {
    match &Law::of(scene, name)? {
        Law::Numbers(_) => Ok([0.0, f64::INFINITY]),
        Law::Formula { formula, density } => formula::range(name, formula, *density),
        Law::Table(table) => Ok(table.range()),
    }
}

fn over(scene: &Scene, name: &str, energies: &[f64]) -> Result<Vec<Constants>> {
    if let Some(energy) = energies.iter().find(|energy| !(energy.is_finite() && **energy > 0.0)) {
        return Err(Error::scene("source.energy", format!("{energy} keV"), "an energy above 0"));
    }
    match &Law::of(scene, name)? {
        Law::Numbers(constants) => Ok(vec![*constants; energies.len()]),
        Law::Formula { formula, density } => formula::constants(name, formula, *density, energies),
        Law::Table(table) => energies.iter().map(|energy| table.at(name, *energy)).collect(),
    }
}

/// Where the constants of a material come from.
enum Law<'a> {
    /// The same at every energy that is asked for.
    Numbers(Constants),
    Formula {
        formula: &'a str,
        density: f64,
    },
    Table(table::Table),
}

impl<'a> Law<'a> {
    fn of(scene: &'a Scene, name: &str) -> Result<Self> {
        let Some(spec) = scene.materials.get(name) else {
            let found = builtin(name).ok_or_else(|| unknown(scene, name))?;
            return Ok(match found.formula {
                "" => Self::Numbers(Constants::default()),
                formula => Self::Formula { formula, density: found.density },
            });
        };
        match spec {
            MaterialSpec::Constants { mu, delta } => match &scene.source.beam {
                Beam::Energy(_) => Ok(Self::Numbers(Constants { mu: *mu, delta: *delta })),
                Beam::Spectrum(_) => Err(Error::scene(
                    crate::scene::path::join("materials", name),
                    "mu and delta as numbers under source.spectrum",
                    "formula and density, or a table: numbers hold at one energy only",
                )),
            },
            MaterialSpec::Formula { formula, density } => {
                Ok(Self::Formula { formula, density: *density })
            }
            MaterialSpec::Table { path } => {
                Ok(Self::Table(table::Table::read(&scene.checked(path)?)?))
            }
        }
    }
}

fn unknown(scene: &Scene, name: &str) -> Error {
    let defined: Vec<&str> = scene.materials.keys().map(String::as_str).collect();
    let known = builtin::all_spellings().chain(defined);
    let mut allowed = String::from("an entry of [materials] or a built-in material");
    if let Some(meant) = suggestion::nearest(name, known, builtin::fold) {
        allowed.push_str(&format!(" (did you mean \"{meant}\"?)"));
    }
    Error::scene(user(scene, name), format!("\"{name}\""), allowed)
}

/// The first key of the scene that names a material.
fn user(scene: &Scene, name: &str) -> String {
    let bars = |mask: &Option<MaskSpec>| match mask {
        Some(MaskSpec { body: MaskBody::Bars { material, .. }, .. }) => material == name,
        _ => false,
    };
    if scene.surroundings == name {
        return "surroundings.material".into();
    }
    if bars(&scene.sample_mask) {
        return "sample_mask.material".into();
    }
    if bars(&scene.detector_mask) {
        return "detector_mask.material".into();
    }
    match scene.objects.iter().position(|object| object.material == name) {
        Some(index) => format!("object[{index}].material"),
        None => "material".into(),
    }
}
