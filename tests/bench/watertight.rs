//! Watertightness at scale: rays through vertices, edges and insides of ten kinds of closed
//! meshes; every object must be left as often as it was entered.
//!
//! `cargo bench --bench watertight -- [RAYS [FIRST]] [bvh|ray-query] [KIND...]`: `RAYS` in all
//! (1e7), on one backend (both), shared equally among the kinds of meshes (or some of them), the
//! rays of each from number `FIRST` (0) on. A ray is a function of its number: runs may be split
//! by numbers, kinds and backends. Fails where a ray stays unbalanced after re-tracing.

#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a benchmark stops at the first fault")]
#![allow(clippy::print_stdout, reason = "a table is the result")]
#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "small counts; rays are f32"
)]

use beamlet_reference as reference;
mod closed;

use beamlet::internals::gpu::{Device, DeviceOptions, shaders};
use beamlet::internals::interface::FLAG_UNBALANCED;
use beamlet::internals::trace::{DeviceSample, MaterialTable, Ray, TraceKernels, Tracer};
use beamlet::scene::{Scene, Transport};
use beamlet::{Backend, geometry};
use rayon::prelude::*;
use reference::scenes;
use reference::stack::Setup;
use reference::surfaces::{Body, Random};
use std::f64::consts::{FRAC_PI_2, FRAC_PI_4};
use std::ops::Range;
use std::sync::Arc;
use std::time::Instant;

/// Rays made and traced at once.
const CHUNK: u64 = 1 << 19;
/// Views; the sines and cosines of the first are exact.
const ANGLES: [f64; 4] = [0.0, FRAC_PI_2, FRAC_PI_4, 0.5];

fn main() {
    let arguments: Vec<String> =
        std::env::args().skip(1).filter(|a| !a.starts_with("--")).collect();
    let numbers: Vec<u64> =
        arguments.iter().filter_map(|a| a.parse::<f64>().ok()).map(|n| n as u64).collect();
    let rays = numbers.first().copied().unwrap_or(10_000_000);
    let first = numbers.get(1).copied().unwrap_or(0);
    let named = |name: &str| arguments.iter().any(|a| a == name);
    let both = [Backend::Bvh, Backend::RayQuery];
    let any_backend = both.iter().any(|b| named(&b.to_string()));
    let any_kind = closed::KINDS.iter().any(|(name, _)| named(name));
    for argument in &arguments {
        let known = both.iter().any(|b| b.to_string() == *argument)
            || closed::KINDS.iter().any(|(name, _)| name == argument);
        assert!(known || argument.parse::<f64>().is_ok(), "{argument}: no such kind or backend");
    }
    let kinds: Vec<_> = closed::KINDS.iter().filter(|(name, _)| !any_kind || named(name)).collect();
    println!(
        "{:10} {:24}{:>10}{:>14}{:>8}{:>16}{:>10}{:>12}{:>9}",
        "backend",
        "mesh",
        "triangles",
        "rays",
        "met",
        "crossings",
        "again",
        "unbalanced",
        "seconds"
    );
    let mut unbalanced = 0;
    for backend in both.into_iter().filter(|b| !any_backend || named(&b.to_string())) {
        let share = rays.div_ceil(kinds.len() as u64);
        let mut all = Counts::default();
        for (name, make) in &kinds {
            let bodies = make();
            let Some(counts) = trace(backend, &bodies, first..first + share) else {
                println!("{backend:10} the device has no ray query");
                break;
            };
            let triangles: usize = bodies.iter().map(|b| b.mesh.triangles.len()).sum();
            counts.print(backend, name, &triangles.to_string());
            all.add(&counts);
        }
        if kinds.len() > 1 {
            all.print(backend, "all", "");
        }
        unbalanced += all.unbalanced;
    }
    assert_eq!(unbalanced, 0, "rays left an object other than as often as they entered it");
}

/// Outcome of rays.
#[derive(Default)]
struct Counts {
    rays: u64,
    met: u64,
    crossings: u64,
    retraced: u64,
    unbalanced: u64,
    seconds: f64,
}

impl Counts {
    fn add(&mut self, other: &Self) {
        self.rays += other.rays;
        self.met += other.met;
        self.crossings += other.crossings;
        self.retraced += other.retraced;
        self.unbalanced += other.unbalanced;
        self.seconds += other.seconds;
    }

    fn print(&self, backend: Backend, name: &str, triangles: &str) {
        println!(
            "{:10} {name:24}{triangles:>10}{:>14}{:>7.1}%{:>16}{:>10}{:>12}{:>9.1}",
            backend.to_string(),
            self.rays,
            100.0 * self.met as f64 / self.rays as f64,
            self.crossings,
            self.retraced,
            self.unbalanced,
            self.seconds,
        );
    }
}

