//! Writing retrieved images: into a directory beside, which takes the place of the right one
//! when everything stands. A retrieval that ends early leaves nothing.

mod record;
mod sheet;

pub use record::Record;

use crate::locked_file::LockedFile;
use crate::whole_file::{refuse_link, sibling, sync_directory};
use crate::{Error, Result};
use ndarray::ArrayView2;
use serde::{Deserialize, Serialize};
use sheet::Sheet;
use std::collections::BTreeMap;
use std::fs::{self, File};
use std::path::{Path, PathBuf};

/// The file that describes the images.
pub(super) const RECORD: &str = "retrieved.json";
const OF_OTHERS: &str = "is not of the retrieval and would be lost; choose another directory";
/// Ending of the folder in the making.
const PARTIAL: &str = ".partial";
/// Ending of the folder that is replaced.
const REPLACED: &str = ".replaced";
/// File that says that a folder in the making is of beamlet.
const MARK: &str = ".beamlet-partial";

/// File format of retrieved images.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum ImageFormat {
    /// `NAME/view_0000.exr`, 32-bit float, channel `Y`.
    #[default]
    Exr,
    /// `NAME.npy`, (view, row, column), f32.
    Npy,
    /// `NAME.tif`, 32-bit float, a page per view.
    Tiff,
}

/// A directory of images in the making.
#[derive(Debug)]
pub(crate) struct ImageDirectory {
    path: PathBuf,
    partial: PathBuf,
    format: ImageFormat,
    /// Stands in the images' own metadata.
    about: serde_json::Value,
    sheets: BTreeMap<String, Sheet>,
    overwrite: bool,
    finished: bool,
    /// Holds the lock of the folder in the making.
    _mark: LockedFile,
}

impl ImageDirectory {
    /// Refuses a place that is taken, before any work is done.
    pub(super) fn check(path: &Path, overwrite: bool) -> Result<()> {
        let Ok(mut entries) = fs::read_dir(path) else {
            return match fs::symlink_metadata(path).is_ok() {
                true => Err(Error::file(path, "is not a directory", None)),
                false => Ok(()),
            };
        };
        if entries.next().is_none() {
            return Ok(());
        }
        if !path.join(RECORD).exists() {
            let problem = "is not empty and holds no retrieved images; choose another directory";
            return Err(Error::file(path, problem, None));
        }
        if !overwrite {
            let problem = "holds retrieved images already; overwrite them or choose another \
                           directory";
            return Err(Error::file(path, problem, None));
        }
        let names = Record::names(&path.join(RECORD))?;
        refuse_others(path, &|name| names.contains(name))
    }

    /// Begins beside `path`; where that is a link, beside what it leads to.
    pub(crate) fn begin(
        path: &Path,
        format: ImageFormat,
        overwrite: bool,
        about: serde_json::Value,
    ) -> Result<Self> {
        let place = match fs::symlink_metadata(path) {
            Ok(found) if found.is_symlink() => {
                path.canonicalize().map_err(failed(path, "leads nowhere"))?
            }
            _ => path.to_path_buf(),
        };
        Self::check(&place, overwrite)?;
        if place.file_name().is_none() {
            return Err(Error::file(path, "has no name of its own: name a directory", None));
        }
        let replaced = sibling(&place, REPLACED);
        if fs::symlink_metadata(&replaced).is_ok() {
            // What a crash left; anything else there is of others.
            Self::check(&replaced, true)?;
        }
        let partial = sibling(&place, PARTIAL);
        let mark = claim(&partial)?;
        Ok(Self {
            path: place,
            partial,
            format,
            overwrite,
            about,
            sheets: BTreeMap::new(),
            finished: false,
            _mark: mark,
        })
    }

    /// Adds the image of the next view to those of `name`, of which there will be `views`.
    pub(crate) fn put(
        &mut self,
        name: &str,
        unit: &str,
        views: usize,
        image: ArrayView2<'_, f32>,
    ) -> Result<()> {
        if !self.sheets.contains_key(name) {
            let mut about = self.about.clone();
            if let Some(about) = about.as_object_mut() {
                about.insert("image".into(), name.into());
                about.insert("unit".into(), unit.into());
            }
            let shape = [views, image.nrows(), image.ncols()];
            let sheet = Sheet::begin(&self.partial, name, self.format, shape, about)?;
            self.sheets.insert(name.to_owned(), sheet);
        }
        match self.sheets.get_mut(name) {
            Some(sheet) => sheet.put(&image.as_standard_layout()),
            None => Ok(()),
        }
    }

