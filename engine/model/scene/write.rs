//! The resolved scene as TOML.

use std::collections::BTreeMap;
use std::path::Path;

use super::keys::detector::resolved;
use super::keys::material::MaterialEntry;
use super::keys::record::{Keys, Record};
use super::keys::surroundings::write_surroundings;
use super::keys::value::Base;
use super::text::{Text, quoted};
use super::{Object, Scene, path};
use beamlet_core::Result;

impl Text {
    /// A table by its heading.
    fn record<T: Record>(&mut self, heading: &str, it: &T, base: &Base<'_>) -> Result<()> {
        self.table(heading);
        self.keys(it, T::KEYS, base)
    }

    /// Lines of the keys that the resolved scene has.
    pub(super) fn keys<T: Record>(
        &mut self,
        it: &T,
        keys: &Keys<T>,
        base: &Base<'_>,
    ) -> Result<()> {
        let written = keys.write(it, base)?;
        for row in keys.spec.rows {
            it.comments(row.name).iter().for_each(|line| self.comment(line));
            let line = written.iter().find(|line| line.0 == row.name);
            if let Some((key, text)) = line.filter(|_| !it.leaves_out(row.name)) {
                self.raw(key, text);
            }
        }
        Ok(())
    }
}

pub(super) fn to_toml(
    scene: &Scene,
    directory: &Path,
    hashes: &BTreeMap<String, String>,
    sets: &[String],
) -> Result<String> {
    let base = &Base { scene, directory };
    let mut out = Text::default();
    out.comment(concat!("Resolved scene, beamlet ", env!("CARGO_PKG_VERSION")));
    sets.iter().for_each(|set| out.comment(&format!("--set {set}")));
    if let Some(title) = &scene.title {
        out.raw("title", quoted(title));
    }
    out.record("[source]", &scene.source, base)?;
    out.record("[detector]", &resolved(&scene.detector), base)?;
    for (key, mask) in scene.masks() {
        out.record(&format!("[{key}]"), mask, base)?;
    }
    out.record("[sampling]", &scene.sampling, base)?;
    out.record("[scan]", &scene.scan, base)?;
    for (name, spec) in &scene.materials {
        let key = if path::is_bare(name) { name.clone() } else { quoted(name) };
        let entry = MaterialEntry::of(scene, name, spec);
        out.record(&format!("[materials.{key}]"), &entry, base)?;
    }
    let region = scene.region().map(|region| hashed(region, hashes));
    write_surroundings(&mut out, base, region.as_ref())?;
    for object in scene.listed_objects() {
        out.record("[[object]]", &hashed(object, hashes), base)?;
    }
    if !scene.files.is_empty() {
        out.table("[files]");
    }
    for (path, hash) in &scene.files {
        out.raw(&quoted(&base.file(path)?), quoted(hash));
    }
    Ok(out.0)
}

/// An object with the hash of its mesh.
fn hashed(object: &Object, hashes: &BTreeMap<String, String>) -> Object {
    let sha256 = hashes.get(&object.name).or(object.sha256.as_ref()).cloned();
    Object { sha256, ..object.clone() }
}
