//! PLY files, binary and text: vertices and faces. Other elements and properties are passed over.
//!
//! `ply-rs-bw` reads them (the rows of text: `ply_text`), after a look at the header that holds its counts to the length of the
//! file: elements without properties take no bytes, and would come without end.

use std::borrow::Cow;
use std::io::{Cursor, Read};
use std::path::Path;

use ply_rs_bw::parser::{ParseError, Parser, Reader};
use ply_rs_bw::ply::{Encoding, Header, PropertyType, ScalarType};

use super::ply_elements::{CORNERS, Face, Other, Vertex};
use super::ply_text;
use crate::polygon;
use crate::surface::{Defect, Surface};
use beamlet_core::watch::Task;
use beamlet_core::{input_file, numbers, printed};

/// Peak bytes per byte of a file while it is read: a triangle is a line of eight characters, or 13
/// bytes, and is held as a list, and as three corners.
pub(super) const PEAK_PER_BYTE: u64 = 24;
/// Faces between two reports of how far reading is.
const REPORT: usize = 1 << 14;
/// Share of the time that reading takes; the rest goes to the cutting of faces.
const PARSED: f64 = 0.7;
/// Most bytes of a header that is looked for in a file.
const HEADER: usize = 1 << 16;

/// Reads a PLY file. Not yet welded.
pub(super) fn parse(bytes: &[u8], task: Task<'_>) -> Result<Surface, Defect> {
    let bytes = &*plain(bytes)?;
    let mut reader = Reader::new(Cursor::new(bytes));
    let header = Parser::<Other>::new().read_header(&mut reader).map_err(failed)?;
    vet(&header, (bytes.len() as u64).saturating_sub(reader.get_ref().position()))?;
    let (mut vertices, mut faces) = (Vec::<Vertex>::new(), Vec::<Face>::new());
    let reach = |bytes: u64| {
        task.reach(numbers::whole(PARSED * bytes as f64));
    };
    if header.encoding == Encoding::Ascii {
        let (head, body) = bytes.split_at(numbers::length(reader.get_ref().position()));
        let line = 1 + head.iter().filter(|byte| **byte == b'\n').count();
        let progress = |read: usize| reach((head.len() + read) as u64);
        (vertices, faces) =
            ply_text::payload(&String::from_utf8_lossy(body), line, &header, progress)?;
    }
    let binary = header.elements.iter().filter(|_| header.encoding != Encoding::Ascii);
    for (name, element) in binary {
        match name.as_str() {
            "vertex" => {
                vertices = Parser::new()
                    .read_payload_for_element(&mut reader, element, &header)
                    .map_err(failed)?;
            }
            "face" => {
                faces = Parser::new()
                    .read_payload_for_element(&mut reader, element, &header)
                    .map_err(failed)?;
            }
            _ => {
                Parser::<Other>::new()
                    .read_payload_for_element(&mut reader, element, &header)
                    .map_err(failed)?;
            }
        }
        reach(reader.get_ref().position());
    }
    surface(&vertices, &faces, |share| {
        let share = (PARSED + (1.0 - PARSED) * share) * bytes.len() as f64;
        task.reach(numbers::whole(share));
    })
}

fn surface(vertices: &[Vertex], faces: &[Face], progress: impl Fn(f64)) -> Result<Surface, Defect> {
    let mut surface = Surface::default();
    let mut corners = Vec::new();
    for (index, Face { corners: numbers }) in faces.iter().enumerate() {
        if index % REPORT == 0 {
            progress(index as f64 / faces.len() as f64);
        }
        let failed = |problem| Defect::new(problem, format!("face {} of the file", index + 1));
        corners.clear();
        for number in numbers {
            let vertex = usize::try_from(*number).ok().and_then(|number| vertices.get(number));
            let Some(Vertex(vertex)) = vertex else {
                let there = vertices.len();
                return Err(failed(format!(
                    "{number} is not a vertex: there are {there}, counted from 0"
                )));
            };
            corners.push(*vertex);
        }
        if corners.len() < 3 {
            let found = corners.len();
            return Err(failed(format!("a face needs at least 3 corners, this one has {found}")));
        }
        for [a, b, c] in polygon::triangles(&corners).map_err(failed)? {
            surface.push_triangle([corners[a], corners[b], corners[c]]).map_err(failed)?;
        }
    }
    Ok(surface)
}

