//! Which files of a folder of images or volumes are beamlet's: nothing else is replaced or removed.

use super::failed;
use crate::layout::{self, CORRECTIONS, GEOMETRY, IMAGES_MARK as MARK, RETRIEVED};
use beamlet_core::locked_file::LockedFile;
use beamlet_core::whole_file::refuse_link;
use beamlet_core::{Error, Result, folder, input_file};
use serde::Deserialize;
use serde::de::IgnoredAny;
use std::collections::BTreeMap;
use std::ffi::OsString;
use std::fs::{self, File, FileType};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

const OF_OTHERS: &str =
    "was not written by this command and would be lost; choose another directory";

/// Contents of a folder of arrays.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
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

/// Entries of a record that say which files of its folder are beamlet's.
#[derive(Deserialize)]
struct Listed {
    units: BTreeMap<String, String>,
    /// Names of files beside the arrays; hashes by path where it is a map, as in retrieved.json.
    #[serde(default)]
    files: serde_json::Value,
    #[serde(default)]
    corrections: Vec<IgnoredAny>,
}

impl Listed {
    fn read(record: &Path, kind: Kind) -> Result<Self> {
        let text = input_file::text(record)
            .map_err(|error| Error::file(record, "cannot be read", Some(error)))?;
        serde_json::from_str(&text).map_err(|error| {
            let problem = format!("is not the record of {}: {error}", kind.noun());
            Error::file(record, problem, None)
        })
    }

    fn has_array(&self, name: &str) -> bool {
        self.units.contains_key(name)
    }

    fn has_file(&self, name: &str) -> bool {
        let is_listed =
            self.files.as_array().is_some_and(|files| files.iter().any(|it| it == name));
        let is_table = name == CORRECTIONS && !self.corrections.is_empty();
        layout::is_beside_arrays(name) && (is_listed || is_table)
    }
}

/// Refuses a link in place of the retrieved images of a run.
pub(super) fn refuse_linked(path: &Path) -> Result<()> {
    // Without a slash at its end, which the system would follow.
    let path: PathBuf = path.components().collect();
    let is_own = path.file_name().is_some_and(|name| name == RETRIEVED);
    match path.parent().filter(|run| is_own && layout::is_run(run)) {
        Some(_) => refuse_link(&path),
        None => Ok(()),
    }
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
    let listed = Listed::read(&record, kind)?;
    refuse_others(path, &|name| listed.has_array(name), &|name| listed.has_file(name))
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
    refuse_others(partial, &|_| true, &layout::is_beside_arrays)?;
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
    refuse_link(path)?;
    check(path, kind, true)?;
    discard(path, kind)
}

/// Removes the arrays of a folder and the files beside them, the record last: a removal that ends early can
/// be repeated. Files of others stay, and so does a folder without a record that can be read.
pub(super) fn discard(path: &Path, kind: Kind) -> Result<()> {
    refuse_link(path)?;
    let record = path.join(kind.record());
    if let Ok(listed) = Listed::read(&record, kind) {
        let gone =
            |place: &Path| fs::remove_file(place).map_err(failed(place, "cannot be removed"));
        for (name, kind) in entries(path)? {
            let place = path.join(&name);
            if kind.is_dir() && listed.has_array(&name) {
                let images = entries(&place)?.into_iter();
                let images = images.filter(|(name, kind)| is_image(name, *kind));
                images.map(|(name, _)| place.join(name)).try_for_each(|image| gone(&image))?;
                let _ = fs::remove_dir(&place);
            } else if place != record
                && is_own(&name, kind, &|name| listed.has_array(name), &|name| {
                    listed.has_file(name)
                })
            {
                gone(&place)?;
            }
        }
        gone(&record)?;
    }
    let _ = fs::remove_dir(path);
    Ok(())
}

/// Names in a folder with their kinds, links not followed; a name that is not Unicode is empty.
fn entries(path: &Path) -> Result<Vec<(String, FileType)>> {
    let unread = failed(path, "cannot be read");
    let names = folder::names(path).map_err(&unread)?.into_iter();
    let entry = |name: OsString| {
        let kind = fs::symlink_metadata(path.join(&name)).map_err(&unread)?.file_type();
        Ok((name.into_string().unwrap_or_default(), kind))
    };
    names.map(entry).collect()
}

/// True if an entry is a file with an array of these names, one of these files, the geometry, a record or
/// the mark.
fn is_own(
    name: &str,
    kind: FileType,
    is_name: &dyn Fn(&str) -> bool,
    is_file: &dyn Fn(&str) -> bool,
) -> bool {
    let known = [layout::RECORD, layout::ASTRA, layout::VOLUME, GEOMETRY, MARK];
    let is_array = || layout::array_name(name).is_some_and(is_name);
    kind.is_file() && (known.contains(&name) || is_array() || is_file(name))
}

/// True if an entry is the image of a view or slice.
fn is_image(name: &str, kind: FileType) -> bool {
    kind.is_file() && layout::is_image_of_folder(name)
}

/// Refuses entries that are neither [`is_own`] nor the folder of an array of these names.
fn refuse_others(
    path: &Path,
    is_name: &dyn Fn(&str) -> bool,
    is_file: &dyn Fn(&str) -> bool,
) -> Result<()> {
    let others = |place: PathBuf| Err(Error::file(place, OF_OTHERS, None));
    for (name, kind) in entries(path)? {
        let place = path.join(&name);
        if kind.is_dir() && is_name(&name) {
            let images = entries(&place)?;
            if let Some((name, _)) = images.iter().find(|(name, kind)| !is_image(name, *kind)) {
                return others(place.join(name));
            }
        } else if !is_own(&name, kind, is_name, is_file) {
            return others(place);
        }
    }
    Ok(())
}
