//! Refusals: a table of cases for each area in `tests/refusals/`.
//!
//! A group has a `scene` (a path below `tests/`, or text), `files` by name with their text, files that it has a `copy`
//! of by their paths below `tests/`, `arrays` of a value and a shape, and the command lines `before` that make runs.
//! Each of its `cases` replaces `from` by `to` in the file `edit`, writes `text` to `file`, and appends `more` and each
//! `set` to the command `lines`. All fail with `code`, print `words` to stderr and none of `lack`, print nothing to
//! stdout (but reports of `check`), and change no file. `errors` is the number of errors. A key of a group is the default
//! of its cases; `all` are words of every case.
//!
//! A process takes longer than a refusal: of the cases of a group that [`CHECK`] refuses, the first goes through the
//! program and the others through the functions of the library that it calls. Where a group has several lines, all of
//! them refuse every fourth case, and the first one the others. With `BEAMLET_ALL` the program runs every line.

use crate::support::program::{beamlet, ended};
use crate::support::{everything, root};
use beamlet::check::Check;
use beamlet::cli_support::{load_scene, printed};
use beamlet::ndarray::ArrayD;
use beamlet::scene::Scene;
use ndarray_npy::write_npy;
use serde::Deserialize;
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::sync::Mutex;
use tempfile::TempDir;

/// The line of cases that have no other.
const CHECK: &str = "check scene.toml --no-estimate";

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
            lines: vec![CHECK.into()],
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

/// Exit code, stdout and stderr of a command.
struct Answer {
    code: Option<i32>,
    printed: String,
    message: String,
}

/// The answer of the program.
fn by_program(place: &Path, case: &Case, line: &str) -> Answer {
    let sets = case.set.iter().flat_map(|set| ["--set", set]);
    let output = beamlet(place).args(split(line)).args(sets).output().unwrap();
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    let (printed, message) = (text(&output.stdout), text(&output.stderr));
    Answer { code: output.status.code(), printed, message }
}

/// The answer of [`CHECK`] by the functions that the program calls for it.
fn by_library(place: &Path, case: &Case) -> Answer {
    let path = place.join("scene.toml");
    let texts = |error: beamlet::Error| -> Vec<String> {
        error.each().iter().map(ToString::to_string).collect()
    };
    let errors = match load_scene(&path, &case.set) {
        Err(error) => texts(error),
        Ok(scene) => match Check::of(&scene).without_estimate().run() {
            Err(error) => texts(Scene::locate(&path, &case.set, error)),
            Ok(report) => report.refusals,
        },
    };
    // The program is in the folder of the scene, and names files from there.
    let folder = format!("{}/", place.display());
    let lines = errors.iter().map(|error| format!("error: {}\n", error.replace(&folder, "")));
    let message = printed::lines(&lines.fold(String::new(), |all, line| all + &line));
    Answer { code: Some(i32::from(!errors.is_empty())), printed: String::new(), message }
}

/// The fault of a refusal, if it has one; `quick`: by the library where that has the command.
fn refuse(place: &Path, case: &Case, line: &str, quick: bool) -> Option<String> {
    let before = listed(place);
    let is_check = line == CHECK && case.more.is_empty();
    let line = format!("{line} {}", case.more);
    let Answer { code, printed, message } = match quick && is_check {
        true => by_library(place, case),
        false => by_program(place, case, &line),
    };
    let count = message.lines().filter(|line| line.starts_with("error: ")).count();
    let words = case.all.iter().chain(&case.words);
    let fault = match words.clone().find(|word| !message.contains(*word)) {
        Some(word) => format!("no {word:?}"),
        None if code != Some(case.code) => format!("{code:?}"),
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
    for (number, case) in cases.as_array().expect("a list of cases").iter().enumerate() {
        let mut keys = group.clone();
        let own = case.as_table().expect("keys of a case").clone();
        let every_line = own.contains_key("lines") || number % 4 == 0 || everything();
        keys.extend(own);
        let case = read(keys);
        let count = if every_line { case.lines.len() } else { 1 };
        let quick = number > 0 && !everything();
        let edited = (!case.from.is_empty()).then(|| place.path().join(&case.edit));
        let whole = edited.as_ref().map(|path| fs::read_to_string(path).unwrap());
        if let (Some(path), Some(whole)) = (&edited, &whole) {
            assert!(whole.contains(&case.from), "{:?} is not in {}", case.from, case.edit);
            fs::write(path, whole.replacen(&case.from, &case.to, 1)).unwrap();
        }
        if !case.file.is_empty() {
            write(&case.file, case.text.as_bytes());
        }
        let lines = case.lines.iter().take(count);
        faults.extend(lines.filter_map(|line| refuse(place.path(), &case, line, quick)));
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
    // Those that make runs, which take longest, are the first.
    groups.sort_by_key(|group| group.contains_key("before"));
    let (groups, faults) = (Mutex::new(groups), Mutex::new(Vec::new()));
    std::thread::scope(|scope| {
        for _ in 0..2 {
            // The stack of a main thread, as the program has.
            let thread = std::thread::Builder::new().stack_size(8 << 20);
            let walked = thread.spawn_scoped(scope, || {
                while let Some(group) = { groups.lock().unwrap().pop() } {
                    faults.lock().unwrap().extend(walk(group));
                }
            });
            walked.expect("a thread");
        }
    });
    let faults = faults.into_inner().unwrap();
    assert!(faults.is_empty(), "{} faults:\n{}", faults.len(), faults.join("\n"));
}
