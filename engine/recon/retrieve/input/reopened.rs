//! The measured stacks of a retrieval, opened again to be looked at.

use super::Input;
use super::correction::{Correction, Dark};
use super::open::require_one_shape;
use super::selection::{Columns, Selection};
use crate::retrieve::Record;
use beamlet_core::{Error, Result, folder};
use beamlet_files::StackFile;
use beamlet_files::layout::RECORD;
use beamlet_model::scene::Scene;
use std::path::{Path, PathBuf};

impl Input {
    /// The stacks that the images in `directory` were retrieved from, with the geometry that
    /// `record` (its retrieved.json) keeps. Relative paths start from the working directory or,
    /// where nothing is there, from the parent of `directory`. Values that the retrieval left out
    /// as saturated are not marked.
    ///
    /// # Errors
    /// [`Error::File`] where the record has no geometry or it does not read, and where a stack is
    /// gone or no longer has the shape of the images.
    pub fn reopened(record: &Record, directory: &Path) -> Result<Self> {
        let refused = |problem: String| Error::file(directory, problem, None);
        let Some(text) = &record.geometry else {
            return Err(refused(format!("{RECORD} keeps no geometry: retrieve again")));
        };
        let scene = Scene::from_toml(text, directory)?;
        let [flat, sample] = record.sources.as_slice() else {
            let count = record.sources.len();
            return Err(refused(format!("{RECORD} names {count} stacks; allowed: 2")));
        };
        let open = |source: &String| StackFile::open(place(source, directory));
        let (flat, mut sample) = (
            open(flat)?.with_order(record.frame_order),
            open(sample)?.with_order(record.frame_order),
        );
        let dark = record.dark.as_ref().map(open).transpose()?;
        let angles = record.shape[0];
        let views = angles * scene.scan.dithers_of_angle();
        let [found, frames, ..] = sample.shape();
        if found != views && views > 0 {
            sample = sample.with_steps(found * frames / views)?;
        }
        require_one_shape(&flat, std::iter::once(&sample).chain(&dark))?;
        let omitted = record.omitted_steps.clone();
        let steps = record.offsets.len() + omitted.len();
        let flat = match flat.shape()[1] {
            frames if frames > steps && steps > 0 => flat.with_steps(steps)?,
            _ => flat,
        };
        let read = [&flat, &sample].into_iter().chain(&dark).map(|s| s.path().to_owned()).collect();
        let dark = dark.as_ref().map(Dark::of).transpose()?;
        let correction = Correction { dark, ..Correction::default() };
        let (counts, frames) = (record.counts, record.frames.clone());
        let input = Self::new(scene, flat, sample, read);
        let mut input = Self {
            flats_every: record.flats_every,
            correction,
            counts,
            is_run: false,
            frames,
            omitted,
            ..input
        };
        let columns = record.kept_columns.as_deref().map(Columns::parse).transpose()?;
        input.selection = Selection::whole(input.whole_frame(), input.group());
        input = input.with_selection(columns, record.bin)?;
        let found = input.frame()[0];
        if found != record.shape[1] {
            let problem = format!(
                "has frames of {found} rows; the images of {} have {}",
                directory.display(),
                record.shape[1]
            );
            return Err(Error::file(input.flat.path(), problem, None));
        }
        Ok(input)
    }
}

/// A path of the record, from where the program runs.
fn place(source: &str, directory: &Path) -> PathBuf {
    let path = PathBuf::from(source);
    let beside = directory.parent().map(|parent| parent.join(&path));
    match beside {
        Some(beside) if !folder::is_there(&path) && folder::is_there(&beside) => beside,
        _ => path,
    }
}
