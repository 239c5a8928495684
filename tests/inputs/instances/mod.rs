//! Instances of objects: keys, files of positions, packings.

mod files;
mod keys;
mod packings;
mod touching;
mod walls;

use beamlet::Error;
use beamlet::internals::instances::{InstanceTransform, transforms};
use beamlet::scene::Scene;
use std::path::Path;

/// A scene with one object of this shape and these instances, both in TOML.
fn scene_in(directory: &Path, shape: &str, instances: &str) -> Result<Scene, Error> {
    let text = format!(
        "[source]\ndistance = \"1 m\"\nspot = \"0 um\"\nenergy = \"30 keV\"\n[detector]\n\
         distance = \"2 m\"\npixels = [1, 1]\npitch = \"100 um\"\n[[object]]\nname = \"many\"\n\
         material = \"gold\"\nshape = {shape}\ninstances = {instances}\n"
    );
    crate::kept::kept(&text, Scene::from_toml(&text, directory))
}

/// The instances of a packing or file.
fn instances_of(shape: &str, instances: &str) -> Result<Vec<InstanceTransform>, Error> {
    let scene = scene_in(Path::new("."), shape, instances)?;
    transforms(&scene, &scene.objects[0])
}

fn fibre(radius: &str, height: &str) -> String {
    format!("{{ cylinder = {{ radius = \"{radius}\", height = \"{height}\", sides = 64 }} }}")
}

fn sphere(radius: &str) -> String {
    format!("{{ sphere = {{ radius = \"{radius}\", sides = 64 }} }}")
}

/// A packing in TOML: kind, region and the other keys.
fn packing(kind: &str, region: &str, more: &str) -> String {
    format!("{{ packing = \"{kind}\", region = {{ {region} }}, {more} }}")
}
