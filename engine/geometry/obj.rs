//! Wavefront OBJ files: positions and faces. Everything else is ignored, material libraries
//! included.
//!
//! `tobj` reads them, after a first look that names the line of whatever is wrong and leaves
//! texture and normal indices out: `tobj` reports no lines, and overflows on some indices.

use super::polygon;
use super::surface::{Defect, Surface};
use super::watch::Task;
use crate::numbers;
use glam::DVec3;
use std::fmt::Write as _;
use std::path::Path;

/// Lines, or faces, between two reports of how far reading is.
const REPORT: usize = 1 << 14;
/// What the first look takes of the time to read a file; then `tobj`, then the cutting of faces.
const FIRST_LOOK: f64 = 0.4;
const PARSED: f64 = 0.7;

/// Reads an OBJ file. All its objects and groups together; not yet welded.
pub(super) fn parse(bytes: &[u8], task: Task<'_>) -> Result<Surface, Defect> {
    // A name in some other encoding than UTF-8 is no reason to refuse a file.
    let text = String::from_utf8_lossy(bytes);
    let share = |share: f64| {
        task.reach(numbers::whole::<u64>(share * bytes.len() as f64));
    };
    let (plain, lines) = vetted(&text, |done| share(FIRST_LOOK * done))?;
    share(FIRST_LOOK);
    let options = tobj::LoadOptions { triangulate: false, ..tobj::LoadOptions::default() };
    let no_materials = |_: &Path| Err(tobj::LoadError::GenericFailure);
    let (models, _) = tobj::load_obj_buf(&mut plain.as_bytes(), &options, no_materials)
        .map_err(|error| Defect::new(format!("not a valid OBJ file: {error}"), String::new()))?;
    let mut surface = Surface::default();
    let (count, mut faces) = (lines.len() as f64, lines.into_iter());
    for mesh in models.into_iter().map(|model| model.mesh) {
        let position = |index: &u32| DVec3::from_slice(&mesh.positions[3 * *index as usize..]);
        let mut rest = mesh.indices.as_slice();
        // Without arities every face is a triangle.
        let mut arities = mesh.face_arities.iter();
        while !rest.is_empty() {
            let arity = arities.next().map_or(3, |n| *n as usize);
            let (face, others) = rest.split_at(arity);
            rest = others;
            if faces.len() % REPORT == 0 {
                share(1.0 - (1.0 - PARSED) * faces.len() as f64 / count);
            }
            let line = faces.next().unwrap_or_default();
            let corners: Vec<DVec3> = face.iter().map(position).collect();
            let failed = |problem| Defect::new(problem, format!("line {line}"));
            for [a, b, c] in polygon::triangles(&corners).map_err(failed)? {
                surface.push_triangle([corners[a], corners[b], corners[c]]).map_err(failed)?;
            }
        }
    }
    Ok(surface)
}

/// Positions and faces with position indices alone, and the line of each face. `progress` gets the
/// share that is done.
fn vetted(text: &str, progress: impl Fn(f64)) -> Result<(String, Vec<usize>), Defect> {
    let mut plain = String::with_capacity(text.len());
    let mut faces = Vec::new();
    let mut vertices = 0;
    let mut lines = text.lines().zip(1_usize..);
    while let Some((line, number)) = lines.next() {
        if number % REPORT == 0 {
            progress((line.as_ptr() as usize - text.as_ptr() as usize) as f64 / text.len() as f64);
        }
        let joined;
        let mut line = line.split('#').next().unwrap_or_default().trim();
        if line.ends_with('\\') {
            let mut whole = line.to_owned();
            while whole.ends_with('\\') {
                whole.pop();
                whole.push(' ');
                let next = lines.next().map_or("", |(line, _)| line);
                whole.push_str(next.split('#').next().unwrap_or_default().trim());
            }
            joined = whole;
            line = &joined;
        }
        let failed =
            |problem: String| Defect::new(problem, format!("line {number}: \"{}\"", shown(line)));
        let mut words = line.split_ascii_whitespace();
        match words.next() {
            Some("v") => {
                let mut number = || words.next().and_then(|word| word.parse::<f64>().ok());
                let (Some(x), Some(y), Some(z)) = (number(), number(), number()) else {
                    return Err(failed("a vertex needs three numbers: v x y z".into()));
                };
                vertices += 1;
                // Writing to a string cannot fail; f64 texts read back to the same bits.
                let _ = writeln!(plain, "v {x:?} {y:?} {z:?}");
            }
            Some("f") => {
                plain.push('f');
                let mut corners = 0;
                for word in words {
                    let index = corner(word, vertices).map_err(failed)?;
                    let _ = write!(plain, " {index}");
                    corners += 1;
                }
                if corners < 3 {
                    let problem =
                        format!("a face needs at least 3 corners, this one has {corners}");
                    return Err(failed(problem));
                }
                plain.push('\n');
                faces.push(number);
            }
            _ => {}
        }
    }
    Ok((plain, faces))
}

/// The beginning of a line, for messages.
fn shown(line: &str) -> String {
    line.chars().take(60).collect()
}

/// The vertex, from 1, of a corner "vertex/texture/normal" that counts from 1, or from -1
/// backwards.
fn corner(word: &str, vertices: usize) -> Result<usize, String> {
    let bad =
        || format!("\"{}\" names no vertex: {vertices} are given before this line", shown(word));
    let index: i64 = word.split('/').next().unwrap_or_default().parse().map_err(|_| bad())?;
    let back = usize::try_from(index.unsigned_abs()).map_err(|_| bad())?;
    match index {
        1.. if back <= vertices => Ok(back),
        ..=-1 => vertices.checked_sub(back).map(|place| place + 1).ok_or_else(bad),
        _ => Err(bad()),
    }
}
