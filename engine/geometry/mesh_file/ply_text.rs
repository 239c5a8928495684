//! Vertices and faces of PLY files in text. Values that are passed over may be any words.

use ply_rs_bw::ply::{Header, PropertyType};

use super::ply_elements::{Face, Vertex, is_corners};
use super::words::Words;
use crate::surface::Defect;
use beamlet_core::printed;

/// Rows between two reports of how far reading is.
const REPORT: usize = 1 << 14;

/// Reads what follows the header, whose last line is the one before `line`. Every row of an element is a
/// line, except in texts of fewer lines than rows.
pub(super) fn payload(
    text: &str,
    line: usize,
    header: &Header,
    progress: impl Fn(usize),
) -> Result<(Vec<Vertex>, Vec<Face>), Defect> {
    let rows: usize = header.elements.iter().map(|(_, element)| element.count).sum();
    let lines = text.lines().filter(|line| !line.trim_ascii().is_empty()).count();
    let words = Words { rest: text, line };
    let mut rows = Rows { words, by_line: lines >= rows, begins: true };
    let (mut vertices, mut faces) = (Vec::new(), Vec::new());
    for (name, element) in &header.elements {
        for index in 0..element.count {
            rows.begins = true;
            let (mut vertex, mut corners) = ([f64::NAN; 3], Vec::new());
            for (property, definition) in &element.properties {
                match (&definition.data_type, axis(property)) {
                    (PropertyType::Scalar(_), Some(axis)) if name == "vertex" => {
                        vertex[axis] = rows.number(property)?;
                    }
                    (PropertyType::Scalar(_), _) => {
                        rows.word(property)?;
                    }
                    (PropertyType::List(..), _) => {
                        let count = rows.number::<usize>(property)?;
                        for _ in 0..count {
                            match name == "face" && is_corners(property) {
                                true => corners.push(rows.number(property)?),
                                false => {
                                    rows.word(property)?;
                                }
                            }
                        }
                    }
                }
            }
            match name.as_str() {
                "vertex" => vertices.push(Vertex(vertex.into())),
                "face" => faces.push(Face { corners }),
                _ => {}
            }
            if index % REPORT == 0 {
                progress(text.len() - rows.words.rest.len());
            }
        }
    }
    Ok((vertices, faces))
}

fn axis(property: &str) -> Option<usize> {
    ["x", "y", "z"].iter().position(|axis| *axis == property)
}

/// Rows of values.
struct Rows<'a> {
    words: Words<'a>,
    /// True if every row is a line.
    by_line: bool,
    /// True before the first value of a row.
    begins: bool,
}

impl<'a> Rows<'a> {
    /// The next value of the row.
    fn word(&mut self, property: &str) -> Result<&'a str, Defect> {
        let before = self.words.line;
        let word = self.words.next();
        let begins = std::mem::take(&mut self.begins);
        let is_in_row = !self.by_line || begins || self.words.line == before;
        match word.filter(|_| is_in_row) {
            Some(word) => Ok(word),
            None => Err(failed(before, &format!("no value of {}", printed::line(property)))),
        }
    }

    /// The next value of the row as a number.
    fn number<T: std::str::FromStr>(&mut self, property: &str) -> Result<T, Defect> {
        let word = self.word(property)?;
        word.parse().map_err(|_| {
            let word: String = word.chars().take(40).collect();
            let [word, property] = [&word, property].map(printed::line);
            failed(self.words.line, &format!("\"{word}\" is no value of {property}"))
        })
    }
}

fn failed(line: usize, problem: &str) -> Defect {
    Defect::new(format!("not a valid PLY file: {problem}"), format!("line {line}"))
}
