//! Retrieved images of a run.

use super::{StackFile, extension};
use crate::{Error, Result};
use ndarray::Array2;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Retrieved images in a directory (`RUN/retrieved`): by name, one per view.
#[derive(Debug)]
pub struct Maps {
    path: PathBuf,
    maps: BTreeMap<String, StackFile>,
    views: usize,
}

impl Maps {
    /// Opens a directory of images: `NAME.npy` (view, row, column), `NAME.tif` with a page per
    /// view, or `NAME/view_0000.exr`.
    ///
    /// # Errors
    /// [`Error::Output`] where there are none, or where they differ in shape.
    pub fn open(path: impl AsRef<Path>) -> Result<Self> {
        let path = path.as_ref();
        let unread = |error| Error::output(path, "cannot be read", Some(error));
        let mut maps = BTreeMap::new();
        for entry in std::fs::read_dir(path).map_err(unread)? {
            let entry = entry.map_err(unread)?.path();
            let is_map = entry.is_dir() || matches!(extension(&entry).as_str(), "npy" | "tif");
            let name = entry.file_stem().map(|name| name.to_string_lossy().into_owned());
            if let (true, Some(name)) = (is_map, name.filter(|name| !name.starts_with('.'))) {
                maps.insert(name, StackFile::open(&entry)?);
            }
        }
        let mut shapes = maps.values().map(|map| (map.path(), map.shape()));
        let Some((first, shape)) = shapes.next() else {
            return Err(Error::output(path, "holds no retrieved images", None));
        };
        if let Some((other, found)) = shapes.find(|(_, found)| *found != shape) {
            let problem = format!(
                "has {found:?} images, rows and columns; {} has {shape:?}",
                first.display()
            );
            return Err(Error::output(other, problem, None));
        }
        let views = shape[1];
        Ok(Self { path: path.to_path_buf(), maps, views })
    }

    /// Names of the images, sorted.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.maps.keys().map(String::as_str)
    }

    /// Number of views.
    #[must_use]
    pub const fn views(&self) -> usize {
        self.views
    }

    /// The image of a view, `[row][column]`, in the unit that `retrieved.json` names.
    ///
    /// # Errors
    /// [`Error::Output`] for a name or view that is not there (says what is), or where the file
    /// cannot be read.
    pub fn map(&self, name: &str, view: usize) -> Result<Array2<f32>> {
        let Some(map) = self.maps.get(name) else {
            let names: Vec<&str> = self.names().collect();
            let problem = format!("has no image {name}; it has {}", names.join(", "));
            return Err(Error::output(&self.path, problem, None));
        };
        map.only_frame(view)
    }
}
