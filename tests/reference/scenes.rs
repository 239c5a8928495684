//! The same set-up and bodies as a scene of the engine: plain data only.

use super::masks::{Bars, Mask};
use super::stack::Setup;
use super::surfaces::Body;
use beamlet::scene::{
    Beam, Detector, MaskBody, MaskSpec, MaterialSpec, Mesh, Object, Placement, Sampling, Scan,
    Scene, ShapeOrMesh, Source,
};
use std::collections::BTreeMap;

/// A scene with `bodies` in it, every constant given by number, one view at angle 0.
pub(crate) fn scene(setup: &Setup, bodies: &[Body], offsets: &[f64]) -> Scene {
    let mut materials = BTreeMap::new();
    let mut add = |name: String, mu: f64, delta: f64| {
        materials.insert(name.clone(), MaterialSpec::Constants { mu, delta });
        name
    };
    let mut spec = |mask: &Mask, name: &str| MaskSpec {
        distance: mask.distance,
        period: mask.period,
        aperture: mask.aperture,
        // The setup's origin is the aperture nearest the axis; the scene's is the lattice of
        // aperture k at (k + 1/2 - C/2) periods.
        offset: mask.origin
            - if setup.pixels[0].is_multiple_of(2) { 0.5 * mask.period } else { 0.0 },
        body: match mask.bars {
            Bars::Boxes { mu, thickness } => {
                MaskBody::Bars { material: add(name.to_owned(), mu, 0.0), thickness }
            }
            Bars::Sheet { transmission } => MaskBody::Sheet { transmission },
        },
    };
    let sample_mask = setup.sample_mask.as_ref().map(|m| spec(m, "bars before the sample"));
    let before_detector = setup.detector_mask.map(|m| on_detector(m, setup.detector_distance));
    let detector_mask = before_detector.as_ref().map(|m| spec(m, "bars before the detector"));
    let objects = bodies.iter().enumerate().map(|(i, body)| Object {
        name: format!("body {i}"),
        geometry: ShapeOrMesh::Mesh(Mesh::Arrays {
            vertices: body.mesh.vertices.clone(),
            triangles: body.mesh.triangles.clone(),
        }),
        material: add(format!("material {i}"), body.mu, body.delta),
        placement: Placement::default(),
        sha256: None,
        allow_defects: false,
    });
    let objects = objects.collect();
    Scene {
        directory: ".".into(),
        source: Source {
            distance: setup.source_distance,
            spot: setup.spot.into(),
            beam: Beam::Energy(30.0),
        },
        detector: Detector::new(setup.detector_distance, setup.pixels, setup.pitch),
        sample_mask,
        detector_mask,
        sampling: Sampling::default(),
        scan: Scan { mask_offsets: offsets.to_vec(), angles: vec![0.0] },
        materials,
        surroundings: "vacuum".to_owned(),
        files: BTreeMap::new(),
        objects,
    }
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
