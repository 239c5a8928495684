//! Values and lines of TOML.

use std::fmt::{Display, Write};

use beamlet_core::units::Dimension;

/// A TOML text that grows line by line.
#[derive(Debug, Default)]
pub(super) struct Text(pub(super) String);

impl Text {
    pub(super) fn table(&mut self, header: &str) {
        let _ = writeln!(self.0, "\n{header}");
    }

    pub(super) fn comment(&mut self, text: &str) {
        // A comment ends with its line, and TOML allows no control characters in it.
        let line: String = text.chars().map(|c| if c.is_control() { ' ' } else { c }).collect();
        let _ = writeln!(self.0, "# {line}");
    }

    /// A key with a value that is TOML already.
    pub(super) fn raw(&mut self, key: &str, value: impl Display) {
        let _ = writeln!(self.0, "{key} = {value}");
    }
}

pub(super) fn quantity(value: f64, dimension: Dimension) -> String {
    quoted(&dimension.format(value))
}

pub(super) fn list(values: &[f64], dimension: Dimension) -> String {
    let texts: Vec<_> = values.iter().map(|value| quantity(*value, dimension)).collect();
    format!("[{}]", texts.join(", "))
}

/// Shortest text that reads back to the same number.
pub(super) fn number(value: f64) -> String {
    format!("{value:?}")
}

/// A TOML basic string.
pub(super) fn quoted(text: &str) -> String {
    let mut out = String::from("\"");
    for c in text.chars() {
        match c {
            '"' | '\\' => out.extend(['\\', c]),
            c if c.is_control() => {
                let _ = write!(out, "\\u{:04X}", u32::from(c));
            }
            c => out.push(c),
        }
    }
    out.push('"');
    out
}
