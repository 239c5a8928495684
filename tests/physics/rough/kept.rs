//! Kept moments of a rough body: what it spreads is kept by pairs of materials.

use super::light::{MONO, SPECTRUM, plates};
use crate::support::kept::{again, keep};
use crate::support::{amount, engine, engine_with, sample};
use beamlet::scene::{MaterialSpec, Refine};
use beamlet::stack::Stacks;
use beamlet::{Backend, EngineOptions};
use ndarray::Array4;

fn mean_off(a: &Stacks, b: &Stacks) -> f64 {
    let off: Array4<f64> = (&a.sample - &b.sample).mapv(|off| f64::from(off.abs()));
    off.sum() / off.len() as f64
}

#[test]
fn rough_bodies_are_illuminated_again() {
    let few = |beam| {
        let mut scene = plates(beam);
        scene.sampling.max_rays = 500;
        scene.detector.pixels[0] = amount(10, 24);
        scene
    };
    let run = few(MONO);
    let directory = tempfile::tempdir().expect("a folder");
    let path = directory.path().join("run");
    let options = EngineOptions::default().with_backend(Backend::Bvh).with_keep_moments(true);
    let keeping = engine_with(options);
    let kept = keep(&keeping, &run, &path);
    let engine = engine(Backend::Bvh);
    // Nothing is traced again here: the empty sample of this run must not say what a ray keeps.
    let same = again(&engine, &kept, kept.scene()).expect("a run");
    let fresh = keeping.simulate(&run).expect("a run");
    assert_eq!(same.flat, fresh.flat);
    assert_eq!(same.sample, fresh.sample);
    let mut steps = run.clone();
    steps.scan.mask_offsets = vec![-7e-6, 11e-6];
    let mut denser = run.clone();
    let beryllium = MaterialSpec::Formula { formula: "Be".to_owned(), density: 2.2 };
    denser.materials.insert("matter".to_owned(), beryllium);
    let changes = vec![("steps", steps), ("density", denser), ("spectrum", few(SPECTRUM))];
    for (change, scene) in sample(changes, 2) {
        let got = again(&engine, &kept, &scene).expect("a run");
        let want = engine.simulate(&scene).expect("a run");
        let mut smooth = scene.clone();
        smooth.objects[0].roughness = 0.0;
        let seen = mean_off(&engine.simulate(&smooth).expect("a run"), &want);
        let off = mean_off(&got, &want);
        assert!(seen > 1e-4, "{change}: roughness is seen: {seen:e}");
        // As of smooth bodies: cells were refined for the run's own set-up.
        println!("measured {change}: {off:e} of {seen:e}");
        assert!(off < 2e-5, "{change}: {off:e} of {seen:e}");
    }
}

/// Rays that the device chooses: light is of the normals that they drew. Moments do not depend on the mask offsets.
#[test]
fn rough_bodies_whose_rays_the_device_chooses_are_illuminated_again() {
    let mut scene = plates(MONO);
    scene.sampling.max_rays = 500;
    scene.detector.pixels[0] = 10;
    scene.sampling.refine = Refine::Device;
    let directory = tempfile::tempdir().expect("a folder");
    let options = EngineOptions::default().with_backend(Backend::Bvh).with_keep_moments(true);
    let keeping = engine_with(options);
    let kept = keep(&keeping, &scene, &directory.path().join("run"));
    let mut steps = scene.clone();
    steps.scan.mask_offsets = vec![-7e-6, 11e-6];
    let engine = engine(Backend::Bvh);
    for (change, scene) in [("none", scene), ("steps", steps)] {
        let got = again(&engine, &kept, &scene).expect("a run");
        assert_eq!(got.sample, keeping.simulate(&scene).expect("a run").sample, "{change}");
        let mut by_host = scene.clone();
        by_host.sampling.refine = Refine::Host;
        let mut smooth = by_host.clone();
        smooth.objects[0].roughness = 0.0;
        let want = engine.simulate(&by_host).expect("a run");
        let seen = mean_off(&engine.simulate(&smooth).expect("a run"), &want);
        let off = mean_off(&got, &want);
        println!("measured {change}, device: {off:e} of {seen:e}");
        assert!(seen > 1e-4, "{change}: roughness is seen: {seen:e}");
        assert!(off < 2e-5, "{change}: {off:e} of {seen:e}");
    }
}
