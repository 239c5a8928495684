//! The images of one name, view after view.

use super::own::Kind;
use crate::layout;
use beamlet_core::array_file::{Append, Format, Sample, append};
use beamlet_core::whole_file::{sync_directory, sync_path};
use beamlet_core::{Error, Result, folder};
use ndarray::ArrayView2;
use rayon::prelude::*;
use std::fmt;
use std::path::{Path, PathBuf};

/// Form of the files of images.
#[derive(Debug, Clone, Copy)]
pub(super) struct Form {
    pub(super) format: Format,
    /// Views, rows and columns.
    pub(super) sides: [u32; 3],
    /// Size of a pixel on the detector, x and z, m.
    pub(super) pitch: Option<[f64; 2]>,
    /// Type of the values.
    pub(super) sample: Sample,
}

impl Form {
    fn append(self, path: &Path) -> Result<Box<dyn Append>> {
        append(path, self.format, self.sides, self.pitch, self.sample)
    }
}

/// Images in the making.
pub(super) struct Sheet {
    path: PathBuf,
    kind: Kind,
    form: Form,
    about: serde_json::Value,
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
    /// Begins the images at `path`: kind of their folder, their form and their description.
    pub(super) fn begin(
        path: PathBuf,
        kind: Kind,
        form: Form,
        about: serde_json::Value,
    ) -> Result<Self> {
        let file = if form.format.abilities().pages {
            Some(form.append(&path)?)
        } else {
            let unwritten = |error| Error::file(&path, "cannot be written", Some(error));
            folder::make(&path).map_err(unwritten)?;
            None
        };
        Ok(Self { path, kind, form, about, next: 0, file })
    }

    /// The next view.
    pub(super) fn put(&mut self, image: ArrayView2<'_, f32>) -> Result<()> {
        let mut about = self.about.clone();
        if self.form.sides[0] > 1
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
            None => self.form.append(&path)?.put(image, &about.to_string()),
        }
    }

    /// The file of a view, where each has one.
    fn path_of(&self, view: u32) -> PathBuf {
        let Form { format, sides: [views, ..], .. } = self.form;
        let name = match self.kind {
            Kind::Images => layout::image_of_view(views, view, format),
            Kind::Astra | Kind::Volume => layout::image_of_slice(views, view, format),
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
