//! Dark field of many bodies at random places, by waves over by rays.

use super::flat::Flat;
use super::gaussian::fitted_variance;
use super::pixel::Pixel;
use super::series::Series;
use super::structure::{Form, structure_by_rays, structure_by_waves};
use super::{MOST_TERMS, Node, wavelength};
use rayon::prelude::*;
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
#[derive(Debug, Clone, PartialEq)]
pub struct Bodies {
    /// Their form.
    pub form: Form,
    /// Their sizes.
    pub sizes: Vec<Body>,
    /// Difference of delta to the material around at each energy node.
    pub delta: Vec<f64>,
    /// Bodies per length of x, 1/m, for cylinders; per area across the beam, 1/m², for spheres.
    pub density: f64,
}

impl Bodies {
    /// Structure function D of a body on average at an energy node, by waves and by rays, at a frequency of
    /// the curve, cycles per metre.
    fn structure(&self, pixel: &Pixel, energy: f64, delta: f64, frequency: f64) -> [f64; 2] {
        let length = wavelength(energy);
        let shear = pixel.body_shear(length, frequency);
        let phase = 2.0 * TAU / length * delta;
        let sum = |of: fn(Form, f64, f64, f64) -> f64| -> f64 {
            self.sizes.iter().map(|it| it.share * of(self.form, it.radius, phase, shear)).sum()
        };
        [sum(structure_by_waves), sum(structure_by_rays)]
    }

    /// Dark field by waves over the dark field by rays, from the transform of the curve at 1/(2πσ), σ the
    /// width of the curve; `None` where rays see none.
    #[must_use]
    pub fn ratio(&self, pixel: &Pixel, nodes: &[Node]) -> Option<f64> {
        let frequency = 1.0 / (TAU * pixel.curve_width());
        let mut sums = [0.0; 2];
        for ((energy, weight, _), delta) in nodes.iter().zip(&self.delta) {
            let found = self.structure(pixel, *energy, *delta, frequency);
            sums.iter_mut().zip(found).for_each(|(sum, value)| *sum += weight * value);
        }
        (sums[1] > 0.0).then(|| sums[0] / sums[1])
    }

    /// Dark fields σ² by waves and by rays, rad², of Gaussian fits to the curve at mask offsets, m, with and
    /// without the bodies; `None` where the fit does not settle a width.
    #[must_use]
    pub fn dark_fields(&self, pixel: &Pixel, nodes: &[Node], offsets: &[f64]) -> Option<[f64; 2]> {
        let centre = pixel.aligned(offsets)?;
        if pixel.term_count(pixel.period) > MOST_TERMS {
            return None;
        }
        let [waves, rays] = self.curves(pixel, nodes);
        let widening = |curves: [Vec<(f64, Series)>; 2]| -> Option<f64> {
            let [flat, sample] = curves.map(|parts| {
                let curve = Series::sum(parts.iter().map(|(weight, part)| (*weight, part)))?;
                fitted_variance(offsets, centre, |at| curve.at(at))
            });
            Some((sample? - flat?) / pixel.distance.powi(2))
        };
        Some([widening(waves)?, widening(rays)?])
    }

    /// Curves without and with the bodies at all nodes, each with its weight: by waves, and by rays.
    fn curves(&self, pixel: &Pixel, nodes: &[Node]) -> [[Vec<(f64, Series)>; 2]; 2] {
        let mut curves: [[Vec<(f64, Series)>; 2]; 2] = Default::default();
        for ((energy, weight, leaks), delta) in nodes.iter().zip(&self.delta) {
            let lengths = [wavelength(*energy), 0.0];
            let flats = lengths.map(|length| Flat::of(pixel, length, *leaks).light);
            let structure: Vec<[f64; 2]> = (0..flats[0].terms.len())
                .into_par_iter()
                .map(|term| self.structure(pixel, *energy, *delta, flats[0].frequency(term)))
                .collect();
            for (of, (flat, curves)) in flats.into_iter().zip(&mut curves).enumerate() {
                let left = |term: usize| libm::exp(-self.density * structure[term][of]);
                curves[1].push((*weight, flat.damped(left)));
                curves[0].push((*weight, flat));
            }
        }
        curves
    }
}
