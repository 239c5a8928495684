//! The frames of a run in any of its formats.

use super::Format;
use crate::Result;
use crate::scene::Scene;
use crate::stack::array_frames::{ArrayFrames, ArrayLayout};
use crate::stack::exr_frames::{ExrFrames, Values};
use crate::stack::{Exposure, StackShape};
use ndarray::ArrayView3;
use std::ops::Range;
use std::path::Path;

#[derive(Debug)]
pub(super) enum Frames {
    Exr(ExrFrames),
    Arrays(ArrayFrames),
}

impl Frames {
    /// The stacks under `root` of a run of `scene`, with dark frames or without.
    pub(super) fn begin(
        format: Format,
        root: &Path,
        extent: StackShape,
        scene: &Scene,
        values: Values,
        dark: bool,
    ) -> Result<Self> {
        Ok(match ArrayLayout::of(format, extent, scene) {
            None => Self::Exr(ExrFrames::begin(root, extent, scene, values, dark)),
            Some(layout) => Self::Arrays(ArrayFrames::begin(root, layout, values, dark)?),
        })
    }

    pub(super) fn write(
        &mut self,
        view: Exposure,
        rows: &Range<u32>,
        data: ArrayView3<'_, f32>,
    ) -> Result<()> {
        match self {
            Self::Exr(frames) => frames.write(view, rows, data),
            Self::Arrays(frames) => frames.write(view, rows, data),
        }
    }

    pub(super) fn commit(&mut self, view: Exposure) -> Result<String> {
        match self {
            Self::Exr(frames) => frames.commit(view),
            Self::Arrays(frames) => frames.commit(view),
        }
    }

    /// Refuses stacks of a run, all of whose views are committed, that are not all there.
    pub(super) fn refuse_missing(&self) -> Result<()> {
        match self {
            Self::Exr(frames) => frames.refuse_missing(),
            Self::Arrays(frames) => frames.refuse_moved(),
        }
    }
}
