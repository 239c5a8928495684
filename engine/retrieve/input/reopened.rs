//! The measured stacks of a retrieval, opened again to be looked at.

use super::{Input, mean};
use crate::retrieve::Record;
use crate::scene::Scene;
use crate::stack::StackFile;
use crate::stack::layout::RECORD;
use crate::{Error, Result};
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
        let (flat, mut sample) = (open(flat)?, open(sample)?);
        let dark = record.dark.as_ref().map(open).transpose()?;
        let [angles, rows, _] = record.shape;
        let views = angles * scene.scan.dithers_of_angle();
        let [found, frames, ..] = sample.shape();
        if found != views && views > 0 {
            sample = sample.with_steps(found * frames / views)?;
        }
        let frame = [flat.shape()[2], flat.shape()[3]];
        for other in [&flat, &sample].into_iter().chain(&dark) {
            let [_, _, other_rows, columns] = other.shape();
            if other_rows != rows || [other_rows, columns] != frame {
                let problem = format!(
                    "has frames of {other_rows} x {columns} pixels; the images of {} have {rows} \
                     rows",
                    directory.display()
                );
                return Err(Error::file(other.path(), problem, None));
            }
        }
        let steps = record.offsets.len();
        let flat = match flat.shape()[1] {
            frames if frames > steps && steps > 0 => flat.with_steps(steps)?,
            _ => flat,
        };
        let dark_path = dark.as_ref().map(|dark| dark.path().to_path_buf());
        let read = [&flat, &sample].into_iter().chain(&dark).map(|s| s.path().to_owned()).collect();
        let dark = dark.as_ref().map(mean).transpose()?;
        let (saturation, noise, counts) = (None, None, record.counts);
        let frames = record.frames.clone();
        Ok(Self {
            scene,
            flat,
            sample,
            flats_every: record.flats_every,
            dark,
            dark_path,
            bad: None,
            saturation,
            noise,
            counts,
            is_run: false,
            read,
            frames,
        })
    }
}

/// A path of the record, from where the program runs.
fn place(source: &str, directory: &Path) -> PathBuf {
    let path = PathBuf::from(source);
    let beside = directory.parent().map(|parent| parent.join(&path));
    match beside {
        Some(beside) if !path.exists() && beside.exists() => beside,
        _ => path,
    }
}
