//! How many beamlets and rays a scene has, before it is traced.

use crate::lines::{PATCHES_AT_ONCE, PIECES_AT_ONCE};
use crate::sampling::Lattice;
use beamlet_core::{Error, Result, numbers};
use beamlet_geometry::ObjectSummary;
use beamlet_model::optics::Optics;

/// Most beamlets of a scene: 256 for every column of the largest detector.
const BEAMLETS: u64 = 1 << 24;

/// Beamlets whose light reaches the pixels that take it.
pub(super) fn beamlets(lattice: &Lattice) -> Result<u64> {
    let count = lattice.beamlets.end.abs_diff(lattice.beamlets.start);
    if count <= BEAMLETS {
        return Ok(count);
    }
    Err(Error::scene(
        "sample_mask",
        format!("light of {count} apertures on the detector"),
        format!(
            "up to {BEAMLETS} apertures: a larger period, a mask farther from the source, smaller \
             mask offsets or a smaller focal spot"
        ),
    ))
}

/// Rays of the patches touched by objects in any view that are sampled together, about, and those of one row.
pub(super) fn cell_rays(optics: &Optics, lattice: &Lattice, objects: &[ObjectSummary]) -> [u64; 2] {
    let beamlets = lattice.beamlets.end.abs_diff(lattice.beamlets.start) as f64;
    let rows = f64::from(optics.detector.pixels[1]);
    let source = optics.rotation;
    let touched = objects.iter().map(|object| {
        let [low, high] = object.bounds.map(glam::DVec3::from);
        let widest = low.abs().max(high.abs());
        let reach = widest.truncate().length();
        // Nearest to the source it looks largest.
        let near = (source - reach).max(0.1 * source);
        let width = 2.0 * reach * lattice.plane / near / lattice.period + 2.0;
        let pitch = optics.detector.pitch_at(1, near);
        let height = (high.z - low.z) / pitch + 2.0;
        (width.min(beamlets), height.min(rows))
    });
    // A line of a beamlet has about two pieces per cell; a row takes about two lines.
    let of_beamlet = f64::from(4 * lattice.cells + 2);
    let (mut all, mut widths) = (0.0, 0.0);
    for (width, height) in touched {
        all += width * height;
        widths += width;
    }
    let most = all.min(beamlets * rows).min(PATCHES_AT_ONCE as f64);
    [most, widths.min(beamlets)]
        .map(|it| numbers::whole::<u64>(it * of_beamlet).min(PIECES_AT_ONCE))
}
