//! Expected uncertainties of a set-up that is retrieved in two directions.

use super::illumination::{BLURRED_PART, bare};
use crate::Engine;
use beamlet_core::numbers::whole;
use beamlet_core::{Error, Result};
use beamlet_model::optics::Optics;
use beamlet_model::scene::{Scan, Scene};
use beamlet_recon::retrieve::{Method, RetrieveOptions, Weights, sigmas_in_two_directions};
use beamlet_simulate::run::quality;
use serde::Serialize;

/// Periods of a lattice of beamlets in the examined part of a detector: the lattice is found in it.
const PERIODS: f64 = 12.0;
/// Columns and rows of the examined part where each pixel has a curve.
const CURVES: u32 = 8;

/// One standard deviation of the images in two directions without a sample, median of pixels or beamlets, from the
/// Fisher information of a fit with the weights of counts.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[non_exhaustive]
pub struct PlanarUncertainty {
    /// Method of the fit: the default of `retrieve`.
    pub method: &'static str,
    /// Deviation of the transmission.
    pub transmission: f64,
    /// Deviations of the refraction angles along x and z, rad.
    pub refraction: [f64; 2],
    /// Deviations of the dark field σ² xx, zz and xz, rad²; `None` where the values do not determine it.
    pub dark_field: Option<[f64; 3]>,
}

/// The uncertainties of a scene with photons; `None` where slits have curves over x alone, and where no method
/// retrieves the scene in two directions.
///
/// # Errors
/// As [`Engine::simulate`].
pub(super) fn uncertainty(engine: &Engine, scene: &Scene) -> Result<Option<PlanarUncertainty>> {
    let Some(counts) = scene.detector.counts.as_ref().filter(|_| scene.has_heights()) else {
        return Ok(None);
    };
    let variance = quality::open_variance(scene, counts)?;
    let mut scan = Scan::new(scene.scan.mask_offsets.clone(), vec![0.0]);
    scan.mask_offsets_z.clone_from(&scene.scan.mask_offsets_z);
    let (part, scattered) = bare(scene, scan, part(scene));
    let flat = engine.simulate(&part)?.flat;
    let flat = flat.mapv(|light| light * (1.0 + beamlet_core::numbers::single(scattered)));
    let options = RetrieveOptions::default()
        .with_gain(variance.per_light)
        .with_read_noise(variance.read_noise)
        .with_weights(Weights::Poisson)
        .resolved(&part)?;
    match sigmas_in_two_directions(&part, &options, flat.view()) {
        Ok(found) => Ok(found.and_then(|sigmas| of(options.method(), sigmas))),
        // Offsets or masks that no method takes, and lattices that the part does not show.
        Err(Error::Scene { .. } | Error::Argument { .. }) => Ok(None),
        Err(error) => Err(error),
    }
}

fn of(method: Method, [t, x, z, xx, zz, xz]: [Option<f64>; 6]) -> Option<PlanarUncertainty> {
    let dark_field = match (xx, zz, xz) {
        (Some(xx), Some(zz), Some(xz)) => Some([xx, zz, xz]),
        _ => None,
    };
    let refraction = [x?, z?];
    Some(PlanarUncertainty { method: method.name(), transmission: t?, refraction, dark_field })
}

/// Columns and rows that the curves or the beamlets of a scene need.
fn part(scene: &Scene) -> [u32; 2] {
    let optics = Optics::of(scene);
    let blurred = scene.detector.blur.is_some();
    let curves = if blurred { BLURRED_PART } else { [CURVES; 2] };
    let alone = optics.sample_mask.as_ref().filter(|_| optics.detector_mask.is_none());
    let Some(mask) = alone.filter(|_| scene.scan.mask_offsets.len() == 1) else { return curves };
    let period = mask.openings(optics.detector.distance).period;
    [0, 1].map(|axis| {
        let pixels = (PERIODS * period[axis] / scene.detector.pitch[axis]).ceil();
        whole::<u32>(pixels).max(if blurred { BLURRED_PART[axis] } else { 0 })
    })
}
