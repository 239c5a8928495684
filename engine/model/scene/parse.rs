//! TOML and JSON text into the tree of [`super::tree`].

use std::borrow::Cow;
use std::path::PathBuf;

use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::tree::{Document, Origin, TreeEntry, TreeNode, TreeValue, excerpt};
use beamlet_core::units::plain_minus;
use beamlet_core::{Error, Place, Result};

/// What helps paths of Windows in TOML.
const BACKSLASH: &str =
    "; in double quotes a backslash begins an escape: in paths write / or single quotes";

fn syntax(
    file: Option<PathBuf>,
    text: &str,
    at: std::ops::Range<usize>,
    problem: &str,
    language: &str,
) -> Error {
    let (line, column, excerpt) = excerpt(text, &at);
    let has_minus = text.lines().nth(line - 1).is_some_and(|line| line.contains('\u{2212}'));
    let minus = if has_minus { "; the minus sign U+2212 is not -" } else { "" };
    let has_backslash = language == "TOML"
        && text.lines().nth(line - 1).is_some_and(|line| line.contains('"') && line.contains('\\'));
    let backslash = if has_backslash { BACKSLASH } else { "" };
    Error::Scene {
        place: Box::new(Place { file, line_column: Some((line, column)), excerpt: Some(excerpt) }),
        key: "syntax".to_owned(),
        found: format!("{problem}{minus}"),
        allowed: format!("valid {language}{backslash}"),
    }
}

/// Reads TOML text.
pub(super) fn toml(text: &str, file: Option<PathBuf>) -> Result<Document> {
    // The parser bounds the depth, also of dotted keys: the walks below may recurse.
    let table = DeTable::parse(text).map_err(|error| {
        let at = error.span().unwrap_or(text.len()..text.len());
        syntax(file.clone(), text, at, error.message(), "TOML")
    })?;
    let mut root = TreeNode {
        value: TreeValue::Table(entries(table.get_ref(), &|span| Origin::Text(span))),
        origin: Origin::Whole,
    };
    sort(&mut root);
    Ok(Document::new(file, text.to_owned(), root))
}

/// Reads the value of an override: a TOML value, or a bare string.
pub(super) fn toml_value(text: &str, origin: &Origin) -> std::result::Result<TreeValue, String> {
    let bare = || TreeValue::Text(text.trim().to_owned());
    match DeValue::parse(text.trim()) {
        Ok(value) => match value.get_ref() {
            DeValue::Datetime(_) => Ok(bare()),
            value => Ok(convert(value, &|_| origin.clone())),
        },
        // What opens like a list, a table or a string was meant as one.
        Err(error) if text.trim().starts_with(['[', '{', '"', '\'']) => {
            Err(error.message().to_owned())
        }
        Err(_) => match plain_minus(text) {
            Cow::Borrowed(_) => Ok(bare()),
            Cow::Owned(plain) => toml_value(&plain, origin),
        },
    }
}

/// Turns a span of the text into an origin.
type Locate<'a> = &'a dyn Fn(std::ops::Range<usize>) -> Origin;

fn entries(table: &DeTable<'_>, origin: Locate<'_>) -> Vec<TreeEntry> {
    let entry = |(key, value): (&Spanned<_>, &Spanned<DeValue<'_>>)| TreeEntry {
        key: AsRef::<str>::as_ref(key.get_ref()).to_owned(),
        origin: origin(key.span()),
        node: node(value, origin),
    };
    table.iter().map(entry).collect()
}

fn node(value: &Spanned<DeValue<'_>>, origin: Locate<'_>) -> TreeNode {
    TreeNode { value: convert(value.get_ref(), origin), origin: origin(value.span()) }
}

fn convert(value: &DeValue<'_>, origin: Locate<'_>) -> TreeValue {
    match value {
        DeValue::String(text) => TreeValue::Text(text.to_string()),
        DeValue::Integer(integer) => i128::from_str_radix(integer.as_str(), integer.radix())
            .map_or(TreeValue::Other("a number that is too large"), TreeValue::Integer),
        DeValue::Float(float) => {
            float.as_str().parse().map_or(TreeValue::Other("a broken number"), TreeValue::Float)
        }
        DeValue::Boolean(value) => TreeValue::Bool(*value),
        DeValue::Datetime(_) => TreeValue::Other("a date or time"),
        DeValue::Array(items) => {
            TreeValue::List(items.iter().map(|item| node(item, origin)).collect())
        }
        DeValue::Table(table) => TreeValue::Table(entries(table, origin)),
    }
}

