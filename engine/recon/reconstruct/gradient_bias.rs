//! Bias of δ by attenuation gradients within a curve.

use super::grid::Volume;
use super::quantity::Quantity;
use beamlet_core::numbers::single;
use beamlet_core::{Error, Result};
use beamlet_model::scene::Scene;
use ndarray::Zip;

/// Length k by which δ comes out too small, δ − kμ, where a step of the sample mask moves the aperture
/// over the sample (docs/physics.md): `(M/z)(z_s/z₁)(σ² − a²/12)`, σ the standard deviation of the curve
/// without sample in offsets of the mask (`flat_width`, m), a its aperture.
///
/// # Errors
/// [`Error::Scene`] without a sample mask; [`Error::Argument`] for a width that cannot be.
pub fn gradient_bias(scene: &Scene, flat_width: f64) -> Result<f64> {
    let Some(mask) = &scene.sample_mask else {
        let allowed = "a sample mask: without it steps do not move over the sample";
        return Err(Error::scene("sample_mask", "none", allowed));
    };
    let own = mask.aperture * mask.aperture / 12.0;
    let rest = flat_width * flat_width - own;
    if !(rest.is_finite() && rest >= 0.0) {
        let found = format!("{flat_width} m");
        let allowed = format!("at least {} m, the deviation of the aperture alone", own.sqrt());
        return Err(Error::argument("flat_width", found, allowed));
    }
    let moved = scene.axis_distance() / mask.distance;
    Ok(scene.magnification() / scene.lever_arm() * moved * rest)
}

/// Adds kμ to a volume of δ.
///
/// # Errors
/// [`Error::Argument`] for volumes of other quantities, or on other grids.
pub fn add_gradient_bias(delta: &mut Volume, mu: &Volume, k: f64) -> Result<()> {
    let found = [delta.quantity, mu.quantity];
    if found != [Quantity::Delta, Quantity::Mu] {
        return Err(Error::argument("volumes", format!("{found:?}"), "δ and μ"));
    }
    if delta.grid != mu.grid {
        return Err(Error::argument("volumes", "two grids", "one grid"));
    }
    Zip::from(&mut delta.values)
        .and(&mu.values)
        .for_each(|delta, mu| *delta = single(f64::from(*delta) + k * f64::from(*mu)));
    Ok(())
}
