//! Wavefront OBJ files: positions, faces, and the names of objects, groups and materials. Free-form
//! surfaces get a warning, and other files that one calls are refused. Everything else is ignored,
//! material libraries and colours of vertices included.
//!
//! `tobj` reads them, after a first look that names the line of whatever is wrong and leaves
//! texture and normal indices out: `tobj` reports no lines, and overflows on some indices.

use super::file::MeshFile;
use super::names::{Label, Names};
use crate::polygon;
use crate::surface::{Defect, Surface};
use beamlet_core::numbers;
use beamlet_core::watch::Task;
use glam::DVec3;
use rayon::prelude::*;
use std::collections::HashMap;
use std::fmt::Write as _;
use std::ops::Range;
use std::path::Path;

/// Most corners of a face: the time to cut one grows faster than its line.
const CORNERS: usize = 1_000_000;
/// Corners of a face whose cutting is worth a task of its own.
const LARGE: usize = 1000;
/// Lines, or faces, between two reports of how far reading is.
const REPORT: usize = 1 << 14;
/// Words of lines that are free-form surfaces, the last three in old files.
const SURFACES: [&str; 4] = ["surf", "bzp", "bsp", "cdp"];
/// Words of lines that name what follows.
const NAMING: [&str; 3] = ["o", "g", "usemtl"];
/// Share of the first look in the time to read a file; then `tobj`, then the cutting of faces.
const FIRST_LOOK: f64 = 0.4;
const PARSED: f64 = 0.7;

/// Reads an OBJ file.
pub(super) fn parse(bytes: &[u8], task: Task<'_>) -> Result<MeshFile, Defect> {
    // A name in some other encoding than UTF-8 is no reason to refuse a file.
    let plain = super::plain(bytes)?;
    let text = String::from_utf8_lossy(&plain);
    let share = |share: f64| {
        task.reach(numbers::whole::<u64>(share * bytes.len() as f64));
    };
    let Vetted { plain, faces, mut names, surfaces } =
        vetted(&text, |done| share(FIRST_LOOK * done))?;
    if faces.is_empty() && surfaces > 0 {
        let problem =
            format!("it has free-form surfaces ({surfaces}) and no faces; export it with faces");
        return Err(Defect::new(problem, ""));
    }
    share(FIRST_LOOK);
    let options = tobj::LoadOptions { triangulate: false, ..tobj::LoadOptions::default() };
    let no_materials = |_: &Path| Err(tobj::LoadError::GenericFailure);
    let (models, _) = tobj::load_obj_buf(&mut plain.as_bytes(), &options, no_materials)
        .map_err(|error| Defect::new(format!("not a valid OBJ file: {error}"), String::new()))?;
    let mut surface = Surface::default();
    let (count, mut faces) = (faces.len() as f64, faces.into_iter());
    for mesh in models.into_iter().map(|model| model.mesh) {
        let mut large = cut_large(&mesh);
        for face in faces_of(&mesh) {
            if faces.len() % REPORT == 0 {
                share(1.0 - (1.0 - PARSED) * faces.len() as f64 / count);
            }
            let Face { line, label } = faces.next().unwrap_or_default();
            let corners = corners_of(&mesh, face.clone());
            let failed = |problem| Defect::new(problem, format!("line {line}"));
            let triangles = large.remove(&face.start);
            let triangles = triangles.unwrap_or_else(|| polygon::triangles(&corners));
            for [a, b, c] in triangles.map_err(failed)? {
                surface.push_triangle([corners[a], corners[b], corners[c]]).map_err(failed)?;
                names.push(label);
            }
        }
    }
    let unread = || {
        format!("free-form surfaces of the file ({surfaces}) are not read: export them as faces")
    };
    let warnings = (surfaces > 0).then(unread).into_iter().collect();
    Ok(MeshFile { surface, names, warnings, ..MeshFile::default() })
}

/// Index ranges of the faces.
fn faces_of(mesh: &tobj::Mesh) -> impl Iterator<Item = Range<usize>> {
    let mut start = 0;
    // Without arities every face is a triangle.
    let mut arities = mesh.face_arities.iter();
    std::iter::from_fn(move || {
        let face = start..start + arities.next().map_or(3, |n| *n as usize);
        start = face.end;
        (face.start < mesh.indices.len()).then_some(face)
    })
}

