//! Names from files and from users as they are printed: without control characters, which
//! terminals obey, and without bidirectional ones, which reorder what is read.

use std::path::Path;

/// Control characters, bidirectional marks and line separators: they change how the text around
/// them is shown.
#[must_use]
pub fn is_unsafe(c: char) -> bool {
    c.is_control()
        || matches!(c, '\u{061c}' | '\u{200e}' | '\u{200f}' | '\u{2028}'..='\u{202e}'
            | '\u{2066}'..='\u{2069}' | '\u{feff}')
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

/// A path on one line.
#[must_use]
pub fn path(path: &Path) -> String {
    line(&path.to_string_lossy())
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
    fn control_and_bidirectional_characters_are_escaped_and_others_stay() {
        assert_eq!(line("a\u{1b}[31m\u{202e}b\n"), "a\\u001b[31m\\u202eb\\u000a");
        assert_eq!(lines("Größe σ²\n\t\u{85}"), "Größe σ²\n\t\\u0085");
    }
}
