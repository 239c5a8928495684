//! Uncertainties that a set-up has in two directions without a sample.

use super::super::noise_factors::NoiseFactors;
use super::super::options::RetrieveOptions;
use super::geometry::Design;
use super::retriever::PlanarRetriever;
use beamlet_core::Result;
use beamlet_core::cancel::Cancel;
use beamlet_model::scene::Scene;
use ndarray::{ArrayView3, s};

/// Most rows in the middle of a frame whose pixels are fitted.
const MOST_ROWS: usize = 8;
/// Most values of the model for them: some seconds.
const MOST_VALUES: usize = 1 << 24;

/// Median 1 sigma of transmission, refraction along x and z (rad), and dark field xx, zz and xz (rad^2), where flat and
/// sample have the noise of the options: of a flat without noise, `[step][row][column]`, on the detector of the scene.
/// `None` for slits that are moved along x, and for lists of many apertures, whose fits take minutes; a contrast
/// without an answer has none.
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
    let (_, rows, _) = flat.dim();
    let mut own = 0..rows;
    if !retriever.needs_whole_frames() {
        let most = (MOST_VALUES / retriever.values_of_row().max(1)).min(MOST_ROWS);
        if most == 0 {
            return Ok(None);
        }
        let first = (rows - most.min(rows)) / 2;
        own = first..(first + most).min(rows);
    }
    let some = flat.slice(s![.., own.clone(), ..]);
    let fits = retriever.fits((some, own.start), NoiseFactors::ONE, None, &Cancel::default())?;
    Ok(Some(retriever.sigmas(&fits)))
}
