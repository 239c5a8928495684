//! scene.toml of a run: the resolved scene, and how another one differs from it.

use beamlet_core::units::Dimension::Angle;
use beamlet_core::{Error, Result, input_file};
use beamlet_model::scene::Scene;
use std::collections::BTreeMap;
use std::path::Path;
use toml::Value;

/// Text of the resolved scene for a file in `directory`, with the hashes of its meshes by
/// object and the overrides that it was loaded with.
pub(super) fn resolved(
    directory: &Path,
    scene: &Scene,
    mesh_hashes: &BTreeMap<String, String>,
    overrides: &[String],
) -> Result<String> {
    scene.to_toml(directory, mesh_hashes, overrides)
}

/// Takes the tolerances of the scene stored at `path` where `scene` has no number. Reads the text alone: meshes of
/// arrays are not in it.
pub(super) fn keep_resolved(path: &Path, scene: &mut Scene) {
    let stored = input_file::text(path).ok().and_then(|text| text.parse::<toml::Table>().ok());
    let sampling = stored.as_ref().and_then(|scene| scene.get("sampling")?.as_table());
    let value = |key: &str| sampling.and_then(|sampling| sampling.get(key));
    let angle = value("angle_tolerance").and_then(Value::as_str);
    let angle = angle.and_then(|text| Angle.parse(text).ok());
    let own = &mut scene.sampling;
    own.tolerance = own.tolerance.or(value("tolerance").and_then(Value::as_float));
    own.angle_tolerance = own.angle_tolerance.or(angle);
}

/// Keys and files of `scene`, with their hashes, that differ from the scene stored at `path`, with both values.
/// `mesh_hashes`: `None` leaves the meshes' hashes out.
pub(super) fn differences(
    path: &Path,
    scene: &Scene,
    mesh_hashes: Option<&BTreeMap<String, String>>,
) -> Result<Vec<String>> {
    let text =
        input_file::text(path).map_err(|error| Error::file(path, "cannot be read", Some(error)))?;
    let mut stored = parse(path, &text)?;
    let directory = path.parent().unwrap_or(path);
    let none = BTreeMap::new();
    let mut now = parse(path, &resolved(directory, scene, mesh_hashes.unwrap_or(&none), &[])?)?;
    let [stored_files, files] = [&mut stored, &mut now].map(take_files);
    // It says nothing about the stacks.
    for scene in [&mut stored, &mut now] {
        scene.as_table_mut().map(|table| table.remove("title"));
    }
    if mesh_hashes.is_none() {
        [&mut stored, &mut now].into_iter().for_each(remove_mesh_hashes);
    }
    let mut found = Vec::new();
    compare("", Some(&stored), Some(&now), &mut found);
    let mut differences: Vec<String> =
        found.into_iter().map(|(key, values)| format!("{key}: {values}")).collect();
    for (file, hash) in &files {
        let stored = stored_files.get(file);
        if stored != Some(hash) {
            let values = format!("sha256 there {}, here {}", word(stored), word(Some(hash)));
            differences.push(format!("{file}: {values}"));
        }
    }
    Ok(differences)
}

/// The table of hashes, which is compared by file.
fn take_files(scene: &mut Value) -> toml::Table {
    match scene.as_table_mut().and_then(|table| table.remove("files")) {
        Some(Value::Table(files)) => files,
        _ => toml::Table::new(),
    }
}

/// Removes the hash of its mesh from each object.
fn remove_mesh_hashes(scene: &mut Value) {
    let Some(Value::Array(objects)) = scene.get_mut("object") else { return };
    for object in objects.iter_mut().filter_map(Value::as_table_mut) {
        object.remove("sha256");
    }
}

fn parse(path: &Path, text: &str) -> Result<Value> {
    toml::from_str::<toml::Table>(text)
        .map(Value::Table)
        .map_err(|error| Error::file(path, format!("is not a scene: {error}"), None))
}

/// Leaves that differ, as key and "there …, here …".
fn compare(
    key: &str,
    there: Option<&Value>,
    here: Option<&Value>,
    found: &mut Vec<(String, String)>,
) {
    match (there, here) {
        (Some(Value::Table(there)), Some(Value::Table(here))) => {
            let added = here.keys().filter(|name| !there.contains_key(*name));
            for name in there.keys().chain(added) {
                let dot = if key.is_empty() { "" } else { "." };
                compare(&format!("{key}{dot}{name}"), there.get(name), here.get(name), found);
            }
        }
        (Some(Value::Array(there)), Some(Value::Array(here))) if there.len() == here.len() => {
            for (index, (there, here)) in there.iter().zip(here).enumerate() {
                compare(&format!("{key}[{index}]"), Some(there), Some(here), found);
            }
        }
        (there, here) if there == here => {}
        (there, here) => {
            found.push((key.into(), format!("there {}, here {}", word(there), word(here))))
        }
    }
}

/// A value in a message.
fn word(value: Option<&Value>) -> String {
    match value {
        None => "nothing".into(),
        Some(Value::Table(_)) => "a table".into(),
        Some(Value::Array(values)) => format!("a list of length {}", values.len()),
        Some(value) => value.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn differences_name_key_and_both_values() {
        let there = "a = 1\n[[object]]\nname = \"rod\"\nscale = 1.0\n[s]\nx = [1, 2]";
        let here = "a = 1\nb = 2\n[[object]]\nname = \"rod\"\nscale = 2.0\n[s]\nx = [1]";
        let (there, here) =
            (parse(Path::new("t"), there).unwrap(), parse(Path::new("h"), here).unwrap());
        let mut found = Vec::new();
        compare("", Some(&there), Some(&here), &mut found);
        found.sort();
        let keys: Vec<&str> = found.iter().map(|(key, _)| key.as_str()).collect();
        assert_eq!(keys, ["b", "object[0].scale", "s.x"]);
        assert_eq!(found[1].1, "there 1.0, here 2.0");
    }
}
