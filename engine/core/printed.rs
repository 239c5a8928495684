//! Text for printing. Names from files and from users: without control characters, which terminals obey,
//! and without bidirectional ones, which reorder text. Numbers: short.

use std::borrow::Cow;
use std::path::Path;

/// Control characters, bidirectional marks and line separators: they change how the text around
/// them is shown.
#[must_use]
pub fn is_unsafe(c: char) -> bool {
    c.is_control()
        || matches!(c, '\u{061c}' | '\u{200e}' | '\u{200f}' | '\u{2028}'..='\u{202e}'
            | '\u{2066}'..='\u{2069}' | '\u{feff}')
}

/// A number of things: "1 view", "3 views".
#[must_use]
pub fn counted(count: usize, thing: &str) -> String {
    match count {
        1 => format!("1 {thing}"),
        count => format!("{count} {thing}s"),
    }
}

/// A text on one line: unsafe characters as `\u001b`, which JSON strings take too.
#[must_use]
pub fn line(text: &str) -> String {
    escape(text, |c| !is_unsafe(c))
}

/// A text that keeps its line breaks and tabs.
#[must_use]
pub fn lines(text: &str) -> String {
    escape(text, |c| c == '\n' || c == '\t' || !is_unsafe(c))
}

/// Most characters of a text that is printed in full.
const MOST: usize = 500;
/// Printed characters of a longer one.
const BEGINNING: usize = 120;

/// A text that was found, or its beginning and how long it is.
pub(crate) fn beginning(text: &str) -> Cow<'_, str> {
    // At most four bytes to a character.
    if text.len() <= MOST || text.chars().count() <= MOST {
        return text.into();
    }
    let shown: String = text.chars().take(BEGINNING).collect();
    format!("{shown}… ({} characters)", text.chars().count()).into()
}

/// A path on one line.
#[must_use]
pub fn path(path: &Path) -> String {
    line(&path.to_string_lossy())
}

/// A name with its unit in brackets, as of a column or an axis; without a unit the name alone.
#[must_use]
pub fn with_unit(name: &str, unit: &str) -> String {
    match unit {
        "" => name.to_owned(),
        unit => format!("{name} [{unit}]"),
    }
}

/// Five significant digits without trailing zeros, and whole numbers below 1e9 in full: 0.59,
/// 1234567, 2.56e-7.
#[must_use]
pub fn number(value: f64) -> String {
    let rounded: f64 = format!("{value:.4e}").parse().unwrap_or(value);
    match value.abs() {
        size if (1e5..1e9).contains(&size) => format!("{value:.0}"),
        size if (1e-4..1e5).contains(&size) || size == 0.0 || !size.is_finite() => {
            rounded.to_string()
        }
        _ => format!("{rounded:e}"),
    }
}

/// A time in the unit that suits it, to two digits.
pub fn duration(seconds: f64) -> String {
    match seconds {
        s if s < 10.0 => format!("{s:.1} s"),
        s if s < 300.0 => format!("{s:.0} s"),
        s if s < 3.0 * 3600.0 => format!("{:.0} min", s / 60.0),
        s if s < 72.0 * 3600.0 => format!("{:.0} h", s / 3600.0),
        s => format!("{:.0} days", s / 86400.0),
    }
}

fn escape(text: &str, keep: impl Fn(char) -> bool) -> String {
    use std::fmt::Write;
    text.chars().fold(String::with_capacity(text.len()), |mut out, c| {
        if keep(c) {
            out.push(c);
        } else {
            let _ = write!(out, "\\u{:04x}", u32::from(c));
        }
        out
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_keep_five_digits_and_no_zeros_behind() {
        for (value, text) in [
            (0.59, "0.59"),
            (51.234_56, "51.235"),
            (53_122.4, "53122"),
            (-8.0, "-8"),
            (0.0, "0"),
            (2.56e-7, "2.56e-7"),
            (1e-4, "0.0001"),
            (1_234_567.0, "1234567"),
            (1.234_56e12, "1.2346e12"),
            (f64::INFINITY, "inf"),
            (f64::NAN, "NaN"),
        ] {
            assert_eq!(number(value), text);
        }
    }

    #[test]
    fn long_texts_are_shown_by_their_beginning() {
        assert_eq!(beginning("12 µm"), "12 µm");
        let long = beginning(&"µ".repeat(300_000)).into_owned();
        assert!(long.ends_with("µµ… (300000 characters)") && long.chars().count() < 200);
    }

    #[test]
    fn control_and_bidirectional_characters_are_escaped_and_others_stay() {
        assert_eq!(line("a\u{1b}[31m\u{202e}b\n"), "a\\u001b[31m\\u202eb\\u000a");
        assert_eq!(lines("Größe σ²\n\t\u{85}"), "Größe σ²\n\t\\u0085");
    }
}
