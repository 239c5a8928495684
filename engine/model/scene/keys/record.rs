//! Structs of the model as tables of a scene file: read, written and checked key by key.

use std::fmt;

use super::faults::Faults;
use super::row::{Kind, Need, Row, Spec};
use super::value::{Base, Value};
use crate::scene::table::{ListItem, Table};
use beamlet_core::Result;

/// A table of the scene file, with the place of each key in a struct.
pub(crate) struct Keys<T: 'static> {
    pub(crate) spec: Spec,
    /// `None` for a key that code beside the table reads.
    pub(crate) fields: &'static [Option<&'static dyn Field<T>>],
}

impl<T> fmt::Debug for Keys<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.spec.fmt(f)
    }
}

/// The place of a key in a struct or in a variant of an enum.
pub(crate) trait Field<T>: Sync {
    /// True if the value has this place.
    fn holds(&self, it: &T) -> bool;
    /// Reads the key into its place.
    fn read(&self, it: &mut T, item: &ListItem<'_>, row: &'static Row) -> Result<()>;
    /// The value at the place as TOML; `None` where it has no such place or leaves the key out.
    fn write(&self, it: &T, row: &Row, base: &Base<'_>) -> Result<Option<String>>;
    /// Reports values of the place that are not allowed.
    fn check(&self, it: &T, key: &str, row: &Row, faults: &mut Faults);
}

/// A place by two functions.
pub(crate) struct At<T: 'static, V: 'static> {
    pub(crate) get: for<'a> fn(&'a T) -> Option<&'a V>,
    pub(crate) set: for<'a> fn(&'a mut T) -> Option<&'a mut V>,
}

impl<T, V: Value> Field<T> for At<T, V> {
    fn holds(&self, it: &T) -> bool {
        (self.get)(it).is_some()
    }

    fn read(&self, it: &mut T, item: &ListItem<'_>, row: &'static Row) -> Result<()> {
        if let Some(place) = (self.set)(it) {
            *place = V::read(item, row)?;
        }
        Ok(())
    }

    fn write(&self, it: &T, row: &Row, base: &Base<'_>) -> Result<Option<String>> {
        (self.get)(it).map_or(Ok(None), |value| value.write(row, base))
    }

    fn check(&self, it: &T, key: &str, row: &Row, faults: &mut Faults) {
        if let Some(value) = (self.get)(it) {
            value.check(key, row, faults);
        }
    }
}

/// A table of keys: `keys! { NAME: Struct, "path", [groups], [other names]; rows }`, or without the
/// struct where other code reads the table. A row is `name => kind, need, example, documentation;`.
/// Its place is the field of its name; `name at PATTERN` has the pattern that binds `name`, and
/// `name by hand` has no place, and `name by FIELD` a `Field` of its own.
macro_rules! keys {
    (@place $type:ty, $name:ident by hand) => { None };
    (@place $type:ty, $name:ident by $field:ident) => { Some(&$field) };
    (@place $type:ty, $name:ident at $place:pat) => {
        Some(&$crate::scene::keys::record::At {
            get: |it: &$type| match it { $place => Some($name), _ => None },
            set: |it: &mut $type| match it { $place => Some($name), _ => None },
        })
    };
    (@place $type:ty, $name:ident) => {
        Some(&$crate::scene::keys::record::At {
            get: |it: &$type| Some(&it.$name),
            set: |it: &mut $type| Some(&mut it.$name),
        })
    };
    (@spec $path:literal, [$($group:expr),*], [$($other:literal => $meant:literal),*];
     $($name:ident => $kind:expr, $need:expr, $example:literal, $doc:literal;)*) => {
        $crate::scene::keys::row::Spec {
            path: $path,
            rows: &[$($crate::scene::keys::row::Row {
                name: stringify!($name),
                kind: $kind,
                need: $need,
                example: $example,
                doc: $doc,
            }),*],
            groups: &[$($group),*],
            other_names: &[$(($other, $meant)),*],
        }
    };
    ($table:ident: $type:ty, $path:literal, $groups:tt, $others:tt;
     $($name:ident $(by $hand:ident)? $(at $place:pat)? =>
       $kind:expr, $need:expr, $example:literal, $doc:literal;)*) => {
        #[allow(unreachable_patterns, reason = "structs have all their places, enums some")]
        pub(crate) static $table: $crate::scene::keys::record::Keys<$type> =
            $crate::scene::keys::record::Keys {
                spec: keys!(@spec $path, $groups, $others;
                    $($name => $kind, $need, $example, $doc;)*),
                fields: &[$(keys!(@place $type, $name $(by $hand)? $(at $place)?)),*],
            };
    };
    ($table:ident, $path:literal, $groups:tt, $others:tt;
     $($name:ident => $kind:expr, $need:expr, $example:literal, $doc:literal;)*) => {
        pub(crate) static $table: $crate::scene::keys::row::Spec =
            keys!(@spec $path, $groups, $others; $($name => $kind, $need, $example, $doc;)*);
    };
}
pub(crate) use keys;

