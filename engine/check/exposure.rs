//! Photons, time and dose of a scan.

use beamlet_core::Result;
use beamlet_files::StackShape;
use beamlet_model::material;
use beamlet_model::optics::through_sample_mask;
use beamlet_model::scene::{Counts, MaterialSpec, Photons, Scene};
use beamlet_model::spectrum::{Absorbing, emission};
use serde::Serialize;

/// Gy of a photon per m2, of a keV and a cm2/g: joules of a keV times the m2/kg of a cm2/g.
const GRAY: f64 = 1.602_176_634e-16 * 0.1;

/// Photons, time and dose of a scan. Kerma and dose are means over the field at the axis of rotation, behind filters
/// and sample mask, without attenuation and scatter in the sample, over all frames with the sample.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct ScanExposure {
    /// Mean number of photons that an open pixel detects in a frame.
    pub photons: f64,
    /// Exposure time of all frames, flats and darks, s; `None` without `detector.exposure`.
    pub time: Option<f64>,
    /// Charge through the tube in frames with light, mA s; `None` without `detector.exposure`.
    pub tube_load: Option<f64>,
    /// Air kerma, Gy.
    pub air_kerma: f64,
    /// Absorbed dose in water, Gy.
    pub water_dose: f64,
    /// Absorbed doses in the materials of the sample.
    pub materials: Vec<MaterialDose>,
}

/// Absorbed dose in a material of the sample.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct MaterialDose {
    /// Name in the scene.
    pub material: String,
    /// Absorbed dose, Gy; `None`: unknown, the energy absorption of the material is not tabulated.
    pub dose: Option<f64>,
}

impl ScanExposure {
    /// The exposure of a scene with counts.
    ///
    /// # Errors
    /// Errors of the beam and of the materials in it.
    pub fn of(scene: &Scene, counts: &Counts) -> Result<Self> {
        let StackShape { views, flats, darks, steps, .. } = StackShape::of(scene)?;
        let [views, flats, darks] = [views, flats, darks].map(|n| f64::from(n) * f64::from(steps));
        let seconds = match counts.photons {
            Photons::Exposure(seconds) => Some(seconds),
            Photons::Number(_) => None,
        };
        let emitted = emission(scene, counts)?;
        let beam = emitted.per_solid_angle.through_path(scene, scene.axis_distance())?;
        let mask = through_sample_mask(scene, &beam.energies_kev)?;
        let area = scene.axis_distance().powi(2);
        let dose = |material: Absorbing| {
            let rows = beam.energies_kev.iter().zip(&beam.weights).zip(&mask);
            let energy = rows.map(|((energy, weight), passed)| {
                weight * passed * energy * material.per_mass(*energy)
            });
            views * GRAY / area * energy.sum::<f64>()
        };
        let mut materials: Vec<MaterialDose> = Vec::new();
        for object in &scene.objects {
            if materials.iter().all(|known| known.material != object.material) {
                let dose = tabulated(scene, &object.material).map(dose);
                materials.push(MaterialDose { material: object.material.clone(), dose });
            }
        }
        Ok(Self {
            photons: emitted.photons,
            time: seconds.map(|seconds| seconds * (views + flats + darks)),
            tube_load: seconds
                .zip(scene.source.current)
                .map(|(seconds, current)| seconds * current * (views + flats)),
            air_kerma: dose(Absorbing::Air),
            water_dose: dose(Absorbing::Water),
            materials,
        })
    }
}

impl ScanExposure {
    /// The exposure with photons and time of each frame multiplied.
    pub(crate) fn scaled(&self, factor: f64) -> Self {
        let dose = |of: &MaterialDose| MaterialDose {
            material: of.material.clone(),
            dose: of.dose.map(|dose| dose * factor),
        };
        Self {
            photons: self.photons * factor,
            time: self.time.map(|time| time * factor),
            tube_load: self.tube_load.map(|load| load * factor),
            air_kerma: self.air_kerma * factor,
            water_dose: self.water_dose * factor,
            materials: self.materials.iter().map(dose).collect(),
        }
    }
}

/// Air or water, where a material of a scene is one of them.
fn tabulated(scene: &Scene, name: &str) -> Option<Absorbing> {
    let builtin = |name: &str| Absorbing::named(&material::builtin(name)?.name);
    match scene.materials.get(name) {
        None => builtin(name),
        Some(MaterialSpec::Formula { formula, .. }) => builtin(formula),
        Some(_) => None,
    }
}
