//! Mask offsets from a list or a file.

use beamlet_core::csv_table::{Numbered, Quantities, TableKind};
use beamlet_core::units::Dimension::Length;
use beamlet_core::{Error, Result, input_file};
use std::path::Path;

/// Files of offsets with a header.
const TABLE: Quantities = Quantities {
    kind: TableKind {
        key: "offset",
        noun: "offsets",
        columns: "the column offset_UNIT with a unit of length, as offset_um",
        most: 1 << 20,
    },
    name: "offset",
    dimension: Some(Length),
    columns: Numbered::No,
};

/// Mask offsets from a list such as "-10 um, 0 um, 10 um", or from a file with one per line, or with a header as
/// tables of scenes have it.
///
/// # Errors
/// [`Error::File`] for a file that cannot be read; [`Error::Argument`] for a value without a unit,
/// naming its place in the list.
pub fn offsets(list_or_file: &str) -> Result<Vec<f64>> {
    let path = Path::new(list_or_file);
    // A word that begins with no number can only be meant as the name of a file.
    let begins = |c: char| c.is_ascii_digit() || "+-.,\u{2212}".contains(c);
    let named = !list_or_file.trim().is_empty() && !list_or_file.trim_start().starts_with(begins);
    let text = if path.is_file() || named {
        let problem =
            "cannot be read as a file of offsets, nor is it a list such as \"-10 um, 0 um\"";
        input_file::text(path).map_err(|error| Error::file(path, problem, Some(error)))?
    } else {
        list_or_file.to_owned()
    };
    let is_table = |text: &str| {
        let mut lines = text.lines().map(|line| line.trim().trim_start_matches('"'));
        let head = lines.find(|line| !line.is_empty() && !line.starts_with('#'));
        let head = head.and_then(|head| head.get(..TABLE.name.len()));
        head.is_some_and(|head| head.eq_ignore_ascii_case(TABLE.name))
    };
    if path.is_file() && is_table(&text) {
        return Ok(TABLE.read(path)?.into_iter().flatten().collect());
    }
    let words = text
        .lines()
        .map(|line| line.split('#').next().unwrap_or_default())
        .flat_map(|line| line.split([',', ';', '\t']))
        .map(|word| word.trim().trim_matches('"').trim())
        .filter(|word| !word.is_empty());
    let offsets: Vec<f64> = words
        .enumerate()
        .map(|(index, word)| {
            Length.parse(word).map_err(|error| {
                let allowed = "lengths with units, as in \"-10 um, 0 um, 10 um\", or a file with \
                               one on each line";
                Error::argument(format!("offsets[{index}]"), error.found, allowed)
            })
        })
        .collect::<Result<_>>()?;
    if offsets.is_empty() {
        return Err(Error::argument("offsets", "nothing", "at least one length"));
    }
    Ok(offsets)
}
