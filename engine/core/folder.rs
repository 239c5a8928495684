//! Folders, listed and removed.
//!
//! [`std::fs::read_dir`] panics where the system reports an error when it closes a folder; by then
//! the folder is read, and the error concerns nobody.

use crate::{Error, Result};
use std::ffi::{OsStr, OsString};
use std::path::{Path, PathBuf};
use std::{fs, io};

/// Names in a folder, sorted.
///
/// # Errors
///
/// Errors of the file system.
pub fn names(folder: &Path) -> io::Result<Vec<OsString>> {
    let mut names = read(folder)?;
    names.sort();
    Ok(names)
}

/// Paths in a folder, sorted by name.
///
/// # Errors
///
/// Errors of the file system.
pub fn paths(folder: &Path) -> io::Result<Vec<PathBuf>> {
    Ok(names(folder)?.into_iter().map(|name| folder.join(name)).collect())
}

/// True for a pattern of names in a folder: nothing has this name, and its last part has `*` (any
/// text) or `?` (one character).
pub fn is_pattern(path: &Path) -> bool {
    let name = path.file_name().map(OsStr::as_encoded_bytes).unwrap_or_default();
    name.iter().any(|byte| b"*?".contains(byte)) && fs::symlink_metadata(path).is_err()
}

/// True where a file or folder exists, or a pattern fits one.
pub fn is_there(path: &Path) -> bool {
    path.exists() || (is_pattern(path) && entries(path).is_ok_and(|all| !all.is_empty()))
}

/// The folder that holds the entries of a path: itself, or the parent of a pattern.
pub fn holder(path: &Path) -> &Path {
    match path.parent().filter(|_| is_pattern(path)) {
        Some(parent) if parent.as_os_str().is_empty() => Path::new("."),
        Some(parent) => parent,
        None => path,
    }
}

/// Paths in a folder, or of the names in a folder that a pattern fits, sorted by name.
///
/// # Errors
///
/// Errors of the file system.
pub fn entries(path: &Path) -> io::Result<Vec<PathBuf>> {
    if !is_pattern(path) {
        return paths(path);
    }
    let pattern = path.file_name().unwrap_or_default().to_string_lossy();
    let pattern: Vec<char> = pattern.chars().collect();
    let fits = |name: &OsString| {
        let name: Vec<char> = name.to_string_lossy().chars().collect();
        fits(&pattern, &name)
    };
    let folder = holder(path);
    Ok(names(folder)?.into_iter().filter(fits).map(|name| folder.join(name)).collect())
}

/// True where a pattern fits a name.
fn fits(pattern: &[char], name: &[char]) -> bool {
    // Places of the last star and of the name behind the text that it stands for.
    let (mut at, mut place, mut star) = (0, 0, None);
    while place < name.len() {
        match pattern.get(at) {
            Some('*') => {
                star = Some((at, place));
                at += 1;
            }
            Some(c) if *c == '?' || *c == name[place] => (at, place) = (at + 1, place + 1),
            _ => {
                let Some((of_star, behind)) = star else { return false };
                star = Some((of_star, behind + 1));
                (at, place) = (of_star + 1, behind + 1);
            }
        }
    }
    pattern[at..].iter().all(|c| *c == '*')
}

/// Removes a folder with everything in it; links are removed and not followed.
///
/// # Errors
///
/// Errors of the file system.
pub fn remove(folder: &Path) -> io::Result<()> {
    for path in paths(folder)? {
        match fs::symlink_metadata(&path)?.is_dir() {
            true => remove(&path)?,
            false => fs::remove_file(&path)?,
        }
    }
    fs::remove_dir(folder)
}

/// Makes a folder with those that it is in.
///
/// # Errors
/// [`Error::File`] where it cannot be made.
pub fn make_all(folder: &Path) -> Result<()> {
    fs::create_dir_all(folder).map_err(|error| failed(folder, "cannot be created", error))
}

/// The error of a folder that cannot be made or read: names the file in its place, or in the place
/// of a folder that it would be in.
pub fn failed(folder: &Path, problem: &str, error: io::Error) -> Error {
    let is_other = |path: &&Path| fs::symlink_metadata(path).is_ok() && !path.is_dir();
    match folder.ancestors().find(is_other) {
        Some(path) => Error::file(path, "is not a directory", None),
        None => Error::file(folder, problem, Some(error)),
    }
}

/// Makes a folder in one that is there already; it may be there, too.
///
/// # Errors
///
/// Errors of the file system.
pub fn make(folder: &Path) -> io::Result<()> {
    match fs::create_dir(folder) {
        Err(_) if folder.is_dir() => Ok(()),
        made => made,
    }
}

