//! Writing retrieved images: into a directory beside, which takes the place of the right one
//! when everything stands. A retrieval that ends early leaves nothing.

mod record;
mod sheet;

pub use record::Record;

use crate::{Error, Result};
use ndarray::ArrayView2;
use serde::{Deserialize, Serialize};
use sheet::Sheet;
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

/// The file that tells what the images are.
pub(super) const RECORD: &str = "retrieved.json";

/// File format of retrieved images.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
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
    finished: bool,
}

impl ImageDirectory {
    /// Refuses a place that is taken, before any work is done.
    pub(super) fn check(path: &Path, overwrite: bool) -> Result<()> {
        let Ok(mut entries) = fs::read_dir(path) else {
            return match path.exists() {
                true => Err(Error::output(path, "is not a directory", None)),
                false => Ok(()),
            };
        };
        if entries.next().is_none() {
            return Ok(());
        }
        if !path.join(RECORD).exists() {
            let problem = "is not empty and holds no retrieved images; choose another directory";
            return Err(Error::output(path, problem, None));
        }
        if !overwrite {
            let problem = "holds retrieved images already; overwrite them or choose another \
                           directory";
            return Err(Error::output(path, problem, None));
        }
        let ours = Record::names(&path.join(RECORD))?;
        for entry in fs::read_dir(path).into_iter().flatten().flatten() {
            let stem = entry.path().file_stem().map(|s| s.to_string_lossy().into_owned());
            if entry.file_name() != RECORD && stem.is_none_or(|stem| !ours.contains(&stem)) {
                let problem = "is not of the retrieval and would be lost; choose another directory";
                return Err(Error::output(entry.path(), problem, None));
            }
        }
        Ok(())
    }

    /// Begins beside `path`.
    pub(crate) fn begin(
        path: &Path,
        format: ImageFormat,
        about: serde_json::Value,
    ) -> Result<Self> {
        let Some(name) = path.file_name() else {
            return Err(Error::output(path, "has no name of its own: name a directory", None));
        };
        let mut name = name.to_os_string();
        name.push(".partial");
        let partial = path.with_file_name(name);
        if partial.exists() {
            fs::remove_dir_all(&partial).map_err(failed(&partial, "cannot be removed"))?;
        }
        fs::create_dir_all(&partial).map_err(failed(&partial, "cannot be created"))?;
        Ok(Self {
            path: path.to_path_buf(),
            partial,
            format,
            about,
            sheets: BTreeMap::new(),
            finished: false,
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
        let mut name = self.path.file_name().unwrap_or_default().to_os_string();
        name.push(".replaced");
        let replaced = self.path.with_file_name(name);
        if self.path.exists() {
            fs::rename(&self.path, &replaced).map_err(failed(&self.path, "cannot be moved"))?;
        }
        fs::rename(&self.partial, &self.path)
            .map_err(failed(&self.path, "cannot be put in place"))?;
        self.finished = true;
        if replaced.exists() {
            fs::remove_dir_all(&replaced).map_err(failed(&replaced, "cannot be removed"))?;
        }
        Ok(())
    }
}

impl Drop for ImageDirectory {
    fn drop(&mut self) {
        if !self.finished {
            self.sheets.clear();
            let _ = fs::remove_dir_all(&self.partial);
        }
    }
}

fn failed<'a>(path: &'a Path, problem: &'a str) -> impl Fn(std::io::Error) -> Error + 'a {
    move |error| Error::output(path, problem, Some(error))
}
