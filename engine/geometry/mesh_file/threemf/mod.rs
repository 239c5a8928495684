//! 3MF files: a zip archive with models in XML. Objects, their components, units, and the names of
//! objects and base materials. Elements count by their name spaces; colours, textures and slices are
//! passed over. Support and modifiers of slicers are left out, with a warning.
//!
//! The crate `threemf` reads neither name spaces, required extensions, types, roles of slicers, components
//! in other models nor materials of triangles, and has no limit on unpacking, so `zip` unpacks and
//! `quick-xml` reads.

mod expand;
mod model;
mod roles;

use std::collections::HashMap;
use std::io::{Cursor, Read};

use zip::ZipArchive;
use zip::result::ZipError;

use super::file::MeshFile;
use crate::surface::{Defect, SIMPLIFY};
use beamlet_core::watch::Task;
use beamlet_core::{input_file, printed, reserve};
use model::Model;
use roles::{Roles, SETTINGS};

/// Most bytes that the models of a file unpack to, as texts may have.
const UNPACKED: u64 = 2 << 30;
/// Peak bytes per byte of a model while it is read, of which a triangle takes some thirty.
const PEAK_PER_BYTE: u64 = 8;
/// Most bytes of the relations of a file.
const RELATIONS: u64 = 1 << 20;
/// The relations that name the first model.
const ROOT: &str = "_rels/.rels";
const ROOT_KIND: &str = "/3dmodel";

/// Reads the build list of a 3MF file.
pub(super) fn parse(bytes: &[u8], task: Task<'_>) -> Result<MeshFile, Defect> {
    let mut archive = ZipArchive::new(Cursor::new(bytes)).map_err(broken)?;
    let mut parts = Vec::new();
    for index in 0..archive.len() {
        let part = archive.by_index_raw(index).map_err(broken)?;
        let name = key(&part.name().map_err(broken)?);
        parts.push(Part { index, name, size: part.size() });
    }
    let mut root = None;
    if let Some(part) = parts.iter().find(|part| part.name == ROOT && part.size <= RELATIONS) {
        root = model::target(&part.text(&mut archive)?, ROOT_KIND).map(|target| key(&target));
    }
    let is_model = |name: &str| name.ends_with(".model") || root.as_deref() == Some(name);
    parts.retain(|part| is_model(&part.name) || SETTINGS.contains(&part.name.as_str()));
    let total = parts.iter().fold(0_u64, |total, part| total.saturating_add(part.size));
    if total > UNPACKED {
        let problem = format!("its models unpack to {total} bytes; allowed: up to {UNPACKED}");
        return Err(Defect::new(problem, ""));
    }
    reserve::ask(total.saturating_mul(PEAK_PER_BYTE), "unpacking it", SIMPLIFY)
        .map_err(|error| Defect::new(error.to_string(), ""))?;
    let (mut models, mut roles) = (HashMap::new(), Roles::default());
    let mut done = 0;
    for part in parts {
        let text = part.text(&mut archive)?;
        if SETTINGS.contains(&part.name.as_str()) {
            roles.read(&text);
        } else {
            let model = Model::read(&text).map_err(|mut defect| {
                defect.place = match defect.place.is_empty() {
                    true => shown(&part.name),
                    false => format!("{}, {}", shown(&part.name), defect.place),
                };
                defect
            })?;
            models.insert(part.name, model);
        }
        done += part.size;
        task.reach(done * bytes.len() as u64 / total.max(1));
    }
    let root = match root {
        Some(root) => root,
        None if models.len() == 1 => models.keys().next().cloned().unwrap_or_default(),
        None => key("3D/3dmodel.model"),
    };
    expand::expand(&models, &root, &roles)
}

fn broken(error: ZipError) -> Defect {
    Defect::new(format!("not a 3MF file: {error}"), "as a zip archive")
}

/// A part of an archive.
struct Part {
    index: usize,
    /// Keyed as [`key`] makes them.
    name: String,
    /// Unpacked, by its entry, bytes.
    size: u64,
}

impl Part {
    fn text(&self, archive: &mut ZipArchive<Cursor<&[u8]>>) -> Result<String, Defect> {
        let part = archive.by_index(self.index).map_err(broken)?;
        unpacked(part, self.size).map_err(|problem| Defect::new(problem, shown(&self.name)))
    }
}

/// The text of a part of `size` bytes, by its header.
fn unpacked(part: impl Read, size: u64) -> Result<String, String> {
    let mut bytes = Vec::new();
    match part.take(size.saturating_add(1)).read_to_end(&mut bytes) {
        Err(error) => return Err(format!("cannot be unpacked: {error}")),
        Ok(found) if found as u64 != size => {
            return Err(format!("does not unpack to the {size} bytes of its entry"));
        }
        Ok(_) => {}
    }
    let mark = bytes.len() - input_file::without_mark(&bytes).len();
    bytes.drain(..mark);
    String::from_utf8(bytes).map_err(|_| "is not UTF-8".to_owned())
}

/// A part as the map has it: parts are named with a slash before them, or without, in either case, and
/// by some programs with backslashes.
fn key(name: &str) -> String {
    name.replace('\\', "/").trim_start_matches('/').to_ascii_lowercase()
}

fn shown(name: &str) -> String {
    printed::line(name)
}