    /// Writes the record and puts everything in its place.
    pub(crate) fn finish(mut self, record: Option<&Record>) -> Result<()> {
        for sheet in std::mem::take(&mut self.sheets).into_values() {
            sheet.finish()?;
        }
        if let Some(record) = record {
            record.write(&self.partial.join(RECORD))?;
        }
        sync_directory(&self.partial)?;
        // Somebody may have put files there since the beginning.
        Self::check(&self.path, self.overwrite)?;
        let replaced = sibling(&self.path, REPLACED);
        remove_images(&replaced)?;
        if fs::remove_dir(&self.path).is_err() && self.path.exists() {
            fs::rename(&self.path, &replaced).map_err(failed(&self.path, "cannot be moved"))?;
        }
        fs::rename(&self.partial, &self.path)
            .map_err(failed(&self.path, "cannot be put in place"))?;
        self.finished = true;
        let mark = self.path.join(MARK);
        fs::remove_file(&mark).map_err(failed(&mark, "cannot be removed"))?;
        sync_directory(&self.path)?;
        sync_directory(self.path.parent().unwrap_or(&self.path))?;
        remove_images(&replaced)
    }
}

impl Drop for ImageDirectory {
    fn drop(&mut self) {
        if !self.finished {
            self.sheets.clear();
            let _ = sweep(&self.partial);
            let _ = fs::remove_file(self.partial.join(MARK));
            let _ = fs::remove_dir(&self.partial);
        }
    }
}

/// Makes the folder of images in the making ours: marks and locks it, and removes what a crash
/// left in it.
fn claim(partial: &Path) -> Result<LockedFile> {
    refuse_link(partial)?;
    fs::create_dir_all(partial).map_err(failed(partial, "cannot be created"))?;
    let mark = partial.join(MARK);
    let empty = fs::read_dir(partial).is_ok_and(|mut entries| entries.next().is_none());
    if !empty && !mark.is_file() {
        let problem = "is not of beamlet, and its name is needed for images in the making; move \
                       it, or choose another directory for the images";
        return Err(Error::file(partial, problem, None));
    }
    refuse_link(&mark)?;
    let file = File::create(&mark).map_err(failed(&mark, "cannot be created"))?;
    let file = LockedFile::exclusive(file)
        .ok_or_else(|| Error::file(partial, "another beamlet is making images here", None))?;
    sweep(partial)?;
    Ok(file)
}

/// Removes images from a folder of images in the making; it is an error where anything else is
/// in it.
fn sweep(partial: &Path) -> Result<()> {
    refuse_others(partial, &|_| true)?;
    for entry in fs::read_dir(partial).map_err(failed(partial, "cannot be read"))?.flatten() {
        let path = entry.path();
        let done = match path.is_dir() {
            true => fs::remove_dir_all(&path),
            false if entry.file_name() == MARK => Ok(()),
            false => fs::remove_file(&path),
        };
        done.map_err(failed(&path, "cannot be removed"))?;
    }
    Ok(())
}

/// Removes a folder of retrieved images, where there is one with nothing else in it.
fn remove_images(path: &Path) -> Result<()> {
    if fs::symlink_metadata(path).is_err() {
        return Ok(());
    }
    ImageDirectory::check(path, true)?;
    fs::remove_dir_all(path).map_err(failed(path, "cannot be removed"))
}

/// Refuses what is not an image with one of these names, the record or the mark.
fn refuse_others(path: &Path, is_name: &dyn Fn(&str) -> bool) -> Result<()> {
    let unread = failed(path, "cannot be read");
    for entry in fs::read_dir(path).map_err(&unread)? {
        let entry = entry.map_err(&unread)?;
        let (place, kind) = (entry.path(), entry.file_type().map_err(&unread)?);
        let name = entry.file_name();
        let name = name.to_str().unwrap_or_default();
        let ours = match name.rsplit_once('.') {
            _ if kind.is_dir() && is_name(name) => {
                refuse_beside_views(&place)?;
                true
            }
            _ if !kind.is_file() => false,
            _ if name == RECORD || name == MARK => true,
            Some((stem, "npy" | "tif")) => is_name(stem),
            _ => false,
        };
        if !ours {
            return Err(Error::file(place, OF_OTHERS, None));
        }
    }
    Ok(())
}

/// Refuses what is not the EXR image of a view.
fn refuse_beside_views(folder: &Path) -> Result<()> {
    let unread = failed(folder, "cannot be read");
    for entry in fs::read_dir(folder).map_err(&unread)? {
        let entry = entry.map_err(&unread)?;
        let name = entry.file_name();
        let is_view = name
            .to_str()
            .and_then(|name| name.strip_prefix("view_")?.strip_suffix(".exr"))
            .is_some_and(|digits| digits.bytes().all(|digit| digit.is_ascii_digit()));
        if !is_view || !entry.file_type().map_err(&unread)?.is_file() {
            return Err(Error::file(entry.path(), OF_OTHERS, None));
        }
    }
    Ok(())
}

fn failed<'a>(path: &'a Path, problem: &'a str) -> impl Fn(std::io::Error) -> Error + 'a {
    move |error| Error::file(path, problem, Some(error))
}
