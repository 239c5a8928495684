//! Tolerances of a run by the quality of its scene (docs/scene.md, "sampling").

use beamlet_core::Result;
use beamlet_model::media::MaterialTable;
use beamlet_model::optics::{self, Optics, ThinCurve};
use beamlet_model::scene::{Counts, Quality, Scene, Tolerances};
use beamlet_model::spectrum;
use std::f64::consts::SQRT_2;

/// Share of the noise that sampling may leave.
const SHARE: f64 = 0.1;
/// Least and greatest tolerances by noise: share of open beam, rad.
const LIGHT: [f64; 2] = [1e-5, 1e-3];
const ANGLE: [f64; 2] = [2e-9, 100e-9];

/// The scene with a number for each tolerance.
///
/// # Errors
/// Errors of the materials of masks and beam.
pub fn resolved(scene: &Scene) -> Result<Scene> {
    let mut resolved = scene.clone();
    if scene.sampling.tolerance.is_none() || scene.sampling.angle_tolerance.is_none() {
        resolved.sampling.fill(tolerances(scene)?);
    }
    Ok(resolved)
}

/// Rule of a scene that gives none.
pub(crate) fn quality(scene: &Scene) -> Quality {
    let counts = scene.detector.counts.is_some();
    let default = if counts { Quality::Noise } else { Quality::Standard };
    scene.sampling.quality.unwrap_or(default)
}

/// Tolerances that the quality of a scene stands for.
///
/// # Errors
///
/// [`beamlet_core::Error::Scene`] where noise has no open beam to be compared with.
pub fn tolerances(scene: &Scene) -> Result<Tolerances> {
    match (quality(scene), &scene.detector.counts) {
        (Quality::Fine, _) => Ok(Tolerances::FINE),
        (Quality::Noise, Some(counts)) => by_noise(scene, counts),
        (Quality::Noise | Quality::Standard, _) => Ok(Tolerances::STANDARD),
    }
}

fn by_noise(scene: &Scene, counts: &Counts) -> Result<Tolerances> {
    let noise = open_variance(scene, counts)?.of(1.0).sqrt();
    let angle = expected_angle(scene)?.map(|sigma| limited(sigma, ANGLE));
    Ok(Tolerances {
        light: limited(noise, LIGHT),
        angle: angle.unwrap_or(Tolerances::STANDARD.angle),
    })
}

/// A tenth of a standard deviation within limits, to one digit.
fn limited(deviation: f64, [least, most]: [f64; 2]) -> f64 {
    let value = (SHARE * deviation).clamp(least, most);
    let digit = 10_f64.powf(value.log10().floor());
    // By division where that is exact: 7e-4 and not 7.000000000000001e-4.
    let text = format!("{:.0e}", (value / digit).round() * digit);
    text.parse().unwrap_or(value)
}

/// Variance of a value of the detector by its light, shares of open beam.
#[derive(Debug, Clone, Copy)]
pub struct Variance {
    /// Variance per light.
    pub per_light: f64,
    /// Standard deviation of the electronic noise.
    pub read_noise: f64,
}

impl Variance {
    /// Variance at this light.
    pub fn of(self, light: f64) -> f64 {
        self.per_light * light + self.read_noise * self.read_noise
    }
}

/// The variance of the values of a detector with noise.
///
/// # Errors
/// Errors of the beam.
pub fn open_variance(scene: &Scene, counts: &Counts) -> Result<Variance> {
    let per_open = counts.gain * spectrum::photons(scene, counts)?;
    Ok(Variance {
        per_light: spectrum::variance_per_value(scene)? / per_open,
        read_noise: counts.electronic_noise / per_open,
    })
}

/// Standard deviation of the refraction angle of a pixel without a sample, rad, in closed form: flat and
/// sample have the counts of thin masks. `None` without photons or a mask, or with fewer than three offsets.
///
/// # Errors
/// Errors of the materials of masks and beam.
pub fn expected_angle(scene: &Scene) -> Result<Option<f64>> {
    let Some(counts) = &scene.detector.counts else { return Ok(None) };
    let media = MaterialTable::of(scene)?;
    let scene = &*optics::straightened(scene, (&media.energies, &media.weights))?;
    let optics = Optics::of(scene);
    let leaks = optics::mean_leaks(scene, &optics, (&media.energies, &media.weights))?;
    let variance = open_variance(scene, counts)?;
    let share = optics::through_substrates(scene, &optics, (&media.energies, &media.weights))?;
    let curve = ThinCurve::of(&optics, leaks).map(|curve| curve.dimmed(share));
    let offsets = scene.offsets_of_group(&scene.scan.mask_offsets);
    let centre =
        curve.and_then(|curve| curve.centre_deviation(&offsets, |light| variance.of(light)));
    Ok(centre.map(|centre| SQRT_2 * centre / optics.lever_arm))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tolerances_are_a_tenth_of_the_noise_to_one_digit() {
        for (photons, light) in [(20_000.0, 7e-4), (1e6, 1e-4), (100.0, 1e-3), (1e12, 1e-5)] {
            let found = limited(1.0 / f64::sqrt(photons), LIGHT);
            assert_eq!(found.to_bits(), f64::to_bits(light), "{photons}: {found:e}");
        }
        assert_eq!(limited(300e-9, ANGLE).to_bits(), 30e-9_f64.to_bits());
    }
}
