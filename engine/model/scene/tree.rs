//! A scene file as a tree of values with their places, the same for TOML and JSON, so that one reader
//! serves both and every error, early or late, can show its place.

use std::cell::RefCell;
use std::ops::Range;
use std::path::PathBuf;

use annotate_snippets::{AnnotationKind, Group, Level, Renderer, Snippet};

use super::path::{self, Step};
use beamlet_core::{Error, Place, Result};

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
    /// Placeholder of a missing or wrong value, which was reported: reading continues.
    Missing,
}

/// The node of a placeholder.
pub(super) static MISSING: TreeNode = TreeNode { value: TreeValue::Missing, origin: Origin::Whole };

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
    /// Directory that paths of the scene start from.
    pub(super) directory: PathBuf,
    pub(super) root: TreeNode,
    pub(super) faults: RefCell<Faults>,
}

/// Faults that reading found so far.
#[derive(Debug, Default)]
pub(super) struct Faults {
    errors: Vec<Error>,
    /// Tables whose values are in the model, each with the key that names it.
    tables: Vec<(String, PathBuf)>,
    /// Paths without a value of their own in the model: what follows from them is no error.
    paths: Vec<String>,
}

impl Faults {
    /// True if a key is one of these, or lies below or above one.
    fn concern(&self, key: &str) -> bool {
        self.paths.iter().any(|path| below(key, path) || below(path, key))
    }
}

/// True if a path is another one, or leads below it.
fn below(path: &str, other: &str) -> bool {
    let rest = path.strip_prefix(other);
    rest.is_some_and(|rest| rest.is_empty() || rest.starts_with(['.', '[']))
}

/// Width of an excerpt in characters: a JSON file may be one long line.
const EXCERPT: usize = 100;
/// Bytes of a line that are drawn from, of a span and on either side of it: many times that width.
const AROUND: usize = 2000;

impl Document {
    /// A document without faults.
    pub(super) fn new(file: Option<PathBuf>, text: String, root: TreeNode) -> Self {
        let directory = PathBuf::from(".");
        Self { file, text, sets: Vec::new(), directory, root, faults: RefCell::default() }
    }

    /// Keeps an error, unless it follows from one before it.
    pub(super) fn report(&self, error: Error) {
        let mut faults = self.faults.borrow_mut();
        if let Error::Scene { key, .. } = &error {
            // Also faults of a table as a whole while one of its keys is faulty.
            if faults.concern(key) {
                return;
            }
            faults.paths.push(key.clone());
        }
        faults.errors.push(error);
    }

    /// Notes a table whose values were read, with the key that names it.
    pub(super) fn note_table(&self, key: String, path: PathBuf) {
        self.faults.borrow_mut().tables.push((key, path));
    }

    /// Tables whose values were read, each with the key that names it.
    pub(super) fn tables(&self) -> Vec<(String, PathBuf)> {
        self.faults.borrow().tables.clone()
    }

    /// Marks a key whose value is not known, for a reason that was reported.
    pub(super) fn forget(&self, path: String) {
        self.faults.borrow_mut().paths.push(path);
    }

    /// True if the value of a key is not known.
    pub(super) fn is_forgotten(&self, path: &str) -> bool {
        self.faults.borrow().paths.iter().any(|known| known == path)
    }

    /// True if an error was reported.
    pub(super) fn has_errors(&self) -> bool {
        !self.faults.borrow().errors.is_empty()
    }

    /// Keeps the value, or the error.
    pub(super) fn keep<T>(&self, result: Result<T>) -> Option<T> {
        result.map_err(|error| self.report(error)).ok()
    }

