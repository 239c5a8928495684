//! Values of keys: reading, writing and checking each by the row of its key.

use std::path::{Path, PathBuf};

use super::faults::{Faults, in_range, named, whole};
use super::row::{Kind, Row};
use crate::scene::Scene;
use crate::scene::table::{ListItem, Table};
use crate::scene::text::{list, number, quantity, quoted};
use beamlet_core::units::Dimension::Length;
use beamlet_core::{Error, Result};

/// A value that a key of a scene file may have.
pub(crate) trait Value: Sized {
    /// Reads the value. One that is wrong is reported, and another stands for it.
    ///
    /// # Errors
    /// What concerns the value as a whole.
    fn read(item: &ListItem<'_>, row: &'static Row) -> Result<Self>;

    /// The value as TOML; `None` where the key is left out.
    ///
    /// # Errors
    /// A path that cannot be written.
    fn write(&self, row: &Row, base: &Base<'_>) -> Result<Option<String>>;

    /// Reports a value of this key that is not allowed.
    fn check(&self, _key: &str, _row: &Row, _faults: &mut Faults) {}
}

/// Reads the value of a key, if it is there.
pub(crate) fn optional<V: Value>(table: &Table<'_>, key: &str) -> Result<Option<V>> {
    let row = table.row(key)?;
    table.get(key).map(|item| V::read(&item, row)).transpose()
}

/// Refuses lengths beyond the range of a key whose values the model keeps under another key: the error
/// names the key and the length of the scene.
pub(crate) fn refuse_beyond(table: &Table<'_>, key: &str, lengths: &mut [f64]) -> Result<()> {
    let (row, Some(item)) = (table.row(key)?, table.get(key)) else { return Ok(()) };
    let mut known = lengths.iter().filter(|length| !length.is_nan());
    let beyond = known.find_map(|length| in_range(key, &row.kind, *length).err());
    if let Some(Error::Scene { found, allowed, .. }) = beyond {
        lengths.fill(item.refuse(item.error(found, allowed), f64::NAN)?);
    }
    Ok(())
}

/// Reads the value of a key that must be there.
pub(crate) fn required<V: Value>(table: &Table<'_>, key: &str) -> Result<V> {
    V::read(&table.require(key)?, table.row(key)?)
}

/// Base of relative paths in a text.
#[derive(Debug)]
pub(crate) struct Base<'a> {
    pub(crate) scene: &'a Scene,
    /// Directory of the text.
    pub(crate) directory: &'a Path,
}

impl Base<'_> {
    /// A path as the text has it.
    pub(crate) fn file(&self, path: &Path) -> Result<String> {
        let unicode = |path: &Path| {
            let problem = "the path must be Unicode to be written into a scene";
            path.to_str().map(str::to_owned).ok_or_else(|| Error::file(path, problem, None))
        };
        if self.directory == self.scene.directory {
            return unicode(path);
        }
        let path = self.scene.resolve(path);
        let absolute = std::path::absolute(&path)
            .map_err(|source| Error::file(&path, "cannot make the path absolute", Some(source)))?;
        unicode(&absolute)
    }
}

impl<V: Value> Value for Option<V> {
    fn read(item: &ListItem<'_>, row: &'static Row) -> Result<Self> {
        V::read(item, row).map(Some)
    }

    fn write(&self, row: &Row, base: &Base<'_>) -> Result<Option<String>> {
        self.as_ref().map_or(Ok(None), |value| value.write(row, base))
    }

    fn check(&self, key: &str, row: &Row, faults: &mut Faults) {
        if let Some(value) = self {
            value.check(key, row, faults);
        }
    }
}

impl Value for f64 {
    fn read(item: &ListItem<'_>, row: &'static Row) -> Result<Self> {
        match row.kind {
            Kind::Quantity(dimension, _) => item.quantity(dimension),
            Kind::Unit => match Length.parse_unit(item.text(&row.allowed())?) {
                Ok(unit) => Ok(unit),
                Err(error) => item.refuse(item.quantity_error(error), Self::NAN),
            },
            Kind::Number(..) if item.as_text().is_some() => {
                let allowed = format!("{}, without a unit", row.kind.range_allowed());
                item.refuse(item.mismatch(allowed), Self::NAN)
            }
            _ => item.number(),
        }
    }

    fn write(&self, row: &Row, _: &Base<'_>) -> Result<Option<String>> {
        Ok(Some(match row.kind {
            Kind::Quantity(dimension, _) => quantity(*self, dimension),
            Kind::Unit => {
                let text = Length.format(*self);
                quoted(text.strip_prefix("1 ").unwrap_or(&text))
            }
            _ => number(*self),
        }))
    }

    fn check(&self, key: &str, row: &Row, faults: &mut Faults) {
        faults.note(in_range(key, &row.kind, *self));
    }
}

/// Two lengths, along x and z.
impl Value for [f64; 2] {
    fn read(item: &ListItem<'_>, row: &'static Row) -> Result<Self> {
        if item.is_list() {
            return item.array(&row.allowed(), |item| item.quantity(Length));
        }
        Ok([item.quantity(Length)?; 2])
    }

    fn write(&self, _: &Row, _: &Base<'_>) -> Result<Option<String>> {
        Ok(Some(list(self, Length)))
    }

    fn check(&self, key: &str, row: &Row, faults: &mut Faults) {
        faults.note(self.iter().try_for_each(|value| in_range(key, &row.kind, *value)));
    }
}

