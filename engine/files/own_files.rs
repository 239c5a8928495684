//! The files of a run directory by their names: only what beamlet wrote is removed or changed,
//! and no link is followed.

use super::layout::{self, LOG, RUN};
use super::run_file::RunFile;
use super::shape::StackShape;
use beamlet_core::whole_file::refuse_link;
use beamlet_core::{Error, Result, folder};
use beamlet_model::scene::Exposure;
use std::fs::{self, File};
use std::io::{self, ErrorKind, Read};
use std::path::Path;

/// Checks that a run can begin in `path`.
///
/// # Errors
/// As [`crate::RunDirectory::create`].
pub(super) fn look(path: &Path, overwrite: bool) -> Result<()> {
    let names = match folder::names(path) {
        Ok(names) => names,
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(()),
        Err(error) => return Err(folder::failed(path, "cannot hold a run", error)),
    };
    let empty = names.is_empty() || has_only_begun(path);
    let is_run = RunFile::read(&path.join(RUN)).is_ok();
    if !empty && !overwrite {
        let problem = if is_run {
            "holds a run already: `simulate --resume` goes on with it, --overwrite replaces it; or choose \
             another directory"
        } else {
            "is not empty; choose another directory (or --overwrite: files that are not of a run \
             stay)"
        };
        return Err(Error::file(path, problem, None));
    }
    if !is_run && let Some(name) = first_of_our_names(path) {
        let problem = "was not written by beamlet and would be replaced; choose another directory";
        return Err(Error::file(path.join(name), problem, None));
    }
    refuse_links(path)
}

/// True if a run ended here before run.json existed, and nothing else is here.
pub(super) fn has_only_begun(path: &Path) -> bool {
    let first = first_names();
    let is_first = |name: &std::ffi::OsString| first.iter().any(|first| name == first.as_str());
    is_empty_log(path) && folder::names(path).is_ok_and(|names| names.iter().all(is_first))
}

/// Files that a run begins with, before run.json.
fn first_names() -> Vec<String> {
    let names = [LOG, layout::SCENE, layout::GEOMETRY].map(str::to_owned);
    layout::unfinished().chain(names).collect()
}

/// True if the log is there and commits nothing.
fn is_empty_log(path: &Path) -> bool {
    fs::symlink_metadata(path.join(LOG)).is_ok_and(|log| log.is_file() && log.len() == 0)
}

/// The first name of ours in `path`. Beside an empty log the files that a run begins with do not count: it
/// ended before run.json existed.
fn first_of_our_names(path: &Path) -> Option<String> {
    let first = if is_empty_log(path) { first_names() } else { Vec::new() };
    layout::owned()
        .filter(|name| !first.contains(name))
        .find(|name| fs::symlink_metadata(path.join(name)).is_ok())
}

/// Refuses links in place of files and folders of a run.
pub(super) fn refuse_links(path: &Path) -> Result<()> {
    let names = layout::owned().chain([layout::RETRIEVED.to_owned()]);
    names.map(|name| path.join(name)).try_for_each(|path| refuse_link(&path))?;
    layout::folders().try_for_each(|folder| refuse_links_in(&path.join(folder)))
}

fn refuse_links_in(folder: &Path) -> Result<()> {
    each_entry(folder, |name, path| {
        if !layout::is_of_folder(name) {
            return Ok(());
        }
        refuse_link(path)?;
        if path.is_dir() { refuse_links_in(path) } else { Ok(()) }
    })
}

/// Removes the stacks under `root` of a run with this extent, but for the views in `keep`.
pub(super) fn remove_stacks(root: &Path, extent: StackShape, keep: &[Exposure]) -> Result<()> {
    for stack in layout::STACKS {
        if !layout::has_folders(extent, stack) {
            if !keep.contains(&stack) {
                remove_frames(&layout::view_folder(root, extent, stack), extent)?;
            }
            continue;
        }
        let folder = root.join(layout::stack(stack));
        each_entry(&folder, |name, path| {
            let index = layout::view_of_folder(name, extent.count_of(stack));
            match index.is_some_and(|index| !keep.contains(&stack.with_index(index))) {
                true => remove_frames(path, extent),
                false => Ok(()),
            }
        })?;
        let _ = fs::remove_dir(folder);
    }
    remove_frames(&root.join(layout::PARTIAL), extent)
}

/// Removes the frames (and the spool) in a directory, and the directory if nothing else is in it.
pub(super) fn remove_frames(directory: &Path, extent: StackShape) -> Result<()> {
    refuse_link(directory)?;
    each_entry(directory, |name, path| {
        let ours = layout::is_frame(name, extent.steps) || name == layout::SPOOL;
        if ours { remove_file(path) } else { Ok(()) }
    })?;
    let _ = fs::remove_dir(directory);
    Ok(())
}

/// Removes the page of `beamlet report` in a run; any other file or link in its place stays.
pub(super) fn remove_report(run: &Path) -> Result<()> {
    let page = run.join(layout::REPORT);
    let is_file = fs::symlink_metadata(&page).is_ok_and(|found| found.is_file());
    if is_file && begins_as_report(&page).unwrap_or(false) { remove_file(&page) } else { Ok(()) }
}

/// True if the mark of reports is in the first bytes of a file.
fn begins_as_report(page: &Path) -> io::Result<bool> {
    let mut beginning = Vec::new();
    File::open(page)?.take(1 << 12).read_to_end(&mut beginning)?;
    Ok(String::from_utf8_lossy(&beginning).contains(layout::REPORT_MARK))
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

/// Visits the entries of a folder with names in Unicode; a missing folder is empty.
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