fn corners_of(mesh: &tobj::Mesh, face: Range<usize>) -> Vec<DVec3> {
    let position = |index: &u32| DVec3::from_slice(&mesh.positions[3 * *index as usize..]);
    mesh.indices[face].iter().map(position).collect()
}

/// Triangles of the large faces, by the place of their indices: both caps of a part at a time.
fn cut_large(mesh: &tobj::Mesh) -> HashMap<usize, Result<Vec<[usize; 3]>, String>> {
    let large: Vec<Range<usize>> = faces_of(mesh).filter(|face| face.len() >= LARGE).collect();
    let cut = |face: &Range<usize>| polygon::triangles(&corners_of(mesh, face.clone()));
    large.par_iter().map(|face| (face.start, cut(face))).collect()
}

/// Result of the first look at a file.
#[derive(Default)]
struct Vetted {
    /// Positions, then faces with position indices alone.
    plain: String,
    faces: Vec<Face>,
    names: Names,
    /// Number of free-form surfaces.
    surfaces: usize,
}

/// Position of a face, and the number of its label.
#[derive(Default)]
struct Face {
    line: usize,
    label: u32,
}

/// The first look. `progress` gets the share that is done.
fn vetted(text: &str, progress: impl Fn(f64)) -> Result<Vetted, Defect> {
    let mut vetted = Vetted { plain: String::with_capacity(text.len()), ..Vetted::default() };
    let mut label = Label::default();
    // Of the label, once a face has it.
    let mut label_number = None;
    let mut vertices = 0;
    let mut faces = String::with_capacity(text.len() / 2);
    // Largest index of a vertex, and the defect where there is no such vertex.
    let mut highest = (0, Defect::new("", ""));
    let mut lines = text.lines().zip(1_usize..);
    while let Some((line, number)) = lines.next() {
        if number % REPORT == 0 {
            progress((line.as_ptr() as usize - text.as_ptr() as usize) as f64 / text.len() as f64);
        }
        let joined;
        let mut line = without_comment(line);
        if line.ends_with('\\') {
            let mut whole = line.to_owned();
            while whole.ends_with('\\') {
                whole.pop();
                whole.push(' ');
                let next = lines.next().map_or("", |(line, _)| line);
                whole.push_str(match names_follow(&whole) {
                    true => next.trim(),
                    false => without_comment(next),
                });
            }
            joined = whole;
            line = &joined;
        }
        let failed =
            |problem: String| Defect::new(problem, format!("line {number}: \"{}\"", shown(line)));
        let mut words = line.split_ascii_whitespace();
        match words.next() {
            Some("v") => {
                let [x, y, z] = position(words).map_err(failed)?;
                vertices += 1;
                // Writing to a string cannot fail; f64 texts read back to the same bits.
                let _ = writeln!(vetted.plain, "v {x:?} {y:?} {z:?}");
            }
            // Old files have "fo".
            Some("f" | "fo") => {
                let index = face(words, vertices, &mut faces).map_err(failed)?;
                if index > highest.0 {
                    highest = (index, failed(format!("\"{index}\" is not a vertex")));
                }
                let names = &mut vetted.names;
                let label = *label_number.get_or_insert_with(|| names.number(&label));
                vetted.faces.push(Face { line: number, label });
            }
            Some(word) if is_name(word, line, &mut label) => label_number = None,
            Some(word) if SURFACES.contains(&word) => vetted.surfaces += 1,
            Some(word @ ("call" | "csh")) => {
                let problem = format!("\"{word}\" takes content from elsewhere; allowed: one file");
                return Err(failed(problem));
            }
            _ => {}
        }
    }
    let (index, defect) = highest;
    if index > vertices {
        let problem = format!("{}: the file has {vertices}", defect.problem);
        return Err(Defect { problem, ..defect });
    }
    vetted.plain.push_str(&faces);
    Ok(vetted)
}

