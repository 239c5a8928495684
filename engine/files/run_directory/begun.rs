//! A run between its beginning and its end.

use crate::frames::Frames;
use crate::layout::RUN;
use crate::part::Part;
use crate::progress_log::{Entry, ProgressLog};
use crate::run_file::{RunFile, RunState};
use crate::shape::StackShape;
use crate::values::Values;
use beamlet_core::{Error, Result, Tally};
use beamlet_model::scene::Exposure;
use ndarray::ArrayView3;
use std::ops::Range;
use std::path::Path;
use std::time::Instant;

/// State between `begin` and `finish`.
#[derive(Debug)]
pub(super) struct Begun {
    pub(super) file: RunFile,
    pub(super) part: Part,
    pub(super) since: Instant,
    /// Seconds of the parts before this one.
    pub(super) before: f64,
    pub(super) log: ProgressLog,
    pub(super) frames: Frames,
    /// Detector numbers, if the scene has noise.
    pub(super) counts: Option<Frames>,
    /// Counts of the view in work.
    pub(crate) tally: Tally,
    /// First row that the view in work still lacks, and of its counts.
    pub(crate) next: [u32; 2],
}

impl Begun {
    /// Writes run.json with the state that the run ends in.
    pub(super) fn end(&mut self, path: &Path, state: RunState) -> Result<()> {
        self.file.state = state;
        self.file.duration_s = self.before + self.since.elapsed().as_secs_f64();
        self.file.write(&path.join(RUN))
    }

    /// Does work on the files of the run, which must be at their paths.
    pub(super) fn in_place<T>(&mut self, work: impl FnOnce(&mut Self) -> Result<T>) -> Result<T> {
        self.log.refuse_moved()?;
        let done = work(self);
        if done.is_err() {
            // A move is the reason of any other failure.
            self.log.refuse_moved()?;
        }
        done
    }

    /// Takes a band of rows of a view, as intensities or as counts.
    pub(super) fn write(
        &mut self,
        path: &Path,
        view: Exposure,
        rows: &Range<u32>,
        data: ArrayView3<'_, f32>,
        values: Values,
    ) -> Result<()> {
        if !self.part.has(view) {
            let problem = format!("{view:?} is not of this part of the run");
            return Err(Error::file(path, problem, None));
        }
        let next = &mut self.next[usize::from(values == Values::Numbers)];
        follows(path, self.file.extent, view, *next, rows, data.dim())?;
        *next = rows.end;
        let frames = match (values, view) {
            // Dark frames are beside the intensities: no light is no light.
            (Values::Intensities, _) | (_, Exposure::Dark(_)) => Some(&mut self.frames),
            _ => self.counts.as_mut(),
        };
        let missing = || {
            Error::file(path, "the scene has neither detector.photons nor detector.exposure", None)
        };
        frames.ok_or_else(missing)?.write(view, rows, data)
    }

    /// Makes a view count.
    pub(super) fn commit(&mut self, view: Exposure) -> Result<()> {
        let counts = match &mut self.counts {
            Some(frames) if !view.is_dark() => Some(frames.commit(view)?),
            _ => None,
        };
        let sha256 = self.frames.commit(view)?;
        let entry = Entry {
            bytes: self.file.extent.view_bytes(),
            sha256,
            counts,
            tally: std::mem::take(&mut self.tally),
        };
        // The frames of a run that was moved meanwhile are in the other place.
        self.log.refuse_moved()?;
        self.log.append(view, &entry)
    }

    /// Refuses a run whose folders or files were moved or removed while it went on.
    pub(super) fn refuse_missing(&self) -> Result<()> {
        self.frames.refuse_missing()?;
        self.counts.as_ref().map_or(Ok(()), Frames::refuse_missing)
    }
}

/// Checks that a band of a view comes where it should, in its shape.
fn follows(
    path: &Path,
    extent: StackShape,
    view: Exposure,
    next: u32,
    rows: &Range<u32>,
    found: (usize, usize, usize),
) -> Result<()> {
    let shape = (extent.steps as usize, rows.len(), extent.columns as usize);
    if rows.start == next && found == shape {
        return Ok(());
    }
    let problem =
        format!("rows {rows:?} of {view:?} as {found:?} do not follow row {next} as {shape:?}");
    Err(Error::file(path, problem, None))
}
