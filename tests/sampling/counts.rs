//! Numbers of lines and rays of the cases of `tests/bench/cases.py` before smaller detectors: a change of sampling that costs
//! more changes this table.

use crate::reference::scenes;
use crate::reference::silhouettes::bumpy;
use crate::reference::stack::Setup;
use crate::reference::surfaces::body;
use crate::support::{CARBON, engine, everything, root};
use beamlet::Backend;
use beamlet::scene::{Object, Scene, Shape};
use std::f64::consts::PI;

/// Largest part by which the rays of a case may differ from its row.
const PART: f64 = 0.1;

/// An experiment of the documentation before these pixels.
fn experiment(name: &str, pixels: [u32; 2]) -> Scene {
    let path = root().join("docs/experiments").join(name).join("scene.toml");
    let mut scene = Scene::load(path).expect("an experiment");
    scene.detector.pixels = pixels;
    scene
}

/// The prism of 2,048 sides, tilted by 10 degrees.
fn tilted() -> Scene {
    let mut scene = experiment("cylinder", [96, 4]);
    let sides = Some(2048);
    let shape = Shape::Cylinder { radius: 4e-3, height: 24e-3, sides };
    let mut prism = Object::new("tilted", shape, "carbon");
    prism.placement.rotate = vec![([0.0, 1.0, 0.0], PI / 18.0)];
    scene.objects = vec![prism];
    scene
}

/// The bumpy ball, a quarter as wide.
fn ball(masks: bool, pixels: u32, pitch: f64) -> Scene {
    let mut setup = Setup::paper([pixels; 2]);
    setup.pitch = [pitch; 2];
    let steps: Vec<f64> = (0..11).map(|step| 5e-6 * f64::from(step - 5)).collect();
    let ball = body(bumpy(1e-3, 5).rounded(), CARBON[0], CARBON[1]);
    if !masks {
        (setup.sample_mask, setup.detector_mask) = (None, None);
    }
    let mut scene = scenes::scene(&setup, &[ball], if masks { &steps } else { &[0.0] });
    scene.sampling.angle_tolerance = Some(2e-9);
    scene
}

/// The radiograph, which has most of the rays, with `BEAMLET_ALL`.
#[test]
fn rays_of_the_cases_are_those_of_the_table() {
    let mut cases = vec![
        ("cylinder", experiment("cylinder", [96, 4]), [320, 130]),
        ("tilted", tilted(), [1650, 3876]),
        ("bumpy", ball(true, 24, 150e-6), [11347, 6825]),
        ("bracket", experiment("bracket", [64, 12]), [9306, 26799]),
    ];
    if everything() {
        cases.push(("radio", ball(false, 96, 37.5e-6), [103_037, 62_191]));
    }
    let engine = engine(Backend::Bvh);
    let mut wrong = Vec::new();
    for (name, scene, expected) in cases {
        let tally = engine.simulate(&scene).expect("a run").record.tally;
        for (of, found, expected) in
            [("lines", tally.lines, expected[0]), ("rays", tally.rays, expected[1])]
        {
            println!("measured {name}: {found} {of}, {expected} in the table");
            if (found as f64 / f64::from(expected) - 1.0).abs() > PART {
                wrong.push(format!("{name}: {found} {of}, {expected} in the table"));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}
