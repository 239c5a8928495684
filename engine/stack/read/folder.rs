//! Folders of frames: the order of the files, and what is missing from it.

use super::extension;
use crate::{Error, Result};
use std::fs;
use std::path::{Path, PathBuf};

/// The number of views and the files of all frames, the views one after another.
pub(super) fn frames(path: &Path) -> Result<(usize, Vec<PathBuf>)> {
    let (files, folders) = listing(path)?;
    if !files.is_empty() {
        return Ok((1, files));
    }
    let mut all = Vec::new();
    let mut first: Option<(PathBuf, usize)> = None;
    let mut views = 0;
    for folder in in_order(folders)? {
        let (files, _) = listing(&folder)?;
        if files.is_empty() {
            continue;
        }
        match &first {
            Some((before, count)) if *count != files.len() => {
                let problem =
                    format!("holds {} frames; {} holds {count}", files.len(), before.display());
                return Err(Error::file(folder, problem, None));
            }
            Some(_) => {}
            None => first = Some((folder.clone(), files.len())),
        }
        all.extend(files);
        views += 1;
    }
    if all.is_empty() {
        return Err(Error::file(
            path,
            "holds no frames: .exr or .tif files, or folders of \
                                        them",
            None,
        ));
    }
    Ok((views, all))
}

/// Frames in order, and folders, of a folder.
fn listing(path: &Path) -> Result<(Vec<PathBuf>, Vec<PathBuf>)> {
    let unread = |error| Error::file(path, "cannot be read", Some(error));
    let (mut frames, mut folders) = (Vec::new(), Vec::new());
    for entry in fs::read_dir(path).map_err(unread)? {
        let entry = entry.map_err(unread)?.path();
        let hidden = entry.file_name().is_some_and(|n| n.as_encoded_bytes().starts_with(b"."));
        if hidden {
            continue;
        }
        if entry.is_dir() {
            folders.push(entry);
        } else if matches!(extension(&entry).as_str(), "exr" | "tif" | "tiff") {
            frames.push(entry);
        }
    }
    let exr = frames.iter().filter(|frame| extension(frame) == "exr").count();
    if exr != 0 && exr != frames.len() {
        return Err(Error::file(path, "holds EXR and TIFF frames; allowed is one format", None));
    }
    Ok((in_order(frames)?, folders))
}

/// By the last number in the names, where all have one; a number that is missing is an error.
fn in_order(mut paths: Vec<PathBuf>) -> Result<Vec<PathBuf>> {
    let keys: Option<Vec<(String, u64)>> = paths.iter().map(|path| number(path)).collect();
    let Some(keys) = keys else {
        paths.sort();
        return Ok(paths);
    };
    let mut keyed: Vec<((String, u64), PathBuf)> = keys.into_iter().zip(paths).collect();
    keyed.sort();
    let one_series = keyed.windows(2).all(|pair| pair[0].0.0 == pair[1].0.0);
    if one_series && keyed.len() > 2 {
        let gaps = keyed.windows(2).map(|pair| pair[1].0.1 - pair[0].0.1);
        let least = gaps.min().unwrap_or(1);
        if let Some(pair) = keyed.windows(2).find(|pair| pair[1].0.1 - pair[0].0.1 != least) {
            let missing = pair[0].0.1 + least;
            let problem = format!(
                "is followed by {}: number {missing} is missing",
                pair[1].1.file_name().unwrap_or_default().display()
            );
            return Err(Error::file(&pair[0].1, problem, None));
        }
    }
    Ok(keyed.into_iter().map(|(_, path)| path).collect())
}

/// What stands before the last number of a file's name, and the number.
fn number(path: &Path) -> Option<(String, u64)> {
    let stem = path.file_stem()?.to_str()?;
    let end = stem.rfind(|c: char| c.is_ascii_digit())? + 1;
    let start = stem[..end]
        .rfind(|c: char| !c.is_ascii_digit())
        .map_or(0, |at| at + stem[at..].chars().next().map_or(1, char::len_utf8));
    Some((stem[..start].to_owned(), stem[start..end].parse().ok()?))
}
