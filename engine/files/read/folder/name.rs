//! Numbers in the names of the files of a folder, with signs and decimals.
//!
//! A point between two groups of digits is a decimal point, unless it is one of several in a chain
//! (`2026.11.24`). A `-` or `+` before digits is a sign where it is the first character or follows one
//! that is neither letter nor digit (`scan_-10`), and where other names of the folder have another
//! sign or none at this place (`scan-10`, `scan10`). Behind a letter in all names (`step-003`) or
//! behind a digit (`2026-11-24`) it is a part of the text.

use beamlet_core::{Error, Result};
use std::path::{Path, PathBuf};

/// Digits of a number at most, those behind the point included: 10 to their power fits an `i128`.
const DIGITS: usize = 37;

/// A name as text with numbers in between.
#[derive(Debug)]
struct Name {
    /// The text before each number, without signs, and the text behind the last.
    texts: Vec<String>,
    numbers: Vec<Written>,
}

/// A number as it is written.
#[derive(Debug)]
struct Written {
    sign: Option<char>,
    /// The sign is at the beginning, or behind a character that is neither letter nor digit.
    apart: bool,
    whole: String,
    fraction: String,
}

/// One number of every name.
#[derive(Debug)]
pub(super) struct Column {
    /// Values times 10 to the power of `decimals`.
    pub(super) values: Vec<i128>,
    pub(super) decimals: usize,
}

impl Column {
    /// A value as people write it.
    pub(super) fn shown(&self, value: i128) -> String {
        let sign = if value < 0 { "-" } else { "" };
        let digits = format!("{:0width$}", value.unsigned_abs(), width = self.decimals + 1);
        match digits.split_at(digits.len() - self.decimals) {
            (whole, "") => format!("{sign}{whole}"),
            (whole, fraction) => format!("{sign}{whole}.{fraction}"),
        }
    }
}

/// The numbers of the names of `paths`, one column for each place; none where no name has any.
///
/// # Errors
/// [`Error::File`] where names differ in more than their numbers.
pub(super) fn columns(folder: &Path, paths: &[PathBuf]) -> Result<Vec<Column>> {
    let mut names: Vec<Name> = paths.iter().map(|path| parsed(&stem(path))).collect();
    let Some(count) = names.first().map(|name| name.numbers.len()) else { return Ok(Vec::new()) };
    let differ = |other: usize, how: &str| {
        let [first, other] = [&paths[0], &paths[other]].map(|path| shown(path));
        let problem = format!(
            "holds {first} and {other}, {how}; allowed: names that differ in their numbers alone, such as \
             step_0, step_1"
        );
        Error::file(folder, problem, None)
    };
    if let Some(other) = names.iter().position(|name| name.numbers.len() != count) {
        return Err(differ(other, "which have different counts of numbers"));
    }
    if count == 0 {
        return Ok(Vec::new());
    }
    (0..count).for_each(|place| unsigned(&mut names, place));
    if let Some(other) = names.iter().position(|name| name.texts != names[0].texts) {
        return Err(differ(other, "which differ in more than numbers"));
    }
    (0..count).map(|place| column(paths, &names, place)).collect()
}

/// Name of a path, for messages.
pub(super) fn shown(path: &Path) -> String {
    path.file_name().unwrap_or_default().display().to_string()
}

/// The name in a path: for a file without its ending.
fn stem(path: &Path) -> String {
    let name = if path.is_dir() { path.file_name() } else { path.file_stem() };
    name.unwrap_or_default().to_string_lossy().into_owned()
}

