//! Files that are written whole or not at all.
//!
//! The bytes go to a file of another name, which is flushed and synced and then renamed into
//! place: a full disk or a crash leaves the file that was there before.

use crate::locked_file::LockedFile;
use crate::{Error, Result, folder, open_file};
use std::ffi::OsString;
use std::fs::{self, File, OpenOptions};
use std::io::{self, ErrorKind, Write};
use std::path::{Path, PathBuf};

/// Ending of files of a run that are not whole yet.
pub const NEW: &str = ".new";
/// Beginning and ending of other files that are not whole yet.
const UNFINISHED: [&str; 2] = [".", ".beamlet-new"];

/// Path of a file while it is not whole: a hidden name of its own, so that files of others stay. A file
/// that a crash leaves there is replaced by the next that is written.
fn unfinished(path: &Path) -> PathBuf {
    let mut name = OsString::from(UNFINISHED[0]);
    name.push(path.file_name().unwrap_or_default());
    name.push(UNFINISHED[1]);
    path.with_file_name(name)
}

/// The name that a file gets when it is whole; the name itself for others.
pub fn whole_name(name: &str) -> &str {
    let [beginning, ending] = UNFINISHED;
    let hidden = || name.strip_prefix(beginning)?.strip_suffix(ending);
    hidden().or_else(|| name.strip_suffix(NEW)).unwrap_or(name)
}

/// Opens the file of a name that one process has at a time, emptied.
fn claim(path: &Path) -> Result<LockedFile> {
    let failed = |error| Error::file(path, "cannot be written", Some(error));
    loop {
        refuse_link(path)?;
        let mut options = OpenOptions::new();
        let file = options.write(true).create(true).truncate(false).open(path).map_err(failed)?;
        let file = LockedFile::exclusive(file).ok_or_else(|| {
            Error::file(path, "another beamlet process is writing this file", None)
        })?;
        // Another process may have finished its file, which has another name then.
        if open_file::is_at(&file, path) {
            file.set_len(0).map_err(failed)?;
            return Ok(file);
        }
    }
}

/// Writes a file with the directories it is in, and syncs it, before it takes the place of one
/// that is there, or that a link there leads to. A device or pipe is written to.
///
/// # Errors
/// [`Error::File`] if it cannot be written, or another process writes it; an existing file is unchanged
/// then.
pub fn write_file(path: &Path, bytes: &[u8]) -> Result<()> {
    let failed = |error| Error::file(path, "cannot be written", Some(error));
    match fs::metadata(path) {
        Ok(found) if found.is_dir() => return Err(Error::file(path, "is a directory", None)),
        Ok(found) if !found.is_file() => {
            let mut open = OpenOptions::new().write(true).open(path).map_err(failed)?;
            return open.write_all(bytes).and_then(|()| open.flush()).map_err(failed);
        }
        _ => {}
    }
    // Links such as /dev/stdout are not replaced.
    let real = path.canonicalize().unwrap_or_else(|_| path.to_path_buf());
    folder::make_all(real.parent().unwrap_or(path))?;
    let new = unfinished(&real);
    let mut file = claim(&new)?;
    replace(&real, &new, &mut file, bytes).map_err(failed)
}

/// As [`write_file`] for a file of a run directory, which is locked, under the name with [`NEW`].
///
/// # Errors
///
/// [`Error::File`] for a link at either name, or where it cannot be written.
pub fn write_whole(path: &Path, bytes: &[u8]) -> Result<()> {
    let new = sibling(path, NEW);
    refuse_link(&new)?;
    refuse_link(path)?;
    File::create(&new)
        .and_then(|mut file| replace(path, &new, &mut file, bytes))
        .map_err(|error| Error::file(path, "cannot be written", Some(error)))
}

fn replace(path: &Path, new: &Path, file: &mut File, bytes: &[u8]) -> io::Result<()> {
    let done = file
        .write_all(bytes)
        .and_then(|()| file.sync_all())
        .and_then(|()| fs::rename(new, path))
        .and_then(|()| sync(path.parent().unwrap_or(path)));
    if done.is_err() {
        let _ = fs::remove_file(new);
    }
    done
}

/// The path with an ending more.
pub fn sibling(path: &Path, ending: &str) -> PathBuf {
    let mut name = path.file_name().unwrap_or_default().to_os_string();
    name.push(ending);
    path.with_file_name(name)
}

/// Gives a file of a run another path, by a hard link where the system has these, and by a copy
/// elsewhere; a file at that path is replaced. The file is synced.
///
/// # Errors
/// [`Error::File`].
pub fn link_or_copy(from: &Path, to: &Path) -> Result<()> {
    let failed = |error| Error::file(to, "cannot be written", Some(error));
    match fs::remove_file(to) {
        Err(error) if error.kind() != ErrorKind::NotFound => return Err(failed(error)),
        _ => {}
    }
    if fs::hard_link(from, to).is_err() {
        if !from.is_file() {
            return Err(Error::file(from, "is missing", None));
        }
        fs::copy(from, to).map_err(failed)?;
    }
    sync_path(to)
}

/// Refuses a symbolic link in place of a file or folder that beamlet writes, since its target may belong
/// to others, and pipes and devices, which block.
///
/// # Errors
///
/// [`Error::File`] that names the object found.
pub fn refuse_link(path: &Path) -> Result<()> {
    match fs::symlink_metadata(path) {
        Ok(found) if found.is_symlink() => {
            let problem = "is a link, and links inside a run are not followed; only the run directory itself may be one";
            Err(Error::file(path, problem, None))
        }
        Ok(found) if !found.is_file() && !found.is_dir() => {
            let problem = "is neither a file nor a folder, so beamlet cannot write there";
            Err(Error::file(path, problem, None))
        }
        Err(error) if error.kind() != ErrorKind::NotFound => {
            Err(Error::file(path, "cannot be examined", Some(error)))
        }
        _ => Ok(()),
    }
}

/// Syncs an existing file or folder.
///
/// # Errors
///
/// [`Error::File`] where the file system refuses.
pub fn sync_path(path: &Path) -> Result<()> {
    File::open(path)
        .and_then(|file| file.sync_all())
        .map_err(|error| Error::file(path, "cannot be synced", Some(error)))
}

/// Makes renames in a directory last; systems without that notion do without.
///
/// # Errors
///
/// [`Error::File`] where the file system refuses.
pub fn sync_directory(path: &Path) -> Result<()> {
    sync(path).map_err(|error| Error::file(path, "cannot be synced", Some(error)))
}

fn sync(directory: &Path) -> io::Result<()> {
    if cfg!(not(unix)) {
        return Ok(());
    }
    let here = Path::new(".");
    let directory = if directory.as_os_str().is_empty() { here } else { directory };
    File::open(directory)?.sync_all()
}
