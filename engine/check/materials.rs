//! The materials of a scene and who uses them.

use super::Material;
use beamlet_core::Result;
use beamlet_geometry::Sample;
use beamlet_model::scene::{MaskSpec, MaterialSpec, Object, Scene};
use beamlet_model::{material, microstructure};
use serde::Serialize;

/// Attenuation of a path through a material by the modulated light of a spectrum.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Hardening {
    /// Longest horizontal side of an object of the material, m.
    pub path: f64,
    /// -ln T of the path over its length, relative to `mu` of the material, less 1.
    pub change: f64,
}

/// Materials in use, each once, in the order: surroundings, objects, masks.
pub(super) fn materials(scene: &Scene, energy: f64) -> Result<Vec<Material>> {
    // Who uses it, the key where it is named, its name.
    let object = |(number, object): (usize, &Object)| {
        let key = scene.object_key(number, "material");
        (object.name.clone(), key, Some(object.material.clone()))
    };
    let bars = scene.masks().flat_map(|(name, mask)| {
        let layers = mask.body.layers_by_key(name).into_iter();
        layers.map(move |(key, (material, _))| (name.to_owned(), key, Some(material.to_owned())))
    });
    let substrate = |name: &str, spec: &Option<MaskSpec>| {
        let plate = spec.as_ref().and_then(|mask| mask.substrate.as_ref());
        let key = format!("{name}.substrate.material");
        (format!("substrate of {name}"), key, plate.map(|plate| plate.material.clone()))
    };
    let surroundings = Some(scene.surroundings.clone());
    let around = if scene.region().is_some() { "around the region" } else { "surroundings" };
    let uses = [(around.to_owned(), scene.surroundings_key().to_owned(), surroundings)]
        .into_iter()
        .chain(scene.objects.iter().enumerate().map(object))
        .chain(bars)
        .chain([
            substrate("sample_mask", &scene.sample_mask),
            substrate("detector_mask", &scene.detector_mask),
            (
                "detector".to_owned(),
                "detector.absorber.material".to_owned(),
                scene.detector.absorber.as_ref().map(|absorber| absorber.material.clone()),
            ),
        ]);
    let mut found: Vec<Material> = Vec::new();
    for (user, key, name) in uses.filter_map(|(user, key, name)| name.map(|name| (user, key, name)))
    {
        if let Some(known) = found.iter_mut().find(|material| material.name == name) {
            known.used_by.push(user);
            continue;
        }
        let constants = material::constants_at_for(scene, &name, energy, &key)?;
        let variance = microstructure::variances(scene, &name, &[energy])?;
        let [across, along] = match scene.scattering.get(&name) {
            Some(scattering) => scattering.across_and_along(energy),
            None => [variance.map_or(0.0, |it| it.iter().sum()); 2],
        };
        found.push(Material {
            used_by: vec![user],
            mu: constants.mu,
            delta: constants.delta,
            critical_angle: (2.0 * constants.delta.max(0.0)).sqrt(),
            scattering: across,
            scattering_along: along,
            hardening: None,
            shadows_builtin: shadows_builtin(scene, &name),
            name,
        });
    }
    Ok(found)
}

/// Adds the hardening of the materials of objects. `light`: energies, keV, and their shares of the modulated light.
///
/// # Errors
/// As [`material::constants_over`].
pub(super) fn add_hardening(
    materials: &mut [Material],
    scene: &Scene,
    sample: &Sample,
    (energies, shares): (&[f64], &[f64]),
) -> Result<()> {
    for material in materials.iter_mut().filter(|material| energies.len() > 1 && material.mu > 0.0)
    {
        let objects = scene.objects.iter().zip(&sample.objects);
        let sides = objects
            .filter(|(object, _)| object.material == material.name && object.instances.is_none());
        let longest = |[low, high]: [[f64; 3]; 2]| (high[0] - low[0]).max(high[1] - low[1]);
        let path = sides.map(|(_, summary)| longest(summary.bounds)).fold(0.0, f64::max);
        if path <= 0.0 {
            continue;
        }
        let all = material::constants_over(scene, &material.name, energies)?;
        let passed: f64 =
            all.iter().zip(shares).map(|(of, share)| share * libm::exp(-of.mu * path)).sum();
        let change = -libm::log(passed) / path / material.mu - 1.0;
        material.hardening = change.is_finite().then_some(Hardening { path, change });
    }
    Ok(())
}

/// True if an entry of the scene has the name of a built-in material and is another one.
fn shadows_builtin(scene: &Scene, name: &str) -> bool {
    let (Some(own), Some(builtin)) = (scene.materials.get(name), material::builtin(name)) else {
        return false;
    };
    !matches!(own, MaterialSpec::Formula { formula, density }
        if *formula == *builtin.formula && (density / builtin.density - 1.0).abs() < 1e-9)
}
