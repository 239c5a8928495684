//! The images of one name, view after view.

use super::own::Kind;
use crate::layout;
use beamlet_core::array_file::{Append, Format, Sample, append};
use beamlet_core::whole_file::{sync_directory, sync_path};
use beamlet_core::{Error, Result, folder, numbers};
use ndarray::ArrayView2;
use rayon::prelude::*;
use std::fmt;
use std::path::{Path, PathBuf};

/// Images in the making.
pub(super) struct Sheet {
    path: PathBuf,
    format: Format,
    kind: Kind,
    about: serde_json::Value,
    /// Views, rows and columns.
    sides: [u32; 3],
    /// Size of a pixel on the detector, x and z, m.
    pitch: Option<[f64; 2]>,
    sample: Sample,
    next: u32,
    /// The file of all views; `None` where each has a file.
    file: Option<Box<dyn Append>>,
}

impl fmt::Debug for Sheet {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Sheet").field("path", &self.path).finish_non_exhaustive()
    }
}

impl Sheet {
    /// Begins the images of `name`: views, rows and columns.
    pub(super) fn begin(
        folder: &Path,
        name: &str,
        format: Format,
        kind: Kind,
        sides: [usize; 3],
        pitch: Option<[f64; 2]>,
        about: serde_json::Value,
    ) -> Result<Self> {
        let (path, sides) = (layout::array(folder, name, format), sides.map(numbers::count));
        let sample = if name == layout::FLAGS { Sample::U32 } else { Sample::F32 };
        let file = if format.abilities().pages {
            Some(append(&path, format, sides, pitch, sample)?)
        } else {
            let unwritten = |error| Error::file(&path, "cannot be written", Some(error));
            folder::make(&path).map_err(unwritten)?;
            None
        };
        Ok(Self { path, format, kind, about, sides, pitch, sample, next: 0, file })
    }

    /// The next view.
    pub(super) fn put(&mut self, image: ArrayView2<'_, f32>) -> Result<()> {
        let mut about = self.about.clone();
        if self.sides[0] > 1
            && let Some(about) = about.as_object_mut()
        {
            let key = match self.kind {
                Kind::Images => "view",
                Kind::Astra => "row",
                Kind::Volume => "slice",
            };
            about.insert(key.into(), self.next.into());
        }
        let path = self.path_of(self.next);
        self.next += 1;
        match &mut self.file {
            Some(file) => file.put(image, &about.to_string()),
            None => {
                let file = append(&path, self.format, self.sides, self.pitch, self.sample);
                file?.put(image, &about.to_string())
            }
        }
    }

    /// The file of a view, where each has one.
    fn path_of(&self, view: u32) -> PathBuf {
        let name = match self.kind {
            Kind::Images => layout::image_of_view(self.sides[0], view, self.format),
            Kind::Astra | Kind::Volume => layout::image_of_slice(self.sides[0], view, self.format),
        };
        self.path.join(name)
    }

    /// The last view was put: everything is on disk.
    pub(super) fn finish(self) -> Result<()> {
        if let Some(file) = self.file {
            return file.finish();
        }
        let paths: Vec<PathBuf> = (0..self.next).map(|view| self.path_of(view)).collect();
        // Journalling file systems settle syncs that wait at the same time together.
        paths.par_iter().try_for_each(|path| sync_path(path))?;
        sync_directory(&self.path)
    }
}