    /// All errors of reading and these of the values that were read, but for those that only
    /// follow from others, in the order of the text.
    pub(super) fn all_errors(&self, of_values: Vec<Error>) -> Vec<Error> {
        let faults = self.faults.take();
        let follows = |error: &Error| match error {
            Error::Scene { key, found, allowed, .. } if !faults.paths.is_empty() => {
                faults.concern(key) || found.contains("NaN") || allowed.contains("NaN")
            }
            _ => false,
        };
        let of_values = of_values.into_iter().filter(|error| !follows(error));
        let mut errors: Vec<Error> = of_values.map(|error| self.located(error)).collect();
        errors.extend(faults.errors);
        let line = |error: &Error| match error {
            Error::Scene { place, .. } => place.line_column,
            _ => None,
        };
        errors.sort_by_key(line);
        errors
    }

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

    /// Adds the place to an error that only knows its key: the key's own place, or the place of the
    /// nearest table around it.
    pub(super) fn located(&self, error: Error) -> Error {
        match error {
            Error::Scene { place, key, found, allowed }
                if place.line_column.is_none() && place.excerpt.is_none() =>
            {
                let place = Box::new(self.place(&self.origin_of(&key)));
                Error::Scene { place, key, found, allowed }
            }
            Error::Several(errors) => {
                Error::Several(errors.into_iter().map(|error| self.located(error)).collect())
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
                    // The file may give an aperture as its projection.
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

/// The last place up to `at` that is between characters.
fn floor_of(text: &str, at: usize) -> usize {
    (0..=at.min(text.len())).rev().find(|at| text.is_char_boundary(*at)).unwrap_or(0)
}

/// Line and column of the start of a span, from 1, and the line with carets below the span.
pub(super) fn excerpt(text: &str, span: &Range<usize>) -> (usize, usize, String) {
    let start = floor_of(text, span.start);
    let end = floor_of(text, span.end).max(start);
    let line_start = text[..start].rfind('\n').map_or(0, |at| at + 1);
    let line_end = text[start..].find('\n').map_or(text.len(), |at| start + at);
    let number = text[..start].matches('\n').count() + 1;
    let column = text[line_start..start].chars().count() + 1;
    let line = text[line_start..line_end].trim_end_matches('\r');
    let [from, to] = [start, end].map(|at| (at - line_start).min(line.len()));
    // Only the beginning of a long span is drawn; drawing all of it takes many times the memory of the
    // text.
    let first = floor_of(line, from.saturating_sub(AROUND));
    let to = floor_of(line, to.min(from + AROUND));
    let line = &line[first..floor_of(line, to.saturating_add(AROUND))];
    let [from, to] = [from, to].map(|at| at - first);
    let marked = AnnotationKind::Primary.span(from..to);
    let snippet = Snippet::source(line).line_start(number).annotation(marked);
    let group = Group::with_level(Level::ERROR).element(snippet);
    (number, column, Renderer::plain().term_width(EXCERPT).render(&[group]))
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
    fn carets_stand_below_wide_characters_and_behind_tabs_and_nothing_controls_the_terminal() {
        let (_, column, shown) =
            excerpt("\tb = \"\u{65e5}\u{672c}\" # \u{1b}[31m\u{202e}", &(5..13));
        assert_eq!(column, 6);
        let lines: Vec<&str> = shown.lines().collect();
        // Two columns for each wide character.
        assert_eq!(lines[2], "  |         ^^^^^^");
        assert!(lines[1].starts_with("1 |     b = \"\u{65e5}"), "{shown}");
        assert!(!shown.contains(['\t', '\u{1b}', '\u{202e}']), "{shown}");
    }

    #[test]
    fn long_lines_are_cut_around_the_span() {
        let text = "x".repeat(5000);
        let (_, column, shown) = excerpt(&text, &(4000..4003));
        assert_eq!(column, 4001);
        assert!(shown.len() < 350, "{shown}");
        // The span itself is long, and so are its characters.
        let text = format!("title = '{}' # end", "\u{e4}".repeat(100_000));
        let (_, column, shown) = excerpt(&text, &(8..200_010));
        assert_eq!(column, 9);
        assert!(shown.len() < 700 && shown.contains("= '\u{e4}\u{e4}"), "{shown}");
    }
}
