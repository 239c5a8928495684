//! Mesh files by their formats: triangles, and the names that they go by.

mod file;
mod names;
mod obj;
mod ply;
mod ply_elements;
mod ply_text;
mod stl;
mod stl_text;
mod threemf;
mod words;

use std::borrow::Cow;
use std::path::Path;

use super::surface::Defect;
use beamlet_core::input_file;
use beamlet_core::watch::Task;
use beamlet_model::scene::MeshFormat;

pub(crate) use file::MeshFile;

/// Contents of a mesh file, by the ending of its name.
pub(super) fn parse(path: &Path, bytes: &[u8], task: Task<'_>) -> Result<MeshFile, Defect> {
    match MeshFormat::of(path) {
        Some(MeshFormat::Obj) => obj::parse(bytes, task),
        Some(MeshFormat::Stl) => stl::parse(bytes, task),
        Some(MeshFormat::Ply) => ply::parse(bytes, task).map(MeshFile::of),
        Some(MeshFormat::ThreeMf) => threemf::parse(bytes, task),
        None => Err(Defect::new(
            "the format of the mesh is not known",
            "the file name must end in .stl, .obj, .ply or .3mf",
        )),
    }
}

/// The text of a file, as [`input_file::plain`].
fn plain(bytes: &[u8]) -> Result<Cow<'_, [u8]>, Defect> {
    input_file::plain(bytes).map_err(|problem| Defect::new(problem, ""))
}

/// Number of triangles stated in the first bytes of a file; `None` if it has none, or cannot be read.
pub(super) fn triangles_in(path: &Path) -> Option<u64> {
    match MeshFormat::of(path)? {
        MeshFormat::Ply => ply::faces_in(path),
        MeshFormat::ThreeMf => None,
        MeshFormat::Obj => None,
        MeshFormat::Stl => stl::triangles_in(path).map(|(triangles, _)| triangles),
    }
}

/// Peak bytes per byte of a file without such a number, while it is read: lines of OBJ files are short,
/// and their faces are held three times. The reader of 3MF files requests its own memory.
pub(super) fn peak_per_byte(path: &Path) -> u64 {
    match MeshFormat::of(path) {
        Some(MeshFormat::Obj) => 16,
        Some(MeshFormat::Stl) => 3,
        Some(MeshFormat::Ply) => ply::PEAK_PER_BYTE,
        Some(MeshFormat::ThreeMf) | None => 0,
    }
}

/// True if a file states its length, and may be longer than text.
pub(super) fn tells_its_length(path: &Path) -> bool {
    match MeshFormat::of(path) {
        Some(MeshFormat::Ply) => ply::is_binary(path),
        // Whatever its name: the length decides.
        _ => stl::triangles_in(path).is_some_and(|(_, is_all)| is_all),
    }
}
