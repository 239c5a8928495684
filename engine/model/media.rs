//! Materials of a scene by index, medium 0 being the surroundings, with their constants.

use crate::material::{self, Constants};
use crate::microstructure;
use crate::scene::{Object, Scene};
use crate::spectrum;
use beamlet_core::{Result, numbers};
use beamlet_interface::{
    KIND_ROUGH, KIND_SCATTERING, KIND_SCATTERING_AXIS, MOMENTS_PER_MATERIAL, MOMENTS_PER_PAIR,
};
use glam::{DMat3, DVec3};
use std::ops::Range;

/// Sine of the angle between directions that are one but for rounding.
const SAME_DIRECTION: f64 = 1e-9;

/// Axis of a material that scatters along it by another variance than across it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ScatteringAxis {
    /// Unit vector in the frame of the sample.
    pub direction: DVec3,
    /// Variance of the refraction angle across the axis and along it, over that of the constants.
    pub shares: [f64; 2],
}

impl ScatteringAxis {
    /// Axis of the material of an object; `None` where it scatters alike in all directions.
    fn of(scene: &Scene, object: &Object) -> Option<Self> {
        let scattering = scene.scattering.get(&object.material)?;
        let axis = scattering.unequal_axis()?;
        let own = DVec3::from_array(axis.direction);
        let shares = [scattering.variance, axis.variance].map(|it| it / scattering.mean());
        Some(Self { direction: object.placement.rotate_direction(own).normalize(), shares })
    }

    /// True if it is an axis of one direction with another, of either sign.
    fn is_along(&self, other: &Self) -> bool {
        self.direction.cross(other.direction).length() < SAME_DIRECTION
    }

    /// Tensor T of the variances over that of the constants: along a unit vector v across the light vᵀTv.
    #[must_use]
    pub fn tensor(&self) -> DMat3 {
        let [across, along] = self.shares;
        let DVec3 { x, y, z } = self.direction;
        let outer = DMat3::from_cols(x * self.direction, y * self.direction, z * self.direction);
        DMat3::IDENTITY * across + outer * (along - across)
    }
}

/// Materials by index; index 0 is the surroundings. A material that scatters along an axis has an index for each
/// direction that objects give it.
#[derive(Debug, Clone, PartialEq)]
pub struct MaterialTable {
    /// Names.
    pub names: Vec<String>,
    /// Energy of each node of the beam's spectrum, keV; one for a single energy.
    pub energies: Vec<f64>,
    /// Weight of each node; their sum is 1.
    pub weights: Vec<f64>,
    /// Constants, `[node][material]`.
    pub constants: Vec<Vec<Constants>>,
    /// Axis of each material that scatters along it by another variance than across it; none where no material does.
    pub axes: Vec<Option<ScatteringAxis>>,
    /// Material of each object.
    pub of_object: Vec<u32>,
    /// Roughness of each object: standard deviation of the slopes of its surface.
    pub roughness: Vec<f64>,
}

impl MaterialTable {
    /// Collects the materials of a scene.
    ///
    /// # Errors
    /// As [`material::constants_at_for`] and [`spectrum::nodes`].
    pub fn of(scene: &Scene) -> Result<Self> {
        let mut names = vec![scene.surroundings.clone()];
        let mut keys = vec![scene.surroundings_key().to_owned()];
        let mut axes: Vec<Option<ScatteringAxis>> = vec![None];
        let mut of_object = Vec::with_capacity(scene.objects.len());
        for (number, object) in scene.objects.iter().enumerate() {
            let axis = ScatteringAxis::of(scene, object);
            let is_own = |(name, other): (&String, &Option<ScatteringAxis>)| {
                *name == object.material
                    && axis.is_none_or(|own| other.is_some_and(|other| own.is_along(&other)))
            };
            let index = names.iter().zip(&axes).position(is_own).unwrap_or_else(|| {
                names.push(object.material.clone());
                keys.push(scene.object_key(number, "material"));
                axes.push(axis);
                names.len() - 1
            });
            of_object.push(numbers::count(index));
        }
        if axes.iter().all(Option::is_none) {
            axes.clear();
        }
        let nodes = spectrum::nodes(scene)?;
        let at = |energy: f64| -> Result<Vec<Constants>> {
            let named = names.iter().zip(&keys);
            named.map(|(name, key)| material::constants_at_for(scene, name, energy, key)).collect()
        };
        let mut constants =
            nodes.energies.iter().map(|&e| at(e)).collect::<Result<Vec<Vec<Constants>>>>()?;
        for (material, name) in names.iter().enumerate() {
            let Some(variances) = microstructure::variances(scene, name, &nodes.energies)? else {
                continue;
            };
            for (of_node, variance) in constants.iter_mut().zip(variances) {
                of_node[material].scattering = variance;
            }
        }
        Ok(Self {
            names,
            energies: nodes.energies,
            weights: nodes.weights,
            constants,
            axes,
            of_object,
            roughness: scene.objects.iter().map(|object| object.roughness).collect(),
        })
    }