impl<T> Keys<T> {
    fn rows(&self) -> impl Iterator<Item = (&'static Row, &'static dyn Field<T>)> {
        let both = self.spec.rows.iter().zip(self.fields);
        both.filter_map(|(row, field)| Some((row, (*field)?)))
    }

    /// True if the value has a place for the first key.
    pub(crate) fn holds(&self, it: &T) -> bool {
        self.rows().next().is_some_and(|(_, field)| field.holds(it))
    }

    /// Reads the keys of a table into a value that has their places.
    pub(crate) fn read(&self, it: &mut T, table: &Table<'_>) -> Result<()> {
        for (row, field) in self.rows() {
            match table.get(row.name) {
                Some(item) if field.holds(it) => {
                    let done = field.read(it, &item, row);
                    item.or_instead(done, ())?;
                }
                Some(item) => {
                    let why = self.spec.with(row.name).map_or("no such key", |(_, why)| why);
                    item.refuse(item.error("the key", why), ())?;
                }
                None if matches!(row.need, Need::Required) && field.holds(it) => {
                    table.require(row.name)?;
                }
                None => {}
            }
        }
        Ok(())
    }

    /// The keys that a value has, each with its value as TOML.
    pub(crate) fn write(&self, it: &T, base: &Base<'_>) -> Result<Vec<(&'static str, String)>> {
        let written = |(row, field): (&'static Row, &dyn Field<T>)| {
            let text = field.write(it, row, base);
            text.map(|text| text.map(|text| (row.name, text))).transpose()
        };
        self.rows().filter_map(written).collect()
    }

    /// Reports values of the keys that are not allowed; `key` makes paths of their names.
    pub(crate) fn check(&self, it: &T, key: &dyn Fn(&str) -> String, faults: &mut Faults) {
        self.rows().for_each(|(row, field)| field.check(it, &key(row.name), row, faults));
    }
}

/// An inline table.
pub(crate) fn inline(keys: &[(&str, String)]) -> String {
    let keys: Vec<_> = keys.iter().map(|(key, text)| format!("{key} = {text}")).collect();
    format!("{{ {} }}", keys.join(", "))
}

/// A struct that is a table of the scene file.
pub(crate) trait Record: Sized + 'static {
    const KEYS: &'static Keys<Self>;

    /// The value before its keys are read: defaults, NaN where a key is required, and the form of
    /// the keys that the table has.
    fn begin(has: &dyn Fn(&str) -> bool) -> Self;

    /// Reads a value that is no table.
    fn short(_: &ListItem<'_>) -> Option<Result<Self>> {
        None
    }

    /// Reads what keys without a place say.
    ///
    /// # Errors
    /// What concerns the table as a whole.
    fn finish(&mut self, _: &Table<'_>) -> Result<()> {
        Ok(())
    }

    /// Notes what several keys do wrong together.
    fn relations(&self, _: &dyn Fn(&str) -> String, _: &mut Faults) {}

    /// True if the resolved scene leaves a key out.
    fn leaves_out(&self, _: &str) -> bool {
        false
    }

    /// Lines of comment before a key of the resolved scene.
    fn comments(&self, _: &str) -> Vec<String> {
        Vec::new()
    }
}

/// Reads a table.
pub(crate) fn read<T: Record>(table: &Table<'_>) -> Result<T> {
    let mut it = T::begin(&|key| table.get(key).is_some());
    T::KEYS.read(&mut it, table)?;
    it.finish(table)?;
    Ok(it)
}