/// A line without blanks around it and without its comment. Names hold any letters, also #.
fn without_comment(line: &str) -> &str {
    let line = line.trim();
    if names_follow(line) {
        return line;
    }
    line.split('#').next().unwrap_or_default().trim_end()
}

/// Checks whether a line, its blanks taken off, names what follows.
fn names_follow(line: &str) -> bool {
    let word = line.split_ascii_whitespace().next();
    word.is_some_and(|word| NAMING.contains(&word))
}

/// Position of a vertex: `x y z`, and behind it a weight of 1 or a colour.
fn position<'a>(mut words: impl Iterator<Item = &'a str>) -> Result<[f64; 3], String> {
    let mut number = || words.next().and_then(|word| word.parse::<f64>().ok());
    let (Some(x), Some(y), Some(z)) = (number(), number(), number()) else {
        return Err("a vertex needs three numbers: v x y z".into());
    };
    // A colour has three numbers or more (r g b, r g b a), a weight is one.
    if let (Some(weight), None) = (words.next(), words.next())
        && weight.parse() != Ok(1.0)
    {
        return Err(format!(
            "a vertex has the weight w = {}; allowed: v x y z, or v x y z 1.0",
            shown(weight)
        ));
    }
    Ok([x, y, z])
}

/// Adds a face of these corners to the text; returns the largest index of a vertex.
fn face<'a>(
    words: impl Iterator<Item = &'a str>,
    vertices: usize,
    plain: &mut String,
) -> Result<usize, String> {
    plain.push('f');
    let (mut corners, mut largest) = (0, 0);
    for word in words {
        let index = corner(word, vertices)?;
        largest = largest.max(index);
        let _ = write!(plain, " {index}");
        corners += 1;
        if corners > CORNERS {
            return Err(format!("a face has more than {CORNERS} corners; cut it into several"));
        }
    }
    if corners < 3 {
        return Err(format!("a face needs at least 3 corners, this one has {corners}"));
    }
    plain.push('\n');
    Ok(largest)
}

/// True if a line names what follows; takes the name.
fn is_name(word: &str, line: &str, label: &mut Label) -> bool {
    // Lines may begin with blanks.
    let name = line.split_once(word).map_or("", |(_, rest)| rest).trim();
    let named = || (!name.is_empty()).then(|| name.to_owned());
    match word {
        "o" => label.objects = named().into_iter().collect(),
        // Several words are several groups; some programs write one name of several words.
        "g" => {
            label.groups = named().into_iter().collect();
            if name.contains(|c: char| c.is_ascii_whitespace()) {
                label.groups.extend(name.split_ascii_whitespace().map(str::to_owned));
            }
        }
        "usemtl" => label.material = named(),
        _ => return false,
    }
    true
}

/// The beginning of a line, for messages.
fn shown(line: &str) -> String {
    line.chars().take(60).collect()
}

/// The vertex, from 1, of a corner "vertex/texture/normal" that counts all vertices of the file from 1, or
/// those before the line backwards from -1.
fn corner(word: &str, vertices: usize) -> Result<usize, String> {
    let bad =
        || format!("\"{}\" is not a vertex: {vertices} are given before this line", shown(word));
    let index: i64 = word.split('/').next().unwrap_or_default().parse().map_err(|_| bad())?;
    let back = usize::try_from(index.unsigned_abs()).map_err(|_| bad())?;
    match index {
        1.. => Ok(back),
        ..=-1 => vertices.checked_sub(back).map(|place| place + 1).ok_or_else(bad),
        _ => Err(bad()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_found_behind_blanks_and_may_hold_any_letters() {
        for (word, line, wanted) in [
            ("g", "g body", "body"),
            ("g", "  \tg body", "body"),
            ("o", " o \u{e9}t\u{e9}", "\u{e9}t\u{e9}"),
            ("g", "\u{2003}g x", "x"),
        ] {
            let mut label = Label::default();
            is_name(word, line, &mut label);
            let found = label.objects.iter().chain(&label.groups).next();
            assert_eq!(found.map_or("", String::as_str), wanted, "{line:?}");
        }
    }
}
