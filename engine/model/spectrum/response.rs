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
    let detector = &scene.detector;
    let absorbed = match &detector.absorber {
        Some(absorber) => {
            let (name, key) = (&absorber.material, "detector.absorber.material");
            let mu = material::constants_at_for(scene, name, energy_kev, key)?.mu;
            -libm::expm1(-mu * absorber.thickness)
        }
        None => 1.0,
    };
    let signal = match detector.mode {
        DetectorMode::Counting { low, high } => {
            let counted = low.is_none_or(|low| energy_kev >= low)
                && high.is_none_or(|high| energy_kev <= high);
            f64::from(u8::from(counted))
        }
        DetectorMode::Integrating => energy_kev,
    };
    Ok(absorbed * signal)
}
