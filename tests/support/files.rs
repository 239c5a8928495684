//! Files below a directory.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

/// Every file below a directory, by its path from there.
pub(crate) fn paths(root: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    let mut open = vec![root.to_path_buf()];
    while let Some(directory) = open.pop() {
        for entry in fs::read_dir(directory).expect("a directory") {
            let path = entry.expect("an entry").path();
            if path.is_dir() {
                open.push(path);
            } else {
                found.push(path.strip_prefix(root).expect("below the root").to_path_buf());
            }
        }
    }
    found.sort();
    found
}

/// Files of a run with their bytes, but run.json, which has the times of the run.
pub(crate) fn of_run(root: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let kept = paths(root).into_iter().filter(|path| path != Path::new("run.json"));
    kept.map(|path| (path.clone(), fs::read(root.join(path)).expect("a file"))).collect()
}
