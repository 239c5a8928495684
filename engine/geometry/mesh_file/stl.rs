//! STL files, binary and ASCII.

use std::io::Read;
use std::path::Path;

use glam::DVec3;

use crate::geometry::surface::{Defect, Surface};
use crate::geometry::watch::Task;
use crate::input_file;

const HEADER: usize = 84;
const RECORD: usize = 50;
/// Triangles, or lines of text, between two reports of how far reading is.
const REPORT: usize = 1 << 14;

/// Reads an STL file. Three vertices per triangle, not yet welded.
pub(super) fn parse(bytes: &[u8], task: Task<'_>) -> Result<Surface, Defect> {
    // Many exporters begin a binary file with "solid" as well, so the length decides.
    let promised = count(bytes).map(|count| HEADER as u64 + RECORD as u64 * u64::from(count));
    if promised == Some(bytes.len() as u64) {
        return binary(&bytes[HEADER..], task);
    }
    // A name in some other encoding than UTF-8 is no reason to refuse a text file.
    let word = bytes.trim_ascii_start().get(..5).unwrap_or_default();
    if word.eq_ignore_ascii_case(b"solid") && !bytes.contains(&0) {
        return ascii(&String::from_utf8_lossy(bytes), task);
    }
    Err(match (count(bytes), promised) {
        (Some(count), Some(promised)) => Defect::new(
            format!(
                "a binary STL of {count} triangles has {promised} bytes, this file has {}",
                bytes.len()
            ),
            "truncated, or not an STL file",
        ),
        _ => Defect::new(
            format!("{} bytes are too few for an STL file", bytes.len()),
            "a binary one has at least 84 bytes, an ASCII one begins with \"solid\"",
        ),
    })
}

/// Triangles that a binary STL file has, from its first bytes and its length; `None` for other
/// files and for those that cannot be read.
pub(super) fn triangles_in(path: &Path) -> Option<u64> {
    let mut file = input_file::open(path).ok()?;
    let length = file.metadata().ok()?.len();
    let mut header = [0; HEADER];
    file.read_exact(&mut header).ok()?;
    let count = u64::from(count(&header)?);
    (HEADER as u64 + RECORD as u64 * count == length).then_some(count)
}

fn count(bytes: &[u8]) -> Option<u32> {
    let field = bytes.get(HEADER - 4..HEADER)?;
    Some(u32::from_le_bytes(field.try_into().ok()?))
}

fn binary(records: &[u8], task: Task<'_>) -> Result<Surface, Defect> {
    let triangles = records.len() / RECORD;
    let mut surface =
        Surface::new(Vec::with_capacity(3 * triangles), Vec::with_capacity(triangles));
    for (index, record) in records.chunks_exact(RECORD).enumerate() {
        if index % REPORT == 0 {
            task.reach((HEADER + RECORD * index) as u64);
        }
        let number = |at: usize| {
            let bytes = [record[at], record[at + 1], record[at + 2], record[at + 3]];
            f64::from(f32::from_le_bytes(bytes))
        };
        // The normal in the first 12 bytes is redundant and often wrong.
        let corners = [12, 24, 36].map(|at| DVec3::new(number(at), number(at + 4), number(at + 8)));
        surface.push_triangle(corners).map_err(|problem| {
            Defect::new(problem, format!("triangle {} of the file", index + 1))
        })?;
    }
    Ok(surface)
}

fn ascii(text: &str, task: Task<'_>) -> Result<Surface, Defect> {
    let mut surface = Surface::default();
    let mut corners: Vec<DVec3> = Vec::with_capacity(3);
    let (mut inside, mut last) = (false, 0);
    for (index, line) in text.lines().enumerate() {
        last = index + 1;
        if index % REPORT == 0 {
            task.reach((line.as_ptr() as usize - text.as_ptr() as usize) as u64);
        }
        let at = |problem: String| Defect::new(problem, format!("line {}", index + 1));
        let mut words = line.split_ascii_whitespace();
        let Some(word) = words.next() else { continue };
        if is(word, "vertex") {
            corners.push(vertex(words).ok_or_else(|| {
                at(format!("expected \"vertex x y z\", found \"{}\"", line.trim()))
            })?);
        } else if is(word, "endloop") {
            let found = corners.len();
            let triangle = <[DVec3; 3]>::try_from(std::mem::take(&mut corners))
                .map_err(|_| at(format!("a facet has {found} vertices, not 3")))?;
            surface.push_triangle(triangle).map_err(at)?;
        } else if is(word, "solid") {
            inside = true;
        } else if is(word, "endsolid") {
            inside = false;
        } else if !["facet", "outer", "endfacet"].iter().any(|known| is(word, known)) {
            return Err(at(format!("\"{word}\" is not part of an ASCII STL file")));
        }
    }
    if inside || !corners.is_empty() {
        return Err(Defect::new(
            "the file ends before \"endsolid\": truncated",
            format!("line {last}"),
        ));
    }
    Ok(surface)
}

fn vertex<'a>(mut words: impl Iterator<Item = &'a str>) -> Option<DVec3> {
    let mut number = || words.next()?.parse::<f64>().ok();
    let vertex = DVec3::new(number()?, number()?, number()?);
    words.next().is_none().then_some(vertex)
}

fn is(word: &str, keyword: &str) -> bool {
    word.eq_ignore_ascii_case(keyword)
}
