//! Dark field of many bodies at random places, by waves over by rays.

use super::pixel::Pixel;
use super::structure::{Form, structure_by_rays, structure_by_waves};
use super::{Node, wavelength};
use std::f64::consts::TAU;

/// A size of the bodies of an object.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Body {
    /// Radius, m.
    pub radius: f64,
    /// Share of the bodies that have it.
    pub share: f64,
}

/// Round bodies at random places that do not depend on one another.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bodies<'a> {
    /// Their form.
    pub form: Form,
    /// Their sizes.
    pub sizes: &'a [Body],
    /// Difference of delta to the material around at each energy node.
    pub delta: &'a [f64],
}

impl Bodies<'_> {
    /// Dark field by waves over the dark field by rays, from the transform of the curve at 1/(2πσ), σ the
    /// width of the curve; `None` where rays see none.
    #[must_use]
    pub fn ratio(&self, pixel: &Pixel, nodes: &[Node]) -> Option<f64> {
        let frequency = 1.0 / (TAU * pixel.curve_width());
        let mut sums = [0.0; 2];
        for ((energy, weight, _), delta) in nodes.iter().zip(self.delta) {
            let length = wavelength(*energy);
            let shear = pixel.body_shear(length, frequency);
            let phase = 2.0 * TAU / length * delta;
            for body in self.sizes {
                let structure = [structure_by_waves, structure_by_rays]
                    .map(|of| of(self.form, body.radius, phase, shear));
                let weight = weight * body.share;
                sums.iter_mut().zip(structure).for_each(|(sum, value)| *sum += weight * value);
            }
        }
        (sums[1] > 0.0).then(|| sums[0] / sums[1])
    }
}
