//! Cursors over the tree: a table with checked keys, and a value with its path. Every read either
//! succeeds or names place, key, found and allowed value. A single wrong value is reported to the
//! document, and reading continues with a placeholder; a fault of several values together is an `Err`.

use std::collections::HashSet;
use std::fmt::Write;
use std::ops::RangeInclusive;
use std::path::Path;

use super::keys::row::{Row, Spec};
use super::path;
use super::tree::{Document, MISSING, Origin, TreeEntry, TreeNode, TreeValue};
use beamlet_core::units::{Dimension, QuantityError};
use beamlet_core::{Error, Result, suggestion};

/// Keys that scenes of version 0.1 have, and what to do about them.
const GONE: [(&str, &str); 3] = [
    (
        "sampling.refine",
        "no place where rays are chosen, which is the same on every device: remove it",
    ),
    ("sampling.cells", "`tolerance` in its place, by which lines are chosen: remove it"),
    ("sampling.rows", "`tolerance` in its place, by which lines are chosen: remove it"),
];

/// A value in the document and the path that leads to it.
#[derive(Debug, Clone)]
pub(super) struct ListItem<'a> {
    document: &'a Document,
    path: String,
    node: &'a TreeNode,
}

/// A table whose keys belong to a spec, without keys that others exclude.
#[derive(Debug)]
pub(super) struct Table<'a> {
    item: ListItem<'a>,
    entries: &'a [TreeEntry],
    spec: &'static Spec,
    /// True if keys that exclude one another were found.
    clash: bool,
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

    /// Reports an error of this value and continues with a placeholder, so that one reading finds all
    /// errors. Missing values were reported before.
    pub(super) fn refuse<T>(&self, error: Error, instead: T) -> Result<T> {
        if !matches!(self.node.value, TreeValue::Missing) {
            self.document.report(error);
        }
        Ok(instead)
    }

    /// The result, or a placeholder if reading failed as a whole: the error is reported, and nothing
    /// below this path is known.
    pub(super) fn or_instead<T>(&self, result: Result<T>, instead: T) -> Result<T> {
        Ok(self.document.keep(result).unwrap_or_else(|| {
            self.document.forget(self.path.clone());
            instead
        }))
    }

    /// Directory that paths of the scene start from.
    /// Notes that the values of the table at `path`, which this item names, are in the model.
    pub(super) fn note_table(&self, path: &Path) {
        self.document.note_table(self.path.clone(), path.to_owned());
    }

    pub(super) fn directory(&self) -> &'a Path {
        &self.document.directory
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
    pub(super) fn integer(&self, range: RangeInclusive<u64>) -> Result<u64> {
        let value = match self.node.value {
            TreeValue::Integer(value) => u64::try_from(value).ok(),
            _ => None,
        };
        let (low, high) = (*range.start(), *range.end());
        match value.filter(|value| range.contains(value)) {
            Some(value) => Ok(value),
            None => {
                let allowed = format!("a whole number from {low} to {high}");
                self.refuse(self.mismatch(allowed), low)
            }
        }
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

    /// A table with the keys of a spec. Others are reported, and keys that exclude one another.
    pub(super) fn table(&self, spec: &'static Spec) -> Result<Table<'a>> {
        let names: Vec<&str> = spec.rows.iter().map(|row| row.name).collect();
        let allowed = format!("a table with the keys {}", names.join(", "));
        let Some(entries) = self.entries(&allowed) else {
            let item = self.child(self.path.clone(), &MISSING);
            return Ok(Table { item, entries: &[], spec, clash: false });
        };
        let mut table = Table { item: self.clone(), entries, spec, clash: false };
        for entry in entries.iter().filter(|entry| !names.contains(&entry.key.as_str())) {
            table.refuse_unknown(entry, &names);
        }
        table.refuse_rivals();
        Ok(table)
    }

    /// The values of a table whose keys are names that the scene chooses.
    pub(super) fn named(&self) -> Result<Vec<(&'a str, Self)>> {
        let entries = self.entries("a table").unwrap_or_default();
        let item = |entry: &'a TreeEntry| {
            (entry.key.as_str(), self.child(path::join(&self.path, &entry.key), &entry.node))
        };
        Ok(entries.iter().map(item).collect())
    }

    /// The entries of a table; `None` where it is no table, which is reported.
    fn entries(&self, allowed: &str) -> Option<&'a [TreeEntry]> {
        let TreeValue::Table(entries) = &self.node.value else {
            if !matches!(self.node.value, TreeValue::Missing) {
                self.document.report(self.mismatch(allowed));
            }
            return None;
        };
        // TOML refuses a repeated key; JSON does not.
        let mut seen = HashSet::new();
        for entry in entries {
            if !seen.insert(entry.key.as_str()) {
                let key = path::join(&self.path, &entry.key);
                let found = "the key a second time";
                let error = error(self.document, &entry.origin, key, found, "each key once");
                self.document.report(error);
            }
        }
        Some(entries)
    }

    fn child(&self, path: String, node: &'a TreeNode) -> Self {
        Self { document: self.document, path, node }
    }
}

