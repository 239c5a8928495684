//! Materials: attenuation and refraction constants at an energy.
//!
//! A name stands for an entry of the scene's `materials` or, where there is none, for a
//! built-in material. Constants come from a formula and a density through tabulated cross
//! sections, from a table file, or as given.

mod builtin;
mod formula;
mod table;

use crate::error::{Error, Result};
use crate::scene::{MaskBody, MaskSpec, MaterialSpec, Scene};

pub use builtin::{Builtin, builtin, builtin_names};

/// Optical constants of a material at one energy.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Constants {
    /// Linear attenuation coefficient, 1/m.
    pub mu: f64,
    /// Refractive index decrement (n = 1 - delta + i beta).
    pub delta: f64,
}

/// Constants of the material `name` at the energy of the scene's source.
///
/// # Errors
/// An unknown name (with the nearest known one), an energy outside the tables (with their
/// range), a formula that cannot be read, or a table file that cannot be read.
pub fn constants(scene: &Scene, name: &str) -> Result<Constants> {
    constants_at(scene, name, scene.source.energy)
}

/// As [`constants`]; an unknown name is an error at `key`, where the scene names it.
///
/// # Errors
/// As [`constants`].
pub fn constants_for(scene: &Scene, name: &str, key: &str) -> Result<Constants> {
    constants(scene, name).map_err(|error| match &error {
        Error::Scene { key: own, .. } if own == "material" => error.at_key(key),
        _ => error,
    })
}

/// Constants of the material `name` at `energy` keV. Constants given as numbers are returned
/// as they are, since nothing says how they change with energy.
///
/// # Errors
/// As [`constants`].
pub fn constants_at(scene: &Scene, name: &str, energy: f64) -> Result<Constants> {
    if !(energy.is_finite() && energy > 0.0) {
        return Err(Error::scene("source.energy", format!("{energy} keV"), "an energy above 0"));
    }
    let Some(spec) = scene.materials.get(name) else {
        let Some(found) = builtin(name) else {
            return Err(unknown(scene, name));
        };
        return match found.formula {
            "" => Ok(Constants::default()),
            formula => formula::constants(name, formula, found.density, energy),
        };
    };
    match spec {
        MaterialSpec::Constants { mu, delta } => Ok(Constants { mu: *mu, delta: *delta }),
        MaterialSpec::Formula { formula, density } => {
            formula::constants(name, formula, *density, energy)
        }
        MaterialSpec::Table { path } => {
            table::Table::read(&scene.directory.join(path))?.at(name, energy)
        }
    }
}

fn unknown(scene: &Scene, name: &str) -> Error {
    let defined: Vec<&str> = scene.materials.keys().map(String::as_str).collect();
    let wanted = builtin::fold(name);
    let nearest = builtin::all_spellings()
        .chain(defined)
        .map(|known| {
            (strsim::normalized_damerau_levenshtein(&builtin::fold(known), &wanted), known)
        })
        .max_by(|a, b| a.0.total_cmp(&b.0));
    let mut allowed = String::from("an entry of [materials] or a built-in material");
    if let Some((_, known)) = nearest.filter(|(likeness, _)| *likeness >= 0.6) {
        allowed.push_str(&format!("; did you mean \"{known}\"?"));
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
