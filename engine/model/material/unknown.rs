//! The error for an unknown material, with a suggestion.

use super::builtin::{Builtin, all_spellings, fold, of_formula};
use super::formula;
use crate::scene::{MaskSpec, Scene};
use beamlet_core::error::Error;
use beamlet_core::suggestion;

/// Most materials that a message suggests.
const SUGGESTIONS: usize = 4;

pub(super) fn unknown(scene: &Scene, name: &str, key: Option<&str>) -> Error {
    let allowed = format!("an entry of [materials] or a built-in material{}", meant(scene, name));
    let found = format!("\"{name}\"");
    match user(scene, name).or_else(|| key.map(str::to_owned)) {
        Some(key) => Error::scene(key, found, allowed),
        None => Error::argument("material", found, allowed),
    }
}

/// A suggestion in parentheses.
fn meant(scene: &Scene, name: &str) -> String {
    let same = of_formula(name);
    if !same.is_empty() {
        let entry = |entry: &&Builtin| format!("\"{}\" ({} g/cm3)", entry.name, entry.density);
        let names: Vec<String> = same.iter().map(entry).collect();
        return format!(" (the formula is that of {})", names.join(", "));
    }
    if let Some(ways) = formula::other_ways(name, None) {
        return format!("; {ways}");
    }
    let suggested = suggested(scene, name);
    if !suggested.is_empty() {
        return format!(" (did you mean {}?)", suggested.join(" or "));
    }
    match formula::check(name) {
        Ok(Ok(())) => format!(
            " (a formula needs its density: an entry of [materials] with formula = \"{name}\" and density)"
        ),
        // Names of compounds have capitals and numbers.
        Ok(Err(fault))
            if name.starts_with(|c: char| c.is_ascii_alphanumeric() && !c.is_lowercase())
                && name.contains(|c: char| c.is_ascii_digit()) =>
        {
            format!(" (`beamlet material` lists them; as a formula: {fault})")
        }
        _ => " (`beamlet material` lists them)".to_owned(),
    }
}

/// Materials whose name begins as `name` does, or has it as a word, or else the one that it is with a slip, in
/// quotes.
fn suggested(scene: &Scene, name: &str) -> Vec<String> {
    let own = scene.materials.keys().map(|key| (key.as_str(), key.as_str()));
    let all: Vec<(&str, &str)> = own.chain(all_spellings()).collect();
    let begun = fold(name);
    let begins = |spelling: &str| begun.chars().count() >= 3 && fold(spelling).starts_with(&begun);
    let has_word = |spelling: &str| spelling.split([' ', ',']).any(|word| fold(word) == begun);
    let mut found: Vec<(&str, &str)> = Vec::new();
    for (entry, spelling) in &all {
        let fits = begins(spelling) || has_word(spelling);
        if fits && found.iter().all(|(known, _)| known != entry) {
            found.push((entry, spelling));
        }
    }
    if found.is_empty() {
        let spellings = all.iter().map(|(_, spelling)| *spelling);
        let meant = suggestion::slip(name, spellings, fold);
        return meant.map(|meant| format!("\"{meant}\"")).into_iter().collect();
    }
    // The shortest is the nearest, and represents names that continue it.
    found.sort_by_key(|(_, spelling)| spelling.chars().count());
    let all = found.clone();
    let goes_on = |a: &str, b: &str| a.strip_prefix(b).is_some_and(|rest| rest.starts_with(' '));
    found.retain(|(_, spelling)| !all.iter().any(|(_, other)| goes_on(spelling, other)));
    found.iter().take(SUGGESTIONS).map(|(_, spelling)| format!("\"{spelling}\"")).collect()
}

/// The first key of the scene that names a material.
fn user(scene: &Scene, name: &str) -> Option<String> {
    if scene.surroundings == name {
        return Some(scene.surroundings_key().into());
    }
    for (key, mask) in scene.masks() {
        let mut layers = mask.body.layers_by_key(key).into_iter();
        if let Some((key, _)) = layers.find(|(_, (material, _))| *material == name) {
            return Some(key);
        }
    }
    let is_of = |mask: &MaskSpec| mask.substrate.as_ref().is_some_and(|it| it.material == name);
    if let Some((key, _)) = scene.masks().find(|(_, mask)| is_of(mask)) {
        return Some(format!("{key}.substrate.material"));
    }
    let object = scene.objects.iter().position(|object| object.material == name);
    object.map(|index| scene.object_key(index, "material"))
}
