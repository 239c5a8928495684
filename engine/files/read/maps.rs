//! Retrieved images of a run.

use super::stack_file::StackFile;
use crate::inputs::refuse_changed;
use crate::layout::{self, RECORD};
use beamlet_core::printed::counted;
use beamlet_core::{Error, Result, folder};
use ndarray::Array2;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Retrieved images in a directory (`RUN/retrieved`): by name, one per view.
#[derive(Debug)]
pub struct Maps {
    path: PathBuf,
    maps: BTreeMap<String, StackFile>,
    /// Views, rows and columns.
    sides: [usize; 3],
}

impl Maps {
    /// Opens a directory of images: `NAME.npy` (view, row, column), `NAME.tif` with a page per
    /// view, or `NAME/view_0000.exr`.
    ///
    /// # Errors
    /// [`Error::File`] where there are none, or where they differ in shape, or where an input has another
    /// hash than in the retrieved.json beside them: names the command that makes them again.
    pub fn open(path: impl AsRef<Path>) -> Result<Self> {
        let path = path.as_ref();
        refuse_changed(path, RECORD, "retrieve")?;
        let unread = |error| Error::file(path, "cannot be read", Some(error));
        let mut maps = BTreeMap::new();
        for entry in folder::paths(path).map_err(unread)? {
            let name = entry.file_name().map(|name| name.to_string_lossy().to_lowercase());
            let is_file = name.is_some_and(|name| layout::array_name(&name).is_some());
            let is_map = entry.is_dir() || is_file;
            let name = entry.file_stem().map(|name| name.to_string_lossy().into_owned());
            if let (true, Some(name)) = (is_map, name.filter(|name| !name.starts_with('.'))) {
                maps.insert(name, StackFile::open(&entry)?);
            }
        }
        let Some(most) = maps.values().max_by_key(|map| map.shape()[1]) else {
            return Err(Error::file(path, "holds no retrieved images", None));
        };
        let [_, views, rows, columns] = most.shape();
        // What belongs to the flat is one image for all views.
        let fits = |map: &&StackFile| {
            let [_, count, r, c] = map.shape();
            (count == views || count == 1) && [r, c] == [rows, columns]
        };
        if let Some(other) = maps.values().find(|map| !fits(map)) {
            let problem = format!(
                "has {:?} images, rows and columns; {} has {:?}",
                &other.shape()[1..],
                most.path().display(),
                &most.shape()[1..]
            );
            return Err(Error::file(other.path(), problem, None));
        }
        Ok(Self { path: path.to_path_buf(), maps, sides: [views, rows, columns] })
    }

    /// Names of the images, sorted.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.maps.keys().map(String::as_str)
    }

    /// Every image as a stack of one view whose steps are the views.
    #[doc(hidden)]
    pub fn into_stacks(self) -> BTreeMap<String, StackFile> {
        self.maps
    }

    /// True if there is one image of this name for several views.
    #[doc(hidden)]
    pub fn is_shared(&self, name: &str) -> bool {
        self.views() > 1 && self.maps.get(name).is_some_and(|map| map.shape()[1] == 1)
    }

    /// Number of views.
    #[must_use]
    pub const fn views(&self) -> usize {
        self.sides[0]
    }

    /// Views, rows and columns of the images.
    #[doc(hidden)]
    pub const fn sides(&self) -> [usize; 3] {
        self.sides
    }

    /// The image of a view, `[row][column]` (the same for all views where it is the flat's), in the unit that `retrieved.json` names.
    ///
    /// # Errors
    /// [`Error::File`] for an unknown name or view (with the known ones), or if the file cannot be read.
    pub fn map(&self, name: &str, view: usize) -> Result<Array2<f32>> {
        let Some(map) = self.maps.get(name) else {
            let names: Vec<&str> = self.names().collect();
            let problem = format!("has no image {name}; it has {}", names.join(", "));
            return Err(Error::file(&self.path, problem, None));
        };
        let views = self.views();
        if view >= views {
            let problem = format!(
                "has {}; view {view} was requested, counted from 0",
                counted(views, "view")
            );
            return Err(Error::file(map.path(), problem, None));
        }
        map.only_frame(view.min(map.shape()[1] - 1))
    }
}