/// Checks that a header has the needed elements, and that its counts fit the bytes that follow.
fn vet(header: &Header, mut left: u64) -> Result<(), Defect> {
    let has = |element: &str, property: &str| {
        let element = header.elements.get(element);
        element.and_then(|it| it.properties.get(property)).map(|it| &it.data_type)
    };
    for axis in ["x", "y", "z"] {
        if !matches!(has("vertex", axis), Some(PropertyType::Scalar(_))) {
            let problem = format!("vertices have no coordinate {axis}");
            return Err(Defect::new(problem, "header: \"element vertex\" needs x, y and z"));
        }
    }
    if !CORNERS.iter().any(|name| matches!(has("face", name), Some(PropertyType::List(..)))) {
        let problem = match header.elements.contains_key("tristrips") {
            true => "it holds strips of triangles and no faces; write it with faces",
            false => "it has no faces: a cloud of points has no surface",
        };
        let place = "header: \"element face\" needs a list vertex_indices";
        return Err(Defect::new(problem, place));
    }
    if header.encoding == Encoding::Ascii {
        // The last line may lack its end.
        left += 1;
    }
    for (name, element) in &header.elements {
        let least =
            element.properties.iter().map(|(_, it)| least_bytes(&header.encoding, &it.data_type));
        let needed = (element.count as u64).saturating_mul(least.sum::<u64>().max(1));
        match left.checked_sub(needed) {
            Some(rest) => left = rest,
            None => {
                let (name, count) = (printed::line(name), element.count);
                return Err(Defect::new(
                    format!(
                        "{count} of the element \"{name}\" need {needed} bytes or more, and {left} \
                         are left"
                    ),
                    "truncated, or its header is wrong",
                ));
            }
        }
    }
    Ok(())
}

fn least_bytes(encoding: &Encoding, kind: &PropertyType) -> u64 {
    match (encoding, kind) {
        // A digit, and what parts it from the next.
        (Encoding::Ascii, _) => 2,
        (_, PropertyType::Scalar(scalar) | PropertyType::List(scalar, _)) => match scalar {
            ScalarType::Char | ScalarType::UChar => 1,
            ScalarType::Short | ScalarType::UShort => 2,
            ScalarType::Int | ScalarType::UInt | ScalarType::Float => 4,
            ScalarType::Double => 8,
        },
    }
}

/// The error of the library, whose further lines repeat the input.
fn failed(error: ParseError) -> Defect {
    let text = error.to_string();
    // The line is reported as the place.
    let text = match text.split_once(": ") {
        Some((line, rest)) if line.starts_with("Line ") => rest,
        _ => &text,
    };
    let mut lines = text.lines().map(|line| printed::line(line.trim()));
    let first = lines.next().unwrap_or_default();
    let inner = lines.next_back().filter(|line| line.starts_with("Error: "));
    let problem =
        inner.map_or(first.clone(), |inner| format!("{first} {}", &inner["Error: ".len()..]));
    let problem: String = problem.chars().take(200).collect();
    let place = error.line().map(|line| format!("line {line}")).unwrap_or_default();
    Defect::new(format!("not a valid PLY file: {problem}"), place)
}

/// A file without a byte order mark, with line feeds in place of carriage returns (in text, and in the
/// header of a binary file whose first line ends with one), and with a header of ASCII: comments have any
/// encoding.
fn plain(bytes: &[u8]) -> Result<Cow<'_, [u8]>, Defect> {
    let bytes = input_file::without_mark(bytes);
    let end = b"end_header";
    let head = &bytes[..bytes.len().min(HEADER)];
    let end = head.windows(end.len()).position(|part| part == end).map(|at| at + end.len() + 1);
    let Some(end) = end.filter(|end| *end <= bytes.len()) else { return super::plain(bytes) };
    let is_text = bytes[..end].windows(12).any(|part| part == b"format ascii");
    let mut plain = if is_text { super::plain(bytes)? } else { Cow::Borrowed(bytes) };
    let end = end.min(plain.len());
    let is_old = !is_text && bytes.starts_with(b"ply\r") && bytes.get(4) != Some(&b'\n');
    if is_old || !plain[..end].is_ascii() {
        for byte in &mut plain.to_mut()[..end] {
            match *byte {
                b'\r' if is_old => *byte = b'\n',
                0x80.. => *byte = b'?',
                _ => {}
            }
        }
    }
    Ok(plain)
}

/// The header of a file that begins with one.
fn header_of(path: &Path) -> Option<Header> {
    let file = input_file::open(path).ok()?;
    let mut bytes = Vec::new();
    file.take(HEADER as u64).read_to_end(&mut bytes).ok()?;
    let bytes = plain(&bytes).ok()?;
    // Other files may have no line end at all.
    bytes.starts_with(b"ply").then_some(())?;
    Parser::<Other>::new().read_header(&mut Reader::new(Cursor::new(&*bytes))).ok()
}

/// Faces that a PLY file counts, and may hold by its length.
pub(super) fn faces_in(path: &Path) -> Option<u64> {
    let header = header_of(path)?;
    vet(&header, path.metadata().ok()?.len()).ok()?;
    Some(header.elements.get("face")?.count as u64)
}

/// True if a file is a binary PLY file.
pub(super) fn is_binary(path: &Path) -> bool {
    header_of(path).is_some_and(|header| header.encoding != Encoding::Ascii)
}
