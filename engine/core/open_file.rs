//! Open files, and whether their paths still lead to them.
//!
//! Files written under several paths of a folder are split over two folders if somebody moves it
//! meanwhile. A file that stays open shows whether the folder is still there.

use crate::{Error, Result, folder, printed};
use std::ffi::OsString;
use std::fs::{self, File};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// Remedy of a run that was moved.
pub const RESUME: &str = "resume the run where it is now, or move it back and resume it";

/// The error of a file or folder of a run that is missing when the run ends.
pub fn lost(path: &Path) -> Error {
    let problem = "was written and is no longer there: moved or removed during the run; resume the \
                   run to make it again";
    Error::file(path, problem, None)
}

/// Names in a folder of a run that ends, sorted.
///
/// # Errors
/// [`Error::File`].
pub fn names_of_run(folder: &Path) -> Result<Vec<OsString>> {
    folder::names(folder).map_err(|error| match error.kind() {
        ErrorKind::NotFound | ErrorKind::NotADirectory => lost(folder),
        _ => Error::file(folder, "cannot be read", Some(error)),
    })
}

/// True if a path, links not followed, leads to an open file.
///
/// # Errors
/// Where the path cannot be looked at; there may be nothing.
#[cfg(unix)]
fn leads_to(path: &Path, file: &File) -> std::io::Result<bool> {
    use std::os::unix::fs::MetadataExt;
    let (open, found) = (file.metadata()?, fs::symlink_metadata(path)?);
    Ok((open.dev(), open.ino()) == (found.dev(), found.ino()))
}

#[cfg(not(unix))]
fn leads_to(path: &Path, _: &File) -> std::io::Result<bool> {
    fs::symlink_metadata(path).map(|_| true)
}

/// True if an open file is still the one at `path`.
pub fn is_at(file: &File, path: &Path) -> bool {
    leads_to(path, file).unwrap_or(false)
}

/// Refuses to go on where an open file is no longer the one at `path`: it, or a folder that it is
/// in, was moved, replaced or removed. `remedy` ends the error of a file that was moved.
///
/// # Errors
/// [`Error::File`] that names both places, where the system knows the second.
pub fn refuse_moved(file: &File, path: &Path, remedy: &str) -> Result<()> {
    let here = match leads_to(path, file) {
        Ok(true) => return Ok(()),
        Ok(false) => "another file",
        Err(error) if matches!(error.kind(), ErrorKind::NotFound | ErrorKind::NotADirectory) => {
            "nothing"
        }
        Err(error) => return Err(Error::file(path, "cannot be examined", Some(error))),
    };
    let (fate, remedy) = match place_of(file) {
        Place::At(place) => (format!("was moved to {}", printed::path(&place)), remedy),
        Place::Removed => ("was removed".to_owned(), ""),
        Place::Unknown => ("was moved or removed".to_owned(), remedy),
    };
    let end = if remedy.is_empty() { "" } else { "; " };
    let problem = format!("{fate} during the run, and {here} is in its place{end}{remedy}");
    Err(Error::file(path, problem, None))
}

/// Where an open file is.
enum Place {
    At(PathBuf),
    Removed,
    Unknown,
}

#[cfg(target_os = "linux")]
fn place_of(file: &File) -> Place {
    use std::os::fd::AsRawFd;
    use std::os::unix::fs::MetadataExt;
    if file.metadata().is_ok_and(|found| found.nlink() == 0) {
        return Place::Removed;
    }
    match fs::read_link(format!("/proc/self/fd/{}", file.as_raw_fd())) {
        Ok(path) if is_at(file, &path) => Place::At(path),
        _ => Place::Unknown,
    }
}

#[cfg(not(target_os = "linux"))]
const fn place_of(_: &File) -> Place {
    Place::Unknown
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;

    #[test]
    fn a_file_that_is_moved_replaced_or_removed_is_named_with_both_places() {
        let place = tempfile::tempdir().unwrap();
        let real = place.path().canonicalize().unwrap();
        let (path, other) = (real.join("run/log"), real.join("moved"));
        fs::create_dir(real.join("run")).unwrap();
        let file = File::create(&path).unwrap();
        let refused = || refuse_moved(&file, &path, "the end").map_err(|error| error.to_string());
        let says = |words: &str| format!("{}: {words}", path.display());
        let moved = if cfg!(target_os = "linux") {
            format!("was moved to {}", other.join("log").display())
        } else {
            "was moved or removed".to_owned()
        };
        let moved = format!("{moved} during the run, and");
        let rest = "is in its place; the end";
        assert_eq!(refused(), Ok(()));
        fs::rename(real.join("run"), &other).unwrap();
        assert_eq!(refused(), Err(says(&format!("{moved} nothing {rest}"))));
        fs::create_dir(real.join("run")).unwrap();
        fs::write(&path, "another").unwrap();
        assert_eq!(refused(), Err(says(&format!("{moved} another file {rest}"))));
        fs::rename(other.join("log"), &path).unwrap();
        assert_eq!(refused(), Ok(()));
        fs::remove_file(&path).unwrap();
        if cfg!(target_os = "linux") {
            let removed = "was removed during the run, and nothing is in its place";
            assert_eq!(refused(), Err(says(removed)));
        } else {
            assert!(refused().is_err());
        }
    }
}