    /// `KIND_` bits of the numbers that moments have beside those of every sample.
    #[must_use]
    pub fn kinds(&self) -> u32 {
        let rough = self.roughness.iter().any(|it| *it > 0.0);
        let scatters = self.constants.iter().flatten().any(|it| it.scattering > 0.0);
        let bit = |has: bool, bit: u32| if has { bit } else { 0 };
        bit(rough, KIND_ROUGH)
            | bit(scatters, KIND_SCATTERING)
            | bit(!self.axes.is_empty(), KIND_SCATTERING_AXIS)
    }

    /// Words of the moments of a ray through them.
    #[must_use]
    pub fn moment_words(&self) -> usize {
        moment_words(self.names.len(), self.kinds())
    }

    /// Words of the moments of a ray that hold the moment of scattering of each material; none where nothing scatters.
    #[must_use]
    pub fn scattering_words(&self) -> Range<usize> {
        moment_words(self.names.len(), self.kinds() & !KIND_SCATTERING)..self.moment_words()
    }

    /// Constants averaged over the spectrum, by material: those that refinement goes by.
    #[must_use]
    pub fn mean(&self) -> Vec<Constants> {
        let mean = |m: usize, of: fn(&Constants) -> f64| {
            self.weights.iter().zip(&self.constants).map(|(w, c)| w * of(&c[m])).sum()
        };
        (0..self.names.len())
            .map(|m| Constants {
                mu: mean(m, |c| c.mu),
                delta: mean(m, |c| c.delta),
                scattering: mean(m, |c| c.scattering),
            })
            .collect()
    }

    /// Weight of each energy, and attenuation there over the attenuation at the mean constants: of the material of an
    /// object that lets the most light pass.
    #[must_use]
    pub fn attenuation_ratios(&self) -> Vec<[f64; 2]> {
        let mean = self.mean();
        let solid = || (1..self.names.len()).filter(|m| mean[*m].mu > 0.0);
        let of = |constants: &Vec<Constants>| {
            let ratios = solid().map(|m| constants[m].mu / mean[m].mu);
            ratios.reduce(f64::min).unwrap_or(1.0)
        };
        self.weights.iter().zip(&self.constants).map(|(w, c)| [*w, of(c)]).collect()
    }

    /// Refraction at each energy over that at constants by material.
    #[must_use]
    pub fn refraction_ratios(&self, reference: &[Constants]) -> Vec<f64> {
        let strength = |of: &[Constants]| of.iter().map(|c| c.delta.abs()).sum::<f64>();
        let least = strength(reference).max(f64::MIN_POSITIVE);
        self.constants.iter().map(|node| strength(node) / least).collect()
    }

    /// Step of delta between two materials, root mean square over the spectrum: neglected terms of the
    /// first order grow with its square.
    #[must_use]
    pub fn step(&self, a: u32, b: u32) -> f64 {
        let square = |c: &Vec<Constants>| (c[a as usize].delta - c[b as usize].delta).powi(2);
        self.weights.iter().zip(&self.constants).map(|(w, c)| w * square(c)).sum::<f64>().sqrt()
    }

    /// Largest step of delta between two materials over the spectrum.
    #[must_use]
    pub fn largest_step(&self, a: u32, b: u32) -> f64 {
        let step = |c: &Vec<Constants>| (c[a as usize].delta - c[b as usize].delta).abs();
        self.constants.iter().map(step).fold(0.0, f64::max)
    }

    /// Delta of a material, root mean square over the spectrum.
    #[must_use]
    pub fn delta(&self, material: usize) -> f64 {
        let square = |c: &Vec<Constants>| c[material].delta.powi(2);
        self.weights.iter().zip(&self.constants).map(|(w, c)| w * square(c)).sum::<f64>().sqrt()
    }

    /// Largest of these of any material.
    #[must_use]
    pub fn strongest(&self) -> f64 {
        (0..self.names.len()).map(|m| self.delta(m)).fold(0.0, f64::max)
    }

    /// Material inside and outside of a surface, by its objects.
    #[must_use]
    pub fn sides(&self, object: u32, outside: Option<u32>) -> [u32; 2] {
        [self.of_object[object as usize], outside.map_or(0, |o| self.of_object[o as usize])]
    }
}

/// Words of the moments of a ray, without their head: of each material, in samples with rough surfaces of each pair of
/// them, and where materials scatter one of each material again. `kinds`: `KIND_` bits of the sample.
#[must_use]
pub const fn moment_words(materials: usize, kinds: u32) -> usize {
    let pairs = if kinds & KIND_ROUGH != 0 { materials * (materials - 1) / 2 } else { 0 };
    let scattering = if kinds & KIND_SCATTERING != 0 { materials } else { 0 };
    materials * MOMENTS_PER_MATERIAL + pairs * MOMENTS_PER_PAIR + scattering
}
