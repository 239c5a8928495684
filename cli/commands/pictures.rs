//! Pictures on their way to files: all are made before the first is written.

use crate::failure::Failure;
use crate::picture::drawing::Drawing;
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Pixels per unit of a drawing: sharp on screens and in print.
const SCALE: f64 = 1.5;

/// Pictures that wait to be written.
#[derive(Debug, Default)]
pub(super) struct Pictures {
    files: Vec<(String, Vec<u8>)>,
}

impl Pictures {
    /// Adds a picture under a file name.
    pub(super) fn add(
        &mut self,
        name: impl Into<String>,
        drawing: &Drawing,
    ) -> Result<(), Failure> {
        let name = name.into();
        let failed = |problem| Failure::File { path: name.clone().into(), problem };
        let png = drawing.to_png(SCALE).map_err(failed)?;
        self.files.push((name, png));
        Ok(())
    }

    /// Writes all of them and prints their paths.
    pub(super) fn write(
        self,
        directory: &Path,
        overwrite: bool,
        out: &mut impl Write,
    ) -> Result<(), Failure> {
        let paths = self.files.iter().map(|(name, _)| directory.join(name));
        let paths: Vec<PathBuf> = paths.collect();
        refuse_existing(&paths, overwrite)?;
        for (path, (_, bytes)) in paths.iter().zip(&self.files) {
            write_file(path, bytes)?;
            writeln!(out, "{}", path.display())?;
        }
        Ok(())
    }
}

/// Refuses to write where something is, unless it may be replaced.
pub(super) fn refuse_existing(paths: &[PathBuf], overwrite: bool) -> Result<(), Failure> {
    match paths.iter().find(|path| path.exists() && !overwrite) {
        Some(path) => Err(Failure::File {
            path: path.clone(),
            problem: "is there already; --overwrite replaces it".into(),
        }),
        None => Ok(()),
    }
}

/// Writes a file whole, with the directories it is in.
pub(super) fn write_file(path: &Path, bytes: &[u8]) -> Result<(), Failure> {
    path.parent().map_or(Ok(()), fs::create_dir_all).and_then(|()| fs::write(path, bytes)).map_err(
        |error| Failure::File { path: path.into(), problem: format!("cannot be written: {error}") },
    )
}
