//! Names in a scene that do not exist, for all names at once.

use std::path::Path;

use beamlet_core::{Error, Result, printed};
use beamlet_model::material;
use beamlet_model::scene::{Beam, Filter, Scene, SpectrumOrigin};

/// Loads a scene file as [`Scene::load_with`] does, and also reports unknown materials and missing files.
/// A single such error is left to the user of the material or file.
///
/// # Errors
/// As [`Scene::load_with`]; [`Error::Several`] for more than one error.
pub fn load_scene(path: impl AsRef<Path>, sets: &[String]) -> Result<Scene> {
    Scene::load_and(path.as_ref(), sets, |scene| {
        let mut errors = unknown_materials(scene);
        errors.extend(missing_files(scene));
        errors
    })
}

fn unknown_materials<'a>(scene: &'a Scene) -> Vec<Error> {
    let mut named: Vec<(String, &str)> = Vec::new();
    if let Beam::Spectrum(spec) = &scene.source.beam {
        let mut name = |list: &str, filters: &'a [Filter]| {
            for (index, filter) in filters.iter().enumerate() {
                let key = format!("source.spectrum.{list}[{index}].material");
                named.push((key, &filter.material));
            }
        };
        name("filters", &spec.filters);
        if let SpectrumOrigin::Tube { inherent_filters, .. } = &spec.origin {
            name("inherent_filters", inherent_filters);
        }
    }
    if let Some(absorber) = &scene.detector.absorber {
        named.push(("detector.absorber.material".into(), &absorber.material));
    }
    for (key, mask) in scene.masks() {
        let layers = mask.body.layers_by_key(key).into_iter();
        named.extend(layers.map(|(key, (material, _))| (key, material)));
        let plate = mask.substrate.as_ref();
        named.extend(
            plate.map(|plate| (format!("{key}.substrate.material"), plate.material.as_str())),
        );
    }
    named.push((scene.surroundings_key().into(), &scene.surroundings));
    for (number, object) in scene.objects.iter().enumerate() {
        named.push((scene.object_key(number, "material"), &object.material));
    }
    for (name, structure) in &scene.microstructures {
        named.push((format!("materials.{name}.microstructure.of"), &structure.of));
    }
    // An empty name has an error of its own.
    let named = named.into_iter().filter(|(_, name)| !name.trim().is_empty());
    named.filter_map(|(key, name)| material::known(scene, name, &key).err()).collect()
}

fn missing_files(scene: &Scene) -> Vec<Error> {
    let mesh = |(number, path)| (scene.object_key(number, "mesh"), path);
    let named = scene.files_by_key().into_iter().chain(scene.mesh_files().map(mesh));
    let named = named.filter(|(_, path)| !path.as_os_str().is_empty());
    let missing = |(key, path): (String, &Path)| {
        let error = std::fs::metadata(scene.resolve(path)).err()?;
        let found = format!("\"{}\": {error}", printed::path(path));
        Some(Error::scene(key, found, "path of a file, from the directory of the scene"))
    };
    named.filter_map(missing).collect()
}
