//! Scenes that seeds found, made small.

use super::case::Case;
use super::compare::{Limits, largest};
use super::runs::run;
use beamlet::Backend;
use beamlet::scene::{Beam, Detector, MaterialSpec, Object, Scene, Shape, Source};

/// A ball whose refraction along z changes over the one row of the detector, before a source without
/// height: light crosses the borders of the row unlike in its middle.
#[test]
fn light_crosses_row_borders_by_its_own_deflection() {
    let source = Source::new(0.09, [2e-6, 0.0], Beam::Energy(30.0));
    let mut scene = Scene::new(source, Detector::new(0.6, [6, 1], [12e-6; 2]));
    scene.materials.insert("glass".into(), MaterialSpec::Constants { mu: 1e4, delta: 1e-6 });
    let mut ball = Object::new("ball", Shape::Sphere { radius: 7.6e-6, sides: None }, "glass");
    ball.placement.position = [0.0, 0.0, 5e-6];
    scene.objects.push(ball);
    let mut case = Case { scene, places: vec![Vec::new()], roughness: vec![0.0] };
    let coarse = run(&case, Backend::Bvh).expect("a run");
    case.scene.sampling.tolerance = Some(3e-5);
    let fine = run(&case, Backend::Bvh).expect("a run");
    // 1e-3 is promised of pixels that a silhouette crosses; 1.3e-2 where light crosses a border as far
    // as it is bent in the middle of its rectangle.
    let limits = Limits { sample: 1e-3, flat: 0.0, rays: None };
    let worst = largest("sample", [&coarse.sample, &fine.sample], &limits);
    println!("measured rows of a ball: {worst}");
    assert!(worst.ratio() <= 1.0, "{worst}");
}
