//! A scene file as a tree of values that know where they stand, the same for TOML and JSON,
//! so that one reader serves both and every error, early or late, can show its place.

use std::ops::Range;
use std::path::PathBuf;

use super::path::{self, Step};
use crate::{Error, Place};

/// Where a value came from.
#[derive(Debug, Clone)]
pub(super) enum Origin {
    /// Bytes of the text.
    Text(Range<usize>),
    /// Override, by index into [`Document::sets`].
    Set(usize),
    /// The text as a whole.
    Whole,
}

/// A value and where it came from.
#[derive(Debug, Clone)]
pub(super) struct TreeNode {
    pub(super) value: TreeValue,
    pub(super) origin: Origin,
}

/// A value, of TOML or JSON.
#[derive(Debug, Clone)]
pub(super) enum TreeValue {
    Text(String),
    Integer(i128),
    Float(f64),
    Bool(bool),
    List(Vec<TreeNode>),
    Table(Vec<TreeEntry>),
    /// Something that no key takes: a date, null, an integer past 128 bits.
    Other(&'static str),
}

/// A key of a table with its value.
#[derive(Debug, Clone)]
pub(super) struct TreeEntry {
    pub(super) key: String,
    pub(super) origin: Origin,
    pub(super) node: TreeNode,
}

/// A whole scene file with the overrides that were applied to it.
#[derive(Debug)]
pub(super) struct Document {
    pub(super) file: Option<PathBuf>,
    pub(super) text: String,
    pub(super) sets: Vec<String>,
    pub(super) root: TreeNode,
}

/// Longest part of a line that an excerpt shows: a JSON file may be one long line.
const EXCERPT: usize = 100;

impl Document {
    /// Line, column and excerpt of an origin.
    pub(super) fn place(&self, origin: &Origin) -> Place {
        let mut place = Place { file: self.file.clone(), ..Place::default() };
        match origin {
            Origin::Whole => {}
            Origin::Set(index) => {
                place.excerpt = self.sets.get(*index).map(|set| format!("  --set {set}"));
            }
            Origin::Text(span) => {
                let (line, column, excerpt) = excerpt(&self.text, span);
                place.line_column = Some((line, column));
                place.excerpt = Some(excerpt);
            }
        }
        place
    }

    /// Adds the place to an error that only knows its key: the key's own, or else that of the
    /// nearest table around it.
    pub(super) fn located(&self, error: Error) -> Error {
        match error {
            Error::Scene { place, key, found, allowed }
                if place.line_column.is_none() && place.excerpt.is_none() =>
            {
                let place = Box::new(self.place(&self.origin_of(&key)));
                Error::Scene { place, key, found, allowed }
            }
            other => other,
        }
    }

    fn origin_of(&self, key: &str) -> Origin {
        let mut node = &self.root;
        for step in path::parse(key).unwrap_or_default() {
            let next = match (&node.value, &step) {
                (TreeValue::Table(entries), Step::Key(key)) => entries
                    .iter()
                    .find(|entry| entry.key == *key)
                    // An aperture may stand in the file as its projection.
                    .or_else(|| {
                        let projected = format!("projected_{key}");
                        entries.iter().find(|entry| entry.key == projected)
                    })
                    .map(|entry| &entry.node),
                (TreeValue::List(items), Step::Index(index)) => items.get(*index),
                _ => None,
            };
            match next {
                Some(next) => node = next,
                None => break,
            }
        }
        node.origin.clone()
    }
}

/// Line and column of the start of a span, from 1, and the line with carets below the span.
pub(super) fn excerpt(text: &str, span: &Range<usize>) -> (usize, usize, String) {
    let floor = |at: usize| (0..=at.min(text.len())).rev().find(|at| text.is_char_boundary(*at));
    let start = floor(span.start).unwrap_or(0);
    let end = floor(span.end).unwrap_or(0).max(start);
    let line_start = text[..start].rfind('\n').map_or(0, |at| at + 1);
    let line_end = text[start..].find('\n').map_or(text.len(), |at| start + at);
    let number = text[..start].matches('\n').count() + 1;
    let before: Vec<char> = text[line_start..start].chars().collect();
    let column = before.len() + 1;

    let skipped = before.len().saturating_sub(EXCERPT / 2);
    let line = text[line_start..line_end].trim_end_matches('\r').chars();
    let shown: String = line.clone().skip(skipped).take(EXCERPT).collect();
    let left = if skipped > 0 { "..." } else { "" };
    let right = if line.count() > skipped + EXCERPT { "..." } else { "" };
    // Tabs are kept, so that the caret stands below its character whatever their width.
    let indent: String =
        before[skipped..].iter().map(|c| if *c == '\t' { '\t' } else { ' ' }).collect();
    let room = shown.chars().count().saturating_sub(before.len() - skipped);
    let width = text[start..end.min(line_end)].chars().count().min(room).max(1);
    let gutter = " ".repeat(number.to_string().len());
    let shift = " ".repeat(left.len());
    let carets = "^".repeat(width);
    let excerpt =
        format!("{gutter} |\n{number} | {left}{shown}{right}\n{gutter} | {shift}{indent}{carets}");
    (number, column, excerpt)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn caret_stands_below_the_span() {
        let (line, column, shown) = excerpt("a = 1\nbb = \"x\"\n", &(11..14));
        assert_eq!((line, column), (2, 6));
        assert_eq!(shown, "  |\n2 | bb = \"x\"\n  |      ^^^");
    }

    #[test]
    fn spans_past_the_end_or_inside_a_character_are_harmless() {
        for span in [0..0, 1..2, 5..900, 900..901] {
            excerpt("\u{b5}m \u{b5}", &span);
        }
    }

    #[test]
    fn long_lines_are_cut_around_the_span() {
        let text = "x".repeat(5000);
        let (_, column, shown) = excerpt(&text, &(4000..4003));
        assert_eq!(column, 4001);
        assert!(shown.len() < 350, "{shown}");
    }
}
