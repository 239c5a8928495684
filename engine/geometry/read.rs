//! The surface of an object, read from a mesh file or made from a shape or arrays.

use std::path::Path;

use sha2::{Digest, Sha256};

use super::load::hash_arrays;
use super::surface::{Defect, Surface};
use super::watch::{LoadStep, Task};
use super::{obj, shapes, stl};
use crate::error::{Error, Result};
use crate::scene::{Mesh, Object, Scene, ShapeOrMesh};
use crate::{input_file, reserve};

/// Peak bytes per triangle of a mesh while it is read and welded, as measured.
pub(crate) const PEAK_PER_TRIANGLE: u64 = 160;
/// The same per byte of text while that is read: lines of OBJ files are short, and their faces are
/// held three times.
const PEAK_PER_BYTE: [(&str, u64); 2] = [("obj", 16), ("stl", 2)];
/// What may be done where a mesh does not fit.
pub(super) const SIMPLIFY: &str =
    "simplify it, or lift the limit of memory that this program runs under";

/// Most bytes of a mesh in text, and of a file that is none.
const TEXT: u64 = 2 << 30;

/// SHA-256 of a file, hexadecimal.
///
/// # Errors
/// The file cannot be read.
pub fn file_hash(path: &Path) -> Result<String> {
    Ok(hash(&read(path)?))
}

fn read(path: &Path) -> Result<Vec<u8>> {
    let failed = |e| Error::file(path, "cannot read the mesh", Some(e));
    // Only what says how long it is may be longer than texts are.
    let most = if stl::triangles_in(path).is_some() { u64::MAX - 1 } else { TEXT };
    input_file::read(path, most).map_err(failed)
}

fn peak_per_byte(path: &Path) -> u64 {
    let extension = path.extension().unwrap_or_default();
    let found = PEAK_PER_BYTE.iter().find(|(known, _)| extension.eq_ignore_ascii_case(known));
    found.map_or(0, |(_, bytes)| *bytes)
}

pub(super) fn hash(bytes: &[u8]) -> String {
    Sha256::digest(bytes).iter().map(|byte| format!("{byte:02x}")).collect()
}

/// The error of a mesh that cannot serve, of an object with this label.
pub(super) fn failed(label: &str) -> impl Fn(Defect) -> Error {
    move |defect| Error::mesh(label, defect.problem, defect.place)
}

/// The surface of an object as it is given, metres per unit of it, and the hash of what was read.
pub(super) fn read_surface(
    scene: &Scene,
    object: &Object,
    label: &str,
    task: Task<'_>,
) -> Result<(Surface, f64, String)> {
    match &object.geometry {
        ShapeOrMesh::Shape(shape) => {
            task.begin(LoadStep::Reading, 0)?;
            let needed = PEAK_PER_TRIANGLE.saturating_mul(shapes::triangles(shape));
            reserve::ask(needed, &format!("making {label}"), SIMPLIFY)?;
            Ok((shapes::surface(shape).map_err(failed(label))?, 1.0, String::new()))
        }
        ShapeOrMesh::Mesh(Mesh::File { path, unit }) => {
            let file = scene.directory.join(path);
            task.begin(LoadStep::Reading, file.metadata().map_or(0, |found| found.len()))?;
            let bytes = read(&file)?;
            let needed = match stl::triangles_in(&file) {
                Some(triangles) => PEAK_PER_TRIANGLE.saturating_mul(triangles),
                None => peak_per_byte(path).saturating_mul(bytes.len() as u64),
            };
            reserve::ask(needed, &format!("reading {label}"), SIMPLIFY)?;
            let (surface, hash) = rayon::join(|| parse(path, &bytes, task), || hash(&bytes));
            Ok((surface.map_err(failed(label))?, *unit, hash))
        }
        ShapeOrMesh::Mesh(Mesh::Arrays { vertices, triangles }) => {
            task.begin(LoadStep::Reading, 0)?;
            let surface = arrays(vertices, triangles).map_err(failed(label))?;
            Ok((surface, 1.0, hash_arrays(vertices, triangles)))
        }
    }
}

/// The surface in the bytes of a mesh file, by the extension of its name.
pub(super) fn parse(
    path: &Path,
    bytes: &[u8],
    task: Task<'_>,
) -> std::result::Result<Surface, Defect> {
    let extension = path.extension().map(|it| it.to_string_lossy().to_lowercase());
    match extension.as_deref() {
        Some("obj") => obj::parse(bytes, task),
        Some("stl") => stl::parse(bytes, task),
        _ => Err(Defect::new(
            "the format of the mesh is not known",
            "the file name must end in .stl or .obj",
        )),
    }
}

fn arrays(vertices: &[[f64; 3]], triangles: &[[u32; 3]]) -> std::result::Result<Surface, Defect> {
    let mut surface = Surface::default();
    for (number, triangle) in triangles.iter().enumerate() {
        let place = || format!("triangle {}", number + 1);
        let [Some(a), Some(b), Some(c)] = triangle.map(|index| vertices.get(index as usize)) else {
            return Err(Defect::new(
                format!("{triangle:?} names a vertex beyond the {} given", vertices.len()),
                place(),
            ));
        };
        surface
            .push_triangle([*a, *b, *c].map(Into::into))
            .map_err(|problem| Defect::new(problem, place()))?;
    }
    Ok(surface)
}
