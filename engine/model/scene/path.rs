//! Paths of keys: `detector.pitch`, `object[0].material`, `materials."my resin".density`.

/// One step of a path.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Step {
    /// Key of a table, or name of an object.
    Key(String),
    /// Index into a list.
    Index(usize),
}

/// Splits a path into its steps; `None` if it is none.
pub(super) fn parse(text: &str) -> Option<Vec<Step>> {
    let mut steps = Vec::new();
    let mut rest = text.trim();
    loop {
        if let Some(quoted) = rest.strip_prefix('"') {
            let (key, after) = quoted.split_once('"')?;
            steps.push(Step::Key(key.to_owned()));
            rest = after;
        } else {
            let end = rest.find(['.', '[']).unwrap_or(rest.len());
            let key = rest[..end].trim();
            if key.is_empty() {
                return None;
            }
            steps.push(Step::Key(key.to_owned()));
            rest = &rest[end..];
        }
        while let Some(index) = rest.strip_prefix('[') {
            let (index, after) = index.split_once(']')?;
            steps.push(Step::Index(index.trim().parse().ok()?));
            rest = after;
        }
        if rest.is_empty() {
            return Some(steps);
        }
        rest = rest.strip_prefix('.')?;
    }
}

/// True if a key needs no quotes, in a path and in TOML.
pub(super) fn is_bare(key: &str) -> bool {
    !key.is_empty() && key.chars().all(|c| c.is_ascii_alphanumeric() || c == '_' || c == '-')
}

/// The path of `key` inside the table at `table`.
pub(crate) fn join(table: &str, key: &str) -> String {
    let key = if is_bare(key) { key.to_owned() } else { format!("\"{key}\"") };
    if table.is_empty() { key } else { format!("{table}.{key}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn key(key: &str) -> Step {
        Step::Key(key.to_owned())
    }

    #[test]
    fn paths_split_into_keys_and_indices() {
        assert_eq!(parse("source.energy"), Some(vec![key("source"), key("energy")]));
        assert_eq!(
            parse("object[2].rotate[0].angle"),
            Some(vec![key("object"), Step::Index(2), key("rotate"), Step::Index(0), key("angle")])
        );
        assert_eq!(parse(&join("materials", "a.b c")), Some(vec![key("materials"), key("a.b c")]));
    }

    #[test]
    fn broken_paths_are_refused() {
        for text in ["", ".", "a.", ".a", "a[", "a[x]", "a[-1]", "a[0]b", "a..b", "\"a"] {
            assert_eq!(parse(text), None, "{text}");
        }
    }
}
