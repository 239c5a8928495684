//! Signal of a photon by its energy.

use crate::scene::{DetectorMode, Scene};
use crate::{Result, material};

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
            let constants = material::constants_at(scene, &absorber.material, energy_kev);
            let mu = constants.map_err(absorber_error)?.mu;
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

/// An unknown name is reported where the absorber has it.
fn absorber_error(error: crate::Error) -> crate::Error {
    match &error {
        crate::Error::Scene { key, .. } if key == "material" => {
            error.at_key("detector.absorber.material")
        }
        _ => error,
    }
}
