//! Facets that bend the phase so much over a shear that they diffract as edges.

use super::frequencies::Distances;
use crate::detector::DetectorModel;
use beamlet_core::{Result, numbers};
use beamlet_files::FacetKink;
use beamlet_geometry::{Sample, largest_kinks};
use beamlet_model::material;
use beamlet_model::optics::Optics;
use beamlet_model::optics::waves::wavelength;
use beamlet_model::scene::{Object, Scene, Shape, ShapeOrMesh, Transport};
use beamlet_model::spectrum;
use std::f64::consts::TAU;

/// Bend of the phase at the steepest facets, rad, from which on facets of a round body change light by more than
/// 1e-4 of the open beam (docs/waves.md, "Facets").
const BENT: f64 = 1.0;

/// Objects of a scene by waves whose facets diffract as edges.
///
/// # Errors
/// Errors of the spectrum and of materials.
pub fn facet_kinks(scene: &Scene, sample: &Sample) -> Result<Vec<FacetKink>> {
    if scene.sampling.transport != Transport::Wave {
        return Ok(Vec::new());
    }
    let detector = DetectorModel::of(scene)?;
    let energy = spectrum::nodes(scene)?.energies[0];
    let shear = shear(detector.optics(), wavelength(energy));
    let mut largest = vec![0.0_f64; scene.objects.len()];
    for (component, kink) in sample.components.iter().zip(largest_kinks(sample)) {
        let object = component.object as usize;
        // The region of a scene is not one of its objects.
        let Some(most) = largest.get_mut(object).filter(|_| kink > 0.0) else { continue };
        let delta = |object: Option<u32>| -> Result<f64> {
            let (name, key) = match object {
                Some(index) => {
                    let index = index as usize;
                    (&scene.objects[index].material, scene.object_key(index, "material"))
                }
                None => (&scene.surroundings, scene.surroundings_key().to_owned()),
            };
            Ok(material::constants_at_for(scene, name, energy, &key)?.delta)
        };
        let step = (delta(Some(component.object))? - delta(component.outside)?).abs();
        *most = most.max(TAU / wavelength(energy) * step * kink / shear);
    }
    let all = scene.objects.iter().zip(&sample.objects).zip(largest);
    let bent = all.filter(|((object, _), bend)| *bend > BENT && is_round(object));
    Ok(bent.map(|((object, summary), bend)| kink_of(object, summary.triangles, bend)).collect())
}

/// Shear at the frequency 1/(2πσ) of a curve of width σ, of apertures, windows and blur, m.
fn shear(optics: &Optics, wavelength: f64) -> f64 {
    let masks = [&optics.sample_mask, &optics.detector_mask].into_iter().flatten();
    let openings = masks.map(|mask| mask.openings(optics.cell_plane).narrowest(0));
    let pixel = optics.detector.pitch_at(0, optics.cell_plane);
    let pixel = optics.detector_mask.is_none().then_some(pixel);
    let squares: f64 = openings.chain(pixel).map(|width| width * width / 12.0).sum();
    let blur = optics.spot.narrowest(0) * (1.0 - optics.cell_plane / optics.analyser);
    wavelength * Distances::of(optics).sample / TAU / (squares + blur * blur).sqrt()
}

/// True if facets approximate a curved surface.
const fn is_round(object: &Object) -> bool {
    !matches!(
        object.geometry,
        ShapeOrMesh::Shape(Shape::Box { .. } | Shape::Prism { .. } | Shape::Extrusion { .. })
    )
}

/// Bends fall with the third power of the width of facets.
fn kink_of(object: &Object, triangles: usize, bend: f64) -> FacetKink {
    let finer = (bend / BENT).cbrt();
    let sides = match &object.geometry {
        ShapeOrMesh::Shape(
            Shape::Cylinder { sides, .. }
            | Shape::Cone { sides, .. }
            | Shape::Sphere { sides, .. }
            | Shape::Ellipsoid { sides, .. }
            | Shape::Torus { sides, .. }
            | Shape::Tube { sides, .. },
        ) => *sides,
        ShapeOrMesh::Shape(_) | ShapeOrMesh::Mesh(_) => None,
    };
    let triangles = numbers::whole((triangles as f64 * finer * finer).ceil());
    let sides = sides.map(|sides| numbers::whole((f64::from(sides) * finer).ceil()));
    let mut kink = FacetKink::new(&object.name, bend, triangles);
    kink.sides = sides;
    kink
}
