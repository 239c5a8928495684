//! Writing retrieved images: into a directory beside, which takes the place of the right one
//! when everything stands. A retrieval that ends early leaves nothing.

mod record;
mod sheet;

pub use record::Record;

use crate::array_file::Format;
use crate::locked_file::LockedFile;
use crate::stack::layout::{
    self, IMAGES_MARK as MARK, IMAGES_PARTIAL as PARTIAL, IMAGES_REPLACED as REPLACED, RECORD,
};
use crate::whole_file::{refuse_link, sibling, sync_directory};
use crate::{Error, Result, folder, open_file};
use ndarray::ArrayView2;
use sheet::Sheet;
use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

const OF_OTHERS: &str = "is not of the retrieval and would be lost; choose another directory";

/// A directory of images in the making.
#[derive(Debug)]
pub(crate) struct ImageDirectory {
    path: PathBuf,
    partial: PathBuf,
    format: Format,
    /// Stands in the images' own metadata.
    about: serde_json::Value,
    sheets: BTreeMap<String, Sheet>,
    overwrite: bool,
    finished: bool,
    /// Holds the lock of the folder in the making.
    mark: LockedFile,
}

impl ImageDirectory {
    /// Refuses a place that is taken, before any work is done.
    pub(super) fn check(path: &Path, overwrite: bool) -> Result<()> {
        let names = match folder::names(path) {
            Ok(names) => names,
            Err(error) if error.kind() == ErrorKind::NotADirectory => {
                return Err(Error::file(path, "is not a directory", None));
            }
            Err(_) if fs::symlink_metadata(path).is_err() => return Ok(()),
            Err(error) => return Err(Error::file(path, "cannot be read", Some(error))),
        };
        if names.is_empty() {
            return Ok(());
        }
        if !layout::is_retrieved(path) {
            let problem = "is not empty and holds no retrieved images; choose another directory";
            return Err(Error::file(path, problem, None));
        }
        if !overwrite {
            let problem = "holds retrieved images already; overwrite them (--overwrite) or choose \
                           another directory";
            return Err(Error::file(path, problem, None));
        }
        let names = Record::names(&path.join(RECORD))?;
        refuse_others(path, &|name| names.contains(name))
    }

    /// Begins beside `path`; where that is a link, beside what it leads to.
    pub(crate) fn begin(
        path: &Path,
        format: Format,
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
            mark,
        })
    }

    /// Refuses to go on with a folder in the making that was moved or removed.
    fn refuse_moved(&self) -> Result<()> {
        let remedy = "begin again; images that are not finished are of no use";
        open_file::refuse_moved(&self.mark, &self.partial.join(MARK), remedy)
    }

    /// Adds the image of the next view to those of `name`, of which there will be `views`.
    pub(crate) fn put(
        &mut self,
        name: &str,
        unit: &str,
        views: usize,
        image: ArrayView2<'_, f32>,
    ) -> Result<()> {
        self.refuse_moved()?;
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
        self.sheets.get_mut(name).map_or(Ok(()), |sheet| sheet.put(image))
    }

    /// Writes the record and puts everything in its place.
    pub(crate) fn finish(mut self, record: Option<&Record>) -> Result<()> {
        self.refuse_moved()?;
        for sheet in std::mem::take(&mut self.sheets).into_values() {
            sheet.finish()?;
        }
        if let Some(record) = record {
            record.write(&self.partial.join(RECORD))?;
        }
        sync_directory(&self.partial)?;
        self.refuse_moved()?;
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
        // At the path of a folder that was moved may be one of others.
        if !self.finished && self.refuse_moved().is_ok() {
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
    let empty = folder::names(partial).is_ok_and(|names| names.is_empty());
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

/// Removes a folder of retrieved images, where there is one with nothing else in it.
fn remove_images(path: &Path) -> Result<()> {
    if fs::symlink_metadata(path).is_err() {
        return Ok(());
    }
    ImageDirectory::check(path, true)?;
    folder::remove(path).map_err(failed(path, "cannot be removed"))
}

/// Refuses what is not an image with one of these names, the record or the mark.
fn refuse_others(path: &Path, is_name: &dyn Fn(&str) -> bool) -> Result<()> {
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
            kind.is_file() && (name == RECORD || name == MARK || is_image())
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
    for name in folder::names(folder).map_err(&unread)? {
        let place = folder.join(&name);
        let is_view = name.to_str().is_some_and(layout::is_image_of_view);
        if !is_view || !fs::symlink_metadata(&place).map_err(&unread)?.is_file() {
            return Err(Error::file(place, OF_OTHERS, None));
        }
    }
    Ok(())
}

fn failed<'a>(path: &'a Path, problem: &'a str) -> impl Fn(std::io::Error) -> Error + 'a {
    move |error| Error::file(path, problem, Some(error))
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::Array2;

    fn begin(path: &Path) -> ImageDirectory {
        let about = serde_json::json!({});
        ImageDirectory::begin(path, Format::Exr, true, about).unwrap()
    }

    #[cfg(unix)]
    #[test]
    fn images_whose_folder_is_moved_are_not_split_over_two_folders() {
        let place = tempfile::tempdir().unwrap();
        let (run, moved) = (place.path().join("run"), place.path().join("moved"));
        fs::create_dir(&run).unwrap();
        let image = Array2::<f32>::zeros((2, 3));
        for in_its_place in [false, true] {
            let mut images = begin(&run.join("retrieved"));
            images.put("transmission", "1", 2, image.view()).unwrap();
            fs::rename(&run, &moved).unwrap();
            if in_its_place {
                fs::create_dir_all(run.join("retrieved.partial/transmission")).unwrap();
            }
            let error = images.put("transmission", "1", 2, image.view()).unwrap_err().to_string();
            assert!(error.contains("run/retrieved.partial/.beamlet-partial: was "), "{error}");
            assert!(error.contains("moved"), "{error}");
            let error = images.finish(None).unwrap_err().to_string();
            assert!(error.contains("run/retrieved.partial/.beamlet-partial: was "), "{error}");
            if in_its_place {
                let folder = run.join("retrieved.partial/transmission");
                assert!(folder::names(&folder).unwrap().is_empty());
                fs::remove_dir_all(&run).unwrap();
            }
            assert!(!run.exists());
            fs::rename(&moved, &run).unwrap();
        }
        let mut images = begin(&run.join("retrieved"));
        images.put("transmission", "1", 1, image.view()).unwrap();
        images.finish(None).unwrap();
        assert_eq!(folder::names(&run).unwrap(), ["retrieved"]);
        assert_eq!(folder::names(&run.join("retrieved")).unwrap(), ["transmission"]);
    }
}
