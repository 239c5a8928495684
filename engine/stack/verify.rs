//! Whether what a run directory holds is still what was committed.

use super::progress_log::{self, Entry};
use super::run_directory::COUNTS;
use super::{Extent, Format, View, exr_frames, npy};
use crate::Result;
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::path::Path;

/// The frames of a run, compared with progress.log.
#[derive(Debug, Default)]
pub(super) struct Verified {
    /// Views whose frames, and counts where there are some, have the checksums of the log.
    pub(super) whole: Vec<View>,
    /// What is wrong with the others, and with headers: one message each.
    pub(super) problems: Vec<(Option<View>, String)>,
}

/// Compares the frames under `path` with the `entries` of its log. `counts`: views have detector
/// numbers beside their intensities.
pub(super) fn frames(
    path: &Path,
    format: Format,
    extent: Extent,
    counts: bool,
    entries: &BTreeMap<View, Entry>,
) -> Verified {
    let mut found = Verified::default();
    if format == Format::Npy && !entries.is_empty() {
        let mut problems = npy::header_problems(path, extent, counts);
        if counts {
            problems.extend(npy::header_problems(&path.join(COUNTS), extent, false));
        }
        found.problems = problems.into_iter().map(|problem| (None, problem)).collect();
    }
    let of_view = |(view, entry): (&View, &Entry)| {
        let counts = counts && *view != View::Dark;
        (*view, problem_of_view(path, format, extent, counts, *view, entry))
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

/// Views among `views` whose kept moments are missing or damaged, with what is wrong.
pub(super) fn moments(path: &Path, views: &[View]) -> Vec<(View, String)> {
    let of_view = |view: &View| match view {
        View::Sample(index) => {
            let error = crate::kept::file::check(path, *index).err()?;
            Some((*view, format!("{error} ({})", progress_log::name(*view))))
        }
        View::Flat | View::Dark => None,
    };
    views.par_iter().filter_map(of_view).collect()
}

/// What is wrong with a view, where anything is.
fn problem_of_view(
    path: &Path,
    format: Format,
    extent: Extent,
    counts: bool,
    view: View,
    entry: &Entry,
) -> Option<String> {
    let name = progress_log::name(view);
    if !extent.has(view) {
        return Some(format!("{}: {name} is no view of this run", path.display()));
    }
    let checksum = |root: &Path| match format {
        Format::Exr => exr_frames::checksum(root, extent, view),
        Format::Npy => npy::checksum(root, extent, view),
    };
    let is_whole = || -> Result<bool> {
        let numbers = if counts { Some(checksum(&path.join(COUNTS))?) } else { None };
        Ok(entry.bytes == extent.view_bytes()
            && numbers == entry.counts
            && checksum(path)? == entry.sha256)
    };
    match is_whole() {
        Ok(true) => None,
        Ok(false) => Some(format!("{}: {name} is not what was committed", path.display())),
        Err(error) => Some(format!("{error} ({name})")),
    }
}
