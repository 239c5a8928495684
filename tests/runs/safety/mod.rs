//! What is on disk stays: the program replaces nothing that it reads, nothing through a link,
//! nothing of others, nothing while another writes it, and nothing on a full disk.
#![cfg(all(feature = "cli", unix))]

mod directory;
mod full_disk;
#[cfg(target_os = "linux")]
mod moved;
mod replace;
mod words;

use crate::support::program;
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

const SCENE: &str = concat!(
    include_str!("../../support/paper.toml"),
    r#"pixels = [8, 2]
[sampling]
tolerance = 1e-2
angle_tolerance = "1 urad"
[scan]
mask_offsets = { from = "-25 um", to = "25 um", count = 4 }
angles = { from = "0 deg", to = "180 deg", count = 3 }

"#,
    include_str!("../../support/rod.toml")
);

fn workplace() -> tempfile::TempDir {
    program::workplace(SCENE)
}

fn beamlet(place: &Path, line: &str) -> Command {
    let mut command = program::beamlet(place);
    command.args(line.split_whitespace());
    command
}

/// Runs the words of `line`, which must end with this code; stderr.
#[track_caller]
fn ends(place: &Path, line: &str, code: i32) -> String {
    program::ended(&beamlet(place, line).output().unwrap(), code)
}

#[track_caller]
fn simulate(place: &Path, more: &str) {
    ends(place, &format!("simulate scene.toml -q --backend bvh -o run {more}"), 0);
}

/// Every file below a folder with its bytes, links not followed.
fn contents(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut all = BTreeMap::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let kind = fs::symlink_metadata(&path).unwrap();
        if kind.is_symlink() {
            all.insert(
                path.clone(),
                fs::read_link(&path).unwrap().into_os_string().into_encoded_bytes(),
            );
        } else if kind.is_dir() {
            all.extend(contents(&path));
        } else {
            all.insert(path.clone(), fs::read(&path).unwrap());
        }
    }
    all
}
