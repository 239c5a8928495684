//! Cursors over the tree: a table whose keys were checked, and a value with its path. Every
//! read either succeeds or names place, key, what was found and what is allowed. A value of its own
//! that is wrong is reported to the document, and reading goes on with another in its place; what
//! several values do wrong together is an `Err`.

use std::collections::HashSet;
use std::fmt::Write;
use std::ops::RangeInclusive;

use super::keys::{keys_of, other_name};
use super::path;
use super::tree::{Document, MISSING, Origin, TreeEntry, TreeNode, TreeValue};
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

    /// Reports an error of this value and goes on with another in its place, so that one reading
    /// finds all errors. What is missing was reported before.
    pub(super) fn refuse<T>(&self, error: Error, instead: T) -> Result<T> {
        if !matches!(self.node.value, TreeValue::Missing) {
            self.document.report(error);
        }
        Ok(instead)
    }

    /// What was read, or another in its place where that failed as a whole: the error is reported,
    /// and nothing below this path is known.
    pub(super) fn or_instead<T>(&self, result: Result<T>, instead: T) -> Result<T> {
        Ok(self.document.keep(result).unwrap_or_else(|| {
            self.document.forget(self.path.clone());
            instead
        }))
    }

    pub(super) fn is_list(&self) -> bool {
        matches!(self.node.value, TreeValue::List(_))
    }

    pub(super) fn is_table(&self) -> bool {
        matches!(self.node.value, TreeValue::Table(_))
    }

    /// The text, if the value is one.
    pub(super) fn as_text(&self) -> Option<&'a str> {
        match &self.node.value {
            TreeValue::Text(text) if !text.trim().is_empty() => Some(text),
            _ => None,
        }
    }

    pub(super) fn text(&self, allowed: &str) -> Result<&'a str> {
        self.as_text().map_or_else(|| self.refuse(self.mismatch(allowed), ""), Ok)
    }

    pub(super) fn boolean(&self) -> Result<bool> {
        match self.node.value {
            TreeValue::Bool(value) => Ok(value),
            _ => self.refuse(self.mismatch("true or false"), false),
        }
    }

    /// A quantity with its unit; NaN where it is wrong.
    pub(super) fn quantity(&self, dimension: Dimension) -> Result<f64> {
        let error = match &self.node.value {
            TreeValue::Text(text) => match dimension.parse(text) {
                Ok(value) => return Ok(value),
                Err(error) => self.quantity_error(error),
            },
            TreeValue::Integer(_) | TreeValue::Float(_) => {
                let found = format!("{}, without a unit", describe(&self.node.value));
                self.error(found, dimension.allowed())
            }
            _ => self.mismatch(dimension.allowed()),
        };
        self.refuse(error, f64::NAN)
    }

    pub(super) fn quantity_error(&self, error: QuantityError) -> Error {
        self.error(error.found, error.allowed)
    }

    /// A number without a unit; NaN where it is wrong.
    pub(super) fn number(&self) -> Result<f64> {
        match self.node.value {
            TreeValue::Float(value) if value.is_finite() => Ok(value),
            TreeValue::Integer(value) => Ok(value as f64),
            _ => self.refuse(self.mismatch("a finite number without a unit"), f64::NAN),
        }
    }

    /// A whole number within bounds; the least one where it is wrong.
    pub(super) fn integer<T: TryFrom<i128> + Copy + Into<i128>>(
        &self,
        range: RangeInclusive<T>,
    ) -> Result<T> {
        let (low, high): (i128, i128) = ((*range.start()).into(), (*range.end()).into());
        let value = match self.node.value {
            TreeValue::Integer(value) if (low..=high).contains(&value) => T::try_from(value).ok(),
            _ => None,
        };
        let error = || self.mismatch(format!("a whole number from {low} to {high}"));
        value.map_or_else(|| self.refuse(error(), *range.start()), Ok)
    }

    /// One of a few words; the first where it is none of them.
    pub(super) fn choice<T: Copy>(&self, words: &[(&str, T)]) -> Result<T> {
        let names = || words.iter().map(|word| word.0);
        let quoted = names().map(|name| format!("{name:?}")).collect::<Vec<_>>().join(", ");
        let error = match &self.node.value {
            TreeValue::Text(text) => match words.iter().find(|word| word.0 == text) {
                Some(word) => return Ok(word.1),
                None => self.mismatch(with_suggestion(quoted, text, names())),
            },
            _ => self.mismatch(quoted),
        };
        self.refuse(error, words[0].1)
    }

    /// The values of a list; none where it is no list.
    pub(super) fn items(&self, allowed: &str) -> Result<Vec<Self>> {
        let TreeValue::List(nodes) = &self.node.value else {
            return self.refuse(self.mismatch(allowed), Vec::new());
        };
        let item = |(index, node)| self.child(format!("{}[{index}]", self.path), node);
        Ok(nodes.iter().enumerate().map(item).collect())
    }

    /// The values of a list of `N`.
    pub(super) fn array<T, const N: usize>(
        &self,
        allowed: &str,
        read: impl Fn(&Self) -> Result<T>,
    ) -> Result<[T; N]> {
        let mut items = self.items(allowed)?;
        if items.len() != N {
            self.refuse(self.mismatch(allowed), ())?;
            items = (0..N).map(|_| self.child(self.path.clone(), &MISSING)).collect();
        }
        let values = items.iter().map(read).collect::<Result<Vec<_>>>()?;
        values.try_into().map_err(|_| self.mismatch(allowed))
    }

    /// A table with the keys known for `kind`; others are reported.
    pub(super) fn table(&self, kind: &str) -> Result<Table<'a>> {
        let table = self.any_table(keys_of(kind))?;
        for entry in table.entries.iter().filter(|e| !table.known.contains(&e.key.as_str())) {
            let known = table.known.iter().copied();
            let meant = other_name(kind, &entry.key)
                .or_else(|| suggestion::nearest(&entry.key, known, str::to_lowercase));
            let mut allowed = table.known.join(", ");
            if let Some(meant) = meant {
                let _ = write!(allowed, " (did you mean `{meant}`?)");
            }
            let key = path::join(&self.path, &entry.key);
            let error = error(self.document, &entry.origin, key, "an unknown key", allowed);
            self.document.report(error);
            // The key that was meant is not missing as well.
            if let Some(meant) = meant.filter(|meant| table.get(meant).is_none()) {
                self.document.forget(path::join(&self.path, meant));
            }
        }
        Ok(table)
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
            let item = self.child(self.path.clone(), &MISSING);
            return self.refuse(self.mismatch(allowed), Table { item, entries: &[], known });
        };
        // TOML refuses a key that stands twice; JSON does not.
        let mut seen = HashSet::new();
        for entry in entries {
            if !seen.insert(entry.key.as_str()) {
                let key = path::join(&self.path, &entry.key);
                let found = "the key a second time";
                let error = error(self.document, &entry.origin, key, found, "each key once");
                self.document.report(error);
            }
        }
        Ok(Table { item: self.clone(), entries, known })
    }

    fn child(&self, path: String, node: &'a TreeNode) -> Self {
        Self { document: self.document, path, node }
    }
}

impl<'a> Table<'a> {
    fn child(&self, entry: &'a TreeEntry) -> ListItem<'a> {
        self.item.child(path::join(&self.item.path, &entry.key), &entry.node)
    }

    /// The value of a key, if it is there.
    pub(super) fn get(&self, key: &str) -> Option<ListItem<'a>> {
        debug_assert!(self.known.contains(&key), "{key} is read but not listed in keys.rs");
        self.entries.iter().find(|entry| entry.key == key).map(|entry| self.child(entry))
    }

    /// The value of a key that must be there.
    pub(super) fn require(&self, key: &str, allowed: impl Into<String>) -> Result<ListItem<'a>> {
        if let Some(item) = self.get(key) {
            return Ok(item);
        }
        let path = path::join(&self.item.path, key);
        if !self.item.document.is_forgotten(&path) {
            self.item.refuse(self.missing(key, allowed), ())?;
        }
        Ok(self.item.child(path, &MISSING))
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
            Some(item) => item.refuse(item.error("the key", why), ()),
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
        TreeValue::Missing => "nothing".to_owned(),
    }
}
