//! Whole acquisitions: the first experiment, at reduced size, and how time grows with mask steps,
//! pixels, triangles and views. Reading the mesh, building the tree and compiling kernels are
//! left out except where the name says so; frames go to memory.

#![allow(clippy::unwrap_used, reason = "a benchmark stops at the first fault")]

#[path = "../reference/mod.rs"]
mod reference;

use beamlet::scene::{Mesh, Scene, ShapeOrMesh};
use beamlet::stack::ArraySink;
use beamlet::{Backend, Control, Engine, EngineOptions};
use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use reference::surfaces;
use std::time::Duration;

/// The first experiment with fewer pixels and steps.
fn experiment(pixels: u32, steps: u32) -> Scene {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/docs/experiments/cylinder/scene.toml");
    let mut scene = Scene::load(path).unwrap();
    scene.detector.pixels = [pixels; 2];
    let step = |i: u32| {
        let share = if steps > 1 { f64::from(i) / f64::from(steps - 1) } else { 0.5 };
        50e-6 * (share - 0.5)
    };
    scene.scan.mask_offsets = (0..steps).map(step).collect();
    scene
}

/// A ball of `20 * 4^levels` triangles instead of the cylinder, on few pixels: facets cost
/// refinement.
fn ball(levels: u32) -> Scene {
    let mut scene = experiment(16, 11);
    let mesh = surfaces::sphere(0.6e-3, levels);
    scene.objects[0].geometry =
        ShapeOrMesh::Mesh(Mesh::Arrays { vertices: mesh.vertices, triangles: mesh.triangles });
    scene
}

fn run(c: &mut Criterion) {
    let options = EngineOptions::default().with_backend(Backend::Bvh);
    let engine = Engine::open(&options).unwrap();
    let mut group = c.benchmark_group("acquisition");
    group.sample_size(10).warm_up_time(Duration::from_millis(500));
    group.measurement_time(Duration::from_secs(4));
    let whole = experiment(128, 11);
    group.bench_function("experiment, mesh read and prepared", |b| {
        b.iter(|| engine.simulate(&whole).unwrap());
    });
    group.finish();
    let mut slope = |over: &str, scenes: Vec<(u64, Scene)>| {
        let mut group = c.benchmark_group(over);
        group.sample_size(10).warm_up_time(Duration::from_millis(300));
        group.measurement_time(Duration::from_secs(2));
        for (size, scene) in scenes {
            let simulation = engine.prepare(&scene).unwrap();
            group.throughput(Throughput::Elements(size));
            group.bench_function(BenchmarkId::from_parameter(size), |b| {
                b.iter(|| {
                    let mut sink = ArraySink::new();
                    simulation.run(&mut sink, Control::default()).unwrap();
                    sink.into_stacks()
                });
            });
        }
        group.finish();
    };
    slope("steps", [1, 11, 21].map(|n| (n.into(), experiment(64, n))).into());
    slope("pixels", [64, 128, 256].map(|n| (u64::from(n).pow(2), experiment(n, 1))).into());
    slope("triangles", [2, 4, 6].map(|n| (20 * 4_u64.pow(n), ball(n))).into());
    let views = [1_u32, 4].map(|n| {
        let mut scene = experiment(64, 11);
        scene.scan.angles = (0..n).map(|i| 0.1 * f64::from(i)).collect();
        (n.into(), scene)
    });
    slope("views", views.into());
}

criterion_group!(benches, run);
criterion_main!(benches);