/// Three lengths, or a direction.
impl Value for [f64; 3] {
    fn read(item: &ListItem<'_>, row: &'static Row) -> Result<Self> {
        item.array(&row.allowed(), |item| match row.kind {
            Kind::Direction => item.number(),
            _ => item.quantity(Length),
        })
    }

    fn write(&self, row: &Row, _: &Base<'_>) -> Result<Option<String>> {
        Ok(Some(match row.kind {
            Kind::Direction => format!("[{}]", self.map(number).join(", ")),
            _ => list(self, Length),
        }))
    }

    fn check(&self, key: &str, row: &Row, faults: &mut Faults) {
        if matches!(row.kind, Kind::Direction) {
            let length = libm::hypot(libm::hypot(self[0], self[1]), self[2]);
            if !(length.is_finite() && length > 0.0) {
                let allowed = "a direction of finite length > 0";
                let found = format!("a direction of length {length}");
                faults.add(Error::scene(key, found, allowed));
            }
            return;
        }
        for (axis, length) in self.iter().enumerate() {
            faults.note(in_range(&format!("{key}[{axis}]"), &row.kind, *length));
        }
    }
}

impl Value for u64 {
    fn read(item: &ListItem<'_>, row: &'static Row) -> Result<Self> {
        match row.kind {
            Kind::Count(low, high) | Kind::Counts(_, low, high) => item.integer(low..=high),
            _ => item.integer(0..=Self::MAX),
        }
    }

    fn write(&self, _: &Row, _: &Base<'_>) -> Result<Option<String>> {
        Ok(Some(self.to_string()))
    }

    fn check(&self, key: &str, row: &Row, faults: &mut Faults) {
        faults.note(whole(key, &row.kind, *self));
    }
}

impl Value for u32 {
    fn read(item: &ListItem<'_>, row: &'static Row) -> Result<Self> {
        u64::read(item, row).map(|value| Self::try_from(value).unwrap_or(Self::MAX))
    }

    fn write(&self, row: &Row, base: &Base<'_>) -> Result<Option<String>> {
        u64::from(*self).write(row, base)
    }

    fn check(&self, key: &str, row: &Row, faults: &mut Faults) {
        u64::from(*self).check(key, row, faults);
    }
}

impl Value for [u32; 2] {
    fn read(item: &ListItem<'_>, row: &'static Row) -> Result<Self> {
        item.array(&row.allowed(), |item| u32::read(item, row))
    }

    fn write(&self, _: &Row, _: &Base<'_>) -> Result<Option<String>> {
        Ok(Some(format!("{self:?}")))
    }

    fn check(&self, key: &str, row: &Row, faults: &mut Faults) {
        faults.note(self.iter().try_for_each(|value| whole(key, &row.kind, u64::from(*value))));
    }
}

impl Value for bool {
    fn read(item: &ListItem<'_>, _: &'static Row) -> Result<Self> {
        item.boolean()
    }

    fn write(&self, _: &Row, _: &Base<'_>) -> Result<Option<String>> {
        Ok(Some(self.to_string()))
    }
}

impl Value for String {
    fn read(item: &ListItem<'_>, row: &'static Row) -> Result<Self> {
        let allowed = row.allowed();
        let text = item.text(&allowed)?;
        let is_hash = || text.len() == 64 && text.bytes().all(|byte| byte.is_ascii_hexdigit());
        match row.kind {
            Kind::Hash | Kind::Named(Kind::Hash) if !is_hash() => {
                item.refuse(item.mismatch(allowed), Self::new())
            }
            Kind::Hash | Kind::Named(Kind::Hash) => Ok(text.to_ascii_lowercase()),
            _ => Ok(text.to_owned()),
        }
    }

    fn write(&self, _: &Row, _: &Base<'_>) -> Result<Option<String>> {
        Ok(Some(quoted(self)))
    }

    fn check(&self, key: &str, row: &Row, faults: &mut Faults) {
        if matches!(row.kind, Kind::Name(_)) {
            faults.note(named(key, self));
        }
    }
}

impl Value for PathBuf {
    fn read(item: &ListItem<'_>, row: &'static Row) -> Result<Self> {
        let path = item.text(&row.allowed())?;
        if path.contains(char::is_control) {
            let found = format!("{path:?}, with a control character");
            let allowed =
                "a path; in double quotes a backslash begins an escape: write / or single quotes";
            return item.refuse(item.error(found, allowed), Self::new());
        }
        Ok(Self::from(path))
    }

    fn write(&self, _: &Row, base: &Base<'_>) -> Result<Option<String>> {
        Ok(Some(quoted(&base.file(self)?)))
    }

    fn check(&self, key: &str, _: &Row, faults: &mut Faults) {
        if self.as_os_str().is_empty() {
            faults.add(Error::scene(key, "\"\"", "path of a file"));
        }
    }
}

/// Words of a scene file for the variants of an enum: `words!(Scheme, SCHEMES: "cells" => Cells)`.
macro_rules! words {
    ($type:ident, $words:ident: $($word:literal => $variant:ident $({ $($field:tt)* })?),+) => {
        pub(crate) static $words: &[&str] = &[$($word),+];

        impl Value for $type {
            fn read(item: &ListItem<'_>, _: &'static Row) -> Result<Self> {
                item.choice(&[$(($word, Self::$variant $({ $($field)* })?)),+])
            }

            fn write(&self, _: &Row, _: &Base<'_>) -> Result<Option<String>> {
                let word = match self { $(Self::$variant { .. } => $word),+ };
                Ok(Some(quoted(word)))
            }
        }
    };
}
pub(crate) use words;
