//! The files of a run directory by their names: only what beamlet wrote is removed or changed,
//! and no link is followed.

use super::run_directory::{COUNTS, LOG, RUN, SCENE};
use super::{Exposure, RunFile, StackShape, array_frames, exr_frames};
use crate::whole_file::refuse_link;
use crate::{Error, Result, folder};
use std::ffi::OsString;
use std::fs;
use std::io::ErrorKind;
use std::path::Path;

/// Spool of a view in the making, in the folder of partial frames.
pub(super) const SPOOL: &str = "spool.f32";
/// What a crash leaves of a file that was being written.
const NEW: [&str; 2] = ["scene.toml.new", "run.json.new"];
/// Folders of a run.
const FOLDERS: [&str; 6] =
    ["flat", "sample", "dark", COUNTS, exr_frames::PARTIAL, crate::moments::DIRECTORY];

/// Names that stand in a run directory.
pub(super) fn owned_names() -> impl Iterator<Item = &'static str> {
    [RUN, SCENE, LOG].into_iter().chain(array_frames::FILES).chain(NEW).chain(FOLDERS)
}

/// Whether a run can begin in `path`.
///
/// # Errors
/// As [`super::RunDirectory::create`].
pub(super) fn look(path: &Path, overwrite: bool) -> Result<()> {
    let names = match folder::names(path) {
        Ok(names) => names,
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(()),
        Err(error) => return Err(Error::file(path, "cannot hold a run", Some(error))),
    };
    let empty = names.is_empty() || has_only_begun(path);
    let is_run = RunFile::read(&path.join(RUN)).is_ok();
    if !empty && !overwrite {
        let problem = if is_run {
            "holds a run already; resume it, overwrite it or choose another directory"
        } else {
            "is not empty; choose another directory (or overwrite: files that are not of a run \
             stay)"
        };
        return Err(Error::file(path, problem, None));
    }
    if !is_run
        && !has_only_begun(path)
        && let Some(name) = first_of_our_names(path)
    {
        let problem = "was not written by beamlet and would be replaced; choose another directory";
        return Err(Error::file(path.join(name), problem, None));
    }
    refuse_links(path)
}

/// Whether a run was ended here before its run.json stood: its log is there and empty, and
/// beside it at most what a run begins with.
pub(super) fn has_only_begun(path: &Path) -> bool {
    let is_first = |name: &OsString| [LOG, SCENE].iter().chain(&NEW).any(|first| name == *first);
    is_empty_log(path) && folder::names(path).is_ok_and(|names| names.iter().all(is_first))
}

/// Whether the log is there and commits nothing.
fn is_empty_log(path: &Path) -> bool {
    fs::symlink_metadata(path.join(LOG)).is_ok_and(|log| log.is_file() && log.len() == 0)
}

/// The first name of ours that stands in `path`. An empty log does not count: a run begins with
/// one, and there is nothing in it to lose.
fn first_of_our_names(path: &Path) -> Option<&'static str> {
    let empty_log = is_empty_log(path);
    owned_names()
        .filter(|name| !(empty_log && *name == LOG))
        .find(|name| fs::symlink_metadata(path.join(name)).is_ok())
}

/// Refuses links in place of files and folders of a run.
pub(super) fn refuse_links(path: &Path) -> Result<()> {
    owned_names().try_for_each(|name| refuse_link(&path.join(name)))?;
    FOLDERS.iter().try_for_each(|folder| refuse_links_in(&path.join(folder)))
}

fn refuse_links_in(folder: &Path) -> Result<()> {
    each_entry(folder, |name, path| {
        if !is_of_folder(name) {
            return Ok(());
        }
        refuse_link(path)?;
        if path.is_dir() { refuse_links_in(path) } else { Ok(()) }
    })
}

/// Whether beamlet gives this name to anything in a folder of a run.
fn is_of_folder(name: &str) -> bool {
    let stacks = ["flat", "sample", exr_frames::PARTIAL, SPOOL];
    let numbered = [("step_", ".exr"), ("view_", ""), ("view_", ".bin"), ("view_", ".partial")];
    stacks.contains(&name)
        || array_frames::FILES.contains(&name)
        || numbered.iter().any(|ends| number(name, *ends).is_some())
}

/// The number between two ends of a name.
fn number(name: &str, (start, end): (&str, &str)) -> Option<u32> {
    let digits = name.strip_prefix(start)?.strip_suffix(end)?;
    let plain = !digits.is_empty() && digits.bytes().all(|digit| digit.is_ascii_digit());
    if plain { digits.parse().ok() } else { None }
}

/// Removes the stacks under `root` of a run with this extent, but for the views in `keep`.
pub(super) fn remove_stacks(root: &Path, extent: StackShape, keep: &[Exposure]) -> Result<()> {
    for view in [Exposure::Flat, Exposure::Dark] {
        if !keep.contains(&view) {
            remove_frames(&root.join(exr_frames::view_directory(extent, view)), extent)?;
        }
    }
    let sample = root.join("sample");
    each_entry(&sample, |name, path| {
        let Some(index) = number(name, ("view_", "")).filter(|index| *index < extent.views) else {
            return Ok(());
        };
        let view = Exposure::Sample(index);
        let directory = root.join(exr_frames::view_directory(extent, view));
        match directory == path && !keep.contains(&view) {
            true => remove_frames(&directory, extent),
            false => Ok(()),
        }
    })?;
    remove_frames(&root.join(exr_frames::PARTIAL), extent)?;
    let _ = fs::remove_dir(sample);
    Ok(())
}

/// Removes the frames (and the spool) in a directory, and the directory if nothing else is in it.
pub(super) fn remove_frames(directory: &Path, extent: StackShape) -> Result<()> {
    refuse_link(directory)?;
    each_entry(directory, |name, path| {
        let step = number(name, ("step_", ".exr")).filter(|step| *step < extent.steps);
        let is_frame = step.is_some_and(|step| exr_frames::step_file(extent, step) == name);
        if is_frame || name == SPOOL { remove_file(path) } else { Ok(()) }
    })?;
    let _ = fs::remove_dir(directory);
    Ok(())
}

/// Removes a file; a link in its place is an error.
pub(super) fn remove_file(path: &Path) -> Result<()> {
    refuse_link(path)?;
    match fs::remove_file(path) {
        Err(error) if error.kind() != ErrorKind::NotFound => {
            Err(Error::file(path, "cannot be removed", Some(error)))
        }
        _ => Ok(()),
    }
}

/// Visits what stands in a folder under a name in Unicode; a folder that is not there is empty.
fn each_entry(folder: &Path, mut visit: impl FnMut(&str, &Path) -> Result<()>) -> Result<()> {
    let names = match folder::names(folder) {
        Ok(names) => names,
        Err(error) if matches!(error.kind(), ErrorKind::NotFound | ErrorKind::NotADirectory) => {
            return Ok(());
        }
        Err(error) => return Err(Error::file(folder, "cannot be read", Some(error))),
    };
    let mut names = names.iter().filter_map(|name| name.to_str());
    names.try_for_each(|name| visit(name, &folder.join(name)))
}
