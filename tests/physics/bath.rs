//! A bath around the sample: what it takes of the light, by closed form, and what displaces it.

use crate::support::{CARBON, WATER, Worst, engine};
use beamlet::Backend;
use beamlet::scene::{Beam, Detector, MaterialSpec, Object, Scene, Shape, Source};

/// A point source, and pixels so far apart that each sees one thickness.
fn scene() -> Scene {
    let source = Source::new(1.21, [0.0; 2], Beam::Energy(30.0));
    let mut scene = Scene::new(source, Detector::new(1.8, [9, 1], [150e-6; 2]));
    for (name, [mu, delta]) in [("wet", WATER), ("rod", CARBON)] {
        scene.materials.insert(name.into(), MaterialSpec::Constants { mu, delta });
    }
    scene
}

#[test]
fn a_bath_takes_its_thickness_of_the_light_and_what_stands_in_it_displaces_it() {
    let engine = engine(Backend::Bvh);
    let (bath, slab) = (6e-3, 2e-3);
    let mut scene = scene();
    scene.fill_region(Shape::Box { size: [20e-3, bath, 20e-3] }, "wet");
    let alone = engine.simulate(&scene).expect("a bath");
    let box_of_carbon = Shape::Box { size: [10e-3, slab, 10e-3] };
    scene.objects.push(Object::new("slab", box_of_carbon, "rod"));
    let with = engine.simulate(&scene).expect("a slab in it");
    // Intensity 1 is the open value, and the flat is without the bath.
    assert!(alone.flat.iter().all(|it| (it - 1.0).abs() < 1e-6));
    // Between planes across the axis a ray is longer by its secant: at most 3e-7 here.
    let mut worst = Worst::new("bath and slab, closed form", 5e-6);
    let wet = (-WATER[0] * bath).exp();
    let both = (-WATER[0] * (bath - slab) - CARBON[0] * slab).exp();
    for (stack, want, what) in [(&alone, wet, "bath"), (&with, both, "slab in a bath")] {
        for ((.., column), got) in stack.sample.indexed_iter() {
            worst.take(f64::from(*got) - want, || format!("{what}, column {column}: {got}"));
        }
    }
    worst.holds();
}
