//! Refusals: a table of cases for each area in `tests/refusals/`.
//!
//! A group has a `scene` (a path below `tests/`, or text), `files` by name with their text, files that it has a `copy`
//! of by their paths below `tests/`, `arrays` of a value and a shape, and the command lines `before` that make runs.
//! Each of its `cases` replaces `from` by `to` in the file `edit`, writes `text` to `file`, and appends `more` and each
//! `set` to the command `lines`. All fail with `code`, print `words` to stderr and none of `lack`, print nothing to
//! stdout (but reports of `check`), and change no file. `errors` is the number of errors. A key of a group is the default
//! of its cases; `all` are words of every case.

use crate::support::program::{beamlet, ended};
use crate::support::root;
use beamlet::ndarray::ArrayD;
use ndarray_npy::write_npy;
use serde::Deserialize;
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::sync::Mutex;
use tempfile::TempDir;

#[derive(Deserialize)]
struct Table {
    group: Vec<toml::Table>,
}

#[derive(Deserialize)]
#[serde(default, deny_unknown_fields)]
struct Case {
    scene: String,
    files: BTreeMap<String, String>,
    copy: BTreeMap<String, String>,
    arrays: BTreeMap<String, Vec<f32>>,
    before: Vec<String>,
    edit: String,
    from: String,
    to: String,
    file: String,
    text: String,
    lines: Vec<String>,
    more: String,
    set: Vec<String>,
    code: i32,
    all: Vec<String>,
    words: Vec<String>,
    lack: Vec<String>,
    errors: usize,
}

impl Default for Case {
    fn default() -> Self {
        let none = String::new;
        let list = Vec::new;
        Self {
            scene: none(),
            files: BTreeMap::new(),
            copy: BTreeMap::new(),
            arrays: BTreeMap::new(),
            before: list(),
            edit: "scene.toml".into(),
            from: none(),
            to: none(),
            file: none(),
            text: none(),
            lines: vec!["check scene.toml --no-estimate".into()],
            more: none(),
            set: list(),
            code: 1,
            all: list(),
            words: list(),
            lack: list(),
            errors: 0,
        }
    }
}

/// Words of a command line; a word may have spaces between single quotes.
fn split(line: &str) -> Vec<String> {
    let mut words = Vec::new();
    for (at, part) in line.split('\'').enumerate() {
        match at % 2 {
            0 => words.extend(part.split_whitespace().map(str::to_owned)),
            _ => words.push(part.to_owned()),
        }
    }
    words
}

/// All files below a directory, with their lengths.
fn listed(directory: &Path) -> Vec<(String, u64)> {
    let mut found = Vec::new();
    for entry in fs::read_dir(directory).unwrap() {
        let entry = entry.unwrap();
        let path = entry.path().display().to_string();
        match entry.file_type().unwrap().is_dir() {
            true => found.extend(listed(&entry.path())),
            false => found.push((path, entry.metadata().unwrap().len())),
        }
    }
    found.sort();
    found
}

/// The fault of a refusal, if it has one.
fn refuse(place: &Path, case: &Case, line: &str) -> Option<String> {
    let before = listed(place);
    let sets = case.set.iter().flat_map(|set| ["--set", set]);
    let mut command = beamlet(place);
    let line = format!("{line} {}", case.more);
    let output = command.args(split(&line)).args(sets).output().unwrap();
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    let printed = String::from_utf8_lossy(&output.stdout);
    let count = message.lines().filter(|line| line.starts_with("error: ")).count();
    let words = case.all.iter().chain(&case.words);
    let fault = match words.clone().find(|word| !message.contains(*word)) {
        Some(word) => format!("no {word:?}"),
        None if output.status.code() != Some(case.code) => format!("{:?}", output.status),
        None if words.count() == 0 => "a case without words".into(),
        None if !printed.is_empty() && !line.trim().starts_with("check") => {
            format!("stdout {printed}")
        }
        None if case.errors > 0 && case.errors != count => format!("{count} errors"),
        None if case.lack.iter().any(|word| message.contains(word)) => "a word too many".into(),
        None if listed(place) != before => "files changed".into(),
        None => return None,
    };
    Some(format!("{fault}: {line} {:?} {:?}: {message}", case.to, case.set))
}

/// Faults of the cases of a group.
fn walk(mut group: toml::Table) -> Vec<String> {
    let cases = group.remove("cases").expect("cases");
    let read = |keys: toml::Table| -> Case {
        keys.clone().try_into().unwrap_or_else(|error| panic!("{keys}: {error}"))
    };
    let common = read(group.clone());
    let read_test = |path: &str| fs::read(root().join("tests").join(path)).unwrap();
    let place = TempDir::new().unwrap();
    let write = |name: &str, text: &[u8]| {
        let path = place.path().join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, text).unwrap();
    };
    match common.scene.contains('\n') {
        true => write("scene.toml", common.scene.as_bytes()),
        false if common.scene.is_empty() => {}
        false => write("scene.toml", &read_test(&common.scene)),
    }
    common.files.iter().for_each(|(name, text)| write(name, text.as_bytes()));
    common.copy.iter().for_each(|(name, path)| write(name, &read_test(path)));
    for (name, numbers) in &common.arrays {
        let shape: Vec<usize> = numbers[1..].iter().map(|side| *side as usize).collect();
        write_npy(place.path().join(name), &ArrayD::from_elem(shape, numbers[0])).unwrap();
    }
    for line in &common.before {
        ended(&beamlet(place.path()).args(split(line)).output().unwrap(), 0);
    }
    let mut faults = Vec::new();
    for case in cases.as_array().expect("a list of cases") {
        let mut keys = group.clone();
        keys.extend(case.as_table().expect("keys of a case").clone());
        let case = read(keys);
        let edited = (!case.from.is_empty()).then(|| place.path().join(&case.edit));
        let whole = edited.as_ref().map(|path| fs::read_to_string(path).unwrap());
        if let (Some(path), Some(whole)) = (&edited, &whole) {
            assert!(whole.contains(&case.from), "{:?} is not in {}", case.from, case.edit);
            fs::write(path, whole.replacen(&case.from, &case.to, 1)).unwrap();
        }
        if !case.file.is_empty() {
            write(&case.file, case.text.as_bytes());
        }
        faults.extend(case.lines.iter().filter_map(|line| refuse(place.path(), &case, line)));
        if !case.file.is_empty() {
            fs::remove_file(place.path().join(&case.file)).unwrap();
        }
        if let (Some(path), Some(whole)) = (edited, whole) {
            fs::write(path, whole).unwrap();
        }
    }
    faults
}

#[test]
fn refusals_have_their_words_and_write_nothing() {
    let mut groups = Vec::new();
    for entry in fs::read_dir(root().join("tests/refusals")).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            continue;
        }
        let table = toml::from_str(&fs::read_to_string(&path).unwrap());
        let table: Table = table.unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        groups.extend(table.group);
    }
    let (groups, faults) = (Mutex::new(groups), Mutex::new(Vec::new()));
    std::thread::scope(|scope| {
        for _ in 0..2 {
            scope.spawn(|| {
                while let Some(group) = { groups.lock().unwrap().pop() } {
                    faults.lock().unwrap().extend(walk(group));
                }
            });
        }
    });
    let faults = faults.into_inner().unwrap();
    assert!(faults.is_empty(), "{} faults:\n{}", faults.len(), faults.join("\n"));
}
