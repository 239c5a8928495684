//! Tracing alone on five scenes: million rays per second of processor time (all cores), all
//! crossings of each ray.

#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a benchmark stops at the first fault")]
#![allow(clippy::print_stdout, reason = "a table is the result")]

mod scenes;

use beamlet::internals::gpu::{Device, DeviceOptions, shaders};
use beamlet::internals::trace::{DeviceSample, MaterialTable, Ray, TraceKernels, Tracer};
use beamlet::scene::{Scene, Transport};
use beamlet::{Backend, geometry};
use std::fs;
use std::sync::Arc;
use std::time::Duration;

/// Rays per side of a scene.
const SIDE: u32 = 512;

/// Attempts at a rate, the best of which counts, and the processor time of each.
const ATTEMPTS: u32 = 3;
const LEAST: Duration = Duration::from_millis(1000);

fn main() {
    println!(
        "{:16}{:>12}{:>12}{:>12}{:>12}{:>12}",
        "scene", "triangles", "crossings", "per ray", "bvh", "ray-query"
    );
    for name in scenes::NAMES {
        let soup = scenes::soup(name);
        let rays = scenes::rays(name, SIDE);
        let triangles = soup.1.len();
        let scene = scenes::scene(soup);
        let mut counts: Option<Vec<u32>> = None;
        let mut rates = [0.0; 2];
        for (backend, rate) in [Backend::Bvh, Backend::RayQuery].into_iter().zip(&mut rates) {
            // Not every device has ray query.
            let Some(mut tracer) = tracer(&scene, backend) else { continue };
            let results = tracer.trace(&rays).unwrap();
            let found: Vec<u32> = results.iter().map(|result| result.crossings).collect();
            assert!(counts.as_ref().is_none_or(|c| *c == found), "the backends differ on {name}");
            counts = Some(found);
            *rate = (0..ATTEMPTS).map(|_| rate_of(&mut tracer, &rays)).fold(0.0, f64::max);
        }
        let counts = counts.unwrap();
        let crossings: u64 = counts.iter().map(|&c| u64::from(c)).sum();
        let per_ray = crossings as f64 / rays.len() as f64;
        let [bvh, query] = rates;
        println!("{name:16}{triangles:>12}{crossings:>12}{per_ray:>12.2}{bvh:>12.3}{query:>12.3}");
    }
}

/// A tracer that stays, as in a run: its buffers are not part of what is measured.
fn tracer(scene: &Scene, backend: Backend) -> Option<Tracer> {
    let device = Device::open(&DeviceOptions { kernels: shaders::ALL, ..DeviceOptions::default() })
        .expect("a Vulkan device");
    let query = backend == Backend::RayQuery;
    if query && !device.description().ray_query {
        return None;
    }
    let sample = geometry::load(scene).unwrap();
    let media = MaterialTable::of(scene).unwrap();
    let sample = DeviceSample::upload(
        &device,
        scene,
        &sample,
        &beamlet::internals::geometry::across_edges(&sample),
        &media,
        query,
    )
    .unwrap();
    let kernels = Arc::new(TraceKernels::new(&device));
    let transport = Transport::FirstOrder;
    Tracer::new(&device, &kernels, &Arc::new(sample), backend, transport, None, u32::MAX).ok()
}

/// Million rays per second of processor time: rays from host memory, results back to it.
fn rate_of(tracer: &mut Tracer, rays: &[Ray]) -> f64 {
    let before = processor_time();
    let mut traced = 0;
    loop {
        tracer.trace(rays).unwrap();
        traced += rays.len();
        let passed = processor_time() - before;
        if passed >= LEAST {
            return traced as f64 / passed.as_secs_f64() / 1e6;
        }
    }
}

/// Processor time of this process, all threads.
fn processor_time() -> Duration {
    let stat = fs::read_to_string("/proc/self/stat").expect("Linux");
    let fields: Vec<&str> = stat.rsplit(')').next().unwrap().split_whitespace().collect();
    // User and system time in clock ticks of 10 ms.
    let ticks: u64 = fields[11].parse::<u64>().unwrap() + fields[12].parse::<u64>().unwrap();
    Duration::from_millis(10 * ticks)
}
