//! Which files of a folder of images or volumes are beamlet's: nothing else is replaced or removed.

use super::failed;
use crate::locked_file::LockedFile;
use crate::stack::layout::{self, GEOMETRY, IMAGES_MARK as MARK};
use crate::whole_file::refuse_link;
use crate::{Error, Result, folder, input_file};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::ErrorKind;
use std::path::Path;

const OF_OTHERS: &str =
    "was not written by this command and would be lost; choose another directory";

/// Contents of a folder of arrays.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Kind {
    /// Retrieved images, or differences of images: an image per view.
    Images,
    /// Projections for ASTRA: an image per row.
    Astra,
    /// Volumes: an image per slice.
    Volume,
}

impl Kind {
    /// File that describes the folder and names its arrays.
    pub(crate) const fn record(self) -> &'static str {
        match self {
            Self::Images => layout::RECORD,
            Self::Astra => layout::ASTRA,
            Self::Volume => layout::VOLUME,
        }
    }

    const fn noun(self) -> &'static str {
        match self {
            Self::Images => "retrieved images",
            Self::Astra => "projections for ASTRA",
            Self::Volume => "a reconstruction",
        }
    }
}

/// What every record has: its arrays with their units, and the files beside them.
#[derive(Deserialize)]
struct Listed {
    units: BTreeMap<String, String>,
    #[serde(default)]
    files: Vec<String>,
}

/// Refuses a place that is taken, before any work is done.
pub(super) fn check(path: &Path, kind: Kind, overwrite: bool) -> Result<()> {
    let names = match folder::names(path) {
        Ok(names) => names,
        Err(error)
            if error.kind() == ErrorKind::NotFound && fs::symlink_metadata(path).is_err() =>
        {
            return Ok(());
        }
        Err(error) => return Err(folder::failed(path, "cannot be read", error)),
    };
    if names.is_empty() {
        return Ok(());
    }
    let (record, noun) = (path.join(kind.record()), kind.noun());
    if !record.exists() {
        let problem = format!(
            "is not empty and holds no {}; choose another directory",
            noun.trim_start_matches("a ")
        );
        return Err(Error::file(path, problem, None));
    }
    if !overwrite {
        let problem =
            format!("holds {noun} already; overwrite (--overwrite) or choose another directory");
        return Err(Error::file(path, problem, None));
    }
    let text = input_file::text(&record)
        .map_err(|error| Error::file(&record, "cannot be read", Some(error)))?;
    let listed: Listed = serde_json::from_str(&text).map_err(|error| {
        Error::file(&record, format!("is not the record of {noun}: {error}"), None)
    })?;
    let is_file = |name: &str| listed.files.iter().any(|file| file == name);
    refuse_others(path, &|name| listed.units.contains_key(name), &is_file)
}

/// Claims the folder of images in the making: marks and locks it, and removes the remains of a crash.
pub(super) fn claim(partial: &Path) -> Result<LockedFile> {
    refuse_link(partial)?;
    folder::make_all(partial)?;
    let mark = partial.join(MARK);
    let empty = folder::names(partial).is_ok_and(|names| names.is_empty());
    if !empty && !mark.is_file() {
        let problem = "was not written by beamlet, and its name is needed for unfinished images; move it, or choose another directory for the images";
        return Err(Error::file(partial, problem, None));
    }
    refuse_link(&mark)?;
    let file = File::create(&mark).map_err(failed(&mark, "cannot be created"))?;
    let file = LockedFile::exclusive(file).ok_or_else(|| {
        Error::file(partial, "another beamlet process is writing images here", None)
    })?;
    sweep(partial)?;
    Ok(file)
}

/// Removes images from a folder of images in the making; it is an error where anything else is
/// in it.
pub(super) fn sweep(partial: &Path) -> Result<()> {
    let is_written = |name: &str| layout::is_beside_arrays(name);
    refuse_others(partial, &|_| true, &is_written)?;
    for path in folder::paths(partial).map_err(failed(partial, "cannot be read"))? {
        let done = match path.is_dir() {
            true => folder::remove(&path),
            false if path.file_name().is_some_and(|name| name == MARK) => Ok(()),
            false => fs::remove_file(&path),
        };
        done.map_err(failed(&path, "cannot be removed"))?;
    }
    Ok(())
}

/// Removes a folder of arrays, where there is one with nothing else in it.
pub(super) fn remove(path: &Path, kind: Kind) -> Result<()> {
    if fs::symlink_metadata(path).is_err() {
        return Ok(());
    }
    check(path, kind, true)?;
    folder::remove(path).map_err(failed(path, "cannot be removed"))
}

/// Refuses entries that are not an array of these names, one of these files, the geometry, a record or
/// the mark.
fn refuse_others(
    path: &Path,
    is_name: &dyn Fn(&str) -> bool,
    is_file: &dyn Fn(&str) -> bool,
) -> Result<()> {
    let unread = failed(path, "cannot be read");
    for name in folder::names(path).map_err(&unread)? {
        let place = path.join(&name);
        let kind = fs::symlink_metadata(&place).map_err(&unread)?;
        let name = name.to_str().unwrap_or_default();
        let ours = if kind.is_dir() && is_name(name) {
            refuse_beside_views(&place)?;
            true
        } else {
            let is_image = || layout::array_name(name).is_some_and(is_name);
            let known = [layout::RECORD, layout::ASTRA, layout::VOLUME, GEOMETRY, MARK];
            kind.is_file() && (known.contains(&name) || is_image() || is_file(name))
        };
        if !ours {
            return Err(Error::file(place, OF_OTHERS, None));
        }
    }
    Ok(())
}

/// Refuses entries that are not the image of a view or slice.
fn refuse_beside_views(folder: &Path) -> Result<()> {
    let unread = failed(folder, "cannot be read");
    for name in folder::names(folder).map_err(&unread)? {
        let place = folder.join(&name);
        let is_view = name.to_str().is_some_and(layout::is_image_of_folder);
        if !is_view || !fs::symlink_metadata(&place).map_err(&unread)?.is_file() {
            return Err(Error::file(place, OF_OTHERS, None));
        }
    }
    Ok(())
}
