//! STL files, binary and ASCII. Attributes of triangles are passed over.

use std::io::Read;
use std::path::Path;

use glam::DVec3;

use super::file::MeshFile;
use super::stl_text;
use crate::surface::{Defect, Surface};
use beamlet_core::watch::Task;
use beamlet_core::{input_file, printed};

const HEADER: usize = 84;
const RECORD: usize = 50;
/// Bytes of a text that a message shows.
const WORDS: usize = 20;
/// Triangles between two reports of how far reading is.
const REPORT: usize = 1 << 14;

/// Reads an STL file. Three vertices per triangle, not yet welded.
pub(super) fn parse(bytes: &[u8], task: Task<'_>) -> Result<MeshFile, Defect> {
    // Many exporters begin a binary file with "solid" as well, so the length decides.
    let count = count(bytes);
    let promised = count.map(length_of);
    if promised == Some(bytes.len() as u64) {
        return binary(&bytes[HEADER..], None, task).map(MeshFile::of);
    }
    let text = super::plain(bytes)?;
    // Zeros at the end may be the count of a binary file that ends there.
    let has_header = bytes[..bytes.len().min(HEADER)].contains(&0);
    let is_text = !text.contains(&0) && !has_header;
    if let Some(solids) = stl_text::solids(&text).filter(|_| is_text) {
        let above = &text[..text.len() - solids.len()];
        let line = 1 + above.iter().filter(|byte| **byte == b'\n').count();
        // A name in some other encoding than UTF-8 is no reason to refuse a text file.
        let solids = String::from_utf8_lossy(solids);
        return stl_text::parse(&solids, line, task).map(MeshFile::of);
    }
    let is_printed = |byte: &u8| !byte.is_ascii_control() || byte.is_ascii_whitespace();
    if is_text && text.get(..HEADER).is_some_and(|head| head.iter().all(is_printed)) {
        let shown = String::from_utf8_lossy(&text[..WORDS]);
        let problem = format!("a text that begins with \"{}\"", printed::line(&shown));
        return Err(Defect::new(problem, "an ASCII STL file begins with \"solid\""));
    }
    match (count, promised) {
        (Some(count @ 1..), Some(promised)) if promised < bytes.len() as u64 => {
            longer(bytes, count, task)
        }
        (Some(count @ 1..), Some(promised)) => Err(Defect::new(
            format!(
                "a binary STL of {count} triangles has {promised} bytes, this file has {}",
                bytes.len()
            ),
            "truncated, or not an STL file",
        )),
        (Some(0), Some(_)) => Err(Defect::new(
            format!("a binary STL file of 0 triangles, with {} bytes", bytes.len()),
            "bytes 81 to 84 are the number of triangles",
        )),
        _ => Err(Defect::new(
            format!("{} bytes are too few for an STL file", bytes.len()),
            "a binary one has at least 84 bytes, an ASCII one begins with \"solid\"",
        )),
    }
}

/// A binary file with more bytes than its triangles have: attributes behind each triangle, of the length
/// that its last two bytes state, several solids one behind the other, or bytes behind the last triangle.
fn longer(bytes: &[u8], count: u32, task: Task<'_>) -> Result<MeshFile, Defect> {
    let records = &bytes[HEADER..];
    let mut starts = Vec::new();
    let mut at = 0;
    while let Some(record) = records.get(at..at + RECORD).filter(|_| starts.len() < count as usize)
    {
        starts.push(at);
        at += RECORD + usize::from(u16::from_le_bytes([record[48], record[49]]));
    }
    if starts.len() == count as usize && at == records.len() {
        return binary(records, Some(&starts), task).map(MeshFile::of);
    }
    if let Some(starts) = solids(bytes) {
        return binary(bytes, Some(&starts), task).map(MeshFile::of);
    }
    let length = RECORD * count as usize;
    let behind = records.len() - length;
    let surface = binary(&records[..length], None, task)?;
    let warning = format!("{behind} bytes behind the last triangle of the file are ignored");
    Ok(MeshFile { warnings: vec![warning], ..MeshFile::of(surface) })
}

/// Starts of the triangles of solids that fill the bytes one behind the other, each with its header; `None` where
/// the bytes do not end with a solid.
fn solids(bytes: &[u8]) -> Option<Vec<usize>> {
    let (mut starts, mut at) = (Vec::new(), 0);
    while at < bytes.len() {
        let triangles = count(&bytes[at..]).filter(|triangles| *triangles > 0)?;
        let end = at as u64 + length_of(triangles);
        if end > bytes.len() as u64 {
            return None;
        }
        starts.extend((0..triangles as usize).map(|index| at + HEADER + RECORD * index));
        at = usize::try_from(end).ok()?;
    }
    Some(starts)
}

/// Triangles that a binary STL file has, from its first bytes and its length, and whether they are all of
/// it; `None` for other files and for those that cannot be read.
pub(super) fn triangles_in(path: &Path) -> Option<(u64, bool)> {
    let mut file = input_file::open(path).ok()?;
    let length = file.metadata().ok()?.len();
    let mut header = [0; HEADER];
    file.read_exact(&mut header).ok()?;
    let count = count(&header)?;
    (length_of(count) <= length).then_some((count.into(), length_of(count) == length))
}

/// Bytes of a file of triangles alone.
fn length_of(triangles: u32) -> u64 {
    HEADER as u64 + RECORD as u64 * u64::from(triangles)
}

fn count(bytes: &[u8]) -> Option<u32> {
    let field = bytes.get(HEADER - 4..HEADER)?;
    Some(u32::from_le_bytes(field.try_into().ok()?))
}

/// Triangles of records behind one another, or at `starts`.
fn binary(records: &[u8], starts: Option<&[usize]>, task: Task<'_>) -> Result<Surface, Defect> {
    let triangles = starts.map_or(records.len() / RECORD, <[usize]>::len);
    let mut surface =
        Surface::new(Vec::with_capacity(3 * triangles), Vec::with_capacity(triangles));
    for index in 0..triangles {
        let start = starts.map_or(RECORD * index, |starts| starts[index]);
        let record = &records[start..start + RECORD];
        if index % REPORT == 0 {
            task.reach((HEADER + start) as u64);
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
