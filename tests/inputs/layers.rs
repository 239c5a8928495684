//! Modules of the engine use one another as the table of docs/architecture.md ("Layers") says: a
//! row uses those below it, and within a row a module may use those to its right.

#![expect(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

/// Rank of each module: the higher, the lower it stands.
fn ranks() -> BTreeMap<String, usize> {
    let text = fs::read_to_string("docs/architecture.md").unwrap();
    let after = text.split_once("## Layers").unwrap().1;
    let table = after.split("```").nth(1).unwrap();
    table.split_whitespace().enumerate().map(|(rank, name)| (name.to_owned(), rank)).collect()
}

pub(crate) fn sources(folder: &Path, out: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        // The Python package lies above the engine.
        if path == Path::new("engine/python") {
            continue;
        }
        if path.is_dir() {
            sources(&path, out);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            out.push(path);
        }
    }
}

/// The module of the engine that a file belongs to.
fn module_of(path: &Path) -> String {
    let name = path.components().nth(1).unwrap().as_os_str().to_str().unwrap();
    name.trim_end_matches(".rs").to_owned()
}

/// A source without its comments and tests.
pub(crate) fn code_of(source: &str) -> String {
    let code = source.split("#[cfg(test)]").next().unwrap();
    let lines = code.lines().map(|line| line.split("//").next().unwrap());
    // Macros that tests use, too, name what they can reach.
    lines.collect::<Vec<_>>().join("\n").replace("$crate::", "")
}

/// Names that stand directly behind `crate::` in a source without its comments and tests.
fn used(source: &str) -> Vec<String> {
    let code = code_of(source);
    let mut names = Vec::new();
    for rest in code.split("crate::").skip(1) {
        let is_name = |c: char| c.is_alphanumeric() || c == '_';
        if let Some(list) = rest.strip_prefix('{') {
            // First names of each path in the braces.
            let mut depth = 0;
            for item in list.split_inclusive([',', '{', '}']) {
                let name = item.trim().split(|c| !is_name(c)).next().unwrap();
                if depth == 0 && !name.is_empty() {
                    names.push(name.to_owned());
                }
                depth += i32::from(item.ends_with('{')) - i32::from(item.ends_with('}'));
                if depth < 0 {
                    break;
                }
            }
        } else {
            names.push(rest.split(|c| !is_name(c)).next().unwrap().to_owned());
        }
    }
    names
}

/// Modules that hold what the crate exports at its root.
fn home(name: &str) -> &str {
    match name {
        "Error" | "Place" | "Result" => "error",
        "Cancel" => "cancel",
        "RowsControl" => "rows_control",
        "Tally" => "tally",
        "RunRecord" | "SamplingSummary" => "stack",
        "Engine" => "engine",
        "Control" | "EdgeBlur" | "Progress" | "RunEstimate" | "Simulation" | "ViewProgress"
        | "load_sample" => "run",
        "write_file" => "whole_file",
        "Backend" | "Compute" | "DeviceDescription" | "EngineOptions" => "gpu",
        other => other,
    }
}

#[test]
fn modules_use_only_lower_layers() {
    let ranks = ranks();
    let mut files = Vec::new();
    sources(Path::new("engine"), &mut files);
    let mut wrong = Vec::new();
    let mut edges = 0;
    for file in files {
        let module = module_of(&file);
        if ["lib", "internals", "cli_support"].contains(&module.as_str()) {
            continue;
        }
        let own = ranks.get(&module);
        let own = own.unwrap_or_else(|| panic!("docs/architecture.md lacks the layer of {module}"));
        for name in used(&fs::read_to_string(&file).unwrap()) {
            let name = home(&name);
            let Some(rank) = ranks.get(name) else {
                wrong.push(format!("{}: crate::{name} is in no layer", file.display()));
                continue;
            };
            edges += usize::from(name != module);
            if rank < own {
                wrong.push(format!("{}: {module} stands below {name}", file.display()));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    assert!(edges > 200, "only {edges} uses were found");
}

#[test]
fn names_behind_crate_are_found_in_every_form() {
    let source = "use crate::{a, b::{c, d}, e};\nuse crate::f::g; // crate::h\nlet i = crate::j();";
    assert_eq!(used(source), ["a", "b", "e", "f", "j"]);
}
