//! Cursors over the tree: a table whose keys were checked, and a value with its path. Every
//! read either succeeds or names place, key, what was found and what is allowed.

use std::collections::HashSet;
use std::fmt::Write;
use std::ops::RangeInclusive;

use super::keys::{keys_of, other_name};
use super::path;
use super::tree::{Document, Origin, TreeEntry, TreeNode, TreeValue};
use crate::units::{Dimension, QuantityError};
use crate::{Error, Result, suggestion};

/// A value in the document and the path that leads to it.
#[derive(Debug, Clone)]
pub(super) struct ListItem<'a> {
    document: &'a Document,
    path: String,
    node: &'a TreeNode,
}

/// A table that has known keys only.
#[derive(Debug)]
pub(super) struct Table<'a> {
    item: ListItem<'a>,
    entries: &'a [TreeEntry],
    known: &'static [&'static str],
}

impl<'a> ListItem<'a> {
    pub(super) fn root(document: &'a Document) -> Self {
        Self { document, path: String::new(), node: &document.root }
    }

    pub(super) fn error(&self, found: impl Into<String>, allowed: impl Into<String>) -> Error {
        error(self.document, &self.node.origin, self.path.clone(), found, allowed)
    }

    /// The error for a value of the wrong kind.
    pub(super) fn mismatch(&self, allowed: impl Into<String>) -> Error {
        self.error(describe(&self.node.value), allowed)
    }

    pub(super) fn is_list(&self) -> bool {
        matches!(self.node.value, TreeValue::List(_))
    }

    pub(super) fn is_table(&self) -> bool {
        matches!(self.node.value, TreeValue::Table(_))
    }

    pub(super) fn text(&self, allowed: &str) -> Result<&'a str> {
        match &self.node.value {
            TreeValue::Text(text) if !text.trim().is_empty() => Ok(text),
            _ => Err(self.mismatch(allowed)),
        }
    }

    pub(super) fn boolean(&self) -> Result<bool> {
        match self.node.value {
            TreeValue::Bool(value) => Ok(value),
            _ => Err(self.mismatch("true or false")),
        }
    }

    /// A quantity with its unit.
    pub(super) fn quantity(&self, dimension: Dimension) -> Result<f64> {
        match &self.node.value {
            TreeValue::Text(text) => {
                dimension.parse(text).map_err(|error| self.quantity_error(error))
            }
            TreeValue::Integer(_) | TreeValue::Float(_) => {
                let found = format!("{}, without a unit", describe(&self.node.value));
                Err(self.error(found, dimension.allowed()))
            }
            _ => Err(self.mismatch(dimension.allowed())),
        }
    }

    pub(super) fn quantity_error(&self, error: QuantityError) -> Error {
        self.error(error.found, error.allowed)
    }

    /// A number without a unit.
    pub(super) fn number(&self) -> Result<f64> {
        match self.node.value {
            TreeValue::Float(value) if value.is_finite() => Ok(value),
            TreeValue::Integer(value) => Ok(value as f64),
            _ => Err(self.mismatch("a finite number without a unit")),
        }
    }

    /// A whole number within bounds.
    pub(super) fn integer<T: TryFrom<i128> + Copy + Into<i128>>(
        &self,
        range: RangeInclusive<T>,
    ) -> Result<T> {
        let (low, high): (i128, i128) = ((*range.start()).into(), (*range.end()).into());
        let refuse = || self.mismatch(format!("a whole number from {low} to {high}"));
        match self.node.value {
            TreeValue::Integer(value) if (low..=high).contains(&value) => {
                T::try_from(value).map_err(|_| refuse())
            }
            _ => Err(refuse()),
        }
    }

    /// One of a few words.
    pub(super) fn choice<T: Copy>(&self, words: &[(&str, T)]) -> Result<T> {
        let names = || words.iter().map(|word| word.0);
        let quoted: Vec<_> = names().map(|name| format!("{name:?}")).collect();
        let TreeValue::Text(text) = &self.node.value else {
            return Err(self.mismatch(quoted.join(", ")));
        };
        match words.iter().find(|word| word.0 == text) {
            Some(word) => Ok(word.1),
            None => Err(self.mismatch(with_suggestion(quoted.join(", "), text, names()))),
        }
    }

    /// The values of a list.
    pub(super) fn items(&self, allowed: &str) -> Result<Vec<Self>> {
        let TreeValue::List(nodes) = &self.node.value else {
            return Err(self.mismatch(allowed));
        };
        let item = |(index, node)| Self {
            document: self.document,
            path: format!("{}[{index}]", self.path),
            node,
        };
        Ok(nodes.iter().enumerate().map(item).collect())
    }

    /// The values of a list of `N`.
    pub(super) fn array<T, const N: usize>(
        &self,
        allowed: &str,
        read: impl Fn(&Self) -> Result<T>,
    ) -> Result<[T; N]> {
        let values = self.items(allowed)?.iter().map(read).collect::<Result<Vec<_>>>()?;
        values.try_into().map_err(|_| self.mismatch(allowed))
    }

    /// A table with the keys known for `kind`.
    pub(super) fn table(&self, kind: &str) -> Result<Table<'a>> {
        let table = self.any_table(keys_of(kind))?;
        let Some(entry) = table.entries.iter().find(|e| !table.known.contains(&e.key.as_str()))
        else {
            return Ok(table);
        };
        let known = table.known.join(", ");
        let allowed = match other_name(kind, &entry.key) {
            Some(meant) => format!("{known} (did you mean `{meant}`?)"),
            None => with_suggestion(known, &entry.key, table.known.iter().copied()),
        };
        let key = path::join(&self.path, &entry.key);
        Err(error(self.document, &entry.origin, key, "an unknown key", allowed))
    }

    /// The values of a table whose keys are names that the scene chooses.
    pub(super) fn named(&self) -> Result<Vec<(&'a str, Self)>> {
        let table = self.any_table(&[])?;
        Ok(table.entries.iter().map(|entry| (entry.key.as_str(), table.child(entry))).collect())
    }

    fn any_table(&self, known: &'static [&'static str]) -> Result<Table<'a>> {
        let TreeValue::Table(entries) = &self.node.value else {
            let allowed = match known {
                [] => "a table".to_owned(),
                _ => format!("a table with the keys {}", known.join(", ")),
            };
            return Err(self.mismatch(allowed));
        };
        // TOML refuses a key that stands twice; JSON does not.
        let mut seen = HashSet::new();
        for entry in entries {
            if !seen.insert(entry.key.as_str()) {
                let key = path::join(&self.path, &entry.key);
                let found = "the key a second time";
                return Err(error(self.document, &entry.origin, key, found, "each key once"));
            }
        }
        Ok(Table { item: self.clone(), entries, known })
    }
}