impl<'a> Table<'a> {
    fn child(&self, entry: &'a TreeEntry) -> ListItem<'a> {
        self.item.child(path::join(&self.item.path, &entry.key), &entry.node)
    }

    fn has(&self, key: &str) -> bool {
        self.entries.iter().any(|entry| entry.key == key)
    }

    fn refuse_unknown(&self, entry: &TreeEntry, known: &[&'static str]) {
        let document = self.item.document;
        let other = self.spec.other_names.iter().find(|it| it.0.eq_ignore_ascii_case(&entry.key));
        let meant = other
            .map(|it| it.1)
            .or_else(|| suggestion::nearest(&entry.key, known.iter().copied(), str::to_lowercase));
        let mut allowed = known.join(", ");
        let key = path::join(&self.item.path, &entry.key);
        if let Some((_, remedy)) = GONE.iter().find(|(gone, _)| *gone == key) {
            allowed = format!("{remedy}; {allowed}");
        } else if let Some(meant) = meant {
            let _ = write!(allowed, " (did you mean `{meant}`?)");
        }
        document.report(error(document, &entry.origin, key, "an unknown key", allowed));
        // The key that was meant is not missing as well.
        if let Some(meant) = meant.filter(|meant| !self.has(meant)) {
            document.forget(path::join(&self.item.path, meant));
        }
    }

    /// Reports the first key of each form besides the one that counts.
    fn refuse_rivals(&mut self) {
        for (forms, _) in self.spec.all_forms() {
            let Some(own) = Spec::own(forms, |key| self.has(key)) else { continue };
            for other in forms.iter().filter(|form| **form != own) {
                let mut rivals = other.iter().filter(|key| !own.contains(key));
                let Some(entry) = rivals.find_map(|key| self.entry(key)) else { continue };
                let head = own.iter().find(|key| self.has(key)).unwrap_or(&own[0]);
                let (found, item) = (format!("both {head} and {}", entry.key), self.child(entry));
                let error = item.error(found, self.spec.choice(forms));
                self.item.document.report(error);
                self.clash = true;
            }
        }
    }

    /// True if a key belongs to a form that the table has not.
    fn is_excluded(&self, key: &str) -> bool {
        self.spec.forms(key).is_some_and(|(forms, missing)| {
            let own = Spec::own(forms, |key| self.has(key)).unwrap_or(forms[missing]);
            !own.contains(&key)
        })
    }

    fn entry(&self, key: &str) -> Option<&'a TreeEntry> {
        self.entries.iter().find(|entry| entry.key == key)
    }

    /// The row of a key.
    pub(super) fn row(&self, key: &str) -> Result<&'static Row> {
        let row = self.spec.row(key);
        row.ok_or_else(|| {
            self.item.error(format!("`{key}`, which is read and in no table"), "no such key")
        })
    }

    /// First key of the form that the table has, or that it lacks: of the forms with this key.
    pub(super) fn form(&self, key: &str) -> &'static str {
        self.spec.forms(key).map_or("", |(forms, missing)| {
            Spec::own(forms, |key| self.has(key)).unwrap_or(forms[missing])[0]
        })
    }

    /// The value of a key, if it is there and no other key excludes it.
    pub(super) fn get(&self, key: &str) -> Option<ListItem<'a>> {
        debug_assert!(self.spec.row(key).is_some(), "{}.{key} is in no table", self.spec.path);
        self.entry(key).filter(|_| !self.is_excluded(key)).map(|entry| self.child(entry))
    }

    /// The value of a key that must be there.
    pub(super) fn require(&self, key: &str) -> Result<ListItem<'a>> {
        let mut allowed = self.row(key)?.allowed();
        if let Some((forms, _)) = self.spec.forms(key) {
            let choice = self.spec.choice(forms);
            allowed = format!("{allowed}; {choice}");
        }
        self.require_as(key, allowed)
    }

    /// The value of a required key; `allowed` describes it in the error.
    pub(super) fn require_as(&self, key: &str, allowed: impl Into<String>) -> Result<ListItem<'a>> {
        if let Some(item) = self.get(key) {
            return Ok(item);
        }
        let (path, document) = (path::join(&self.item.path, key), self.item.document);
        let forms = self.spec.forms(key);
        // Of a form of which nothing is there its first key stands for all, and of keys that exclude
        // one another it is not known which are missing.
        let follows = forms.is_some_and(|(forms, missing)| {
            let none = Spec::own(forms, |key| self.has(key)).is_none();
            self.clash || (none && forms[missing][0] != key)
        });
        if self.is_excluded(key) {
            // Another key stands for it.
        } else if follows {
            document.forget(path.clone());
        } else if !document.is_forgotten(&path) {
            let origin = &self.item.node.origin;
            let missing = "nothing: the key is missing";
            self.item.refuse(error(document, origin, path.clone(), missing, allowed), ())?;
        }
        Ok(self.item.child(path, &MISSING))
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
        TreeValue::List(items) => format!("a list of length {}", items.len()),
        TreeValue::Table(_) => "a table".to_owned(),
        TreeValue::Other(what) => (*what).to_owned(),
        TreeValue::Missing => "nothing".to_owned(),
    }
}
