//! Checks, before work begins, that its memory is available.

use super::MemoryEstimate;
use super::needs::FRAME_COPIES;
use super::program::building;
use beamlet_core::{Error, Result, reserve};
use beamlet_files::StackShape;
use beamlet_geometry as geometry;
use beamlet_model::scene::Scene;

/// Refuses meshes that cannot fit in the limit before they are read.
///
/// # Errors
/// [`Error::Memory`] where they cannot.
pub fn check_before_loading(scene: &Scene, limit: Option<u64>) -> Result<()> {
    let triangles = geometry::triangles_in_files(scene);
    let needed = reserve::PROGRAM.saturating_add(building(triangles));
    match limit {
        Some(limit) if needed > limit => Err(Error::Memory {
            purpose: match triangles {
                0 => "the program with the driver".to_owned(),
                _ => format!("the program, the driver and a tree over {triangles} triangles"),
            },
            needed,
            available: Some(limit),
            remedy: match triangles {
                0 => "raise the memory limit".to_owned(),
                _ => "raise the memory limit, or simplify the meshes".to_owned(),
            },
        }),
        _ => Ok(()),
    }
}

/// Checks that the peak memory of a run is available now, without copies of frames, which not every format
/// makes.
///
/// # Errors
/// [`Error::Memory`] where it is not.
pub(crate) fn ask_for_run(scene: &Scene, estimate: &MemoryEstimate) -> Result<()> {
    let frames = FRAME_COPIES * StackShape::of(scene)?.frame_bytes();
    let bytes = estimate.peak_bytes.saturating_sub(reserve::PROGRAM).saturating_sub(frames);
    let rows = estimate.band_rows;
    let purpose = format!("a run in bands of {rows} rows");
    reserve::ask(
        bytes,
        &purpose,
        "set a lower memory limit, for smaller bands, or raise the system's limit",
    )
}
