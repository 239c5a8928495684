//! A mask as a mesh, traced as an object, against the mask that is evaluated analytically.

use crate::support::{Worst, engine};
use beamlet::geometry::NamedMesh;
use beamlet::scene::{
    Beam, Detector, MaskBody, MaskSpec, MaterialSpec, Mesh, Object, Scene, Source,
};
use beamlet::{Backend, MaskMeshOptions, MaskPlace, mask_meshes};

/// Each side keeps its own budget: the object the accuracy of silhouettes, 1e-3 of open beam, which
/// every pixel here has; the analytic bars 2e-5.
const SILHOUETTES: f64 = 1e-3;
/// Source to the mask, to the rotation centre of the scene with it, and to the detector, m.
const DISTANCES: [f64; 3] = [1.2, 1.21, 1.8];
const COLUMNS: u32 = 96;
const PITCH: f64 = 12.5e-6;
const THICKNESS: f64 = 225e-6;

/// A mask of bars of 80 um and apertures of 20 um, seen by pixels of a twelfth of its period.
fn scene(mu: f64, delta: f64) -> Scene {
    let [mask, centre, detector] = DISTANCES;
    let source = Source::new(centre, [10e-6, 8e-6], Beam::Energy(30.0));
    let mut scene = Scene::new(source, Detector::new(detector, [COLUMNS, 2], [PITCH; 2]));
    scene.materials.insert("bars".into(), MaterialSpec::Constants { mu, delta });
    let body = MaskBody::Bars { material: "bars".into(), thickness: THICKNESS };
    let mut spec = MaskSpec::new(mask, 100e-6, 20e-6, body);
    spec.offset = 7e-6;
    scene.sample_mask = Some(spec);
    scene
}

/// The same with the bars of the mask as an object in its place. The rotation centre is there: cells
/// blur what stands in the plane of the rotation centre as the spot does.
fn as_object(scene: &Scene) -> Scene {
    let options = MaskMeshOptions::default();
    let meshes = mask_meshes(scene, MaskPlace::Sample, &options).expect("a mask");
    let NamedMesh { vertices, triangles, .. } = meshes.into_iter().next().expect("bars");
    let mut scene = scene.clone();
    scene.sample_mask = None;
    scene.source.distance = DISTANCES[0];
    scene.objects.push(Object::new("bars", Mesh::Arrays { vertices, triangles }, "bars"));
    scene
}

/// Largest difference over the pixels, and the mean of the analytic mask.
fn compared(worst: &mut Worst, analytic: &Scene) -> f64 {
    let engine = engine(Backend::Bvh);
    let flat = engine.simulate(analytic).expect("the mask").flat;
    let sample = engine.simulate(&as_object(analytic)).expect("its mesh").sample;
    for ((step, row, column), mask) in flat.indexed_iter() {
        let mesh = sample[[0, step, row, column]];
        worst.take(f64::from(mesh) - f64::from(*mask), || {
            format!("row {row}, column {column}: {mesh} for {mask}")
        });
    }
    flat.iter().map(|it| f64::from(*it)).sum::<f64>() / flat.len() as f64
}

#[test]
fn bars_without_refraction_match_the_analytic_mask() {
    // Opaque, and leaking 39 %: shadows of thick bars and what shines through them.
    for (mu, leak, what) in [
        (53_122.0, 6.4e-6, "mask as a mesh, opaque, no refraction"),
        (4_185.0, 0.39_f64, "mask as a mesh, leaking, no refraction"),
    ] {
        let mut worst = Worst::new(what, SILHOUETTES);
        let mean = compared(&mut worst, &scene(mu, 0.0));
        // A fifth is open, less what the walls shade; a mask that is not there would be 1.
        assert!((mean - (0.2 + 0.8 * leak)).abs() < 0.02, "{mean}");
        worst.holds();
    }
}

#[test]
fn walls_of_gold_reflect_at_most_the_light_that_hits_them() {
    // Light at an angle to the axis meets a strip of one wall of each aperture, as wide as the
    // thickness times that angle, and is reflected there, where the analytic mask has it pass in a
    // straight line. What is reflected at x in the mask lands at M x - 2 (M - 1) x = x / 2: that of
    // one aperture to a pixel, and on the detector as far as twice its half from the axis.
    let angle = f64::from(COLUMNS) * PITCH / DISTANCES[0];
    let strip = THICKNESS * angle / (PITCH * DISTANCES[0] / DISTANCES[2]);
    let mut worst = Worst::new("mask as a mesh, of gold", SILHOUETTES + strip);
    compared(&mut worst, &scene(53_122.0, 3.5424e-6));
    worst.holds();
}

/// Walls of 20 mrad are steeper than the fan of the rays, of half a milliradian less steep.
#[test]
fn tapered_bars_without_refraction_match_the_analytic_mask() {
    let mut worst = Worst::new("tapered mask as a mesh, no refraction", SILHOUETTES);
    for (mu, taper) in [(53_122.0, 0.02_f64), (4_185.0, -0.02), (4_185.0, 0.5e-3)] {
        let mut analytic = scene(mu, 0.0);
        analytic.sample_mask.as_mut().expect("a mask").taper = taper.atan();
        let mean = compared(&mut worst, &analytic);
        let straight = compared(&mut worst, &scene(mu, 0.0));
        // Opaque walls narrow slits by their whole shadow.
        let shaded = THICKNESS * taper.abs() / 100e-6;
        assert!(
            mu < 50_000.0 || (straight - mean - shaded).abs() < 0.2 * shaded,
            "{mean} {straight}"
        );
    }
    worst.holds();
}