/// Traces rays, by number, through a kind of mesh; `None` where the device cannot.
fn trace(backend: Backend, bodies: &[Body], rays: Range<u64>) -> Option<Counts> {
    let device = Device::open(&DeviceOptions { kernels: shaders::ALL, ..DeviceOptions::default() })
        .expect("a Vulkan device");
    if backend == Backend::RayQuery && !device.description().ray_query {
        return None;
    }
    let mut tracer = tracer(&device, backend, &scene_of(bodies));
    let aim = Aim::of(bodies);
    let begin = Instant::now();
    let mut counts = Counts { rays: rays.end - rays.start, ..Counts::default() };
    for first in rays.clone().step_by(CHUNK as usize) {
        let last = rays.end.min(first + CHUNK);
        let chunk: Vec<Ray> = (first..last).into_par_iter().map(|i| aim.ray(i)).collect();
        for result in tracer.trace(&chunk).expect("results") {
            counts.met += u64::from(result.crossings > 0);
            counts.crossings += u64::from(result.crossings);
            counts.unbalanced += u64::from(result.flags & FLAG_UNBALANCED != 0);
        }
    }
    let tally = tracer.tally();
    assert_eq!(
        (tally.rays, tally.unbalanced),
        (counts.rays, counts.unbalanced),
        "the tally counts otherwise"
    );
    assert_eq!((tally.not_finite, tally.dropped), (0, 0));
    counts.retraced = tally.retraced;
    counts.seconds = begin.elapsed().as_secs_f64();
    Some(counts)
}

fn scene_of(bodies: &[Body]) -> Scene {
    let mut setup = Setup::paper([16, 16]);
    setup.sample_mask = None;
    let mut scene = scenes::scene(&setup, bodies, &[0.0]);
    scene.scan.angles = ANGLES.to_vec();
    scene.sampling.transport = Transport::FirstOrder;
    scene
}

/// A tracer of its own, so that its tally can be read.
fn tracer(device: &Arc<Device>, backend: Backend, scene: &Scene) -> Tracer {
    let sample = geometry::load(scene).expect("a sample");
    let media = MaterialTable::of(scene).expect("media");
    let query = backend == Backend::RayQuery;
    let sample = DeviceSample::upload(
        device,
        scene,
        &sample,
        &beamlet::internals::geometry::across_edges(&sample),
        &media,
        query,
    )
    .expect("room");
    let kernels = Arc::new(TraceKernels::new(device));
    let transport = Transport::FirstOrder;
    Tracer::new(device, &kernels, &Arc::new(sample), backend, transport, None, u32::MAX)
        .expect("a tracer")
}

/// Where rays are aimed at.
struct Aim {
    /// Two corners of every triangle.
    edges: Vec<[[f64; 3]; 2]>,
    low: [f64; 2],
    high: [f64; 2],
}

impl Aim {
    fn of(bodies: &[Body]) -> Self {
        let mut aim = Self { edges: Vec::new(), low: [1e3; 2], high: [-1e3; 2] };
        for body in bodies {
            for triangle in 0..body.mesh.triangles.len() {
                let [a, b, c] = body.mesh.corners(triangle);
                aim.edges.extend([[a, b], [b, c], [c, a]]);
                for (p, k) in [a, b, c].iter().flat_map(|p| [(p[0], 0), (p[2], 1)]) {
                    aim.low[k] = aim.low[k].min(p);
                    aim.high[k] = aim.high[k].max(p);
                }
            }
        }
        aim
    }

    /// Ray number `i`: a third at vertices, at edges or a hair beside them; a third on a grid of
    /// round coordinates; a third at random, in every view. Sixteen in a row go to one place,
    /// which lets subgroups work together.
    fn ray(&self, i: u64) -> Ray {
        let (block, within) = (i / 16, i % 16);
        let mut place = Random::new(block.wrapping_mul(0xd134_2543_de82_ef95));
        let mut random = Random::new(!i.wrapping_mul(0xaf25_1af3_b0f0_25b5));
        let slope = |p: f64| if block / 3 % 2 == 0 { 0.0 } else { p / 1.21 };
        let size = [self.high[0] - self.low[0], self.high[1] - self.low[1]];
        match block % 3 {
            0 => {
                let [a, b] = self.edges[(place.next() * self.edges.len() as f64) as usize];
                let share = [0.0, 0.5, random.next(), random.next()][(within % 4) as usize];
                let hair = [0.0, 0.0, 1e-10, -1e-9][(within / 4) as usize];
                let p: Vec<f64> = (0..3).map(|k| a[k] * (1.0 - share) + b[k] * share).collect();
                let slopes = [slope(p[0]), slope(p[2])];
                ray(p[0] - slopes[0] * p[1] + hair, p[2] - slopes[1] * p[1], slopes, 0)
            }
            1 => {
                // Multiples of a power of two, about 4,096 across the mesh.
                let step = (size[0] / 4096.0).log2().floor().exp2();
                let mut at = |k: usize, by: u64| {
                    let first = ((self.low[k] + place.next() * size[k]) / step).round();
                    (first + by as f64) * step
                };
                let (x, z) = (at(0, within % 4), at(1, within / 4));
                let slopes = [0.0, 2.0_f64.powi(-10), -2.0_f64.powi(-10)];
                let slopes = [slopes[(block / 3 % 3) as usize], slopes[(block / 9 % 3) as usize]];
                ray(x, z, slopes, (block / 27 % 2) as u32)
            }
            _ => {
                let mut at = |k: usize| {
                    self.low[k] + size[k] * (place.next() + 1e-3 * (random.next() - 0.5))
                };
                let (x, z) = (at(0), at(1));
                ray(x, z, [slope(x), slope(z)], (block / 6 % 4) as u32)
            }
        }
    }
}

fn ray(x: f64, z: f64, slope: [f64; 2], view: u32) -> Ray {
    Ray {
        x: x as f32,
        z: z as f32,
        slope_x: slope[0] as f32,
        slope_z: slope[1] as f32,
        pose: view,
        key: 0,
    }
}
