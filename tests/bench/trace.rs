//! Tracing alone on five scenes: million rays per second of processor time (all cores), all
//! crossings of each ray. `--export DIR` writes triangles and rays for the peers in tests/peers/.

#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a benchmark stops at the first fault")]
#![allow(clippy::cast_possible_truncation, reason = "coordinates go to the peers as f32")]
#![allow(clippy::print_stdout, reason = "a table is the result")]

mod scenes;

use beamlet::{Backend, Engine, EngineOptions};
use std::fs;
use std::path::Path;
use std::time::Duration;

/// Rays per side of a scene.
const SIDE: u32 = 512;

fn main() {
    let arguments: Vec<String> = std::env::args().collect();
    let export = arguments.iter().position(|a| a == "--export").map(|i| arguments[i + 1].clone());
    println!("{:16}{:>12}{:>12}{:>14}{:>14}", "scene", "triangles", "hits/ray", "bvh", "ray-query");
    for name in scenes::NAMES {
        let soup = scenes::soup(name);
        let rays = scenes::rays(name, SIDE);
        if let Some(folder) = &export {
            write(Path::new(folder), name, &soup, &rays);
        }
        let triangles = soup.1.len();
        let scene = scenes::scene(soup);
        let mut rates = Vec::new();
        let mut hits = 0;
        for backend in [Backend::Bvh, Backend::RayQuery] {
            let options = EngineOptions { backend: Some(backend), ..EngineOptions::default() };
            let Ok(engine) = Engine::open(&options) else { continue };
            let Ok(simulation) = engine.prepare(&scene) else { continue };
            let laws = simulation.trace(&rays).unwrap();
            hits = laws.iter().map(|law| u64::from(law.crossings)).sum();
            let rate = (0..3)
                .map(|_| {
                    let before = processor_time();
                    simulation.trace(&rays).unwrap();
                    rays.len() as f64 / (processor_time() - before).as_secs_f64() / 1e6
                })
                .fold(0.0, f64::max);
            rates.push(rate);
        }
        let hits = hits as f64 / rays.len() as f64;
        let cell = |i: usize| rates.get(i).map_or("-".into(), |r| format!("{r:.3}"));
        println!("{name:16}{triangles:>12}{hits:>12.2}{:>14}{:>14}", cell(0), cell(1));
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
fn write(folder: &Path, name: &str, soup: &scenes::Soup, rays: &[beamlet::trace::Ray]) {
    fs::create_dir_all(folder).unwrap();
    let stem = name.replace([' ', ','], "");
    let corners: Vec<f32> = soup
        .1
        .iter()
        .flat_map(|t| t.map(|v| soup.0[v as usize].map(|c| c as f32)))
        .flatten()
        .collect();
    let rays: Vec<f32> = rays.iter().flat_map(|r| [r.x, r.z, r.slope_x, r.slope_z]).collect();
    fs::write(folder.join(format!("{stem}.triangles")), bytemuck::cast_slice(&corners)).unwrap();
    fs::write(folder.join(format!("{stem}.rays")), bytemuck::cast_slice(&rays)).unwrap();
}
