//! The table of docs/sampling-constants.md has the constants of the sources.

use super::crates::{code_of, sources};
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

const TABLE: &str = "docs/sampling-constants.md";

/// Values by file and name.
type Values = BTreeMap<(String, String), String>;

/// Adds the constants of a source in Rust or GLSL.
fn add_constants(file: &str, code: &str, [floats, others]: [&mut Values; 2]) {
    let mut lines = code.lines().map(str::trim);
    while let Some(line) = lines.next() {
        let parts = line.split_once("const ");
        let is_start = |before: &str| before.is_empty() || before.starts_with("pub");
        let Some((_, declared)) = parts.filter(|it| is_start(it.0)) else { continue };
        let mut declared = declared.to_owned();
        while !declared.ends_with([';', '{']) {
            let Some(next) = lines.next() else { break };
            declared = format!("{declared} {next}");
        }
        let Some((left, value)) = declared.split_once(" = ") else { continue };
        // `NAME: f32` or `float NAME`.
        let in_glsl = || left.split_once(' ').map(|(kind, name)| (name, kind));
        let Some((name, kind)) = left.split_once(": ").or_else(in_glsl) else { continue };
        let name = name.split('[').next().unwrap_or_default();
        if !name.contains(|c: char| c != '_' && !c.is_uppercase() && !c.is_numeric()) {
            let kind = kind.trim_start_matches('[');
            let is_float = ["f32", "f64", "float"].iter().any(|float| kind.starts_with(float));
            let own = if is_float { &mut *floats } else { &mut *others };
            let value = value.trim_end_matches(';').to_owned();
            own.insert((file.to_owned(), name.to_owned()), value);
        }
    }
}

/// Values of the table. A row without a file has the file of the row above.
fn table() -> Values {
    let text = fs::read_to_string(TABLE).expect("the table");
    let (mut rows, mut file) = (Values::new(), "");
    for line in text.lines() {
        let cells: Vec<&str> = line.split(" | ").collect();
        let [first, name, value, _, _, _, _] = cells[..] else { continue };
        let own = first.trim_start_matches('|').trim();
        file = if own.is_empty() { file } else { own };
        if let Some(name) = name.strip_prefix('`') {
            let key = (file.to_owned(), name.trim_end_matches('`').to_owned());
            let before = rows.insert(key, value.trim_matches('`').to_owned());
            assert!(before.is_none(), "{TABLE}: two rows of {file}, {name}");
        }
    }
    rows
}

/// A value without spaces and grouping of digits.
fn plain(value: &str) -> String {
    value.chars().filter(|c| !c.is_whitespace() && *c != '_').collect()
}

#[test]
fn table_of_constants_is_that_of_the_sources() {
    let mut paths = Vec::new();
    for folder in ["engine/simulate/sampling", "engine/simulate/refine"] {
        sources(Path::new(folder), &mut paths);
    }
    let shaders = fs::read_dir("shaders/refine").expect("a folder of shaders");
    paths.extend(shaders.map(|entry| entry.expect("a shader").path()));
    let (mut floats, mut others, table) = (Values::new(), Values::new(), table());
    for path in paths {
        let code = code_of(&fs::read_to_string(&path).expect("a source in UTF-8"));
        let path = path.to_string_lossy().replace('\\', "/");
        let file = path.trim_start_matches("engine/simulate/").trim_start_matches("shaders/");
        add_constants(file, &code, [&mut floats, &mut others]);
    }
    let mut problems = Vec::new();
    for key in floats.keys().chain(table.keys().filter(|key| !floats.contains_key(*key))) {
        let source = floats.get(key).or_else(|| others.get(key)).map_or("nothing", String::as_str);
        let row = table.get(key).map_or("nothing", String::as_str);
        if plain(source) != plain(row) {
            problems.push(format!("{}: {} = {source}, in {TABLE} {row}", key.0, key.1));
        }
    }
    assert!(problems.is_empty(), "{}", problems.join("\n"));
    assert!(floats.len() > 60, "only {} constants", floats.len());
}
