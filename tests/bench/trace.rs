//! Tracing alone on five scenes: million rays per second of processor time (all cores), all
//! crossings of each ray. `--export DIR` writes triangles, rays, crossings per ray and rates for
//! the peers in tests/peers/.

#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a benchmark stops at the first fault")]
#![allow(clippy::cast_possible_truncation, reason = "coordinates go to the peers as f32")]
#![allow(clippy::print_stdout, reason = "a table is the result")]

mod scenes;

use beamlet::internals::gpu::{Device, DeviceOptions, shaders};
use beamlet::internals::trace::{DeviceSample, MaterialTable, Ray, TraceKernels, Tracer};
use beamlet::scene::{Scene, Transport};
use beamlet::{Backend, geometry};
use std::fmt::Write;
use std::fs;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

/// Rays per side of a scene.
const SIDE: u32 = 512;

/// Attempts at a rate, the best of which counts, and the processor time of each.
const ATTEMPTS: u32 = 3;
const LEAST: Duration = Duration::from_millis(1000);

fn main() {
    let arguments: Vec<String> = std::env::args().collect();
    let export = arguments.iter().position(|a| a == "--export").map(|i| arguments[i + 1].clone());
    println!(
        "{:16}{:>12}{:>12}{:>12}{:>12}{:>12}",
        "scene", "triangles", "crossings", "per ray", "bvh", "ray-query"
    );
    let mut table = String::new();
    for name in scenes::NAMES {
        let soup = scenes::soup(name);
        let rays = scenes::rays(name, SIDE);
        let triangles = soup.1.len();
        let stem = name.replace([' ', ','], "");
        let place = export.as_ref().map(|folder| Path::new(folder).join(&stem));
        if let Some(place) = &place {
            write(place, &soup, &rays);
        }
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
        writeln!(table, "{stem}\t{crossings}\t{bvh:.4}\t{query:.4}").unwrap();
        if let Some(place) = &place {
            fs::write(place.with_extension("crossings"), bytemuck::cast_slice(&counts)).unwrap();
        }
    }
    if let Some(folder) = &export {
        fs::write(Path::new(folder).join("rates.tsv"), table).unwrap();
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

/// `NAME.triangles` (9 f32 each) and `NAME.rays` (x, z at y = 0, and their slopes, f32).
fn write(place: &Path, soup: &scenes::Soup, rays: &[Ray]) {
    fs::create_dir_all(place.parent().unwrap()).unwrap();
    let corners: Vec<f32> = soup
        .1
        .iter()
        .flat_map(|t| t.map(|v| soup.0[v as usize].map(|c| c as f32)))
        .flatten()
        .collect();
    let rays: Vec<f32> = rays.iter().flat_map(|r| [r.x, r.z, r.slope_x, r.slope_z]).collect();
    fs::write(place.with_extension("triangles"), bytemuck::cast_slice(&corners)).unwrap();
    fs::write(place.with_extension("rays"), bytemuck::cast_slice(&rays)).unwrap();
}
