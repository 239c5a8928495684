//! Cells where a rough face is met near grazing incidence: rays draw their normals there.

use crate::support::{engine, root};
use beamlet::Backend;
use beamlet::scene::Scene;

/// The octagon of docs/experiments with one of its edges in the middle of few pixels.
fn scene(angles: &[f64]) -> Scene {
    let path = root().join("docs/experiments/octagon/scene.toml");
    let sets = [
        "sampling.scheme=cells",
        "sampling.max_rays=5000",
        "detector.pixels=[9, 1]",
        "object[0].roughness=0.001",
        "object[0].position=[\"-5011.6 um\", \"-11.9 um\", \"0 mm\"]",
    ];
    let mut scene = Scene::load_with(path, &sets.map(str::to_owned)).expect("a scene");
    scene.scan.angles = angles.iter().map(|angle| angle.to_radians()).collect();
    scene
}

#[test]
fn light_changes_evenly_with_the_angle() {
    let engine = engine(Backend::Bvh);
    let step = 0.001;
    let angles: Vec<f64> = (0..8).map(|view| 22.815 + step * f64::from(view)).collect();
    let stacks = engine.simulate(&scene(&angles)).expect("a run");
    let values = stacks.sample.mapv(f64::from);
    let (mut moved, mut worst): (f64, f64) = (0.0, 0.0);
    for pixel in 0..9 {
        let light: Vec<f64> = (0..8).map(|view| values[[view, 0, 0, pixel]]).collect();
        // A straight line, by least squares, over an arc on which the face moves by 3 % of an aperture.
        let at: Vec<f64> = (0..8).map(|view| f64::from(view) - 3.5).collect();
        let mean = light.iter().sum::<f64>() / 8.0;
        let slope = at.iter().zip(&light).map(|(x, y)| x * y).sum::<f64>() / 42.0;
        let off = at.iter().zip(&light).map(|(x, y)| (y - mean - slope * x).abs());
        worst = worst.max(off.fold(0.0, f64::max));
        moved = moved.max((7.0 * slope).abs());
    }
    // Draws of 5,000 rays leave some 3e-5. A wide rectangle at the edge of the face left 3e-3.
    assert!(moved > 2e-3, "the face moves by {moved:e} of open beam");
    assert!(worst < 1.5e-4, "light leaves a straight line by {worst:e} of open beam");
}
