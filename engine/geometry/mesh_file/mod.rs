//! What a mesh file holds: triangles, and the names that they go by.

mod names;
mod obj;
mod ply;
mod stl;
mod threemf;

use std::path::Path;

use super::surface::{Defect, Surface};
use super::watch::Task;
use crate::scene::MeshFormat;
use names::Names;

/// A mesh file, read.
#[derive(Debug, Default)]
pub(super) struct MeshFile {
    /// Not yet welded.
    surface: Surface,
    names: Names,
    /// The length of 1.0 in it, m, where the file tells it.
    pub(super) unit: Option<f64>,
}

impl MeshFile {
    /// The triangles of an object, group or material, or all; and what is odd about that.
    ///
    /// # Errors
    /// No triangle goes by that name.
    pub(super) fn into_part(self, group: Option<&str>) -> Result<(Surface, Vec<String>), Defect> {
        match group {
            None => Ok((self.surface, self.names.merged())),
            Some(_) => self.part(group),
        }
    }

    /// As [`Self::into_part`], and keeps the file.
    ///
    /// # Errors
    /// As there.
    pub(super) fn part(&self, group: Option<&str>) -> Result<(Surface, Vec<String>), Defect> {
        let Some(group) = group else { return Ok((self.surface.clone(), self.names.merged())) };
        let is_taken = self.names.taken(group)?;
        let mut part = Surface::default();
        let labels = self.names.of_triangles();
        let mut not_finite = self.surface.not_finite.iter().peekable();
        let mut triangle = 0_usize;
        // Triangles that are not finite were left out of the surface and have a label all the same.
        for (label, number) in labels.iter().zip(1_u32..) {
            if not_finite.next_if_eq(&&number).is_some() {
                if is_taken[*label as usize] {
                    part.not_finite.push(number);
                }
                continue;
            }
            if is_taken[*label as usize] {
                part.push_numbered(self.surface.corners(triangle), number);
            }
            triangle += 1;
        }
        Ok((part, Vec::new()))
    }
}

/// What the bytes of a mesh file hold, by the ending of its name.
pub(super) fn parse(path: &Path, bytes: &[u8], task: Task<'_>) -> Result<MeshFile, Defect> {
    match MeshFormat::of(path) {
        Some(MeshFormat::Obj) => obj::parse(bytes, task),
        Some(MeshFormat::Stl) => stl::parse(bytes, task).map(MeshFile::of),
        Some(MeshFormat::Ply) => ply::parse(bytes, task).map(MeshFile::of),
        Some(MeshFormat::ThreeMf) => threemf::parse(bytes, task),
        None => Err(Defect::new(
            "the format of the mesh is not known",
            "the file name must end in .stl, .obj, .ply or .3mf",
        )),
    }
}

impl MeshFile {
    /// One without names.
    fn of(surface: Surface) -> Self {
        Self { surface, ..Self::default() }
    }
}

/// Triangles that a file tells in its first bytes; `None` where it does not, or cannot be read.
pub(super) fn triangles_in(path: &Path) -> Option<u64> {
    match MeshFormat::of(path)? {
        MeshFormat::Ply => ply::faces_in(path),
        MeshFormat::ThreeMf => None,
        // Whatever its name: the length tells.
        MeshFormat::Obj | MeshFormat::Stl => stl::triangles_in(path),
    }
}

/// Peak bytes per byte of a file without such a number, while it is read: lines of OBJ files are
/// short, and their faces are held three times. What a 3MF file unpacks to, its reader asks for.
pub(super) fn peak_per_byte(path: &Path) -> u64 {
    match MeshFormat::of(path) {
        Some(MeshFormat::Obj) => 16,
        Some(MeshFormat::Stl) => 2,
        Some(MeshFormat::Ply) => ply::PEAK_PER_BYTE,
        Some(MeshFormat::ThreeMf) | None => 0,
    }
}

/// Whether a file tells how long it is, and may be longer than texts are.
pub(super) fn tells_its_length(path: &Path) -> bool {
    match MeshFormat::of(path) {
        Some(MeshFormat::Ply) => ply::is_binary(path),
        _ => stl::triangles_in(path).is_some(),
    }
}
