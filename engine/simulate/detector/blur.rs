//! From the light on the grid behind the detector mask to the detector's pixels.

use super::grid::SubpixelGrid;
use super::kernel::{KernelOf, Measured, Spread};
use super::spread::Window;
use beamlet_core::Result;
use beamlet_model::scene::{Blur, Scene};
use ndarray::Array2;

/// Weights of the grid around a pixel, which sum to 1; `None` where every part of the grid is a pixel.
pub(super) fn window(scene: &Scene, grid: &SubpixelGrid) -> Result<Option<Window>> {
    let weights = match &scene.detector.blur {
        None => return Ok(None),
        Some(Blur::Gaussian { .. }) if grid.margin == [0; 2] => return Ok(None),
        Some(Blur::Gaussian { sigma }) => {
            let along = |axis: usize| -> Vec<f64> {
                // The optics have a blur along z that the grid does not.
                if axis == 1 && grid.margin[1] == 0 {
                    return vec![1.0];
                }
                let spread = Spread::Gaussian(sigma[axis] / scene.detector.pitch[axis]);
                let [margin, parts] = [grid.margin[axis], grid.parts[axis]].map(f64::from);
                let count = ((2 * grid.margin[axis] + 1) * grid.parts[axis]) as usize;
                let weight = |i: usize| {
                    let low = i as f64 / parts - margin;
                    spread.landing(low, low + 1.0 / parts) / parts
                };
                (0..count).map(weight).collect()
            };
            let [across, down] = [along(0), along(1)];
            Array2::from_shape_fn((down.len(), across.len()), |(j, i)| down[j] * across[i])
        }
        Some(Blur::Kernel(kernel)) => {
            let measured = Measured::read(scene, kernel, KernelOf::Blur)?;
            measured.weights(grid.margin, grid.parts)
        }
    };
    let parts = grid.parts.map(|n| n as usize);
    Ok(Some(Window::new(weights, parts, grid.pixels[0] as usize)))
}
