//! Stacks of frames and the sinks that take them.
//!
//! A stack is `[step][row][column]` per view, f32 intensities, row 0 on top. Where the scene asks
//! for noise there is a second stack of detector numbers beside each, and a stack of dark frames.
//! The engine knows only [`Sink`]; where the frames end up (a run directory, arrays, a callback)
//! is decided here.

mod apart;
mod array;
mod array_frames;
mod callback;
mod exr_frames;
mod npy;
mod own_files;
mod progress_log;
mod read;
mod record;
mod run_directory;
mod run_file;
mod scene_file;
mod tiff_header;
mod verify;

pub use apart::{is_of_run, is_same_place, refuse_overlap};
pub use array::ArraySink;
pub use callback::CallbackSink;
pub(crate) use npy::{le_bytes, npy_header};
pub use read::{Maps, OpenRun, StackFile};
pub use record::{RunRecord, SamplingSummary, SearchCounts};
pub use run_directory::{Format, RunDirectory};
pub(crate) use run_directory::{LOG, SCENE};
pub(crate) use run_file::now;
pub use run_file::{FORMAT_VERSION, RunFile, RunState};
pub use verify::{RunCheck, check_run};

use crate::accel::Backend;
use crate::scene::{Exposure, Scene, limits};
use crate::{Error, Result};
use ndarray::{Array3, Array4, ArrayView3};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::ops::Range;

/// Every view of a run of `scene`: the flat, the dark frames where there are counts, then the
/// angles in order.
///
/// # Errors
/// As [`StackShape::of`].
pub fn views(scene: &Scene) -> Result<impl Iterator<Item = Exposure> + use<>> {
    let extent = StackShape::of(scene)?;
    let dark = scene.detector.counts.map(|_| Exposure::Dark);
    Ok([Some(Exposure::Flat), dark]
        .into_iter()
        .flatten()
        .chain((0..extent.views).map(Exposure::Sample)))
}

/// What is known when a run begins: the part of its record that does not depend on its outcome.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct RunStart {
    /// Device name.
    pub device: String,
    /// Driver name and version.
    pub driver: String,
    /// Backend used.
    pub backend: Backend,
    /// Why that backend.
    pub backend_reason: String,
    /// What the backend was chosen by; `None` where there was nothing to choose.
    pub search: Option<SearchCounts>,
    /// SHA-256 of the meshes by the name of their object, as
    /// [`crate::geometry::ObjectSummary::hash`]; shapes have none.
    pub mesh_hashes: BTreeMap<String, String>,
}

impl RunStart {
    /// A run on a device and backend, for reasons in words; nothing was counted, and no mesh read.
    pub fn new(
        device: impl Into<String>,
        driver: impl Into<String>,
        backend: Backend,
        backend_reason: impl Into<String>,
    ) -> Self {
        Self {
            device: device.into(),
            driver: driver.into(),
            backend,
            backend_reason: backend_reason.into(),
            search: None,
            mesh_hashes: BTreeMap::new(),
        }
    }
}

/// Takes stacks band by band. Calls come in this order: `begin`, then for each view `write`
/// for each band of rows (top to bottom) and one `commit`, then `finish`. Where the scene asks for
/// noise, `write_counts` follows each `write`; of [`Exposure::Dark`] there are counts alone.
pub trait Sink {
    /// A run begins. Nothing may have been written before this returns.
    ///
    /// # Errors
    /// Where the place cannot take the stacks.
    fn begin(&mut self, scene: &Scene, start: &RunStart) -> Result<()>;

    /// One band of rows of a view with all its steps; intensities, `[step][row][column]`.
    ///
    /// # Errors
    /// Where the data cannot be kept.
    fn write(&mut self, view: Exposure, rows: Range<u32>, data: ArrayView3<'_, f32>) -> Result<()>;

    /// The same band as detector numbers: with noise, gain, offset and bit depth.
    ///
    /// # Errors
    /// Where the data cannot be kept.
    fn write_counts(
        &mut self,
        view: Exposure,
        rows: Range<u32>,
        numbers: ArrayView3<'_, f32>,
    ) -> Result<()>;

    /// What was counted while the view was made; comes before its `commit`.
    ///
    /// # Errors
    /// Where the counts cannot be kept.
    fn tally(&mut self, _view: Exposure, _tally: &crate::Tally) -> Result<()> {
        Ok(())
    }

    /// Every row of the view has been written, its counts too: keep it whole.
    ///
    /// # Errors
    /// Where the data cannot be kept.
    fn commit(&mut self, view: Exposure) -> Result<()>;

    /// The run is over; every view is committed.
    ///
    /// # Errors
    /// Where the record of the run cannot be kept.
    fn finish(&mut self, record: &RunRecord) -> Result<()>;
}

/// Stacks in memory, with the record of their run.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct Stacks {
    /// Without the sample, `[step][row][column]`.
    pub flat: Array3<f32>,
    /// With the sample, `[view][step][row][column]`.
    pub sample: Array4<f32>,
    /// Detector numbers, where the scene asks for noise.
    pub counts: Option<CountStacks>,
    /// Provenance and counts.
    pub record: RunRecord,
}

