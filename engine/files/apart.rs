//! A command must not replace the files that it reads.

use super::layout;
use super::run_directory::RunDirectory;
use beamlet_core::{Error, Result, printed};
use std::path::{Component, Path, PathBuf};

/// The path without links, `.` and `..`, also where its end does not exist yet.
#[must_use]
pub fn canonical(path: &Path) -> PathBuf {
    let absolute = std::path::absolute(path).unwrap_or_else(|_| path.to_path_buf());
    let mut found = PathBuf::new();
    for component in absolute.components() {
        match component {
            Component::ParentDir => drop(found.pop()),
            other => {
                found.push(other);
                if let Ok(real) = found.canonicalize() {
                    found = real;
                }
            }
        }
    }
    found
}

/// True if two paths lead to the same place.
#[must_use]
pub fn is_same_place(a: &Path, b: &Path) -> bool {
    canonical(a) == canonical(b)
}

/// True if `path` is a file of the run in `run`, or lies in one of its folders: what
/// `simulate` and `retrieve` write there.
#[must_use]
pub fn is_of_run(run: &Path, path: &Path) -> bool {
    let run = canonical(run);
    let path = canonical(path);
    let Ok(inside) = path.strip_prefix(&run) else { return false };
    let first = inside.components().next();
    let owned = |name: String| first.is_some_and(|first| first.as_os_str() == name.as_str());
    layout::owned().chain([layout::RETRIEVED.to_owned()]).any(owned)
}

/// Refuses to write a file or folder at `written` that is one of `read`, holds one or lies in one.
///
/// # Errors
/// [`Error::File`] that names both.
pub fn refuse_overlap(written: &Path, read: &[PathBuf]) -> Result<()> {
    let place = canonical(written);
    let overlaps = |input: &&PathBuf| {
        let input = canonical(input);
        place.starts_with(&input) || input.starts_with(&place)
    };
    read.iter().find(overlaps).map_or(Ok(()), |input| Err(refused(written, input)))
}

impl RunDirectory {
    /// Refuses a new run at `path` that would replace any of `read`: runs, scenes and their files that
    /// are read for it. Other files may lie beside a run's own.
    ///
    /// # Errors
    /// [`Error::File`] that names both.
    pub fn reading(path: &Path, read: &[PathBuf]) -> Result<()> {
        let clash = |input: &&PathBuf| {
            is_same_place(path, input)
                || is_of_run(path, input)
                || (input.is_dir() && is_of_run(input, path))
        };
        read.iter().find(clash).map_or(Ok(()), |input| Err(refused(path, input)))
    }
}

fn refused(written: &Path, read: &Path) -> Error {
    let problem = format!(
        "would replace {}, which this command reads; choose another place to write to",
        printed::path(read)
    );
    Error::file(written, problem, None)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ends_that_do_not_exist_yet_lose_their_dots() {
        let place = tempfile::tempdir().unwrap();
        let real = place.path().canonicalize().unwrap();
        assert_eq!(canonical(&place.path().join("none/../run/.")), real.join("run"));
        assert!(is_same_place(&place.path().join("none/../run"), &real.join("run")));
        assert!(!is_same_place(&real.join("run"), &real.join("runs")));
    }

    #[test]
    fn a_folder_overlaps_what_it_holds_and_what_holds_it() {
        let place = tempfile::tempdir().unwrap();
        let at = |name: &str| place.path().join(name);
        assert!(refuse_overlap(&at("a"), &[at("a/b.npy")]).is_err());
        assert!(refuse_overlap(&at("a/b"), &[at("a")]).is_err());
        assert!(refuse_overlap(&at("a"), &[at("ab"), at("b")]).is_ok());
    }
}
