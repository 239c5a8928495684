//! Options as keywords of Python: types, defaults, and meanings in its words.

use super::table::{Need, Options, Relation, Row};
use std::fmt::Write as _;

/// An option as a keyword of Python.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Keyword {
    /// Its name.
    pub name: &'static str,
    /// Its type.
    pub python: String,
    /// Its default, as Python writes it.
    pub default: String,
    /// Meaning and default, without a full stop.
    pub doc: String,
    /// Form of its value, where Python has one of its own.
    pub form: Option<&'static str>,
    /// True if functions declare it as a parameter.
    pub is_declared: bool,
    /// True if it belongs to measured stacks: it needs `flat`.
    pub is_measured: bool,
}

/// Keywords of a verb.
#[must_use]
pub fn keywords<T: Options>() -> Vec<Keyword> {
    T::ROWS.iter().filter(|row| !row.is(Relation::Program)).map(keyword).collect()
}

fn keyword<T>(row: &Row<T>) -> Keyword {
    let python = row.form.python;
    let is_text = !matches!(python, "float" | "int");
    let (python, default) = match row.need {
        _ if row.form.is_switch() => (python.to_owned(), "False".to_owned()),
        Need::Default(text) if is_text => (python.to_owned(), format!("{text:?}")),
        Need::Default(text) => (python.to_owned(), text.to_owned()),
        Need::Required | Need::Without(_) => (format!("{python} | None"), "None".to_owned()),
    };
    let mut doc = python_words(row.doc);
    for word in (row.form.words)().iter().filter(|word| !word.help.is_empty()) {
        let _ = write!(doc, "; ``{}``: {}", word.name, python_words(word.help));
    }
    let form = row.form.python_form();
    if let Some(form) = form {
        let _ = write!(doc, "; given as {form}");
    }
    if let Need::Without(words) = row.need
        && !words.is_empty()
    {
        let _ = write!(doc, "; default: {}", python_words(words));
    }
    Keyword {
        name: row.name,
        python,
        default,
        doc,
        form,
        is_declared: row.is(Relation::Position) || row.is(Relation::Declared),
        is_measured: row.needs().contains(&"flat"),
    }
}

/// A text with the keywords of Python in place of options of the command line: `--read-noise` becomes `read_noise`.
#[must_use]
pub fn python_words(text: &str) -> String {
    let mut parts = text.split("--");
    let mut out = parts.next().unwrap_or_default().to_owned();
    for part in parts {
        let is_end = |c: char| !(c.is_ascii_lowercase() || c == '-');
        let (name, rest) = part.split_at(part.find(is_end).unwrap_or(part.len()));
        let _ = write!(out, "`{}`{rest}", name.replace('-', "_"));
    }
    out
}

/// A `TypedDict` in Python that adds the keywords that `is_of` selects to the keywords of `base`.
#[must_use]
pub fn typed_dict(
    name: &str,
    base: &str,
    keywords: &[Keyword],
    is_of: fn(&Keyword) -> bool,
) -> String {
    let mut out = format!("\n\nclass {name}({base}, total=False):\n");
    for it in keywords.iter().filter(|it| !it.is_declared && is_of(it)) {
        let _ = writeln!(out, "    {}: {}", it.name, it.python);
    }
    out
}

/// Types of the words that the options of a verb take.
#[must_use]
pub fn literals<T: Options>() -> String {
    let mut out = String::new();
    for row in T::ROWS.iter().filter(|row| !row.is(Relation::Program)) {
        let words: Vec<_> = (row.form.words)().iter().map(|it| format!("{:?}", it.name)).collect();
        let name = row.form.python.split(' ').next().unwrap_or_default();
        if !words.is_empty() {
            let _ = writeln!(out, "{name} = Literal[{}]", words.join(", "));
        }
    }
    out
}

/// A table of keywords in Markdown with their meanings.
#[must_use]
pub fn page_rows(keywords: &[Keyword]) -> String {
    table(keywords, "meaning", |it| &it.doc)
}

/// A table of keywords in Markdown with the forms of their values: docs/cli.md has the meanings.
#[must_use]
pub fn form_rows(keywords: &[Keyword]) -> String {
    table(keywords, "given as", |it| it.form.unwrap_or_default())
}

fn table(keywords: &[Keyword], last: &str, text: fn(&Keyword) -> &str) -> String {
    let mut out = format!("| argument | type | default | {last} |\n|---|---|---|---|\n");
    for it in keywords {
        let [python, text] = [it.python.as_str(), text(it)].map(|text| text.replace('|', "\\|"));
        let text = text.replace("``", "`");
        let _ = writeln!(out, "| `{}` | `{python}` | `{}` | {text} |", it.name, it.default);
    }
    out
}
