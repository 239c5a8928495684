//! Names of the files of a run and of retrieved images are literals of engine/files/layout.rs alone.

#![expect(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

use super::crates::sources;
use std::fs;
use std::path::Path;

/// Names that no other literal contains.
const NAMES: [&str; 14] = [
    "scene.toml",
    "geometry.json",
    "run.json",
    "progress.log",
    "report.html",
    "retrieved.json",
    "spool.f32",
    "counts/",
    "sample/",
    "flat/",
    ".beamlet-partial",
    "}.npy",
    "}.tif",
    "}.exr",
];
/// Names that no other literal is.
const WHOLE: [&str; 6] = ["view_", "step_", ".npy", ".tif", ".exr", ".bin"];
/// Folders, which no other literal names that is joined to a path.
const FOLDERS: [&str; 6] = ["flat", "sample", "dark", "counts", "partial", "retrieved"];
/// Stacks, which no other literal has with an ending of a file.
const STACKS: [&str; 3] = ["flat", "sample", "dark"];
/// Files of shipped examples, which are no runs.
const EXAMPLES: &str = "cli/commands/example.rs";

/// String literals of a source, each with the code before it on its line; without comments, tests
/// and attributes, which hold help texts and examples.
fn literals(source: &str) -> Vec<(String, String)> {
    let code = source.split("#[cfg(test)]").next().unwrap();
    let (mut found, mut line, mut rest) = (Vec::new(), String::new(), code);
    // Brackets that are open in an attribute.
    let mut depth = 0;
    while let Some(c) = rest.chars().next() {
        if rest.starts_with("//") {
            rest = &rest[rest.find('\n').unwrap_or(rest.len())..];
            continue;
        }
        match c {
            '[' if depth > 0 || line.ends_with('#') || line.ends_with("#!") => depth += 1,
            ']' if depth > 0 => depth -= 1,
            _ => {}
        }
        if rest.starts_with("'\"'") || rest.starts_with("'\\\"'") {
            rest = rest.split_once("\"'").unwrap().1;
        } else if c == '"' {
            let hashes = line.len() - line.trim_end_matches('#').len();
            let is_raw = line.trim_end_matches('#').ends_with('r');
            let (text, behind) = string(&rest[1..], is_raw.then_some(hashes));
            if depth == 0 {
                found.push((line.clone(), text.to_owned()));
            }
            rest = behind;
        } else {
            if c == '\n' {
                line.clear()
            } else {
                line.push(c)
            }
            rest = &rest[c.len_utf8()..];
        }
    }
    found
}

/// The text of a literal up to its end, and what is behind it. `hashes` of raw strings.
fn string(text: &str, hashes: Option<usize>) -> (&str, &str) {
    let end = hashes.map(|count| format!("\"{}", "#".repeat(count)));
    let mut escaped = false;
    let at = text.char_indices().find(|(at, c)| {
        let ends = match &end {
            Some(end) => text[*at..].starts_with(end),
            None => *c == '"' && !escaped,
        };
        escaped = *c == '\\' && !escaped;
        ends
    });
    let at = at.unwrap().0;
    (&text[..at], &text[at + end.map_or(1, |end| end.len())..])
}

/// True if a literal names a file or folder of a run.
fn names_a_file(before: &str, text: &str) -> bool {
    let joined = before.ends_with("join(");
    NAMES.iter().any(|name| text.contains(name))
        || WHOLE.contains(&text)
        || text.contains("view_{") && [".exr", ".bin"].iter().any(|end| text.ends_with(end))
        || joined && FOLDERS.contains(&text)
        || STACKS.iter().any(|stack| {
            ["npy", "tif", "exr"].iter().any(|end| text.contains(&format!("{stack}.{end}")))
        })
}

#[test]
fn names_of_run_files_are_literals_of_the_layout_only() {
    let mut files = Vec::new();
    ["engine", "cli"].iter().for_each(|folder| sources(Path::new(folder), &mut files));
    let (mut wrong, mut seen, mut own) = (Vec::new(), 0, 0);
    for file in files {
        let name = file.to_str().unwrap().replace('\\', "/");
        for (before, text) in literals(&fs::read_to_string(&file).unwrap()) {
            seen += 1;
            let is_name = names_a_file(&before, &text);
            if name == "engine/files/layout.rs" {
                own += usize::from(is_name);
            } else if is_name && name != EXAMPLES {
                wrong.push(format!("{name}: {text:?}"));
            }
        }
    }
    assert!(wrong.is_empty(), "names for engine/files/layout.rs:\n{}", wrong.join("\n"));
    assert!(seen > 4000 && own > 8, "{seen} literals were found, {own} names in the layout");
}

#[test]
fn names_are_found_in_every_form() {
    let source = r##"
        #[command(after_help = "run.json")] // "run.json"
        let a = path.join("flat"); let b = "flat"; let c = '"'; let d = "\"run.json";
        let e = format!("{name}.npy") + r#"it has no "retrieved.json""# + "flat.tif" + "view_";
        let f = format!("view_{view:04}.bin") + "view_{view:04}" + "counts/sample" + "run";
        #[cfg(test)] "scene.toml""##;
    let found = literals(source);
    let names: Vec<&str> = found
        .iter()
        .filter(|(before, text)| names_a_file(before, text))
        .map(|(_, text)| text.as_str())
        .collect();
    assert_eq!(found.len(), 11, "{found:?}");
    let expected = [
        "flat",
        "\\\"run.json",
        "{name}.npy",
        "it has no \"retrieved.json\"",
        "flat.tif",
        "view_",
        "view_{view:04}.bin",
        "counts/sample",
    ];
    assert_eq!(names, expected);
}
