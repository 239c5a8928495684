//! Shares of the light of each pixel that pass through objects.

use super::{Pixels, refuse_heights};
use beamlet_core::{Cancel, Result};
use beamlet_model::scene::Scene;
use beamlet_simulate::run::Simulation;
use beamlet_simulate::trace::{Ray, uncovered};
use ndarray::Array3;

/// Straight rays of a pixel.
const RAYS: usize = 16;
/// Pixels whose rays are on the device at once.
const AT_ONCE: usize = 1 << 11;
/// Surfaces of a ray that count, at most: first, and where these are not enough.
const MOST: [u32; 2] = [64, 256];

/// For each of some objects, by their indices, the share of the straight rays of each pixel of the ideal images of a
/// scene that pass through it, `[view][row][column]`; `None` is any object. NaN behind bars. `simulation` has its sample.
///
/// # Errors
/// As [`super::ideal`].
pub(crate) fn coverage(
    simulation: &Simulation,
    scene: &Scene,
    objects: &[Option<u32>],
    cancel: &Cancel,
) -> Result<Vec<Array3<f32>>> {
    refuse_heights(scene)?;
    let pixels = Pixels::of(scene, Vec::new())?;
    let total = pixels.count();
    let mut shares = vec![vec![f32::NAN; total]; objects.len()];
    for first in (0..total).step_by(AT_ONCE) {
        cancel.check()?;
        let some: Vec<usize> =
            (first..total.min(first + AT_ONCE)).filter(|pixel| pixels.is_open(*pixel)).collect();
        let rays = some.iter().flat_map(|pixel| (0..RAYS).map(|ray| pixels.ray(*pixel, ray, RAYS)));
        let rays: Vec<Ray> = rays.map(|ray| Ray::from(&ray)).collect();
        for most in MOST {
            shares.iter_mut().for_each(|share| some.iter().for_each(|pixel| share[*pixel] = 0.0));
            let mut is_full = false;
            simulation.crossings(&rays, most, |ray, met| {
                is_full |= met.len() >= most as usize;
                let met = uncovered(met);
                for (share, object) in shares.iter_mut().zip(objects) {
                    let passes = match object {
                        Some(object) => met.iter().any(|surface| surface.object == *object),
                        None => !met.is_empty(),
                    };
                    share[some[ray / RAYS]] += f32::from(u8::from(passes)) / RAYS as f32;
                }
            })?;
            if !is_full {
                break;
            }
        }
    }
    shares.iter().map(|share| pixels.image(|pixel| share[pixel])).collect()
}
