//! Photons of a scene on an absolute scale: by the output of the built-in tube, or from the photons that an open pixel
//! detects.

use super::Spectrum;
use super::response::detected_shares;
use super::tube;
use crate::scene::{Beam, Counts, Photons, Scene, SpectrumOrigin};
use beamlet_core::{Error, Result};

/// Photons that an open pixel detects in a frame, on average.
///
/// # Errors
/// Errors of the beam and of the materials in it; [`Error::Scene`] for an exposure without the built-in tube.
pub fn photons(scene: &Scene, counts: &Counts) -> Result<f64> {
    match counts.photons {
        Photons::Number(photons) => Ok(photons),
        Photons::Exposure(_) => Ok(emission(scene, counts)?.photons),
    }
}

/// Photons of a frame.
#[derive(Debug, Clone)]
pub struct Emission {
    /// Photons by energy behind the filters of the source, per steradian along the optical axis.
    pub per_solid_angle: Spectrum,
    /// Photons that an open pixel detects.
    pub photons: f64,
}

/// Photons of a frame at the source and at the detector.
///
/// # Errors
/// As [`photons`].
pub fn emission(scene: &Scene, counts: &Counts) -> Result<Emission> {
    let mut spectrum = behind_filters(scene)?;
    let detected = detected_per_weight(scene, &spectrum)?;
    let (scale, photons) = match counts.photons {
        Photons::Exposure(seconds) => {
            let scale = photons_of_weight(scene, seconds)?;
            (scale, scale * detected)
        }
        Photons::Number(photons) => (photons / detected, photons),
    };
    spectrum.weights.iter_mut().for_each(|weight| *weight *= scale);
    Ok(Emission { per_solid_angle: spectrum, photons })
}

/// The spectrum of the source behind its filters, on its own scale; one row of weight 1 for one energy.
fn behind_filters(scene: &Scene) -> Result<Spectrum> {
    let spec = match &scene.source.beam {
        Beam::Energy(energy) => {
            return Ok(Spectrum { energies_kev: vec![*energy], weights: vec![1.0] });
        }
        Beam::Spectrum(spec) => spec,
    };
    let before = Spectrum::before_filters(scene, spec)?;
    Ok(before.filtered(scene, &spec.filters, "filters")?.significant())
}

/// Photons per steradian in an exposure, s, of a row of weight 1 of the built-in tube.
fn photons_of_weight(scene: &Scene, seconds: f64) -> Result<f64> {
    let anode = match &scene.source.beam {
        Beam::Spectrum(spec) => match &spec.origin {
            SpectrumOrigin::Tube { anode, .. } => Some(*anode),
            SpectrumOrigin::File { .. } => None,
        },
        Beam::Energy(_) => None,
    };
    match (anode, scene.source.current) {
        (Some(anode), Some(current)) => Ok(tube::output(anode) * current * seconds),
        _ => Err(Error::scene(
            "detector.exposure",
            "an exposure without the built-in tube and its source.current",
            "detector.photons, or a tube with source.current",
        )),
    }
}

/// Photons that an open pixel detects, of a spectrum with weights per steradian.
fn detected_per_weight(scene: &Scene, spectrum: &Spectrum) -> Result<f64> {
    let detector = &scene.detector;
    let [x, z] = detector.pitch.map(|pitch| pitch / detector.distance);
    let arriving = spectrum.clone().through_path(scene, detector.distance)?;
    let shares = detected_shares(scene, &arriving.energies_kev)?;
    let detected = arriving.weights.iter().zip(shares).map(|(weight, share)| weight * share);
    let detected = detected.sum::<f64>();
    if detected > 0.0 {
        return Ok(detected * x * z);
    }
    let allowed = "thresholds around the energies of the beam, and an absorber that absorbs";
    Err(Error::scene("detector", "no signal from photons of the beam", allowed))
}
