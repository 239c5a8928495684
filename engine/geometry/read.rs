//! The surface of an object, read from a mesh file or made from a shape or arrays.

use std::path::Path;

use sha2::{Digest, Sha256};

use super::mesh_file::MeshFile;
use super::surface::{Defect, PEAK_PER_TRIANGLE, SIMPLIFY, Surface};
use super::{mesh_file, shapes};
use beamlet_core::error::{Error, Result};
use beamlet_core::watch::{LoadStep, Task};
use beamlet_core::{input_file, reserve};
use beamlet_model::scene::{Mesh, MeshFormat, Object, Scene, ShapeOrMesh};

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
    let most = if mesh_file::tells_its_length(path) { u64::MAX - 1 } else { TEXT };
    input_file::read(path, most).map_err(failed)
}

/// The error of a mesh file of an object; where there is none, with the folder that its path begins at.
fn with_place(error: Error, written: &Path, label: &str) -> Error {
    match error {
        Error::File { path, problem, source: Some(source), .. }
            if source.kind() == std::io::ErrorKind::NotFound && written.is_relative() =>
        {
            let rule = "a relative path begins at the folder of the scene file";
            Error::file(path, format!("{problem} of {label} ({rule})"), Some(source))
        }
        error => error,
    }
}

/// SHA-256, in hexadecimal digits.
pub(super) fn hash(bytes: &[u8]) -> String {
    Sha256::digest(bytes).iter().map(|byte| format!("{byte:02x}")).collect()
}

/// SHA-256 of a mesh given as arrays, in hexadecimal digits.
pub fn hash_arrays(vertices: &[[f64; 3]], triangles: &[[u32; 3]]) -> String {
    let vertices = vertices.as_flattened().iter().flat_map(|number| number.to_le_bytes());
    let triangles = triangles.as_flattened().iter().flat_map(|index| index.to_le_bytes());
    hash(&vertices.chain(triangles).collect::<Vec<u8>>())
}

/// The error of a mesh that cannot serve, of an object with this label.
pub(super) fn failed(label: &str) -> impl Fn(Defect) -> Error {
    move |defect| Error::mesh(label, defect.problem, defect.place)
}

/// A mesh file, read once for all objects that take of it.
pub(super) struct ReadFile {
    mesh: MeshFile,
    hash: String,
}

/// Reads the mesh file of an object with this label.
pub(super) fn read_file(
    scene: &Scene,
    path: &Path,
    label: &str,
    task: Task<'_>,
) -> Result<ReadFile> {
    let file = scene.directory.join(path);
    task.begin(LoadStep::Reading, file.metadata().map_or(0, |found| found.len()))?;
    let bytes = read(&file).map_err(|error| with_place(error, path, label))?;
    let counted = PEAK_PER_TRIANGLE.saturating_mul(mesh_file::triangles_in(&file).unwrap_or(0));
    // The triangles of a binary STL file are all of it.
    let needed = match MeshFormat::of(path) {
        Some(MeshFormat::Stl) if counted > 0 => counted,
        _ => counted.max(mesh_file::peak_per_byte(path).saturating_mul(bytes.len() as u64)),
    };
    reserve::ask(needed, &format!("reading {label}"), SIMPLIFY)?;
    let (mesh, hash) = rayon::join(|| mesh_file::parse(path, &bytes, task), || hash(&bytes));
    Ok(ReadFile { mesh: mesh.map_err(failed(label))?, hash })
}

/// The surface of an object as it is given.
pub(super) struct ReadSurface {
    pub(super) surface: Surface,
    /// m per unit of it.
    pub(super) unit: f64,
    /// Hash of the file; empty for shapes.
    pub(crate) hash: String,
    pub(super) warnings: Vec<String>,
}

/// A mesh file as an object has it.
pub(super) enum FileOf<'a> {
    /// Its alone.
    Own(Box<ReadFile>),
    /// The file of other objects, too.
    Shared(&'a ReadFile),
    /// None.
    None,
}

/// The surface of an object as it is given; `file`: its mesh file.
pub(super) fn read_surface(
    object: &Object,
    file: FileOf<'_>,
    label: &str,
    task: Task<'_>,
) -> Result<ReadSurface> {
    let of = |surface, hash| ReadSurface { surface, unit: 1.0, hash, warnings: Vec::new() };
    match (&object.geometry, file) {
        (ShapeOrMesh::Shape(shape), _) => {
            task.begin(LoadStep::Reading, 0)?;
            let scale = object.placement.scale;
            let needed = PEAK_PER_TRIANGLE.saturating_mul(shapes::triangles(shape, scale));
            reserve::ask(needed, &format!("making {label}"), SIMPLIFY)?;
            Ok(of(shapes::surface(shape, scale).map_err(failed(label))?, String::new()))
        }
        (ShapeOrMesh::Mesh(Mesh::Arrays { vertices, triangles }), _) => {
            task.begin(LoadStep::Reading, 0)?;
            let surface = arrays(vertices, triangles).map_err(failed(label))?;
            Ok(of(surface, hash_arrays(vertices, triangles)))
        }
        (ShapeOrMesh::Mesh(Mesh::File { unit, group, .. }), FileOf::Own(file)) => {
            let unit = unit.or(file.mesh.unit).unwrap_or(1.0);
            let part = file.mesh.into_part(group.as_deref());
            let (surface, warnings) = part.map_err(failed(label))?;
            Ok(ReadSurface { surface, unit, hash: file.hash, warnings })
        }
        (ShapeOrMesh::Mesh(Mesh::File { unit, group, .. }), FileOf::Shared(file)) => {
            let unit = unit.or(file.mesh.unit).unwrap_or(1.0);
            let part = file.mesh.part(group.as_deref());
            let (surface, warnings) = part.map_err(failed(label))?;
            Ok(ReadSurface { surface, unit, hash: file.hash.clone(), warnings })
        }
        (ShapeOrMesh::Mesh(Mesh::File { path, .. }), FileOf::None) => {
            Err(Error::file(path, "was not read", None))
        }
    }
}

fn arrays(vertices: &[[f64; 3]], triangles: &[[u32; 3]]) -> std::result::Result<Surface, Defect> {
    let mut surface = Surface::default();
    for (number, triangle) in triangles.iter().enumerate() {
        let place = || format!("triangle {}", number + 1);
        let [Some(a), Some(b), Some(c)] = triangle.map(|index| vertices.get(index as usize)) else {
            return Err(Defect::new(
                format!(
                    "{triangle:?} has a vertex that does not exist: {} are given",
                    vertices.len()
                ),
                place(),
            ));
        };
        surface
            .push_triangle([*a, *b, *c].map(Into::into))
            .map_err(|problem| Defect::new(problem, place()))?;
    }
    Ok(surface)
}
