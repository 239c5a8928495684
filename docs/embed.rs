//! beamlet inside another program: a scene built in code, stacks as `ndarray` arrays.
//!
//! ```text
//! cargo run --release --no-default-features --example embed
//! ```
//!
//! `default-features = false` leaves out the command line and its crates.

use beamlet::scene::{
    Beam, Detector, MaskBody, MaskSpec, MaterialSpec, Object, Placement, Sampling, Scan, Scene,
    Shape, ShapeOrMesh, Source,
};
use beamlet::stack::ArraySink;
use beamlet::{Control, Engine, EngineOptions, Progress, ViewProgress};
use std::collections::BTreeMap;
use std::io::Write;
use std::path::PathBuf;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let scene = scene();

    // A device is opened once and serves many scenes.
    let engine = Engine::open(&EngineOptions::default())?;

    // Progress comes on this thread. `cancel` and `skip` stay at their defaults.
    let mut report = |progress: Progress| {
        // Other kinds tell of what comes before the first ray.
        if let Progress::Views(ViewProgress { rows_done, rows_total, rays, .. }) = progress {
            let _ = writeln!(std::io::stderr(), "{rows_done} of {rows_total} rows, {rays} rays");
        }
    };
    let control = Control { progress: Some(&mut report), ..Control::default() };

    // Any `Sink` will do; this one keeps everything in memory. `engine.simulate(&scene)` is
    // the short form for those who want neither progress nor cancelling.
    let mut sink = ArraySink::new();
    engine.run(&scene, &mut sink, control)?;
    let stacks = sink.into_stacks().ok_or("the run did not finish")?;

    let mut out = std::io::stdout().lock();
    writeln!(out, "device  {}", stacks.record.device)?;
    writeln!(out, "flat    {:?}, mean {:.5}", stacks.flat.shape(), mean(stacks.flat.iter()))?;
    writeln!(out, "sample  {:?}, mean {:.5}", stacks.sample.shape(), mean(stacks.sample.iter()))?;
    Ok(())
}

/// A carbon cylinder of 8 mm between two gold masks, at 11 mask offsets. Metres, radians, keV.
fn scene() -> Scene {
    let pitch = 150e-6;
    let (source, sample_mask, detector) = (1.21, 1.2, 1.8);
    let gold = MaskBody::Bars { material: "gold".into(), thickness: 225e-6 };
    Scene {
        // Where relative paths of meshes and tables start; this scene has none.
        directory: PathBuf::from("."),
        source: Source { distance: source, spot: [30e-6, 26e-6].into(), beam: Beam::Energy(30.0) },
        detector: Detector::new(detector, [64, 4], [pitch, pitch]),
        sample_mask: Some(MaskSpec {
            distance: sample_mask,
            // One period of either mask is one pixel on the detector.
            period: pitch * sample_mask / detector,
            aperture: 20e-6,
            offset: 0.0,
            body: gold.clone(),
        }),
        detector_mask: Some(MaskSpec {
            // Its back face lies on the detector.
            distance: detector - 225e-6 / 2.0,
            period: pitch * (detector - 225e-6 / 2.0) / detector,
            aperture: 30e-6,
            offset: 0.0,
            body: gold,
        }),
        sampling: Sampling::default(),
        scan: Scan {
            mask_offsets: (-5..=5).map(|step| f64::from(step) * 5e-6).collect(),
            angles: vec![0.0],
        },
        materials: BTreeMap::from([(
            "carbon fibre".into(),
            MaterialSpec::Formula { formula: "C".into(), density: 2.0 },
        )]),
        surroundings: "vacuum".into(),
        files: BTreeMap::new(),
        objects: vec![Object {
            name: "rod".into(),
            geometry: ShapeOrMesh::Shape(Shape::Cylinder {
                radius: 4e-3,
                height: 16e-3,
                sides: 2048,
            }),
            material: "carbon fibre".into(),
            placement: Placement::default(),
            sha256: None,
            allow_defects: false,
        }],
    }
}

fn mean<'a>(values: impl ExactSizeIterator<Item = &'a f32>) -> f64 {
    let count = values.len() as f64;
    values.map(|&value| f64::from(value)).sum::<f64>() / count
}
