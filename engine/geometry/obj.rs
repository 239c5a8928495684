//! Wavefront OBJ files. Polygons are cut into fans; everything but positions and faces is
//! ignored, material libraries included.

use std::cell::Cell;
use std::io::{BufRead, Read};
use std::path::Path;

use glam::DVec3;

use super::surface::{Defect, Surface};

/// Reads an OBJ file. All its objects and groups together; not yet welded.
pub(super) fn parse(bytes: &[u8]) -> Result<Surface, Defect> {
    let options = tobj::LoadOptions {
        triangulate: true,
        ignore_points: true,
        ignore_lines: true,
        ..tobj::LoadOptions::default()
    };
    let lines = Cell::new(0_usize);
    let mut reader = Counted { rest: bytes, lines: &lines };
    let no_materials = |_: &Path| Err(tobj::LoadError::GenericFailure);
    let (models, _) = tobj::load_obj_buf(&mut reader, &options, no_materials).map_err(|error| {
        let line = lines.get();
        let text = bytes.split(|byte| *byte == b'\n').nth(line.saturating_sub(1));
        let text = String::from_utf8_lossy(text.unwrap_or_default());
        Defect::new(
            format!("not a valid OBJ file: {error}"),
            match error {
                // These are found when a group of faces is complete.
                tobj::LoadError::FaceVertexOutOfBounds
                | tobj::LoadError::FaceTexCoordOutOfBounds
                | tobj::LoadError::FaceNormalOutOfBounds => {
                    format!("in the faces before line {line}")
                }
                _ => format!("line {line}: \"{}\"", text.trim()),
            },
        )
    })?;
    let mut surface = Surface::default();
    for model in models {
        let mesh = model.mesh;
        let position = |index: u32| {
            let at = index as usize * 3;
            mesh.positions.get(at..at + 3).map(DVec3::from_slice)
        };
        for (number, triangle) in mesh.indices.chunks_exact(3).enumerate() {
            let place = || format!("triangle {} of \"{}\"", number + 1, model.name);
            let [Some(a), Some(b), Some(c)] = [0, 1, 2].map(|k| position(triangle[k])) else {
                return Err(Defect::new("a face names a vertex that is not there", place()));
            };
            surface.push_triangle([a, b, c]).map_err(|problem| Defect::new(problem, place()))?;
        }
    }
    Ok(surface)
}

/// Counts the lines read, which the parser's own errors do not tell.
struct Counted<'a> {
    rest: &'a [u8],
    lines: &'a Cell<usize>,
}

impl Read for Counted<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        self.rest.read(buffer)
    }
}

impl BufRead for Counted<'_> {
    /// Hands out one line at a time, so that what was consumed is what was parsed.
    fn fill_buf(&mut self) -> std::io::Result<&[u8]> {
        let end =
            self.rest.iter().position(|byte| *byte == b'\n').map_or(self.rest.len(), |at| at + 1);
        Ok(&self.rest[..end])
    }

    fn consume(&mut self, count: usize) {
        if count > 0 {
            self.lines.set(self.lines.get() + 1);
        }
        self.rest = &self.rest[count..];
    }
}
