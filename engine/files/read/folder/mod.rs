//! Folders of frames, or patterns for names in a folder: which files are frames, and the views they make.

mod name;
mod order;
mod time;

use beamlet_core::array_file::{Format, endings};
use beamlet_core::{Error, Result, folder};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// The frames of a folder.
#[derive(Debug)]
pub(super) struct FolderFrames {
    /// Format of the files.
    pub(super) format: Format,
    pub(super) views: usize,
    /// Files of all frames, the views one after another.
    pub(super) files: Vec<PathBuf>,
    /// Frames by the numbers in the names of the files, as [`order::Order::sides`]; of folders of
    /// folders nothing.
    pub(super) sides: Vec<usize>,
}

/// Finds the frames of a folder, or of its folders.
pub(super) fn frames(path: &Path) -> Result<FolderFrames> {
    let (files, folders) = listing(path)?;
    if let Some(format) = files.first().and_then(|file| Format::of(file)) {
        let order::Order { paths: files, sides } = order::in_order(path, files)?;
        return Ok(FolderFrames { format, views: 1, files, sides });
    }
    let mut views: BTreeMap<PathBuf, Vec<PathBuf>> = BTreeMap::new();
    for folder in folders {
        let (files, _) = listing(&folder)?;
        if !files.is_empty() {
            let files = order::in_order(&folder, files)?.paths;
            views.insert(folder, files);
        }
    }
    let folders = order::in_order(path, views.keys().cloned().collect())?.paths;
    let (mut all, count) = (Vec::new(), folders.len());
    let mut first: Option<(PathBuf, usize)> = None;
    for folder in folders {
        let files = views.remove(&folder).unwrap_or_default();
        match &first {
            Some((before, count)) if *count != files.len() => {
                let problem =
                    format!("holds {} frames; {} holds {count}", files.len(), before.display());
                return Err(Error::file(folder, problem, None));
            }
            Some(_) => {}
            None => first = Some((folder, files.len())),
        }
        all.extend(files);
    }
    let format = all.first().and_then(|file| Format::of(file)).ok_or_else(|| {
        let endings = endings(|format| format.abilities().folders);
        let what = if folder::is_pattern(path) { "names" } else { "holds" };
        let problem = format!("{what} no frames: files that end in {endings}, or folders of them");
        Error::file(path, problem, None)
    })?;
    Ok(FolderFrames { format, views: count, files: all, sides: Vec::new() })
}

/// Frames and folders of a folder, by their names.
fn listing(path: &Path) -> Result<(Vec<PathBuf>, Vec<PathBuf>)> {
    let unread = |error| Error::file(path, "cannot be read", Some(error));
    let (mut frames, mut folders) = (Vec::new(), Vec::new());
    for entry in folder::entries(path).map_err(unread)? {
        let hidden = entry.file_name().is_some_and(|n| n.as_encoded_bytes().starts_with(b"."));
        if hidden {
            continue;
        }
        if entry.is_dir() {
            folders.push(entry);
        } else if Format::of(&entry).is_some_and(|format| format.abilities().folders) {
            frames.push(entry);
        }
    }
    let of = |format: &Format| frames.iter().any(|frame| Format::of(frame) == Some(*format));
    let formats: Vec<Format> = Format::ALL.into_iter().filter(of).collect();
    if let [one, other, ..] = formats[..] {
        let [one, other] = [one, other].map(|format| format.to_string().to_uppercase());
        let problem = format!("holds {one} and {other} frames; allowed: one format");
        return Err(Error::file(path, problem, None));
    }
    Ok((frames, folders))
}
