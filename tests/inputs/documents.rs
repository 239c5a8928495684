//! Names in documents: every test, type, key and file that a document names exists, and every link
//! leads to a file and a heading. Commands are parsed by the program itself (cli/documents.rs).

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Component, Path, PathBuf};

/// Documents whose code names other programs' functions.
const OF_OTHER_PROGRAMS: [&str; 2] = ["docs/how-to/coming-from.md", "docs/how-to/cad.md"];
/// Beginnings of names that are made while the program runs, and of names in examples.
const MADE: [&str; 11] = [
    "counts_…",
    "view8_",
    "view9_",
    "view10_",
    "scan_",
    "par_",
    "f_",
    "delta_",
    "mu_",
    "NAME",
    "run_",
];

fn files(folder: &str, endings: &[&str], out: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let name = path.to_str().unwrap();
        if path.is_dir() {
            let is_built = ["target", "node_modules", "__pycache__", ".venv"];
            if !is_built.iter().any(|built| path.ends_with(built)) {
                files(name, endings, out);
            }
        } else if endings.iter().any(|ending| name.ends_with(ending)) {
            out.push(path);
        }
    }
}

fn documents() -> BTreeMap<String, String> {
    let mut paths: Vec<_> =
        ["README.md", "CONTRIBUTING.md", "CHANGELOG.md"].iter().map(PathBuf::from).collect();
    files("docs", &[".md"], &mut paths);
    let read =
        |path: &PathBuf| (path.to_str().unwrap().to_owned(), fs::read_to_string(path).unwrap());
    paths.iter().map(read).collect()
}

/// Words of all sources.
fn words_of_sources() -> BTreeSet<String> {
    let mut paths = Vec::new();
    let endings = [".rs", ".py", ".pyi", ".js", ".sh", ".toml", ".glsl", ".comp", ".html", ".csv"];
    for folder in ["engine", "cli", "tests", "shaders", "docs"] {
        files(folder, &endings, &mut paths);
    }
    paths.extend([".ci/test", ".ci/long", ".ci/setup", ".ci/fuzz", "build.rs"].map(PathBuf::from));
    let mut words = BTreeSet::new();
    for path in paths {
        // This list names what no source has to have; tables of claims name tests, too.
        if path.ends_with("inputs/documents.rs") || path.starts_with("docs/developers/validation") {
            continue;
        }
        let text = String::from_utf8_lossy(&fs::read(path).unwrap()).into_owned();
        words.extend(text.split(|c: char| !is_of_word(c)).map(str::to_owned));
    }
    words
}

fn is_of_word(c: char) -> bool {
    c.is_ascii_alphanumeric() || c == '_'
}

/// A document without its fenced blocks.
fn prose(text: &str) -> String {
    let mut is_inside = false;
    let mut lines = Vec::new();
    for line in text.lines() {
        if line.trim_start().starts_with("```") {
            is_inside = !is_inside;
            lines.push("");
        } else {
            lines.push(if is_inside { "" } else { line });
        }
    }
    lines.join("\n")
}

/// Code within lines.
fn spans(text: &str) -> Vec<String> {
    let of_line = |line: &str| -> Vec<String> {
        line.split('`').skip(1).step_by(2).map(str::to_owned).collect()
    };
    prose(text).lines().flat_map(of_line).collect()
}

/// The anchor of a heading, as GitHub makes it.
fn anchor(heading: &str) -> String {
    let kept = |c: &char| c.is_alphanumeric() || [' ', '-', '_'].contains(c);
    heading.trim().to_lowercase().chars().filter(kept).collect::<String>().replace(' ', "-")
}

fn anchors(text: &str) -> BTreeSet<String> {
    let headings = prose(text);
    let titles = headings.lines().filter(|line| line.starts_with('#'));
    titles.map(|line| anchor(line.trim_start_matches('#'))).collect()
}

/// Targets of links and pictures.
fn links(text: &str) -> Vec<String> {
    let prose = prose(text);
    let mut parts = prose.split("](");
    parts.next();
    parts.filter_map(|rest| Some(rest.split_once(')')?.0.to_owned())).collect()
}

/// A path without `..`.
fn plain(path: &Path) -> PathBuf {
    let mut out = PathBuf::new();
    for part in path.components() {
        match part {
            Component::ParentDir => assert!(out.pop(), "{}", path.display()),
            Component::CurDir => {}
            part => out.push(part),
        }
    }
    out
}

