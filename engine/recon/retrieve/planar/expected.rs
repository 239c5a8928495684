//! Uncertainties that a set-up has in two directions without a sample.

use super::super::noise_factors::NoiseFactors;
use super::super::options::RetrieveOptions;
use super::geometry::Design;
use super::retriever::PlanarRetriever;
use beamlet_core::Result;
use beamlet_core::cancel::Cancel;
use beamlet_model::scene::Scene;
use ndarray::ArrayView3;

/// Median 1 sigma of transmission, refraction along x and z (rad), and dark field xx, zz and xz (rad^2), where flat and
/// sample have the noise of the options: of a flat without noise, `[step][row][column]`, on the detector of the scene.
/// `None` for slits that are moved along x; a contrast without an answer has none.
///
/// # Errors
/// [`beamlet_core::Error::Argument`] and [`beamlet_core::Error::Scene`] for a set-up or options that no method takes.
pub fn sigmas_in_two_directions(
    scene: &Scene,
    options: &RetrieveOptions,
    flat: ArrayView3<'_, f32>,
) -> Result<Option<[Option<f64>; 6]>> {
    let Some(design) = Design::of(scene, options, &[])? else { return Ok(None) };
    design.check(scene, options)?;
    let set_up = (scene, &design);
    let retriever = PlanarRetriever::new(set_up, options, scene.detector.pitch, flat)?;
    let fits = retriever.fits((flat, 0), NoiseFactors::ONE, None, &Cancel::default())?;
    Ok(Some(retriever.sigmas(&fits)))
}
