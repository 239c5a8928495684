//! Pictures on their way to files: all are made before the first is written.

use crate::args::PictureFormat;
use crate::failure::Failure;
use crate::picture::drawing::Drawing;
use beamlet::stack::{is_of_run, is_same_place};
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Pixels per unit of a drawing: sharp on screens and in print.
const SCALE: f64 = 1.5;
/// Bytes for each of these while a picture is painted and encoded: colours, a clip, and the file
/// while it grows.
const OF_PIXEL: u64 = 24;

/// Kind of files that pictures become.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct PictureForm {
    pub(super) format: PictureFormat,
    /// Pixels across; `None`: [`SCALE`] for each unit of the drawing.
    pub(super) width: Option<u32>,
}

/// Pictures that wait to be written.
#[derive(Debug, Default)]
pub(super) struct Pictures {
    form: PictureForm,
    files: Vec<(String, Vec<u8>)>,
}

impl Pictures {
    /// No pictures yet; all are to have this form.
    pub(super) const fn new(form: PictureForm) -> Self {
        Self { form, files: Vec::new() }
    }

    /// Adds a picture under a file name, which gets the ending of its format.
    pub(super) fn add(
        &mut self,
        name: impl Into<String>,
        drawing: &Drawing,
    ) -> Result<(), Failure> {
        let PictureForm { format, width } = self.form;
        let name = name.into() + format.ending();
        let scale = width.map_or(SCALE, |width| f64::from(width) / drawing.width);
        let [width, height] = drawing.pixels_at(scale).map(u64::from);
        let bytes = OF_PIXEL.saturating_mul(width).saturating_mul(height);
        beamlet::cli_support::require_memory(bytes, &format!("the picture {name}"))?;
        let failed = |problem| Failure::File { path: name.clone().into(), problem };
        let file = match format {
            PictureFormat::Png => drawing.to_png(scale).map_err(failed)?,
            PictureFormat::Svg => drawing.to_svg_file(scale * drawing.width).into_bytes(),
        };
        self.files.push((name, file));
        Ok(())
    }

    /// Writes all of them and prints their paths. `read`: files or runs they were made from.
    pub(super) fn write(
        self,
        directory: &Path,
        overwrite: bool,
        read: &[PathBuf],
        out: &mut impl Write,
    ) -> Result<(), Failure> {
        let paths = self.files.iter().map(|(name, _)| directory.join(name));
        let paths: Vec<PathBuf> = paths.collect();
        refuse_read(&paths, read)?;
        refuse_existing(&paths, overwrite)?;
        for (path, (_, bytes)) in paths.iter().zip(&self.files) {
            beamlet::cli_support::write_file(path, bytes)?;
            writeln!(out, "{}", beamlet::cli_support::printed::path(path))?;
        }
        Ok(())
    }
}

/// Refuses to write where something is, unless it may be replaced.
pub(super) fn refuse_existing(paths: &[PathBuf], overwrite: bool) -> Result<(), Failure> {
    match paths.iter().find(|path| fs::symlink_metadata(path).is_ok() && !overwrite) {
        Some(path) => Err(Failure::File {
            path: path.clone(),
            problem: "exists already; --overwrite replaces it".into(),
        }),
        None => Ok(()),
    }
}

/// Refuses to write files over inputs: a file, or anything that belongs to a run.
pub(super) fn refuse_read(paths: &[PathBuf], read: &[PathBuf]) -> Result<(), Failure> {
    let is_read = |path: &PathBuf| {
        read.iter().find(|read| is_same_place(path, read) || is_of_run(read, path))
    };
    match paths.iter().find_map(|path| is_read(path).map(|read| (path, read))) {
        Some((path, read)) => Err(Failure::File {
            path: path.clone(),
            problem: format!(
                "would replace {}, which this command reads",
                beamlet::cli_support::printed::path(read)
            ),
        }),
        None => Ok(()),
    }
}

/// Writes the picture of `--plot`, SVG or PNG by its ending.
pub(super) fn save_plot(drawing: &Drawing, path: &Path, overwrite: bool) -> Result<(), Failure> {
    let ending = path.extension().map(|text| text.to_string_lossy().to_lowercase());
    let bytes = match ending.as_deref() {
        Some("svg") => drawing.to_svg_file(1.5 * drawing.width).into_bytes(),
        Some("png") => drawing
            .to_png(1.5)
            .map_err(|problem| Failure::File { path: path.to_owned(), problem })?,
        _ => {
            let problem = format!(
                "--plot {}: the name must end in .svg or .png",
                beamlet::cli_support::printed::path(path)
            );
            return Err(Failure::Usage(problem));
        }
    };
    refuse_existing(&[path.to_owned()], overwrite)?;
    Ok(beamlet::cli_support::write_file(path, &bytes)?)
}
