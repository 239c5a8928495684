//! Errors of values that are not allowed.

use super::row::Kind;
use crate::scene::limits;
use beamlet_core::units::Dimension::Length;
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
    let found = || dimension.map_or_else(|| format!("{value:?}"), |it| it.rounded(value));
    if !range.contains(value) {
        return Err(Error::scene(key, found(), kind.range_allowed()));
    }
    if dimension == Some(Length) && !limits::is_length(value) {
        return Err(Error::scene(key, found(), too_long()));
    }
    Ok(())
}

/// Allowed lengths of every key.
pub(crate) fn too_long() -> String {
    format!("a length up to {}", Length.rounded(limits::LENGTH))
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

/// Refuses a name that cannot be shown, or is longer than lines of reports.
pub(crate) fn named(key: &str, name: &str) -> Result<()> {
    let count = name.chars().count();
    if count > limits::NAME {
        let found = format!("a name of {count} characters");
        return Err(Error::scene(key, found, format!("1 to {} characters", limits::NAME)));
    }
    if name.trim().is_empty() {
        return Err(Error::scene(key, format!("{name:?}"), "a name"));
    }
    if name.chars().any(printed::is_unsafe) {
        let found = format!("\"{}\"", printed::line(name));
        return Err(Error::scene(key, found, "a name without control or bidirectional characters"));
    }
    Ok(())
}
