//! Peak memory of a run, and the bands that keep it within a limit.
//!
//! One estimate serves `check`, which reports it, and the run, which chooses its bands by it.
//! Bytes per triangle and the like are measured (docs/performance.md, "Memory").

mod ask;
mod needs;
mod program;
mod rays;

pub(crate) use ask::ask_for_run;
pub use ask::check_before_loading;
use beamlet_core::{Result, numbers};
pub use beamlet_geometry::{ObjectSummary, PEAK_PER_CUT_TRIANGLE, PEAK_PER_TRIANGLE};
use beamlet_model::scene::Scene;
use needs::Needs;
use serde::Serialize;

/// Memory of a run at its peak, in bytes. On a CPU device host and device are one process.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[non_exhaustive]
pub struct MemoryEstimate {
    /// Rows of a band.
    pub band_rows: u32,
    /// Rays traced together, about.
    pub rays_at_once: u64,
    /// Rays that the buffers of a tracer hold.
    #[serde(skip)]
    pub(crate) batch_rays: u32,
    /// For one row of pixels with all its steps, host and device together.
    pub row_bytes: u64,
    /// For a band, host and device together.
    pub band_bytes: u64,
    /// On the host, at its peak; the program itself included.
    pub host_bytes: u64,
    /// On the device, at its peak.
    pub device_bytes: u64,
    /// Host and device together, at their peak.
    pub peak_bytes: u64,
    /// Remainder of a limit for lines, host and device together.
    #[serde(skip)]
    pub(crate) left_for_lines: Option<u64>,
}

/// Chooses the bands of a run and estimates its peak memory, with trees for both backends. `objects`: of
/// the loaded sample. A `limit` bounds the peak, host and device together; without one a band takes up to
/// 1 GiB. `band_rows` sets the rows of a band.
///
/// # Errors
/// [`beamlet_core::Error::Memory`] where the limit is too small for one row; [`beamlet_core::Error::Scene`] for an extent
/// beyond 32 bits.
pub fn estimate(
    scene: &Scene,
    objects: &[ObjectSummary],
    limit: Option<u64>,
    band_rows: Option<u32>,
) -> Result<MemoryEstimate> {
    estimate_together(scene, objects, limit, band_rows, 1)
}

/// As [`estimate`], of a number of scenes like this one that are lit together.
///
/// # Errors
/// As [`estimate`].
pub(crate) fn estimate_together(
    scene: &Scene,
    objects: &[ObjectSummary],
    limit: Option<u64>,
    band_rows: Option<u32>,
    scenes: u64,
) -> Result<MemoryEstimate> {
    Needs::of(scene, objects)?.of_scenes(scenes).within(scene, limit, band_rows)
}

/// As [`estimate`]; `cells_at_once`: cells of lines that are in memory together.
///
/// # Errors
/// As [`estimate`].
pub fn estimate_sampled(
    scene: &Scene,
    objects: &[ObjectSummary],
    limit: Option<u64>,
    cells_at_once: f64,
) -> Result<MemoryEstimate> {
    let mut needs = Needs::of(scene, objects)?;
    let first = needs.within(scene, limit, None)?;
    if needs.cells {
        needs.crowded = numbers::whole::<u64>(cells_at_once);
    }
    // A run does not know this number: it takes the bands of the estimate without it. Nor does a
    // limit bound the memory, for a single patch may hold most of it.
    Ok(needs.at(first.band_rows, first.rays_at_once))
}
