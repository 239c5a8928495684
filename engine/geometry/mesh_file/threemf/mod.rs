//! 3MF files: a zip archive with models in XML. Objects, their components, units, and the names of
//! objects and base materials; colours, textures, slices and what slicers add are passed over.
//!
//! The crate `threemf` reads materials only in a prefixed name space, no materials of triangles, and has
//! no limit on unpacking, so `zip` unpacks and `quick-xml` reads.

mod expand;
mod model;

use std::collections::HashMap;
use std::io::{Cursor, Read};

use zip::ZipArchive;

use super::file::MeshFile;
use crate::geometry::surface::{Defect, SIMPLIFY};
use crate::geometry::watch::Task;
use crate::{printed, reserve};
use model::Model;

/// Most bytes that the models of a file unpack to, as texts may have.
const UNPACKED: u64 = 2 << 30;
/// Peak bytes per byte of a model while it is read, of which a triangle takes some thirty.
const PEAK_PER_BYTE: u64 = 8;
/// The relation that names the first model.
const ROOT: &str = "_rels/.rels";
const ROOT_KIND: &str = "/3dmodel";

/// Reads the build list of a 3MF file.
pub(super) fn parse(bytes: &[u8], task: Task<'_>) -> Result<MeshFile, Defect> {
    let broken = |error| Defect::new(format!("not a 3MF file: {error}"), "as a zip archive");
    let mut archive = ZipArchive::new(Cursor::new(bytes)).map_err(broken)?;
    let mut parts = Vec::new();
    let mut total = 0_u64;
    for index in 0..archive.len() {
        let part = archive.by_index_raw(index).map_err(broken)?;
        let name = part.name().map_err(broken)?.into_owned();
        if name.to_ascii_lowercase().ends_with(".model") || name == ROOT {
            total = total.saturating_add(part.size());
            parts.push((index, name, part.size()));
        }
    }
    if total > UNPACKED {
        let problem = format!("its models unpack to {total} bytes; allowed: up to {UNPACKED}");
        return Err(Defect::new(problem, ""));
    }
    reserve::ask(total.saturating_mul(PEAK_PER_BYTE), "unpacking it", SIMPLIFY)
        .map_err(|error| Defect::new(error.to_string(), ""))?;
    let mut models = HashMap::new();
    let mut root = None;
    let mut done = 0;
    for (index, name, size) in parts {
        let part = archive.by_index(index).map_err(broken)?;
        let text = unpacked(part, size).map_err(|problem| Defect::new(problem, shown(&name)))?;
        if name == ROOT {
            root = model::target(&text, ROOT_KIND);
        } else {
            let model = Model::read(&text).map_err(|mut defect| {
                defect.place = match defect.place.is_empty() {
                    true => shown(&name),
                    false => format!("{}, {}", shown(&name), defect.place),
                };
                defect
            })?;
            models.insert(key(&name), model);
        }
        done += size;
        task.reach(done * bytes.len() as u64 / total.max(1));
    }
    let root = match root {
        Some(root) => key(&root),
        None if models.len() == 1 => models.keys().next().cloned().unwrap_or_default(),
        None => key("3D/3dmodel.model"),
    };
    expand::expand(&models, &root)
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
    String::from_utf8(bytes).map_err(|_| "is not UTF-8".to_owned())
}

/// A part as the map has it: parts are named with a slash before them, or without, in either case.
fn key(name: &str) -> String {
    name.trim_start_matches('/').to_ascii_lowercase()
}

fn shown(name: &str) -> String {
    printed::line(name)
}
