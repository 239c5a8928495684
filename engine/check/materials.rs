//! The materials of a scene and who uses them.

use super::Material;
use beamlet_core::Result;
use beamlet_model::scene::{MaskSpec, MaterialSpec, Object, Scene};
use beamlet_model::{material, microstructure};

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
            shadows_builtin: shadows_builtin(scene, &name),
            name,
        });
    }
    Ok(found)
}

/// True if an entry of the scene has the name of a built-in material and is another one.
fn shadows_builtin(scene: &Scene, name: &str) -> bool {
    let (Some(own), Some(builtin)) = (scene.materials.get(name), material::builtin(name)) else {
        return false;
    };
    !matches!(own, MaterialSpec::Formula { formula, density }
        if *formula == *builtin.formula && (density / builtin.density - 1.0).abs() < 1e-9)
}