fn parsed(name: &str) -> Name {
    let mut parsed = Name { texts: Vec::new(), numbers: Vec::new() };
    let (mut text, mut rest) = (String::new(), name);
    while let Some(start) = rest.find(|c: char| c.is_ascii_digit()) {
        text.push_str(&rest[..start]);
        rest = &rest[start..];
        let whole = digits(rest);
        let mut written =
            Written { sign: None, apart: false, whole: whole.to_owned(), fraction: String::new() };
        rest = &rest[whole.len()..];
        // A chain of several points has none that is decimal.
        let fraction = rest.strip_prefix('.').map_or("", digits);
        let behind = &rest[if fraction.is_empty() { 0 } else { 1 + fraction.len() }..];
        let goes_on = behind.strip_prefix('.').is_some_and(|more| !digits(more).is_empty());
        let in_chain = text == "." && !parsed.numbers.is_empty();
        if !fraction.is_empty() && !goes_on && !in_chain {
            fraction.clone_into(&mut written.fraction);
            rest = behind;
        }
        take_sign(&mut text, &mut written, !parsed.numbers.is_empty());
        parsed.texts.push(std::mem::take(&mut text));
        parsed.numbers.push(written);
    }
    parsed.texts.push(rest.to_owned());
    parsed
}

/// The digits that a text begins with.
fn digits(text: &str) -> &str {
    let end = text.find(|c: char| !c.is_ascii_digit()).unwrap_or(text.len());
    &text[..end]
}

/// Moves a sign from the end of the text before a number to the number. `behind`: there is a number
/// before the text.
fn take_sign(text: &mut String, number: &mut Written, behind: bool) {
    let Some(sign) = text.chars().last().filter(|c| ['-', '+', '\u{2212}'].contains(c)) else {
        return;
    };
    let before = text[..text.len() - sign.len_utf8()].chars().last();
    // Directly behind a number it joins two.
    if before.is_none() && behind {
        return;
    }
    text.truncate(text.len() - sign.len_utf8());
    number.sign = Some(if sign == '+' { '+' } else { '-' });
    number.apart = before.is_none_or(|c| !c.is_alphanumeric());
}

/// Gives signs at a place back to the text, where they are none.
fn unsigned(names: &mut [Name], place: usize) {
    let first = names[0].numbers[place].sign;
    let alike = names.iter().all(|name| name.numbers[place].sign == first);
    let apart = names.iter().any(|name| name.numbers[place].apart);
    if !alike || apart {
        return;
    }
    for name in names {
        if let Some(sign) = name.numbers[place].sign.take() {
            name.texts[place].push(sign);
        }
    }
}

/// The numbers at a place.
fn column(paths: &[PathBuf], names: &[Name], place: usize) -> Result<Column> {
    let written = || names.iter().map(|name| &name.numbers[place]);
    let decimals = written().map(|number| number.fraction.len()).max().unwrap_or(0);
    let value = |(path, number): (&PathBuf, &Written)| {
        let digits = format!("{}{:0<decimals$}", number.whole, number.fraction);
        let digits = digits.trim_start_matches('0');
        let value = match digits {
            "" => Some(0),
            digits if digits.len() <= DIGITS => digits.parse::<i128>().ok(),
            _ => None,
        };
        let value = value.ok_or_else(|| {
            let problem = format!("has a number of more than {DIGITS} digits in its name");
            Error::file(path, problem, None)
        })?;
        Ok(if number.sign == Some('-') { -value } else { value })
    };
    let values = paths.iter().zip(written()).map(value).collect::<Result<_>>()?;
    ambiguous(paths, names, place)?;
    Ok(Column { values, decimals })
}

/// Refuses `1.2` beside `1.10`: of decimals it is the larger one, of two numbers the smaller one.
fn ambiguous(paths: &[PathBuf], names: &[Name], place: usize) -> Result<()> {
    let fractions = || names.iter().map(|name| name.numbers[place].fraction.as_str());
    let padded = fractions().position(|fraction| fraction.len() > 1 && fraction.ends_with('0'));
    let Some(padded) = padded else { return Ok(()) };
    let long = names[padded].numbers[place].fraction.len();
    let Some(short) = fractions().position(|other| !other.is_empty() && other.len() != long) else {
        return Ok(());
    };
    let problem = format!(
        "and {} have different numbers of decimals; allowed: the same number in all names, or \
         another character than a point between two numbers",
        shown(&paths[short])
    );
    Err(Error::file(&paths[padded], problem, None))
}
