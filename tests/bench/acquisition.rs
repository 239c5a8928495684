//! Whole acquisitions: the first experiment, at reduced size, and how time grows with mask steps,
//! pixels, triangles and views. Reading the mesh, building the tree and compiling kernels are
//! left out except where the name says so; frames go to memory. The best time of the attempts counts.

#![allow(clippy::unwrap_used, reason = "a benchmark stops at the first fault")]
#![allow(clippy::print_stdout, reason = "a table is the result")]

use beamlet::scene::{Mesh, Scene, ShapeOrMesh, Spot, SpotPart, Transport};
use beamlet::stack::ArraySink;
use beamlet::{Backend, Control, Engine, EngineOptions};
use beamlet_reference as reference;
use reference::surfaces;
use std::time::Instant;

/// Repetitions of each acquisition.
const ATTEMPTS: usize = 10;

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

/// Prints the shortest time of `acquire`, in ms, and that time per unit of `size`, in us.
fn time(name: &str, size: u64, mut acquire: impl FnMut()) {
    acquire();
    let attempts = (0..ATTEMPTS).map(|_| {
        let began = Instant::now();
        acquire();
        began.elapsed().as_secs_f64()
    });
    let best = attempts.fold(f64::INFINITY, f64::min);
    println!("{name:40}{size:>10}{:>12.2}{:>12.3}", 1e3 * best, 1e6 * best / size as f64);
}

/// Prints the device time of lines of 500 rays, 23 frequencies, 11 steps and 3 pixels beyond their trace.
/// `LP_NUM_THREADS=1` makes it processor time.
fn lines_of_waves(options: &EngineOptions) {
    let engine = Engine::open(&options.clone().with_profile(true)).unwrap();
    let mut scene = experiment(128, 11);
    scene.detector.pixels = [128, 4];
    scene.scan.mask_offsets = (0..11).map(|i| 3.4e-6 * (f64::from(i) / 5.0 - 1.0)).collect();
    scene.source.spot = Spot::gaussians(vec![SpotPart::new(1.0, [90e-6, 0.0], [0.0; 2])]);
    scene.sampling.transport = Transport::Wave;
    let profile = engine.simulate(&scene).unwrap().record.profile.unwrap();
    for name in ["wave_line", "wave_field"] {
        let kernel = profile.all.kernels[name];
        let milliseconds = 1e3 * kernel.seconds.unwrap_or(f64::NAN);
        println!("{name:40}{:>10}{milliseconds:>12.2}", kernel.groups);
    }
}

fn main() {
    let options = EngineOptions::default().with_backend(Backend::Bvh);
    let engine = Engine::open(&options).unwrap();
    println!("{:40}{:>10}{:>12}{:>12}", "acquisition", "size", "ms", "us / size");
    let whole = experiment(128, 11);
    time("experiment, mesh read and prepared", 1, || drop(engine.simulate(&whole).unwrap()));
    let slope = |over: &str, scenes: Vec<(u64, Scene)>| {
        for (size, scene) in scenes {
            let simulation = engine.prepare(&scene).unwrap();
            time(over, size, || {
                let mut sink = ArraySink::new();
                simulation.run(&mut sink, Control::default()).unwrap();
                drop(sink.into_stacks());
            });
        }
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
    // Upright cylinder: one line for each beamlet and row.
    let waves = [1, 11].map(|steps| {
        let mut scene = experiment(64, steps);
        scene.detector.pixels = [64, 4];
        scene.sampling.transport = Transport::Wave;
        (u64::from(steps), scene)
    });
    slope("steps by waves", waves.into());
    lines_of_waves(&options);
}
