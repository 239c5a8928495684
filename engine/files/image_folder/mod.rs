//! Writing folders of images and volumes: into a folder beside, which takes the place of the right
//! one when everything is there. Work that ends early leaves nothing.

mod own;
mod sheet;

pub use own::Kind;

use crate::layout::{
    self, IMAGES_MARK as MARK, IMAGES_PARTIAL as PARTIAL, IMAGES_REPLACED as REPLACED,
};
use beamlet_core::array_file::{Format, Sample};
use beamlet_core::locked_file::LockedFile;
use beamlet_core::numbers::count;
use beamlet_core::whole_file::{refuse_link, sibling, sync_directory, sync_path, write_file};
use beamlet_core::{Error, Result, open_file};
use ndarray::ArrayView2;
use own::{check, claim, discard, refuse_linked, remove, sweep};
use sheet::{Form, Sheet};
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

/// A directory of images in the making.
#[derive(Debug)]
pub struct ImageDirectory {
    kind: Kind,
    path: PathBuf,
    partial: PathBuf,
    format: Format,
    /// Files beside the arrays.
    files: Vec<PathBuf>,
    /// Metadata of the images.
    about: serde_json::Value,
    /// Size of a pixel on the detector, x and z, m.
    pitch: Option<[f64; 2]>,
    sheets: BTreeMap<String, Sheet>,
    overwrite: bool,
    finished: bool,
    /// Holds the lock of the folder in the making.
    mark: LockedFile,
}

impl ImageDirectory {
    /// Refuses a place that is taken, before any work is done.
    ///
    /// # Errors
    ///
    /// [`Error::File`] that names the object found.
    pub fn check(path: &Path, kind: Kind, overwrite: bool) -> Result<()> {
        refuse_linked(path)?;
        check(path, kind, overwrite)
    }

    /// Removes the arrays at `path` with the files beside them, also where they were about to be replaced.
    /// Files of others stay.
    pub(crate) fn discard(path: &Path, kind: Kind) -> Result<()> {
        [path, &sibling(path, REPLACED)].into_iter().try_for_each(|path| discard(path, kind))
    }

    /// Begins beside `path`; for a link, beside its target.
    ///
    /// # Errors
    ///
    /// [`Error::File`] for a place that is taken or cannot be written.
    pub fn begin(
        path: &Path,
        kind: Kind,
        format: Format,
        overwrite: bool,
        about: serde_json::Value,
    ) -> Result<Self> {
        refuse_linked(path)?;
        let place = match fs::symlink_metadata(path) {
            Ok(found) if found.is_symlink() => {
                path.canonicalize().map_err(failed(path, "is a link to a missing target"))?
            }
            _ => path.to_path_buf(),
        };
        check(&place, kind, overwrite)?;
        if place.file_name().is_none() {
            return Err(Error::file(path, "does not end in a directory name", None));
        }
        let replaced = sibling(&place, REPLACED);
        if fs::symlink_metadata(&replaced).is_ok() {
            // The remains of a crash; anything else there belongs to others.
            refuse_link(&replaced)?;
            check(&replaced, kind, true)?;
        }
        let partial = sibling(&place, PARTIAL);
        let mark = claim(&partial)?;
        Ok(Self {
            kind,
            files: Vec::new(),
            path: place,
            partial,
            format,
            overwrite,
            about,
            pitch: None,
            sheets: BTreeMap::new(),
            finished: false,
            mark,
        })
    }

    /// Calibrates images by the size of a pixel, x and z, m.
    pub const fn with_pitch(mut self, pitch: [f64; 2]) -> Self {
        self.pitch = Some(pitch);
        self
    }

    /// Refuses to go on with a folder in the making that was moved or removed.
    fn refuse_moved(&self) -> Result<()> {
        let remedy = "start again: unfinished images cannot be used";
        open_file::refuse_moved(&self.mark, &self.partial.join(MARK), remedy)
    }

    /// Adds the image of the next of `views` views to the images of `name`. `sample`: type of the values in the file.
    ///
    /// # Errors
    ///
    /// [`Error::File`] where the folder was moved or cannot be written.
    pub fn put(
        &mut self,
        name: &str,
        unit: &str,
        sample: Sample,
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
            let sides = [views, image.nrows(), image.ncols()].map(count);
            let form = Form { format: self.format, sides, pitch: self.pitch, sample };
            let path = layout::array(&self.partial, name, self.format);
            self.sheets.insert(name.to_owned(), Sheet::begin(path, self.kind, form, about)?);
        }
        self.sheets.get_mut(name).map_or(Ok(()), |sheet| sheet.put(image))
    }

    /// Path of a file beside the arrays, for the caller to write now.
    ///
    /// # Errors
    ///
    /// [`Error::File`] where the folder was moved.
    pub fn file(&mut self, name: &str) -> Result<PathBuf> {
        self.refuse_moved()?;
        let path = self.partial.join(name);
        self.files.push(path.clone());
        Ok(path)
    }

    /// Writes the text of the record and puts everything in its place.
    ///
    /// # Errors
    ///
    /// [`Error::File`] where the folder was moved or cannot be written.
    pub fn finish(mut self, record: Option<&str>) -> Result<()> {
        self.refuse_moved()?;
        for sheet in std::mem::take(&mut self.sheets).into_values() {
            sheet.finish()?;
        }
        if let Some(record) = record {
            write_file(&self.partial.join(self.kind.record()), record.as_bytes())?;
        }
        self.files.iter().try_for_each(|path| sync_path(path))?;
        sync_directory(&self.partial)?;
        self.refuse_moved()?;
        // Somebody may have put files there since the beginning.
        check(&self.path, self.kind, self.overwrite)?;
        let replaced = sibling(&self.path, REPLACED);
        remove(&replaced, self.kind)?;
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
        remove(&replaced, self.kind)
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

fn failed<'a>(path: &'a Path, problem: &'a str) -> impl Fn(std::io::Error) -> Error + 'a {
    move |error| Error::file(path, problem, Some(error))
}

#[cfg(test)]
mod tests {
    use super::*;
    use beamlet_core::folder;
    use ndarray::Array2;

    fn begin(path: &Path) -> ImageDirectory {
        let about = serde_json::json!({});
        ImageDirectory::begin(path, Kind::Images, Format::Exr, true, about).unwrap()
    }

    fn put(images: &mut ImageDirectory, views: usize, image: ArrayView2<'_, f32>) -> Result<()> {
        images.put("transmission", "1", Sample::F32, views, image)
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
            put(&mut images, 2, image.view()).unwrap();
            fs::rename(&run, &moved).unwrap();
            if in_its_place {
                fs::create_dir_all(run.join("retrieved.partial/transmission")).unwrap();
            }
            let error = put(&mut images, 2, image.view()).unwrap_err().to_string();
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
        put(&mut images, 1, image.view()).unwrap();
        images.finish(None).unwrap();
        assert_eq!(folder::names(&run).unwrap(), ["retrieved"]);
        assert_eq!(folder::names(&run.join("retrieved")).unwrap(), ["transmission"]);
    }
}
