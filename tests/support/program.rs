//! The real program in a directory.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use tempfile::TempDir;

/// Path of the program: `BEAMLET_PROGRAM`, where tests do not run on the machine that built them.
pub(crate) fn path() -> PathBuf {
    let built = || PathBuf::from(env!("CARGO_BIN_EXE_beamlet"));
    std::env::var_os("BEAMLET_PROGRAM").map_or_else(built, PathBuf::from)
}

/// The program in a directory, with no words yet. It logs by its own words alone.
pub(crate) fn beamlet(directory: impl AsRef<Path>) -> Command {
    let mut command = Command::new(path());
    command.current_dir(directory).env_remove("RUST_LOG");
    command
}

/// Runs the words of `line`.
pub(crate) fn run(directory: impl AsRef<Path>, line: &str) -> Output {
    beamlet(directory).args(line.split_whitespace()).output().expect("it starts")
}

/// Runs the words of `line`, which have to succeed, and returns what was printed.
#[track_caller]
pub(crate) fn done(directory: &Path, line: &str) -> String {
    let output = run(directory, line);
    assert!(output.status.success(), "{line}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).expect("text")
}

/// As [`done`], without a driver: a page of a run has no picture of its sample, which takes longest.
#[track_caller]
pub(crate) fn done_without_driver(directory: &Path, line: &str) {
    let mut command = beamlet(directory);
    command.env("VK_DRIVER_FILES", "/dev/null").env("VK_ICD_FILENAMES", "/dev/null");
    ended(&command.args(line.split_whitespace()).output().expect("it starts"), 0);
}

/// Messages of a program on stderr.
pub(crate) fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// Asserts that a program ended with this code; returns the text on its stderr.
#[track_caller]
pub(crate) fn ended(output: &Output, code: i32) -> String {
    let message = stderr(output);
    let printed = String::from_utf8_lossy(&output.stdout);
    assert_eq!(output.status.code(), Some(code), "{printed}\n{message}");
    message
}

/// A temporary directory with a scene in scene.toml.
pub(crate) fn workplace(scene: &str) -> TempDir {
    let directory = tempfile::tempdir().expect("a temporary directory");
    std::fs::write(directory.path().join("scene.toml"), scene).expect("the scene is written");
    directory
}

/// Copies a folder with everything in it.
pub(crate) fn copy_folder(from: &Path, to: &Path) {
    std::fs::create_dir(to).expect("a folder");
    for entry in std::fs::read_dir(from).expect("a folder") {
        let entry = entry.expect("an entry");
        let (from, to) = (entry.path(), to.join(entry.file_name()));
        if from.is_dir() {
            copy_folder(&from, &to);
        } else {
            std::fs::copy(from, to).expect("a copy");
        }
    }
}

/// A temporary directory of its own with the scene and the run of a place.
pub(crate) fn copy_of(place: &Path) -> TempDir {
    let copy = tempfile::tempdir().expect("a temporary directory");
    std::fs::copy(place.join("scene.toml"), copy.path().join("scene.toml")).expect("a copy");
    copy_folder(&place.join("run"), &copy.path().join("run"));
    copy
}

/// A temporary directory with a scene in scene.toml, and what the program does there.
pub(crate) struct Workplace(TempDir);

impl Workplace {
    pub(crate) fn new(scene: &str) -> Self {
        Self(workplace(scene))
    }

    /// A copy of the scene and its run.
    pub(crate) fn copy(&self) -> Self {
        Self(copy_of(self.0.path()))
    }

    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    /// Runs the program with these words.
    pub(crate) fn beamlet(&self, words: &[&str]) -> Output {
        beamlet(&self.0).args(words).output().expect("it starts")
    }

    /// `beamlet simulate scene.toml -q --backend bvh -o run`, with more words.
    pub(crate) fn simulate(&self, more: &[&str]) -> Output {
        let mut words = vec!["simulate", "scene.toml", "-q", "--backend", "bvh", "-o", "run"];
        words.extend(more);
        self.beamlet(&words)
    }

    /// The bytes of a file of the run.
    pub(crate) fn bytes(&self, name: &str) -> Vec<u8> {
        let path = self.path("run").join(name);
        std::fs::read(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
    }

    /// Writes a file of the run.
    pub(crate) fn write(&self, name: &str, bytes: &[u8]) {
        std::fs::write(self.path("run").join(name), bytes).expect("the file is written");
    }
}
