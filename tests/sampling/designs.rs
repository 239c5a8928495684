//! Designs that are lit from one walk, against their own runs.

use crate::support::{Worst, backends, engine, engine_of};
use beamlet::internals::designs::{WalkKey, light};
use beamlet::scene::{MaskBody, Scene};
use beamlet::stack::Stacks;
use beamlet::{Backend, Cancel, Control, EngineOptions, Error};

/// Error that sampling may leave in a value, share of open beam.
const TOLERANCE: f64 = 1e-4;

/// A tilted block of six facets, and a cylinder and a ball without facets that overlap.
const BLOCK: &str = "[[object]]\nname = \"block\"\nmaterial = \"nylon 6\"\n\
    rotate = [{ axis = [0, 1, 0], angle = \"11 deg\" }, { axis = [0, 0, 1], angle = \"25 deg\" }]\n\
    shape = { box = { size = [\"1.1 mm\", \"0.8 mm\", \"0.5 mm\"] } }\n";
const ROUND: &str = "[[object]]\nname = \"rod\"\nmaterial = \"nylon 6\"\n\
    rotate = [{ axis = [0, 1, 0], angle = \"35 deg\" }]\n\
    shape = { cylinder = { radius = \"0.3 mm\", height = \"2 mm\" } }\n\
    [[object]]\nname = \"ball\"\nmaterial = \"PMMA\"\nposition = [\"0.35 mm\", \"0 mm\", \"0.1 mm\"]\n\
    shape = { sphere = { radius = \"0.25 mm\" } }\n";

/// Some 1,600 balls in a cube: rays that are spread evenly.
const FOAM: &str = "[sampling]\ntolerance = 1e-3\n\
    [[object]]\nname = \"foam\"\nmaterial = \"nylon 6\"\nshape = { sphere = { radius = \"15 um\" } }\n\
    instances = { packing = \"spheres\", fill = 0.3, \
    region = { box = { size = [\"0.4 mm\", \"0.6 mm\", \"0.3 mm\"] } } }\n";

/// The set-up of the paper with a design of apertures, projected um, and offsets, um.
fn scene(objects: &str, [sample, detector]: [f64; 2], reach: f64, count: u32) -> Scene {
    let masks = include_str!("../support/masks.toml");
    let sets = [
        format!("sample_mask.projected_aperture={sample} um"),
        format!("detector_mask.projected_aperture={detector} um"),
        "sampling.audit=0".to_owned(),
    ];
    let text = format!(
        "{masks}\n[detector]\ndistance = \"1.8 m\"\npixels = [16, 6]\npitch = \"150 um\"\n[scan]\n\
         mask_offsets = {{ from = \"-{reach} um\", to = \"{reach} um\", count = {count} }}\n{objects}"
    );
    Scene::from_toml_with(&text, ".", &sets).expect("a scene")
}

/// Apertures x offsets: 20 designs.
fn designs(objects: &str) -> Vec<Scene> {
    let mut all = Vec::new();
    for sample in [18.0, 24.0, 30.0, 36.0, 45.0] {
        for (detector, reach, count) in
            [(20.0, 25.0, 11), (30.0, 25.0, 11), (30.0, 18.0, 7), (42.0, 32.0, 9)]
        {
            all.push(scene(objects, [sample, detector], reach, count));
        }
    }
    all
}

fn lit(options: EngineOptions, scenes: &[Scene]) -> Vec<Stacks> {
    let lead = engine_of(options).prepare(&scenes[0]).expect("a simulation");
    let simulations = lead.of_designs(scenes, &Cancel::default()).expect("designs");
    light(&simulations, Control::default()).expect("light")
}

/// Both the light of one walk and that of an own run are within the tolerance of the true light, with independent
/// lines; most values are far within, and the largest difference of some 20,000 values is that of the worst patch.
#[test]
fn designs_of_one_walk_have_the_light_of_their_own_runs() {
    let mut worst = Worst::new("light of one walk less that of an own run", TOLERANCE);
    for backend in backends() {
        let options = EngineOptions::default().with_backend(backend);
        for (name, objects) in [("block", BLOCK), ("round", ROUND)] {
            let scenes = designs(objects);
            let scenes: Vec<Scene> = scenes.into_iter().step_by(3).collect();
            for (scene, together) in scenes.iter().zip(lit(options.clone(), &scenes)) {
                let alone = engine(backend).simulate(scene).unwrap();
                assert_eq!(together.flat.dim(), alone.flat.dim());
                let flats = together.flat.iter().zip(&alone.flat);
                let samples = together.sample.iter().zip(&alone.sample);
                for (place, (a, b)) in flats.chain(samples).enumerate() {
                    worst.take(f64::from(a - b), || format!("{name}, {backend}, value {place}"));
                }
            }
        }
    }
    worst.holds();
}

