//! The real program on runs that lost something or whose inputs changed: what is damaged is made
//! again and named, nothing whole is touched, and two beams are never mixed.
#![cfg(feature = "cli")]
#![expect(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

mod moments;
mod npy;
mod reading;
mod referenced;
mod tally;

use crate::support::program::{beamlet, workplace};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Output;

/// The set-up of the paper around a rod, 4 views of 2 steps.
pub(crate) const SCENE: &str = concat!(
    include_str!("../../support/masks.toml"),
    r#"
[detector]
distance = "1.8 m"
pixels = [8, 2]
pitch = "150 um"

[scan]
mask_offsets = { from = "-25 um", to = "25 um", count = 2 }
angles = { from = "0 deg", to = "360 deg", count = 4 }

"#,
    include_str!("../../support/rod.toml")
);

/// A directory with a scene, and what the program does there.
pub(crate) struct Place(tempfile::TempDir);

impl Place {
    pub(crate) fn new(scene: &str) -> Self {
        Self(workplace(scene))
    }

    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    pub(crate) fn beamlet(&self, arguments: &[&str]) -> Output {
        beamlet(&self.0).args(arguments).output().unwrap()
    }

    /// `beamlet simulate scene.toml -q -o run`, with more arguments.
    pub(crate) fn simulate(&self, more: &[&str]) -> Output {
        let mut arguments = vec!["simulate", "scene.toml", "-q", "--backend", "bvh", "-o", "run"];
        arguments.extend(more);
        self.beamlet(&arguments)
    }

    /// The bytes of a file of the run.
    pub(crate) fn bytes(&self, name: &str) -> Vec<u8> {
        let path = self.path("run").join(name);
        fs::read(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
    }

    pub(crate) fn write(&self, name: &str, bytes: &[u8]) {
        fs::write(self.path("run").join(name), bytes).unwrap();
    }
}

/// What a command said on stderr; it ended with this code.
#[track_caller]
pub(crate) fn said(output: &Output, code: i32) -> String {
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(code), "{message}");
    message
}

#[track_caller]
pub(crate) fn assert_says(message: &str, parts: &[&str]) {
    for part in parts {
        assert!(message.contains(part), "no \"{part}\" in: {message}");
    }
}

/// Every file below a directory by its relative path.
pub(crate) fn files(directory: &Path) -> Vec<PathBuf> {
    let mut all = Vec::new();
    for entry in fs::read_dir(directory).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            all.extend(files(&path));
        } else {
            all.push(path);
        }
    }
    all.sort();
    all
}
