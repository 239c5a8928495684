//! The same set-up and bodies as a scene of the engine: plain data only.

use super::masks::{Bars, Mask};
use super::stack::Setup;
use super::surfaces::Body;
use beamlet::scene::{
    Beam, Detector, MaskBody, MaskSpec, MaterialSpec, Mesh, Object, Scene, Source,
};
use std::collections::BTreeMap;

/// A scene with `bodies` in it, every constant given by number, one view at angle 0.
pub fn scene(setup: &Setup, bodies: &[Body], offsets: &[f64]) -> Scene {
    let mut materials = BTreeMap::new();
    let mut add = |name: String, mu: f64, delta: f64| {
        materials.insert(name.clone(), MaterialSpec::Constants { mu, delta });
        name
    };
    let mut spec = |mask: &Mask, name: &str| {
        let body = match mask.bars {
            Bars::Boxes { mu, thickness } => {
                MaskBody::Bars { material: add(name.to_owned(), mu, 0.0), thickness }
            }
            Bars::Sheet { transmission } => MaskBody::Sheet { transmission },
        };
        let mut spec = MaskSpec::new(mask.distance, mask.period, mask.aperture, body);
        // The setup's origin is the aperture nearest the axis; the scene's is the lattice of
        // aperture k at (k + 1/2 - C/2) periods.
        let half = if setup.pixels[0].is_multiple_of(2) { 0.5 * mask.period } else { 0.0 };
        spec.offset = mask.origin - half;
        spec
    };
    let sample_mask = setup.sample_mask.as_ref().map(|m| spec(m, "bars before the sample"));
    let before_detector = setup.detector_mask.map(|m| on_detector(m, setup.detector_distance));
    let detector_mask = before_detector.as_ref().map(|m| spec(m, "bars before the detector"));
    let objects = bodies.iter().enumerate().map(|(i, body)| {
        let (vertices, triangles) = (body.mesh.vertices.clone(), body.mesh.triangles.clone());
        let mesh = Mesh::Arrays { vertices, triangles };
        Object::new(format!("body {i}"), mesh, add(format!("material {i}"), body.mu, body.delta))
    });
    let objects = objects.collect();
    let source = Source::new(setup.source_distance, setup.spot, Beam::Energy(30.0));
    let detector = Detector::new(setup.detector_distance, setup.pixels, setup.pitch);
    let mut scene = Scene::new(source, detector);
    (scene.sample_mask, scene.detector_mask) = (sample_mask, detector_mask);
    scene.scan.mask_offsets = offsets.to_vec();
    (scene.materials, scene.objects) = (materials, objects);
    scene
}

/// Bars whose centre would stand on the detector have their back face on it in a scene, and count
/// as at the detector: seen from the source, apertures are where they were.
fn on_detector(mut mask: Mask, detector: f64) -> Mask {
    if let Bars::Boxes { thickness, .. } = mask.bars
        && mask.distance == detector
    {
        mask.distance = detector - 0.5 * thickness;
        let scale = mask.distance / detector;
        mask.period *= scale;
        mask.aperture *= scale;
        mask.origin *= scale;
    }
    mask
}
