//! beamlet inside another program: a scene built in code, stacks as `ndarray` arrays.
//!
//! ```text
//! cargo run --release --no-default-features --example embed
//! ```
//!
//! `default-features = false` leaves out the command line and its crates.

use beamlet::scene::{
    Beam, Detector, MaskBody, MaskSpec, MaterialSpec, Object, Scene, Shape, Source,
};
use beamlet::stack::ArraySink;
use beamlet::{Control, Engine, EngineOptions, Progress, ViewProgress};
use std::io::Write;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let scene = scene();

    // A device is opened once and serves many scenes.
    let engine = Engine::open(&EngineOptions::default())?;

    // Progress comes on this thread. What is not set stays at its default.
    let mut report = |progress: Progress| {
        // Other kinds report the steps before the first ray.
        if let Progress::Views(ViewProgress { rows_done, rows_total, rays, .. }) = progress {
            let _ = writeln!(std::io::stderr(), "{rows_done} of {rows_total} rows, {rays} rays");
        }
    };
    let control = Control::default().with_progress(&mut report);

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
    let source = Source::new(source, [30e-6, 26e-6], Beam::Energy(30.0));
    let mut scene = Scene::new(source, Detector::new(detector, [64, 4], [pitch, pitch]));
    let thickness = 225e-6;
    let gold = MaskBody::Bars { material: "gold".into(), thickness };
    // One period of either mask is one pixel on the detector.
    let period = |distance: f64| pitch * distance / detector;
    // The back face of the detector mask lies on the detector.
    let detector_mask = detector - thickness / 2.0;
    scene.sample_mask = Some(MaskSpec::new(sample_mask, period(sample_mask), 20e-6, gold.clone()));
    scene.detector_mask = Some(MaskSpec::new(detector_mask, period(detector_mask), 30e-6, gold));
    scene.scan.mask_offsets = (-5..=5).map(|step| f64::from(step) * 5e-6).collect();
    let carbon = MaterialSpec::Formula { formula: "C".into(), density: 2.0 };
    scene.materials.insert("carbon fibre".into(), carbon);
    let cylinder = Shape::Cylinder { radius: 4e-3, height: 16e-3, sides: Some(2048) };
    scene.objects.push(Object::new("rod", cylinder, "carbon fibre"));
    scene
}

fn mean<'a>(values: impl ExactSizeIterator<Item = &'a f32>) -> f64 {
    let count = values.len() as f64;
    values.map(|&value| f64::from(value)).sum::<f64>() / count
}