/// Why a link of a document leads nowhere.
fn broken(documents: &BTreeMap<String, String>, document: &str, link: &str) -> Option<String> {
    if link.contains("://") {
        return None;
    }
    let (file, anchor) = link.split_once('#').map_or((link, None), |(file, at)| (file, Some(at)));
    let folder = Path::new(document).parent().unwrap();
    let path = if file.is_empty() { PathBuf::from(document) } else { plain(&folder.join(file)) };
    if !path.exists() {
        return Some(format!("{document}: no file {link}"));
    }
    let anchor = anchor?;
    let target = documents.get(path.to_str().unwrap())?;
    (!anchors(target).contains(anchor)).then(|| format!("{document}: no heading {link}"))
}

/// Why a piece of code in a document names nothing.
fn unknown(words: &BTreeSet<String>, document: &str, span: &str) -> Option<String> {
    let is_path = |span: &str| {
        let folders = ["tests/", "engine/", "cli/", "shaders/", "docs/", ".ci/"];
        folders.iter().any(|folder| span.starts_with(folder))
            && !span.contains([' ', '*', '<', '…'])
    };
    if is_path(span) {
        let file = span.split("::").next().unwrap();
        let found = [file.to_owned(), format!("{file}.rs"), format!("{file}/mod.rs")];
        return (!found.iter().any(|path| Path::new(path).exists()))
            .then(|| format!("{document}: no file {span}"));
    }
    if OF_OTHER_PROGRAMS.contains(&document) || MADE.iter().any(|it| span.starts_with(it)) {
        return None;
    }
    // A name, the beginning of one or its end, and paths of names.
    let (from, to) = (span.starts_with('…'), span.ends_with('…'));
    let name = span.trim_matches('…').trim_end_matches("()");
    let last = name.rsplit("::").next().unwrap();
    let last = last.split('(').next().unwrap();
    if last.is_empty() || !last.chars().all(is_of_word) || !last.starts_with(char::is_alphabetic) {
        return None;
    }
    let humps = last.chars().filter(char::is_ascii_uppercase).count();
    let is_type = humps >= 2 && last.chars().any(|c| c.is_ascii_lowercase());
    if !last.contains('_') && !is_type && !name.contains("::") {
        return None;
    }
    let found = match (from, to) {
        (false, false) => words.contains(last),
        (false, true) => words.range(last.to_owned()..).next().is_some_and(|w| w.starts_with(last)),
        _ => words.iter().any(|word| word.contains(last)),
    };
    (!found).then(|| format!("{document}: nothing is called {span}"))
}

#[test]
fn links_of_documents_lead_to_files_and_headings() {
    let documents = documents();
    let (mut problems, mut count) = (Vec::new(), 0);
    for (document, text) in &documents {
        for link in links(text) {
            count += 1;
            problems.extend(broken(&documents, document, &link));
        }
    }
    assert!(problems.is_empty(), "{}", problems.join("\n"));
    assert!(count > 200, "only {count} links");
}

#[test]
fn names_in_documents_are_those_of_tests_types_keys_and_files() {
    let words = words_of_sources();
    let (mut problems, mut count) = (Vec::new(), 0);
    for (document, text) in &documents() {
        for span in spans(text) {
            count += 1;
            problems.extend(unknown(&words, document, &span));
        }
    }
    assert!(problems.is_empty(), "{}", problems.join("\n"));
    assert!(count > 2000, "only {count} names");
}

#[test]
fn tests_in_tables_of_claims_exist() {
    let words = words_of_sources();
    let mut paths = Vec::new();
    files("docs/developers/validation", &[".csv"], &mut paths);
    let (mut problems, mut count) = (Vec::new(), 0);
    for path in paths {
        let text = fs::read_to_string(&path).unwrap();
        let rows = text.lines().skip(1);
        let names = rows.flat_map(|row| row.split(|c: char| !is_of_word(c)));
        for name in names.filter(|name| name.matches('_').count() > 2) {
            count += 1;
            if !words.contains(name) {
                problems.push(format!("{}: nothing is called {name}", path.display()));
            }
        }
    }
    assert!(problems.is_empty(), "{}", problems.join("\n"));
    assert!(count > 150, "only {count} names");
}

#[test]
fn what_does_not_exist_is_found() {
    let words = words_of_sources();
    for span in [
        "tests/physics/flatt.rs",
        "no_test_has_this_name_at_all",
        "KeptWriterOfOld",
        "no_test_begins…",
    ] {
        assert!(unknown(&words, "docs/developers/validation.md", span).is_some(), "{span}");
    }
    let documents = documents();
    for link in ["nowhere.md", "physics.md#no-such-heading", "#neither"] {
        assert!(broken(&documents, "docs/scene.md", link).is_some(), "{link}");
    }
    assert!(broken(&documents, "docs/scene.md", "physics.md#mask-algebra").is_none());
}
