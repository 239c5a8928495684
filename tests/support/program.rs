//! The real program in a directory.

use std::path::Path;
use std::process::{Command, Output};
use tempfile::TempDir;

/// The program in a directory, with no words yet. It logs by its own words alone.
pub(crate) fn beamlet(directory: impl AsRef<Path>) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_beamlet"));
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

/// A temporary directory with a scene in scene.toml.
pub(crate) fn workplace(scene: &str) -> TempDir {
    let directory = tempfile::tempdir().expect("a temporary directory");
    std::fs::write(directory.path().join("scene.toml"), scene).expect("the scene is written");
    directory
}
