//! Rough plates from several origins: `source.distance` says where the axis of rotation is, and no light depends on it
//! while the plates stay where they are. The curve of a plate is the overlap of two apertures, blurred by the source and by
//! the slopes of both faces at their own distances from the analyser.

use crate::reference::closed_form::blurred_overlap;
use crate::support::{Worst, engine, sample};
use beamlet::Backend;
use beamlet::scene::{Instances, Object, Scene, Shape, Transport};
use beamlet::stack::Stacks;
use std::f64::consts::{FRAC_PI_2, TAU};
use std::path::Path;

/// Distances of the mask, the plate and the detector from the source, m.
const MASK: f64 = 1.2;
const PLATE: f64 = 1.3;
const DETECTOR: f64 = 1.8;
const APERTURE: f64 = 30e-6;
const PITCH: f64 = 150e-6;
/// Deviation of the spot, m: 30 um full width at half maximum.
const SPOT: f64 = 30e-6 / 2.354_820_045;
const DELTA: f64 = 7.071_067_8e-3;
const ROUGHNESS: f64 = 1e-3;
const THICKNESS: f64 = 1e-4;
const ORIGINS: [f64; 2] = [1.21, 1.6];
/// Share of the open beam: f32.
const TOLERANCE: f64 = 2e-6;

fn set_up() -> Scene {
    let text = format!(
        "[source]\ndistance = \"{PLATE} m\"\nspot = \"30 um\"\nenergy = \"30 keV\"\n\
         [sample_mask]\ndistance = \"{MASK} m\"\ntransmission = 0.0\nprojected_aperture = \"30 um\"\n\
         [detector_mask]\ntransmission = 0.0\nprojected_aperture = \"30 um\"\n\
         [detector]\ndistance = \"{DETECTOR} m\"\npixels = [2, 1]\npitch = \"150 um\"\n\
         [scan]\nmask_offsets = {{ from = \"-25 um\", to = \"25 um\", count = 7 }}\n\
         [sampling]\ntolerance = 1e-4\n\
         [materials.scatterer]\nmu = \"0 /m\"\ndelta = {DELTA}\n"
    );
    Scene::from_toml(&text, Path::new(".")).expect("a scene")
}

/// A plate across the beam, wider than the detector.
fn plate(shape: Shape) -> Object {
    let mut object = Object::new("plate", shape, "scatterer");
    object.roughness = ROUGHNESS;
    object
}

fn boxed() -> Shape {
    Shape::Box { size: [2e-3, THICKNESS, 2e-3] }
}

/// A disc, which is turned until its axis is the beam.
fn disc(sides: Option<u32>) -> Object {
    let shape = Shape::Cylinder { radius: 1e-3, height: THICKNESS, sides };
    let mut object = plate(shape);
    object.placement.rotate = vec![([1.0, 0.0, 0.0], FRAC_PI_2)];
    object
}

/// Light of a step; `faces`: distances of the rough faces behind the usual place of the plate.
fn closed_form(offset: f64, faces: &[f64]) -> f64 {
    let scale = DETECTOR / MASK;
    let by_faces = |face: &f64| (ROUGHNESS * DELTA * (DETECTOR - PLATE - face)).powi(2);
    let blur = ((scale - 1.0) * SPOT).powi(2) + faces.iter().map(by_faces).sum::<f64>();
    blurred_overlap(scale * offset, APERTURE, APERTURE, blur.sqrt()) / PITCH
}

/// Holds a sample to the closed form from all origins; `light`: of a scene.
fn hold(name: &str, object: &Object, faces: &[f64], light: &dyn Fn(&Scene) -> Stacks) {
    for origin in ORIGINS {
        let mut scene = set_up();
        scene.objects = vec![object.clone()];
        scene.source.distance = origin;
        scene.objects[0].placement.position[1] += PLATE - origin;
        let stacks = light(&scene);
        let mut worst = Worst::new("light behind a rough plate", TOLERANCE);
        for ((_, step, ..), light) in stacks.sample.indexed_iter() {
            let expected = closed_form(scene.scan.mask_offsets[step], faces);
            worst.take(f64::from(*light) - expected, || format!("{name}, origin at {origin} m"));
        }
        worst.holds();
    }
}

#[test]
fn no_light_behind_a_rough_plate_depends_on_the_origin() {
    let engine = engine(Backend::Bvh);
    let own = [-0.5 * THICKNESS, 0.5 * THICKNESS];
    let octagon = |k: u32| {
        let (sin, cos) = (TAU * (f64::from(k) + 0.5) / 8.0).sin_cos();
        [1e-3 * cos, 1e-3 * sin]
    };
    let extrusion = Shape::Extrusion { points: (0..8).map(octagon).collect(), height: THICKNESS };
    let mut extruded = plate(extrusion);
    extruded.placement.rotate = vec![([1.0, 0.0, 0.0], FRAC_PI_2)];
    let directory = tempfile::tempdir().expect("a folder");
    let places = directory.path().join("places.csv");
    std::fs::write(&places, "x_mm,y_mm,z_mm\n0,0,0\n0,100,0\n").expect("a file");
    let mut pair = plate(boxed());
    pair.instances = Some(Instances::File(places));
    let behind = 0.1;
    let pair_faces = [own[0], own[1], behind + own[0], behind + own[1]];
    let bodies = vec![
        ("a box", plate(boxed()), &own[..]),
        ("an extrusion", extruded, &own[..]),
        ("a disc", disc(None), &own[..]),
        ("a disc of facets", disc(Some(24)), &own[..]),
        ("two instances", pair.clone(), &pair_faces[..]),
    ];
    // A box, a disc and instances; all with `BEAMLET_ALL`.
    for (name, object, faces) in sample(bodies, 2) {
        hold(name, &object, faces, &|scene| engine.simulate(scene).expect("a run"));
    }
    let exact = |scene: &Scene| {
        let mut scene = scene.clone();
        scene.sampling.transport = Transport::Exact;
        engine.simulate(&scene).expect("a run")
    };
    hold("exact transport", &plate(boxed()), &own, &exact);
}