/// TOML tables come in the order of their keys: restore the order of the text, so that the
/// first error shown is the first in the file.
fn sort(node: &mut TreeNode) {
    match &mut node.value {
        TreeValue::List(items) => items.iter_mut().for_each(sort),
        TreeValue::Table(entries) => {
            entries.iter_mut().for_each(|entry| sort(&mut entry.node));
            entries.sort_by_key(|entry| match &entry.origin {
                Origin::Text(span) => span.start,
                _ => 0,
            });
        }
        _ => {}
    }
}

/// Reads JSON text.
pub(super) fn json(text: &str, file: Option<PathBuf>) -> Result<Document> {
    // serde_json judges the syntax and bounds the depth; the walk below only adds the places.
    if let Err(error) = serde_json::from_str::<serde_json::Value>(text) {
        let line_start: usize =
            text.split_inclusive('\n').take(error.line().saturating_sub(1)).map(str::len).sum();
        let at = line_start + error.column().saturating_sub(1);
        let message = error.to_string();
        let message = message.split(" at line ").next().unwrap_or_default().to_owned();
        return Err(syntax(file, text, at..at + 1, &message, "JSON"));
    }
    let mut walk = JsonWalk { text, at: 0 };
    let root = walk.node();
    match root {
        Some(root) => Ok(Document::new(file, text.to_owned(), root)),
        None => Err(syntax(file, text, walk.at..walk.at + 1, "text out of place", "JSON")),
    }
}

/// Walks over JSON text that is known to be valid.
struct JsonWalk<'a> {
    text: &'a str,
    at: usize,
}

impl JsonWalk<'_> {
    /// The next byte that is no white space.
    fn peek(&mut self) -> Option<u8> {
        let rest = &self.text[self.at..];
        self.at += rest.len() - rest.trim_start().len();
        self.text.as_bytes().get(self.at).copied()
    }

    /// Steps over `byte` if it is next.
    fn eat(&mut self, byte: u8) -> bool {
        let found = self.peek() == Some(byte);
        self.at += usize::from(found);
        found
    }

    fn node(&mut self) -> Option<TreeNode> {
        let first = self.peek()?;
        let start = self.at;
        let value = match first {
            b'{' => {
                self.at += 1;
                let mut entries = Vec::new();
                while !self.eat(b'}') {
                    self.peek()?;
                    let key_start = self.at;
                    let key = self.string()?;
                    let origin = Origin::Text(key_start..self.at);
                    self.eat(b':').then_some(())?;
                    entries.push(TreeEntry { key, origin, node: self.node()? });
                    self.eat(b',');
                }
                TreeValue::Table(entries)
            }
            b'[' => {
                self.at += 1;
                let mut items = Vec::new();
                while !self.eat(b']') {
                    items.push(self.node()?);
                    self.eat(b',');
                }
                TreeValue::List(items)
            }
            b'"' => TreeValue::Text(self.string()?),
            _ => self.word()?,
        };
        Some(TreeNode { value, origin: Origin::Text(start..self.at) })
    }

    fn string(&mut self) -> Option<String> {
        let rest = self.text.get(self.at..)?.strip_prefix('"')?;
        let mut escaped = false;
        let end = rest.bytes().position(|byte| {
            let closes = byte == b'"' && !escaped;
            escaped = byte == b'\\' && !escaped;
            closes
        })?;
        let quoted = &self.text[self.at..self.at + end + 2];
        self.at += quoted.len();
        serde_json::from_str(quoted).ok()
    }

    fn word(&mut self) -> Option<TreeValue> {
        let rest = &self.text[self.at..];
        let ends = |c: char| c.is_whitespace() || matches!(c, ',' | ']' | '}');
        let word = &rest[..rest.find(ends).unwrap_or(rest.len())];
        self.at += word.len();
        Some(match word {
            "true" => TreeValue::Bool(true),
            "false" => TreeValue::Bool(false),
            "null" => TreeValue::Other("null"),
            _ => match word.parse::<i128>() {
                Ok(integer) => TreeValue::Integer(integer),
                Err(_) => TreeValue::Float(word.parse().ok()?),
            },
        })
    }
}
