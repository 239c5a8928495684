//! Numbers in the names of the files of a folder, with signs and decimals.
//!
//! A point between two groups of digits is a decimal point, unless it is one of several in a chain
//! (`2026.11.24`). Digits behind `e` and a sign are an exponent (`5e-06`, `1.5e-05`), unless it is one digit
//! behind a number without decimals that follows a letter (`sample2e-1`). A `-` or `+` before digits is a sign where it is the first character or follows one
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
    /// Power of ten.
    exponent: Option<i32>,
}

/// One number of every name.
#[derive(Debug, Clone)]
pub(super) struct Column {
    /// Values times 10 to the power of `decimals`.
    pub(super) values: Vec<i128>,
    pub(super) decimals: usize,
    /// True if the numbers measure and do not count, as numbers with exponents.
    pub(super) measures: bool,
    /// Number of digits of the whole part, if all names have the same.
    pub(super) digits: Option<usize>,
    /// True if at most one character parts it from the number before it.
    pub(super) is_joined: bool,
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
        let mut written = Written {
            sign: None,
            apart: false,
            whole: whole.to_owned(),
            fraction: String::new(),
            exponent: None,
        };
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
        rest = take_exponent(rest, &text, &mut written);
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

/// Moves an exponent from the beginning of the text behind a number to the number; returns the rest. `text`:
/// before the number.
fn take_exponent<'a>(rest: &'a str, text: &str, number: &mut Written) -> &'a str {
    let signed = rest.strip_prefix(['e', 'E']).filter(|rest| rest.starts_with(['-', '+']));
    let Some(signed) = signed else { return rest };
    let digits = digits(&signed[1..]);
    let behind = &signed[1 + digits.len()..];
    let is_apart = text.chars().last().is_none_or(|c| !c.is_alphanumeric());
    let is_exponent = matches!(digits.len(), 1..=3)
        && (is_apart || digits.len() > 1 || !number.fraction.is_empty());
    number.exponent = signed[..1 + digits.len()].parse().ok().filter(|_| is_exponent);
    if number.exponent.is_some() { behind } else { rest }
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
    // Digits behind the point, of numbers without exponent.
    let behind = |number: &Written| {
        let digits = i64::try_from(number.fraction.len()).unwrap_or(i64::MAX);
        digits.saturating_sub(number.exponent.unwrap_or(0).into()).max(0)
    };
    let decimals = written().map(behind).max().unwrap_or(0);
    let value = |(path, number): (&PathBuf, &Written)| {
        let fraction = i64::try_from(number.fraction.len()).unwrap_or(i64::MAX);
        let zeros = decimals - fraction + i64::from(number.exponent.unwrap_or(0));
        let zeros = usize::try_from(zeros).unwrap_or(0);
        let digits = format!("{}{}{}", number.whole, number.fraction, "0".repeat(zeros));
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
    let measures = written().any(|number| number.exponent.is_some());
    if !measures {
        ambiguous(paths, names, place)?;
    }
    let length = |number: &Written| number.whole.len();
    let digits = written().next().map(length).filter(|one| written().all(|it| length(it) == *one));
    let is_joined = place > 0 && names[0].texts[place].chars().count() <= 1;
    let decimals = usize::try_from(decimals).unwrap_or(0);
    Ok(Column { values, decimals, measures, digits, is_joined })
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