/// Bytes that a program may still write into a folder; `None` where the system does not say.
#[must_use]
pub fn free_space(folder: &Path) -> Option<u64> {
    #[cfg(unix)]
    {
        let found = rustix::fs::statvfs(folder).ok()?;
        found.f_bavail.checked_mul(found.f_frsize)
    }
    #[cfg(not(unix))]
    {
        let _ = folder;
        None
    }
}

#[cfg(unix)]
fn read(folder: &Path) -> io::Result<Vec<OsString>> {
    use rustix::fs::{Dir, Mode, OFlags, open};
    use std::ffi::OsStr;
    use std::os::unix::ffi::OsStrExt;

    let flags = OFlags::RDONLY | OFlags::DIRECTORY | OFlags::CLOEXEC;
    let entries = Dir::new(open(folder, flags, Mode::empty())?)?;
    let name = |entry: rustix::io::Result<rustix::fs::DirEntry>| match entry {
        Ok(entry) => match entry.file_name().to_bytes() {
            b"." | b".." => None,
            name => Some(Ok(OsStr::from_bytes(name).to_owned())),
        },
        Err(error) => Some(Err(error.into())),
    };
    entries.filter_map(name).collect()
}

#[cfg(not(unix))]
fn read(folder: &Path) -> io::Result<Vec<OsString>> {
    fs::read_dir(folder)?.map(|entry| Ok(entry?.file_name())).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_lists_what_the_standard_library_lists() {
        let place = tempfile::tempdir().unwrap();
        let at = |name: &str| place.path().join(name);
        // More than one read of the system returns.
        for index in 0..3000 {
            fs::write(at(&format!("a file with a name of some length {index}")), "").unwrap();
        }
        make(&at("folder")).unwrap();
        make(&at("folder")).unwrap();
        let mut expected: Vec<_> =
            fs::read_dir(place.path()).unwrap().map(|entry| entry.unwrap().path()).collect();
        expected.sort();
        assert_eq!(expected.len(), 3001);
        assert_eq!(paths(place.path()).unwrap(), expected);
        for folder in ["none", "folder/none"] {
            assert_eq!(names(&at(folder)).unwrap_err().kind(), io::ErrorKind::NotFound);
            assert!(make(&at("none/folder")).is_err());
        }
        let file = at("a file with a name of some length 7");
        assert_eq!(names(&file).unwrap_err().kind(), io::ErrorKind::NotADirectory);
        assert!(make(&file).is_err());
        let message = make_all(&file.join("one/two")).unwrap_err().to_string();
        assert!(message.contains("length 7: is not a directory"), "{message}");
        make_all(&at("new/one/two")).unwrap();
        assert!(at("new/one/two").is_dir());
    }

    #[test]
    fn patterns_name_the_entries_that_they_fit() {
        let place = tempfile::tempdir().unwrap();
        for name in ["flat_1.tif", "flat_2.tif", "flat_10.tif", "FLAT_1.tif", "flat_1.txt", "flat"]
        {
            fs::write(place.path().join(name), name).unwrap();
        }
        let of = |pattern: &str| -> Vec<String> {
            let paths = entries(&place.path().join(pattern)).unwrap();
            paths.iter().map(|p| p.file_name().unwrap().display().to_string()).collect()
        };
        assert_eq!(of("flat_*.tif"), ["flat_1.tif", "flat_10.tif", "flat_2.tif"]);
        assert_eq!(of("flat_?.t*"), ["flat_1.tif", "flat_1.txt", "flat_2.tif"]);
        assert_eq!(of("*1*tif"), ["FLAT_1.tif", "flat_1.tif", "flat_10.tif"]);
        assert_eq!(of("flat*"), ["flat", "flat_1.tif", "flat_1.txt", "flat_10.tif", "flat_2.tif"]);
        assert!(of("none_*").is_empty());
        assert_eq!(holder(Path::new("a*")), Path::new("."));
        // A file that has this name is no pattern.
        fs::write(place.path().join("odd*"), "").unwrap();
        assert!(!is_pattern(&place.path().join("odd*")));
    }

    #[cfg(unix)]
    #[test]
    fn what_links_lead_to_stays_when_a_folder_is_removed() {
        let place = tempfile::tempdir().unwrap();
        let at = |name: &str| place.path().join(name);
        fs::create_dir_all(at("folder/inner")).unwrap();
        fs::create_dir(at("others")).unwrap();
        fs::write(at("others/file"), "theirs").unwrap();
        std::os::unix::fs::symlink(at("others"), at("folder/inner/link")).unwrap();
        fs::write(at("folder/inner/file"), "ours").unwrap();
        remove(&at("folder")).unwrap();
        assert!(!at("folder").exists() && at("others/file").exists());
    }
}
