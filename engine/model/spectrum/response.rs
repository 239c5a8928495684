//! Signal of a photon by its energy.

use crate::material;
use crate::scene::{DetectorMode, Scene};
use beamlet_core::Result;

/// Mean signal that a photon of this energy (keV) adds, per photon that arrives; not normalised.
/// The absorber takes 1 - exp(-mu t) of the photons; each counts once within the thresholds, or
/// with its energy in keV. 1 where the scene says nothing of it.
///
/// # Errors
/// As [`material::constants_at`], at `detector.absorber.material`.
pub fn response(scene: &Scene, energy_kev: f64) -> Result<f64> {
    Ok(responses(scene, &[energy_kev])?[0])
}

/// As [`response`], at many energies.
///
/// # Errors
/// As [`response`].
pub(super) fn responses(scene: &Scene, energies: &[f64]) -> Result<Vec<f64>> {
    let mut responses = detected_shares(scene, energies)?;
    if scene.detector.mode == DetectorMode::Integrating {
        responses.iter_mut().zip(energies).for_each(|(response, energy)| *response *= energy);
    }
    Ok(responses)
}

/// Share of the arriving photons of each energy (keV) that add to the signal.
///
/// # Errors
/// As [`response`].
pub(super) fn detected_shares(scene: &Scene, energies: &[f64]) -> Result<Vec<f64>> {
    let detector = &scene.detector;
    let mut shares = match &detector.absorber {
        Some(absorber) => {
            let (name, key) = (&absorber.material, "detector.absorber.material");
            let all = material::constants_over_for(scene, name, energies, key)?;
            all.iter().map(|of| -libm::expm1(-of.mu * absorber.thickness)).collect()
        }
        None => vec![1.0; energies.len()],
    };
    if let DetectorMode::Counting { low, high } = detector.mode {
        for (share, energy) in shares.iter_mut().zip(energies) {
            let counts =
                low.is_none_or(|low| *energy >= low) && high.is_none_or(|high| *energy <= high);
            *share *= f64::from(u8::from(counts));
        }
    }
    Ok(shares)
}
