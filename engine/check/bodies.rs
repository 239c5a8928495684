//! Advice to describe packings of small bodies as materials.

use super::CheckedObject;
use super::display::length;
use beamlet_core::Result;
use beamlet_core::printed::number;
use beamlet_model::material::{Constants, constants_at};
use beamlet_model::microstructure::Description;
use beamlet_model::scene::{
    Beam, BodyShape, Instances, MaterialSpec, Microstructure, Object, Packing, PackingAmount,
    PackingKind, Scene, Shape, ShapeOrMesh,
};

/// Diameter over the width of a pixel below which a pixel sees the mean of many bodies.
const SMALL: f64 = 0.1;
/// Height over the radius above which cylinders count as long.
const LONG: f64 = 20.0;

/// Advice for each packing of bodies that are small against pixels, at an energy, keV.
///
/// # Errors
/// As [`Description::of`].
pub(super) fn advice(scene: &Scene, objects: &[CheckedObject], energy: f64) -> Result<Vec<String>> {
    let mut all = Vec::new();
    for (number, (object, checked)) in scene.objects.iter().zip(objects).enumerate() {
        let Some(medium) = medium(object, checked.volume) else { continue };
        let host = match checked.inside.as_slice() {
            [] => Some(&scene.surroundings),
            [name] => scene.objects.iter().find(|it| it.name == *name).map(|it| &it.material),
            _ => None,
        };
        let Some(host) = host else { continue };
        if scene.microstructures.contains_key(host) {
            continue;
        }
        // The region in place of the bodies, of a material of its own with the constants of the host.
        let name = format!("medium of {}", object.name);
        let Constants { mu, delta, .. } = constants_at(scene, host, energy)?;
        let mut instead = scene.clone();
        instead.source.beam = Beam::Energy(energy);
        instead.materials.insert(name.clone(), MaterialSpec::Constants { mu, delta });
        instead.microstructures.insert(name.clone(), medium);
        instead.objects[number].material.clone_from(&name);
        // A run that would refuse the medium is not advised.
        if instead.validate().is_ok()
            && let Some(of_medium) = Description::of(&instead, &name, energy)?
            && of_medium.per_pixel < SMALL
            && of_medium.variances[1] > 0.0
        {
            all.push(words(&object.name, host, &of_medium));
        }
    }
    Ok(all)
}

/// Microstructure with the bodies of a packing that has no direction; `volume`: of all its bodies, m³.
fn medium(object: &Object, volume: f64) -> Option<Microstructure> {
    let Some(Instances::Packing(packing)) = &object.instances else { return None };
    let Packing { kind, region, amount, diameter_spread, .. } = packing;
    let (shape, radius) = match (&object.geometry, kind) {
        (ShapeOrMesh::Shape(Shape::Sphere { radius, .. }), PackingKind::Spheres) => {
            (BodyShape::Spheres, *radius)
        }
        (ShapeOrMesh::Shape(Shape::Cylinder { radius, height, .. }), PackingKind::RandomFibres)
            if *height > LONG * radius =>
        {
            (BodyShape::Cylinders, *radius)
        }
        _ => return None,
    };
    let scale = object.placement.scale;
    let fraction = match amount {
        PackingAmount::Fill(fill) => *fill,
        PackingAmount::Count(_) => volume / (region.volume() * scale.powi(3)),
    };
    let mut medium = Microstructure::new(shape, &object.material, 2.0 * radius * scale, fraction);
    medium.spread = *diameter_spread;
    Some(medium)
}

fn words(name: &str, host: &str, medium: &Description) -> String {
    let Description { shape, diameter, spread, fraction, of, variances, rays, .. } = medium;
    let diameter = length(*diameter);
    let spread =
        if *spread > 0.0 { format!(", spread = {}", number(*spread)) } else { String::new() };
    let difference = match medium.by_waves {
        true => String::new(),
        false => format!(
            ", where rays through bodies have {} times as much",
            number(rays / variances[1])
        ),
    };
    format!(
        "\"{name}\": its bodies are {:.2} of a pixel, and each costs time; a region of one material with \
         microstructure = {{ shape = \"{shape}\", diameter = \"{diameter}\", fraction = {}{spread}, of = \"{of}\" }} \
         in the host \"{host}\" has their mean dark field by waves, {:.3e} rad^2/m{difference}, without their \
         differences from pixel to pixel",
        medium.per_pixel,
        number(*fraction),
        variances[1],
    )
}
