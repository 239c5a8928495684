//! Frames in one file per stack, of a format with ranges: preallocated, views written at their places.
//!
//! Until a run is done the views that are not committed read as zero or as a part; the log lists those
//! that count.

use super::layout;
use super::part::Part;
use super::shape::StackShape;
use super::values::{Values, hex};
use beamlet_core::array_file::{Format, RangeFile, RangeLayout, Sample};
use beamlet_core::{Error, Result};
use beamlet_model::scene::{Exposure, Scene};
use ndarray::ArrayView3;
use sha2::{Digest, Sha256};
use std::ops::Range;
use std::path::{Path, PathBuf};

/// Arrangement of the stacks of a run in their files.
#[derive(Debug, Clone, Copy)]
pub(super) struct ArrayLayout {
    part: Part,
    format: Format,
    /// Pitch of a pixel, x and z, m.
    pitch: [f64; 2],
    /// Samples of detector numbers.
    numbers: Sample,
}

impl ArrayLayout {
    /// The layout of a run of `scene`; `None` where the format has a file for every frame.
    pub(super) fn of(format: Format, part: Part, scene: &Scene) -> Option<Self> {
        let abilities = format.abilities();
        let bits = scene.detector.counts.and_then(|counts| counts.bit_depth);
        let is_whole = bits.is_some_and(|bits| bits <= abilities.integers);
        let numbers = if is_whole { Sample::U16 } else { Sample::F32 };
        let pitch = scene.detector.pitch;
        abilities.ranges.then_some(Self { part, format, pitch, numbers })
    }

    /// The same run in the folder of another part of it.
    const fn of_part(self, part: Part) -> Self {
        Self { part, ..self }
    }

    /// The stack of a view: its file under `root`, and the places of its values. Dark frames are
    /// numbers, and lie beside the intensities.
    fn stack(&self, root: &Path, view: Exposure, values: Values) -> Result<(PathBuf, RangeLayout)> {
        let path = layout::array(root, &layout::stack(view), self.format);
        let StackShape { steps, rows, columns, .. } = self.part.extent;
        let views = self.part.range(view);
        let sides = [views.end - views.start, steps, rows, columns];
        let first = usize::from(!layout::has_folders(self.part.extent, view));
        let is_number = view.is_dark() || values == Values::Numbers;
        let sample = if is_number { self.numbers } else { Sample::F32 };
        let layout = RangeLayout::new(self.format, &sides[first..], self.pitch, sample);
        let missing = || Error::file(&path, format!("{} has no ranges", self.format), None);
        let layout = layout.ok_or_else(missing)?;
        Ok((path, layout))
    }

    /// Frames of a view in the file of its stack.
    fn frames(&self, view: Exposure) -> Range<u64> {
        let index = u64::from(view.index() - self.part.range(view).start);
        let steps = u64::from(self.part.extent.steps);
        index * steps..(index + 1) * steps
    }
}

/// The stacks under a folder of a run, in one file each.
#[derive(Debug)]
pub(super) struct ArrayFrames {
    root: PathBuf,
    layout: ArrayLayout,
    values: Values,
    /// In parts that have flats.
    flat: Option<RangeFile>,
    sample: RangeFile,
    dark: Option<RangeFile>,
}

impl ArrayFrames {
    /// Creates the files, or opens the files of a resumed run; with one for dark frames if there are any.
    pub(super) fn begin(
        root: &Path,
        layout: ArrayLayout,
        values: Values,
        dark: bool,
    ) -> Result<Self> {
        let open = |view| {
            let (path, layout) = layout.stack(root, view, values)?;
            layout.open(path)
        };
        let has = |view| !layout.part.range(view).is_empty();
        let [of_flats, of_sample, of_darks] = layout::STACKS;
        let flat = if has(of_flats) { Some(open(of_flats)?) } else { None };
        let sample = open(of_sample)?;
        let dark = if dark && has(of_darks) { Some(open(of_darks)?) } else { None };
        Ok(Self { root: root.to_path_buf(), layout, values, flat, sample, dark })
    }

    pub(super) fn write(
        &mut self,
        view: Exposure,
        rows: &Range<u32>,
        data: ArrayView3<'_, f32>,
    ) -> Result<()> {
        let frames = self.layout.frames(view);
        let file = self.file(view)?;
        let mut frames = frames.zip(data.outer_iter());
        frames.try_for_each(|(index, frame)| file.write(index, rows.start, frame))
    }

    /// Copies a view from the folder `from`, which holds another part of the run; its checksum.
    pub(super) fn adopt(&mut self, view: Exposure, from: &Path, of: Part) -> Result<String> {
        let there = self.layout.of_part(of);
        let (path, stack) = there.stack(from, view, self.values)?;
        if let Some(problem) = stack.problem(&path) {
            return Err(Error::file(path, problem, None));
        }
        let (to, frames) = (self.layout.frames(view), there.frames(view));
        self.file(view)?.copy(to.start, (&path, &stack), frames)?;
        self.commit(view)
    }

    /// Syncs the view; its checksum.
    pub(super) fn commit(&mut self, view: Exposure) -> Result<String> {
        let mut hasher = Sha256::new();
        let frames = self.layout.frames(view);
        self.file(view)?.sync(frames, &mut hasher)?;
        Ok(hex(&hasher.finalize()))
    }

    /// Refuses files that are not where they were opened.
    pub(super) fn refuse_moved(&self) -> Result<()> {
        let all = [self.flat.as_ref(), Some(&self.sample), self.dark.as_ref()];
        all.into_iter().flatten().try_for_each(RangeFile::refuse_moved)
    }

    /// The file of a view.
    fn file(&mut self, view: Exposure) -> Result<&mut RangeFile> {
        let file = match view {
            Exposure::Flat(_) => self.flat.as_mut(),
            Exposure::Sample(_) => Some(&mut self.sample),
            Exposure::Dark(_) => self.dark.as_mut(),
        };
        file.ok_or_else(|| Error::file(&self.root, format!("has no place for {view:?}"), None))
    }
}

/// Files under `root` that do not have the header and the length that they were made with, one
/// message each; with the file of dark frames where there is one.
pub(super) fn header_problems(
    root: &Path,
    layout: ArrayLayout,
    values: Values,
    dark: bool,
) -> Vec<String> {
    let stacks = layout::STACKS
        .into_iter()
        .filter(|stack| !layout.part.range(*stack).is_empty() && (dark || !stack.is_dark()));
    let problem = |view: Exposure| match layout.stack(root, view, values) {
        Ok((path, layout)) => {
            layout.problem(&path).map(|problem| format!("{}: {problem}", path.display()))
        }
        Err(error) => Some(error.to_string()),
    };
    stacks.filter_map(problem).collect()
}

/// SHA-256 of a view, as f32 values whatever the samples, as it is in the files under `root`.
pub(super) fn checksum(
    root: &Path,
    layout: ArrayLayout,
    values: Values,
    view: Exposure,
) -> Result<String> {
    let (path, stack) = layout.stack(root, view, values)?;
    let mut hasher = Sha256::new();
    stack.hash(&path, layout.frames(view), &mut hasher)?;
    Ok(hex(&hasher.finalize()))
}
