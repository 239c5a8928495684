//! Wavefront OBJ files: positions and faces. Everything else is ignored, material libraries
//! included.

use glam::DVec3;

use super::polygon;
use super::surface::{Defect, Surface};

/// Reads an OBJ file. All its objects and groups together; not yet welded.
pub(super) fn parse(bytes: &[u8]) -> Result<Surface, Defect> {
    // A name in some other encoding than UTF-8 is no reason to refuse a file.
    let text = String::from_utf8_lossy(bytes);
    let mut vertices = Vec::new();
    let mut surface = Surface::default();
    let mut lines = text.lines().zip(1_usize..);
    while let Some((line, number)) = lines.next() {
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
            Some("v") => vertices.push(
                position(words)
                    .ok_or_else(|| failed("a vertex needs three numbers: v x y z".into()))?,
            ),
            Some("f") => {
                let corners = words
                    .map(|word| corner(word, &vertices))
                    .collect::<Result<Vec<DVec3>, String>>()
                    .map_err(failed)?;
                if corners.len() < 3 {
                    return Err(failed(format!(
                        "a face needs at least 3 corners, this one has {}",
                        corners.len()
                    )));
                }
                for [a, b, c] in polygon::triangles(&corners) {
                    let triangle = [corners[a], corners[b], corners[c]];
                    surface.push_triangle(triangle).map_err(failed)?;
                }
            }
            _ => {}
        }
    }
    Ok(surface)
}

/// The beginning of a line, for messages.
fn shown(line: &str) -> String {
    line.chars().take(60).collect()
}

fn position<'a>(mut words: impl Iterator<Item = &'a str>) -> Option<DVec3> {
    let mut number = || words.next()?.parse::<f64>().ok();
    Some(DVec3::new(number()?, number()?, number()?))
}

/// The vertex of a corner "vertex/texture/normal", counted from 1, or from -1 backwards.
fn corner(word: &str, vertices: &[DVec3]) -> Result<DVec3, String> {
    let index = word.split('/').next().unwrap_or_default();
    let bad = || {
        let given = vertices.len();
        format!("\"{}\" names no vertex: {given} are given before this line", shown(word))
    };
    let place = match index.parse::<i64>() {
        Ok(index @ 1..) => usize::try_from(index - 1).map_err(|_| bad())?,
        Ok(index @ ..=-1) => usize::try_from(index.unsigned_abs())
            .ok()
            .and_then(|back| vertices.len().checked_sub(back))
            .ok_or_else(bad)?,
        _ => return Err(bad()),
    };
    vertices.get(place).copied().ok_or_else(bad)
}
