//! Words of a text with the numbers of their lines.

/// Words that follow in a text.
#[derive(Clone, Copy)]
pub(super) struct Words<'a> {
    /// The text behind the last word.
    pub(super) rest: &'a str,
    /// Number of the line of the last word.
    pub(super) line: usize,
}

impl<'a> Words<'a> {
    /// The next word. Behind the last one the number of the line stays.
    pub(super) fn next(&mut self) -> Option<&'a str> {
        let start = self.rest.find(|c: char| !c.is_ascii_whitespace())?;
        self.line += self.rest[..start].bytes().filter(|byte| *byte == b'\n').count();
        let rest = &self.rest[start..];
        let end = rest.find(|c: char| c.is_ascii_whitespace()).unwrap_or(rest.len());
        self.rest = &rest[end..];
        Some(&rest[..end])
    }
}