impl<'a> Table<'a> {
    fn child(&self, entry: &'a TreeEntry) -> ListItem<'a> {
        let path = path::join(&self.item.path, &entry.key);
        ListItem { document: self.item.document, path, node: &entry.node }
    }

    /// The value of a key, if it is there.
    pub(super) fn get(&self, key: &str) -> Option<ListItem<'a>> {
        debug_assert!(self.known.contains(&key), "{key} is read but not listed in keys.rs");
        self.entries.iter().find(|entry| entry.key == key).map(|entry| self.child(entry))
    }

    /// The value of a key that must be there.
    pub(super) fn require(&self, key: &str, allowed: impl Into<String>) -> Result<ListItem<'a>> {
        self.get(key).ok_or_else(|| self.missing(key, allowed))
    }

    /// The error for a key that is not there.
    pub(super) fn missing(&self, key: &str, allowed: impl Into<String>) -> Error {
        let origin = &self.item.node.origin;
        let key = path::join(&self.item.path, key);
        error(self.item.document, origin, key, "nothing: the key is missing", allowed)
    }

    /// A quantity that must be there.
    pub(super) fn quantity(&self, key: &str, dimension: Dimension) -> Result<f64> {
        self.require(key, dimension.allowed())?.quantity(dimension)
    }

    /// A quantity that may be left out.
    pub(super) fn optional_quantity(&self, key: &str, dimension: Dimension) -> Result<Option<f64>> {
        self.get(key).map(|item| item.quantity(dimension)).transpose()
    }

    /// Refuses `key` where it has no meaning.
    pub(super) fn forbid(&self, key: &str, why: &str) -> Result<()> {
        match self.get(key) {
            Some(item) => Err(item.error("the key", why)),
            None => Ok(()),
        }
    }
}

fn error(
    document: &Document,
    origin: &Origin,
    key: String,
    found: impl Into<String>,
    allowed: impl Into<String>,
) -> Error {
    let key = if key.is_empty() { "scene".to_owned() } else { key };
    Error::Scene {
        place: Box::new(document.place(origin)),
        key,
        found: found.into(),
        allowed: allowed.into(),
    }
}

pub(super) fn with_suggestion<'a>(
    mut allowed: String,
    word: &str,
    candidates: impl IntoIterator<Item = &'a str>,
) -> String {
    if let Some(meant) = suggestion::nearest(word, candidates, str::to_lowercase) {
        let _ = write!(allowed, " (did you mean `{meant}`?)");
    }
    allowed
}

fn describe(value: &TreeValue) -> String {
    match value {
        TreeValue::Text(text) if text.chars().count() > 60 => {
            format!("{:?}...", text.chars().take(60).collect::<String>())
        }
        TreeValue::Text(text) => format!("{text:?}"),
        TreeValue::Integer(number) => format!("the number {number}"),
        TreeValue::Float(number) => format!("the number {number:?}"),
        TreeValue::Bool(value) => format!("{value}"),
        TreeValue::List(items) => format!("a list of {}", items.len()),
        TreeValue::Table(_) => "a table".to_owned(),
        TreeValue::Other(what) => (*what).to_owned(),
    }
}
