//! The frames of a run in any of its formats.

use super::array_frames::{self, ArrayFrames, ArrayLayout};
use super::frame_files::{self, FrameFiles};
use super::part::Part;
use super::values::Values;
use beamlet_core::Result;
use beamlet_core::array_file::Format;
use beamlet_model::scene::{Exposure, Scene};
use ndarray::ArrayView3;
use std::ops::Range;
use std::path::Path;

#[derive(Debug)]
pub(super) enum Frames {
    Files(FrameFiles),
    Arrays(Box<ArrayFrames>),
}

impl Frames {
    /// The stacks under `root` of a run of `scene`, with dark frames or without.
    pub(super) fn begin(
        format: Format,
        root: &Path,
        part: Part,
        scene: &Scene,
        values: Values,
        dark: bool,
    ) -> Result<Self> {
        Ok(match ArrayLayout::of(format, part, scene) {
            None => Self::Files(FrameFiles::begin(root, format, part, scene, values, dark)),
            Some(layout) => Self::Arrays(Box::new(ArrayFrames::begin(root, layout, values, dark)?)),
        })
    }

    pub(super) fn write(
        &mut self,
        view: Exposure,
        rows: &Range<u32>,
        data: ArrayView3<'_, f32>,
    ) -> Result<()> {
        match self {
            Self::Files(frames) => frames.write(view, rows, data),
            Self::Arrays(frames) => frames.write(view, rows, data),
        }
    }

    pub(super) fn commit(&mut self, view: Exposure) -> Result<String> {
        match self {
            Self::Files(frames) => frames.commit(view),
            Self::Arrays(frames) => frames.commit(view),
        }
    }

    /// Takes the frames of a view from the folder `from`, which holds the part `of` of the run: its
    /// checksum as it is here.
    pub(super) fn adopt(&mut self, view: Exposure, from: &Path, of: Part) -> Result<String> {
        match self {
            Self::Files(frames) => frames.adopt(view, from),
            Self::Arrays(frames) => frames.adopt(view, from, of),
        }
    }

    /// Refuses stacks of a run, all of whose views are committed, that are not all there.
    pub(super) fn refuse_missing(&self) -> Result<()> {
        match self {
            Self::Files(frames) => frames.refuse_missing(),
            Self::Arrays(frames) => frames.refuse_moved(),
        }
    }
}

/// The frames of a run on disk, to be compared with their checksums.
#[derive(Debug, Clone, Copy)]
pub(super) struct StoredFrames {
    format: Format,
    part: Part,
    /// `None` where the format has a file for every frame.
    layout: Option<ArrayLayout>,
}

impl StoredFrames {
    pub(super) fn of(format: Format, part: Part, scene: &Scene) -> Self {
        Self { format, part, layout: ArrayLayout::of(format, part, scene) }
    }

    /// SHA-256 of a view under `root`.
    pub(super) fn checksum(&self, root: &Path, values: Values, view: Exposure) -> Result<String> {
        match self.layout {
            None => frame_files::checksum(root, self.format, self.part.extent, view),
            Some(layout) => array_frames::checksum(root, layout, values, view),
        }
    }

    /// Files under `root` without the header and the length that they were made with, one message
    /// each.
    pub(super) fn header_problems(&self, root: &Path, values: Values, dark: bool) -> Vec<String> {
        let of = |layout| array_frames::header_problems(root, layout, values, dark);
        self.layout.map(of).unwrap_or_default()
    }
}