/// Reports values of a table that are not allowed.
pub(crate) fn check<T: Record>(it: &T, key: &dyn Fn(&str) -> String, faults: &mut Faults) {
    T::KEYS.check(it, key, faults);
    it.relations(key, faults);
}

impl<T: Record> Value for T {
    fn read(item: &ListItem<'_>, _: &'static Row) -> Result<Self> {
        if !item.is_table()
            && let Some(short) = T::short(item)
        {
            return short;
        }
        read(&item.table(&T::KEYS.spec)?)
    }

    fn write(&self, _: &Row, base: &Base<'_>) -> Result<Option<String>> {
        Ok(Some(inline(&T::KEYS.write(self, base)?)))
    }

    fn check(&self, key: &str, _: &Row, faults: &mut Faults) {
        check(self, &|name| format!("{key}.{name}"), faults);
    }
}

impl<T: Record> Value for Vec<T> {
    fn read(item: &ListItem<'_>, row: &'static Row) -> Result<Self> {
        let one = |item: &ListItem<'_>| item.or_instead(T::read(item, row), T::begin(&|_| false));
        item.items(&row.allowed())?.iter().map(one).collect()
    }

    fn write(&self, row: &Row, base: &Base<'_>) -> Result<Option<String>> {
        let items = self.iter().map(|item| item.write(row, base)).collect::<Result<Vec<_>>>()?;
        Ok(Some(format!("[{}]", items.into_iter().flatten().collect::<Vec<_>>().join(", "))))
    }

    fn check(&self, key: &str, row: &Row, faults: &mut Faults) {
        for (index, item) in self.iter().enumerate() {
            item.check(&format!("{key}[{index}]"), row, faults);
        }
    }
}

/// Keys, and a value that has their places.
type Begun<T> = (&'static Keys<T>, fn() -> T);

/// An enum that is one of several tables, each under its word: `{ sphere = { radius = "1 mm" } }`.
pub(crate) struct OneOf<T: 'static> {
    pub(crate) spec: &'static Spec,
    /// Keys of each word, in the order of the rows.
    pub(crate) kinds: &'static [Begun<T>],
    /// Placeholder of a wrong value.
    pub(crate) none: fn() -> T,
}

impl<T> OneOf<T> {
    fn named(&self) -> impl Iterator<Item = (&'static str, &'static Begun<T>)> {
        self.spec.rows.iter().map(|row| row.name).zip(self.kinds)
    }

    /// Reads the table of a word.
    pub(crate) fn read_kind(&self, word: &str, item: &ListItem<'_>) -> Result<T> {
        let Some((_, (keys, begin))) = self.named().find(|(name, _)| *name == word) else {
            return Ok((self.none)());
        };
        let mut it = begin();
        keys.read(&mut it, &item.table(&keys.spec)?)?;
        Ok(it)
    }

    pub(crate) fn read(&self, item: &ListItem<'_>) -> Result<T> {
        let table = item.table(self.spec)?;
        match self.named().find_map(|(word, _)| Some((word, table.get(word)?))) {
            Some((word, found)) => self.read_kind(word, &found),
            None => {
                let (forms, _) = self.spec.forms(self.spec.rows[0].name).unwrap_or_default();
                item.refuse(item.mismatch(self.spec.choice(forms)), (self.none)())
            }
        }
    }

    /// The word of a value, and its table as TOML.
    pub(crate) fn write(&self, it: &T, base: &Base<'_>) -> Result<(&'static str, String)> {
        match self.named().find(|(_, (keys, _))| keys.holds(it)) {
            Some((word, (keys, _))) => Ok((word, inline(&keys.write(it, base)?))),
            None => Ok(("", String::new())),
        }
    }

    pub(crate) fn check(&self, it: &T, key: &str, faults: &mut Faults) {
        for (word, (keys, _)) in self.named().filter(|(_, (keys, _))| keys.holds(it)) {
            keys.check(it, &|name| format!("{key}.{word}.{name}"), faults);
        }
    }
}

/// Kind of the values of a table of named values; nothing for another kind.
pub(crate) fn values_of(kind: &'static Kind) -> Option<&'static Kind> {
    match kind {
        Kind::Named(values) => Some(values),
        _ => None,
    }
}
