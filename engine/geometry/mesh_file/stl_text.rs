//! STL files in text. Words are separated by blanks and line ends alike; the name of a solid goes to the end
//! of its line, or to the first facet on it.

use glam::DVec3;

use super::words::Words;
use crate::surface::{Defect, Surface};
use beamlet_core::watch::Task;

/// Triangles between two reports of how far reading is.
const REPORT: usize = 1 << 14;
/// Beginnings of comments that some programs write above the first solid.
const COMMENTS: [&[u8]; 3] = [b"#", b"//", b";"];

/// The text from its first solid on, without comments and blanks above it; `None` for other bytes.
pub(super) fn solids(text: &[u8]) -> Option<&[u8]> {
    let mut rest = text.trim_ascii_start();
    while COMMENTS.iter().any(|sign| rest.starts_with(sign)) {
        let end = rest.iter().position(|byte| *byte == b'\n')?;
        rest = rest[end..].trim_ascii_start();
    }
    rest.get(..5).is_some_and(|word| word.eq_ignore_ascii_case(b"solid")).then_some(rest)
}

/// The triangles of the solids in a text, whose first line has this number.
pub(super) fn parse(text: &str, line: usize, task: Task<'_>) -> Result<Surface, Defect> {
    let mut words = Words { rest: text, line };
    let mut surface = Surface::default();
    let mut corners: Vec<DVec3> = Vec::with_capacity(3);
    let mut inside = false;
    while let Some(word) = words.next() {
        let at = |problem: String| Defect::new(problem, format!("line {}", words.line));
        if is(word, "vertex") {
            let [x, y, z] = words.numbers(word)?;
            corners.push(DVec3::new(x, y, z));
        } else if is(word, "endloop") {
            let found = corners.len();
            let triangle = <[DVec3; 3]>::try_from(std::mem::take(&mut corners))
                .map_err(|_| at(format!("a facet has {found} vertices, not 3")))?;
            surface.push_triangle(triangle).map_err(at)?;
            if surface.triangles.len() % REPORT == 0 {
                task.reach((text.len() - words.rest.len()) as u64);
            }
        } else if is(word, "facet") {
            // The normal is redundant and often wrong.
            words.skip_until(|ahead| {
                ahead.starts_with(&["outer"]) || ahead.starts_with(&["vertex"])
            });
        } else if is(word, "solid") {
            inside = true;
            words.skip_until(|ahead| {
                ahead.starts_with(&["facet", "normal"]) || ahead.starts_with(&["endsolid"])
            });
        } else if is(word, "endsolid") {
            inside = false;
            words.skip_until(|ahead| ahead.starts_with(&["solid"]) && ahead.has_facet());
        } else if !["outer", "loop", "endfacet"].iter().any(|known| is(word, known)) {
            return Err(at(format!("\"{word}\" is not part of an ASCII STL file")));
        }
    }
    if inside || !corners.is_empty() {
        let place = format!("line {}", words.line);
        return Err(Defect::new("the file ends before \"endsolid\": truncated", place));
    }
    Ok(surface)
}

impl Words<'_> {
    /// True if these words follow.
    fn starts_with(mut self, words: &[&str]) -> bool {
        words.iter().all(|wanted| self.next().is_some_and(|word| is(word, wanted)))
    }

    /// True if a facet follows on the same line.
    fn has_facet(mut self) -> bool {
        let line = self.line;
        while let Some(word) = self.next().filter(|_| self.line == line) {
            if is(word, "facet") {
                return true;
            }
        }
        false
    }

    /// Passes over words on the line of the last one, up to the place where `is_end` holds.
    fn skip_until(&mut self, is_end: impl Fn(Self) -> bool) {
        let mut ahead = *self;
        while !is_end(ahead) && ahead.next().is_some() && ahead.line == self.line {
            *self = ahead;
        }
    }

    /// The coordinates behind `word`, the keyword of a vertex.
    fn numbers(&mut self, word: &str) -> Result<[f64; 3], Defect> {
        let (line, before) = (self.line, *self);
        let mut number = || self.next().and_then(|word| word.parse::<f64>().ok());
        let found = [number(), number(), number()];
        let is_end = {
            let mut behind = *self;
            let next = behind.next();
            behind.line > self.line
                || next.is_none_or(|word| KEYWORDS.iter().any(|it| is(word, it)))
        };
        if let ([Some(x), Some(y), Some(z)], true) = (found, is_end) {
            return Ok([x, y, z]);
        }
        let line_end = before.rest.find('\n').unwrap_or(before.rest.len());
        let shown: Vec<&str> = before.rest[..line_end].split_ascii_whitespace().take(4).collect();
        let problem = format!("expected \"vertex x y z\", found \"{word} {}\"", shown.join(" "));
        Err(Defect::new(problem, format!("line {line}")))
    }
}

/// Words that may follow a vertex.
const KEYWORDS: [&str; 2] = ["vertex", "endloop"];

fn is(word: &str, keyword: &str) -> bool {
    word.eq_ignore_ascii_case(keyword)
}
