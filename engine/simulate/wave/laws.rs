//! Contrast of materials that scatter, by the shear of light.

use super::frequencies::Frequencies;
use beamlet_core::Result;
use beamlet_core::numbers::{self, single};
use beamlet_model::media::MaterialTable;
use beamlet_model::microstructure::{Medium, SetUp};
use beamlet_model::scene::Scene;
use rayon::prelude::*;

/// Laws of the materials of a scene: the first one is that of Gaussian angles, which have one variance at every shear,
/// and each material with bodies has its own.
#[derive(Debug)]
pub(super) struct Laws {
    set_up: SetUp,
    /// Materials with bodies by index, `[node]` each.
    bodies: Vec<(usize, Vec<Medium>)>,
    scatters: bool,
}

impl Laws {
    /// Laws of a scene.
    ///
    /// # Errors
    /// As [`Medium::of`].
    pub(super) fn of(scene: &Scene, media: &MaterialTable) -> Result<Self> {
        let of = |(material, name): (usize, &String)| {
            let structure = scene.microstructures.get(name)?;
            let media = Medium::of(scene, name, structure, &media.energies);
            Some(media.map(|media| (material, media)))
        };
        Ok(Self {
            set_up: SetUp::of(scene),
            bodies: media.names.iter().enumerate().filter_map(of).collect::<Result<_>>()?,
            scatters: !media.scattering_words().is_empty(),
        })
    }

    /// Number of laws; 0 where nothing scatters.
    pub(super) fn count(&self) -> u32 {
        if self.scatters { numbers::count(1 + self.bodies.len()) } else { 0 }
    }

    /// Law of a material.
    pub(super) fn of_material(&self, material: usize) -> u32 {
        let place = self.bodies.iter().position(|(own, _)| *own == material);
        place.map_or(0, |place| numbers::count(1 + place))
    }

    /// Variance of the angles that lose the contrast of each shear, over the variance of the material at an energy node:
    /// `[shear][law]`.
    pub(super) fn factors(
        &self,
        media: &MaterialTable,
        node: usize,
        frequencies: &Frequencies,
    ) -> Vec<f32> {
        if !self.scatters {
            return Vec::new();
        }
        let energy = media.energies[node];
        let of = |index: u32| {
            let shear = self.set_up.shear(energy, frequencies.at(index));
            let of_bodies = self.bodies.iter().map(move |(material, media_at)| {
                let whole = media.constants[node][*material].scattering;
                // Nothing is lost without a shear, or by bodies that refract as their host.
                let has_loss = shear > 0.0 && whole > 0.0;
                if has_loss { single(media_at[node].variance(shear) / whole) } else { 0.0 }
            });
            std::iter::once(1.0).chain(of_bodies).collect::<Vec<f32>>()
        };
        (0..frequencies.count).into_par_iter().flat_map_iter(of).collect()
    }
}