/// Bars that let different shares of the light through are judged apart, and offsets shifted against one another, which
/// have as wide openings, do not depend on their order.
#[test]
fn designs_behind_bars_that_leak_have_the_light_of_their_own_runs() {
    let behind = |transmissions: [f64; 2]| {
        let mut scene = scene(ROUND, [30.0, 30.0], 25.0, 11);
        let masks = [&mut scene.sample_mask, &mut scene.detector_mask];
        for (mask, transmission) in masks.into_iter().flatten().zip(transmissions) {
            mask.body = MaskBody::Sheet { transmission };
        }
        scene
    };
    let mut shifted = behind([0.0; 2]);
    shifted.scan.mask_offsets.iter_mut().for_each(|offset| *offset += 5e-6);
    let scenes =
        [behind([0.0, 0.02]), behind([0.0, 0.5]), behind([0.2, 0.0]), behind([0.0; 2]), shifted];
    let keys: Vec<_> = scenes.iter().map(|scene| WalkKey::of(scene).unwrap()).collect();
    assert!(keys.iter().all(|key| key.is_some() && *key == keys[0]));
    let mut worst = Worst::new("light behind bars that leak less that of an own run", TOLERANCE);
    let options = EngineOptions::default().with_backend(Backend::Bvh);
    let together = lit(options.clone(), &scenes);
    let backwards: Vec<Scene> = scenes.iter().rev().cloned().collect();
    let backwards = lit(options, &backwards);
    for ((scene, own), reversed) in scenes.iter().zip(together).zip(backwards.iter().rev()) {
        assert_eq!(own.sample, reversed.sample);
        let alone = engine(Backend::Bvh).simulate(scene).unwrap();
        for (place, (a, b)) in own.sample.iter().zip(&alone.sample).enumerate() {
            worst.take(f64::from(a - b), || format!("value {place}"));
        }
    }
    worst.holds();
}

/// Patches of many bodies aim at 0.4 of the tolerance; rays of one walk and of an own run are independent.
#[test]
fn foams_of_one_walk_have_the_light_of_their_own_runs() {
    let scenes: Vec<Scene> = designs(FOAM).into_iter().step_by(6).collect();
    let mut worst = Worst::new(
        "root mean square of the light of one walk less that of an own run, over the tolerance",
        0.4 * 2.0_f64.sqrt(),
    );
    let options = EngineOptions::default().with_backend(Backend::Bvh);
    for (scene, together) in scenes.iter().zip(lit(options, &scenes)) {
        let alone = engine(Backend::Bvh).simulate(scene).unwrap();
        let pairs = together.sample.iter().zip(&alone.sample);
        let squares: Vec<f64> = pairs
            .filter(|(a, b)| a.to_bits() != b.to_bits())
            .map(|(a, b)| f64::from(a - b).powi(2))
            .collect();
        assert!(squares.len() > 100, "{} values behind the foam", squares.len());
        let rms = (squares.iter().sum::<f64>() / squares.len() as f64).sqrt();
        worst.take(rms / 1e-3, || format!("{} values", squares.len()));
    }
    worst.holds();
}

/// Lines and rays are chosen by the worst of all designs at each place, not for each design.
#[test]
fn twenty_designs_take_about_the_rays_and_lines_of_one() {
    for (name, objects) in [("block", BLOCK), ("round", ROUND), ("foam", FOAM)] {
        let scenes = designs(objects);
        let keys: Vec<_> = scenes.iter().map(|scene| WalkKey::of(scene).unwrap()).collect();
        assert!(keys[0].is_some() && keys.iter().all(|key| *key == keys[0]));
        let backend = EngineOptions::default().with_backend(Backend::Bvh);
        let all = lit(backend.clone(), &scenes)[0].record.tally;
        // The design in the middle.
        let one = lit(backend, &scenes[9..10])[0].record.tally;
        let [of_all, of_one] = [all, one].map(|tally| tally.rays + tally.lines);
        println!("{name}: {of_all} rays and lines of 20 designs, {of_one} of one");
        assert!(of_one > 500, "{name}");
        assert!(2 * of_all <= 3 * of_one, "{name}: {of_all} of 20 designs, {of_one} of one");
    }
}

/// No bit of the light of designs depends on bands, batches, memory, and the order of the designs.
#[test]
fn light_of_designs_does_not_depend_on_bands_batches_and_order() {
    let scenes: Vec<Scene> = designs(ROUND).into_iter().step_by(4).collect();
    let options = EngineOptions::default().with_backend(Backend::Bvh);
    let whole = lit(options.clone(), &scenes);
    let cut = lit(options.clone().with_band_rows(2).with_batch_rays(100), &scenes);
    let little = lit(options.clone().with_memory_limit(Some(300 << 20)), &scenes);
    let backwards: Vec<Scene> = scenes.iter().rev().cloned().collect();
    let backwards = lit(options, &backwards);
    for (((whole, cut), little), reversed) in
        whole.iter().zip(cut).zip(little).zip(backwards.iter().rev())
    {
        assert_eq!(whole.sample, cut.sample);
        assert_eq!(whole.sample, little.sample);
        assert_eq!(whole.sample, reversed.sample);
    }
}

/// Scenes that differ in what moves rays have no walk in common; a walk ends where it is cancelled.
#[test]
fn other_distances_are_another_walk_and_a_cancelled_walk_ends() {
    let one = scene(BLOCK, [30.0, 30.0], 25.0, 11);
    let changes: [fn(&mut Scene); 3] = [
        |scene| scene.detector.distance = 1.9,
        |scene| scene.objects[0].material = "PMMA".into(),
        |scene| scene.detector.pixels = [16, 8],
    ];
    for change in changes {
        let mut other = one.clone();
        change(&mut other);
        assert!(WalkKey::of(&other).unwrap() != WalkKey::of(&one).unwrap());
    }
    let simulations = engine(Backend::Bvh)
        .prepare(&one)
        .unwrap()
        .of_designs(&[one.clone(), one], &Cancel::default())
        .unwrap();
    let cancel = Cancel::default();
    cancel.cancel();
    let ended = light(&simulations, Control::default().with_cancel(cancel));
    assert!(matches!(ended, Err(Error::Interrupted)));
}