/// Detector numbers in memory.
#[derive(Debug, Clone, Default)]
#[non_exhaustive]
pub struct CountStacks {
    /// Without the sample, `[step][row][column]`.
    pub flat: Array3<f32>,
    /// With the sample, `[view][step][row][column]`.
    pub sample: Array4<f32>,
    /// Without light, `[step][row][column]`.
    pub dark: Array3<f32>,
}

/// Shape of the stacks of a scene.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct StackShape {
    /// Views with the sample (the flat is one more).
    pub views: u32,
    /// Mask steps.
    pub steps: u32,
    /// Detector rows.
    pub rows: u32,
    /// Detector columns.
    pub columns: u32,
}

impl StackShape {
    /// Shape of the stacks of `scene`.
    ///
    /// # Errors
    /// [`Error::Scene`] where a list of the scan is longer than 2^32, or the stacks would have
    /// more bytes than 64 bits can count.
    pub fn of(scene: &Scene) -> Result<Self> {
        let count = |key: &str, n: usize| {
            u32::try_from(n)
                .map_err(|_| Error::scene(key, format!("{n} entries"), "fewer than 2^32"))
        };
        let extent = Self {
            views: count("scan.angles", scene.scan.angles.len())?,
            steps: count("scan.mask_offsets", scene.scan.mask_offsets.len())?,
            rows: scene.detector.pixels[1],
            columns: scene.detector.pixels[0],
        };
        let Self { views, steps, rows, columns } = extent;
        let bytes = [views, steps, rows, columns].iter().map(|n| f64::from(*n)).product::<f64>();
        // Frames have four bytes a pixel, and there is the flat.
        if bytes > 2.0_f64.powi(60) {
            return Err(Error::scene(
                "scan",
                format!("{views} views of {steps} steps of {columns} x {rows} pixels"),
                "stacks of no more than 2^62 bytes",
            ));
        }
        Ok(extent)
    }

    /// Whether a scene may have this extent; what is allowed, where not.
    pub(super) fn check(self) -> std::result::Result<(), String> {
        let sides = [
            ("views", self.views, limits::ANGLES),
            ("steps", self.steps, limits::MASK_OFFSETS),
            ("rows", self.rows, limits::PIXELS),
            ("columns", self.columns, limits::PIXELS),
        ];
        match sides.into_iter().find(|(_, found, most)| !(1..=*most).contains(found)) {
            Some((side, found, most)) => Err(format!("{found} {side}; allowed: 1 to {most}")),
            None => Ok(()),
        }
    }

    /// Bytes of one frame.
    #[must_use]
    pub fn frame_bytes(&self) -> u64 {
        4 * u64::from(self.rows) * u64::from(self.columns)
    }

    /// Bytes of one view with all its steps.
    #[must_use]
    pub fn view_bytes(&self) -> u64 {
        self.frame_bytes() * u64::from(self.steps)
    }

    /// Bytes of all views, the flat included.
    #[must_use]
    pub fn total_bytes(&self) -> u64 {
        self.view_bytes() * (u64::from(self.views) + 1)
    }

    /// Bytes of all stacks of a run of `scene`: twice the intensities and the dark frames where
    /// there are counts.
    #[must_use]
    pub fn output_bytes(&self, scene: &Scene) -> u64 {
        match scene.detector.counts {
            Some(_) => 2 * self.total_bytes() + self.view_bytes(),
            None => self.total_bytes(),
        }
    }

    /// Whether a view lies within.
    fn has(&self, view: Exposure) -> bool {
        !matches!(view, Exposure::Sample(index) if index >= self.views)
    }

    /// Every view with light: the flat, then the angles in order.
    pub fn all_views(&self) -> impl Iterator<Item = Exposure> + use<> {
        std::iter::once(Exposure::Flat).chain((0..self.views).map(Exposure::Sample))
    }
}
