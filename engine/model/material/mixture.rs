//! Mixtures by weight: what their parts are.

use super::{builtin, formula};
use crate::scene::{MaterialSpec, Scene, path};
use beamlet_core::error::{Error, Result};

/// The formula of a mixture by weight, and the factor of its density (`formula::mixed`). A part is an entry of `materials` with a formula, a
/// built-in material, or a formula.
pub(super) fn formula(scene: &Scene, name: &str, parts: &[(String, f64)]) -> Result<(String, f64)> {
    let table = path::join(&path::join("materials", name), "mixture");
    let mut known = Vec::with_capacity(parts.len());
    for (part, weight) in parts {
        let key = path::join(&table, part);
        let found = match scene.materials.get(part) {
            Some(MaterialSpec::Formula { formula, .. }) => formula.clone(),
            Some(_) => {
                let allowed = "an entry of [materials] with a formula, a built-in material, or a \
                               formula";
                return Err(Error::scene(key, format!("\"{part}\", without a formula"), allowed));
            }
            None => builtin(part).map_or_else(|| part.clone(), |entry| entry.formula.into_owned()),
        };
        if found.is_empty() {
            return Err(Error::scene(key, "vacuum", "a material"));
        }
        known.push((key, found, *weight));
    }
    formula::mixed(&known)
}
