//! Errors of values that are not allowed.

use super::row::Kind;
use beamlet_core::{Error, Result, printed};

/// The errors of values found so far.
#[derive(Debug, Default)]
pub(crate) struct Faults(pub Vec<Error>);

impl Faults {
    pub(crate) fn add(&mut self, error: Error) {
        self.0.push(error);
    }

    pub(crate) fn note(&mut self, checked: Result<()>) {
        self.0.extend(checked.err());
    }
}

/// Refuses a number beyond the range of its kind.
pub(crate) fn in_range(key: &str, kind: &Kind, value: f64) -> Result<()> {
    let (dimension, _, range) = kind.measure();
    if range.contains(value) {
        return Ok(());
    }
    let found = dimension.map_or_else(|| format!("{value:?}"), |it| it.rounded(value));
    Err(Error::scene(key, found, kind.range_allowed()))
}

/// Refuses a whole number beyond the range of its kind.
pub(crate) fn whole(key: &str, kind: &Kind, value: u64) -> Result<()> {
    match *kind {
        Kind::Count(low, high) | Kind::Counts(_, low, high) if !(low..=high).contains(&value) => {
            let allowed = format!("a whole number from {low} to {high}");
            Err(Error::scene(key, value.to_string(), allowed))
        }
        _ => Ok(()),
    }
}

/// Refuses a name that cannot be shown.
pub(crate) fn named(key: &str, name: &str) -> Result<()> {
    if name.trim().is_empty() {
        return Err(Error::scene(key, format!("{name:?}"), "a name"));
    }
    if name.chars().any(printed::is_unsafe) {
        let found = format!("\"{}\"", printed::line(name));
        return Err(Error::scene(key, found, "a name without control or bidirectional characters"));
    }
    Ok(())
}
