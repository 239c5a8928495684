//! Whether the contents of a run directory are still the committed ones.

use super::frames::StoredFrames;
use super::layout::{self, COUNTS, LOG, RUN, SCENE};
use super::part::Part;
use super::progress_log::{self, Entry};
use super::read::read_scene;
use super::run_file::{RunFile, RunState};
use super::shape::views;
use super::values::Values;
use beamlet_core::Result;
use beamlet_core::array_file::Format;
use beamlet_model::scene::{Exposure, Scene};
use rayon::prelude::*;
use serde::Serialize;
use std::collections::BTreeMap;
use std::path::Path;

/// Findings of [`check_run`].
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct RunCheck {
    /// Format of the frames.
    pub format: Format,
    /// Views of the run: the angles, the flats, and the darks where there are counts.
    pub views: usize,
    /// Views whose frames, and counts if any, are the committed ones.
    pub whole: usize,
    /// Why the run is not whole, one message each; none where it is.
    pub problems: Vec<String>,
    /// Files that the scene refers to and that have changed since. The run is whole without them.
    pub changed_files: Vec<String>,
}

/// Reads all of a run and compares it with its checksums.
///
/// # Errors
/// [`beamlet_core::Error::File`] where there is no run, or its record or log cannot be read;
/// [`beamlet_core::Error::Scene`] where its scene cannot.
///
/// # Example
///
/// ```no_run
/// let checked = beamlet::stack::check_run("run".as_ref())?;
/// println!("{} of {} views are whole", checked.whole, checked.views);
/// # Ok::<(), beamlet::Error>(())
/// ```
pub fn check_run(path: &Path) -> Result<RunCheck> {
    let file = RunFile::read(&path.join(RUN))?;
    file.refuse_part(path)?;
    let scene = read_scene(&path.join(SCENE))?;
    let entries = progress_log::read(&path.join(LOG))?;
    let part = Part::of(&scene, None)?;
    let extent = part.extent;
    let place = path.display();
    let mut problems = Vec::new();
    if extent != file.extent {
        let found = file.extent;
        problems.push(format!("{place}: {RUN} has {found:?}; its scene has {extent:?}"));
    }
    let found = frames(path, file.format, part, &scene, &entries);
    problems.extend(found.problems.into_iter().map(|(_, problem)| problem));
    let all: Vec<Exposure> = views(&scene)?.collect();
    let missing: Vec<&Exposure> = all.iter().filter(|view| !entries.contains_key(view)).collect();
    if let Some(first) = missing.first() {
        let (count, first) = (missing.len(), layout::view(**first, false));
        let of = all.len();
        problems.push(format!("{place}: {count} of {of} views are not committed, first {first}"));
    } else if file.state != RunState::Done {
        problems.push(format!("{place}: every view is committed, but the run has not ended"));
    }
    let changed = scene.changed_files();
    Ok(RunCheck {
        format: file.format,
        views: all.len(),
        whole: found.whole.len(),
        problems,
        changed_files: changed.into_iter().map(|error| error.to_string()).collect(),
    })
}

/// The frames of a run, compared with progress.log.
#[derive(Debug, Default)]
pub(super) struct Verified {
    /// Views whose frames, and counts where there are some, have the checksums of the log.
    pub whole: Vec<Exposure>,
    /// Defects of the others, and of headers: one message each.
    pub problems: Vec<(Option<Exposure>, String)>,
}

/// Compares the frames under `path`, of a run of `scene`, with the `entries` of its log.
pub(super) fn frames(
    path: &Path,
    format: Format,
    part: Part,
    scene: &Scene,
    entries: &BTreeMap<Exposure, Entry>,
) -> Verified {
    let mut found = Verified::default();
    // Views have detector numbers beside their intensities.
    let counts = scene.detector.counts.is_some();
    let stored = StoredFrames::of(format, part, scene);
    if !entries.is_empty() {
        let mut problems = stored.header_problems(path, Values::Intensities, counts);
        if counts {
            let of_counts = stored.header_problems(&path.join(COUNTS), Values::Numbers, false);
            problems.extend(of_counts);
        }
        found.problems = problems.into_iter().map(|problem| (None, problem)).collect();
    }
    let of_view = |(view, entry): (&Exposure, &Entry)| {
        let counts = counts && !view.is_dark();
        (*view, problem_of_view(path, &stored, part, counts, *view, entry))
    };
    let views: Vec<_> = entries.par_iter().map(of_view).collect();
    for (view, problem) in views {
        match problem {
            None => found.whole.push(view),
            Some(problem) => found.problems.push((Some(view), problem)),
        }
    }
    found
}

/// The defect of a view, if any.
fn problem_of_view(
    path: &Path,
    stored: &StoredFrames,
    part: Part,
    counts: bool,
    view: Exposure,
    entry: &Entry,
) -> Option<String> {
    let name = layout::view(view, false);
    if !part.extent.has(view) || !part.has(view) {
        return Some(format!("{}: {name} is not a view of this run", path.display()));
    }
    let checksum = |root: &Path, values| stored.checksum(root, values, view);
    let is_whole = || -> Result<bool> {
        let numbers =
            if counts { Some(checksum(&path.join(COUNTS), Values::Numbers)?) } else { None };
        Ok(entry.bytes == part.extent.view_bytes()
            && numbers == entry.counts
            && checksum(path, Values::Intensities)? == entry.sha256)
    };
    match is_whole() {
        Ok(true) => None,
        Ok(false) => Some(format!(
            "{}: {name} differs from its committed state: resume the run to simulate it again",
            path.display()
        )),
        Err(error) => Some(format!("{error} ({name})")),
    }
}
