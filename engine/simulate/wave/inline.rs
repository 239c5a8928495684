//! Beamlets of scenes without a sample mask: groups of pixels, wide against the light that leaves them.

use super::frequencies::{Distances, last_frequency};
use crate::sampling::Lattice;
use beamlet_core::numbers;
use beamlet_core::{Error, Result};
use beamlet_model::optics::Optics;
use beamlet_model::optics::waves::wavelength;
use beamlet_model::scene::Scene;
use beamlet_model::spectrum;
use std::f64::consts::TAU;

/// Least height of a row over the width of fringes, √(λz): light that crosses its borders along z is not in lines.
const ROW: f64 = 10.0;
/// Most pixels of a beamlet.
const MOST_PIXELS: f64 = 4096.0;

/// Pixels of a beamlet; 1 behind a sample mask. Fringes move light by half of the largest shear, and an edge throws
/// λz/(4π²x) of the light of a width x beyond x.
pub(super) fn pixels_of_beamlet(optics: &Optics, energies: &[f64], tolerance: f64) -> u32 {
    if optics.sample_mask.is_some() {
        return 1;
    }
    let width = |energy: &f64| {
        let area = wavelength(*energy) * Distances::of(optics).sample;
        (area * last_frequency(optics)).max(area.sqrt() / TAU / tolerance.sqrt())
    };
    let widest = energies.iter().map(width).fold(0.0, f64::max);
    numbers::whole((widest / optics.beamlets().period[0]).ceil().clamp(1.0, MOST_PIXELS))
}

/// The lattice of the beamlets of lines.
pub(super) fn lattice(
    lattice: &Lattice,
    optics: &Optics,
    energies: &[f64],
    tolerance: f64,
) -> Lattice {
    lattice.in_groups(pixels_of_beamlet(optics, energies, tolerance))
}

/// Width of fringes √(λz) behind the sample at the lowest of some energies, m.
pub(super) fn fringe(optics: &Optics, energies: &[f64]) -> f64 {
    let lowest = energies.iter().copied().fold(f64::INFINITY, f64::min);
    (wavelength(lowest) * Distances::of(optics).sample).sqrt()
}

/// Refuses scenes without a sample mask whose light does not add up from lines along x.
pub(super) fn refuse(scene: &Scene, optics: &Optics) -> Result<()> {
    let wave = |found: String, allowed: &str| {
        let found = format!("\"wave\" with {found} and no sample mask");
        Err(Error::scene("sampling.transport", found, allowed))
    };
    if optics.spot.narrowest(0) <= 0.0 {
        return wave("a focal spot without width along x".into(), "a focal spot with a width");
    }
    let fringe = fringe(optics, &spectrum::nodes(scene)?.energies);
    let height = scene.detector.pitch[1] * optics.cell_plane / scene.detector.distance;
    if height < ROW * fringe {
        let found = format!("pixels {:.1} um high at the sample", 1e6 * height);
        let allowed = format!(
            "pixels of {:.1} um or more there, ten times √(λz): light that diffraction sends over rows is not computed",
            1e6 * ROW * fringe
        );
        return wave(found, &allowed);
    }
    Ok(())
}
