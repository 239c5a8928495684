//! Counts of the work that tracing gives to a device with memory of its own: such a device is busy only with
//! few and large submissions.

use crate::support::backends;
use beamlet::internals::gpu::{Device, DeviceOptions, shaders};
use beamlet::internals::trace::{DeviceSample, MaterialTable, Ray, TraceKernels, Tracer};
use beamlet::scene::{Scene, Transport};
use beamlet::{Backend, geometry};
use std::sync::Arc;

/// A rough rod beside a smooth ball of facets and a box: rays of all of them are traced again, by other
/// walks or exactly.
const BODIES: &str = r#"
source = { distance = "1.2 m", spot = "30 um", energy = "30 keV" }
detector = { distance = "1.8 m", pixels = [16, 16], pitch = "150 um" }
scan = { mask_offsets = ["0 um"] }
[[object]]
name = "rod"
shape = { cylinder = { radius = "0.2 mm", height = "2 mm" } }
roughness = 0.02
material = "nylon 6"
[[object]]
name = "ball"
shape = { sphere = { radius = "0.3 mm", sides = 24 } }
normals = "smooth"
position = ["0.6 mm", "0 mm", "0 mm"]
material = "water"
[[object]]
name = "box"
shape = { box = { size = ["0.3 mm", "0.3 mm", "2 mm"] } }
position = ["-0.6 mm", "0 mm", "0 mm"]
material = "water"
"#;

/// Rays of a batch.
const BATCH: u32 = 2048;

/// Parallel rays across all bodies.
fn rays(count: u32) -> Vec<Ray> {
    let ray = |i: u32| {
        let x = -1e-3 + 2e-3 * i as f32 / count as f32;
        Ray { x, z: 1e-5 * (i % 7) as f32, slope_x: 0.0, slope_z: 0.0, pose: 0, key: 0 }
    };
    (0..count).map(ray).collect()
}

fn tracer(device: &Arc<Device>, backend: Backend, transport: Transport) -> Tracer {
    let scene = Scene::from_toml(BODIES, ".").expect("a scene");
    let media = MaterialTable::of(&scene).expect("media");
    let sample = geometry::load(&scene).expect("a sample");
    let across = beamlet::internals::geometry::across_edges(&sample);
    let query = backend == Backend::RayQuery;
    let sample = DeviceSample::upload(device, &scene, &sample, &across, &media, query);
    let sample = Arc::new(sample.expect("room"));
    let kernels = Arc::new(TraceKernels::new(device));
    Tracer::new(device, &kernels, &sample, backend, transport, Some(BATCH), u32::MAX)
        .expect("a tracer")
}

#[test]
fn a_batch_of_rays_is_one_submission_and_makes_no_buffer() {
    let options =
        DeviceOptions { staging: true, kernels: shaders::ALL, ..DeviceOptions::default() };
    let device = Device::open(&options).expect("a Vulkan device");
    for backend in backends() {
        for transport in [Transport::FirstOrder, Transport::Auto, Transport::Exact] {
            let mut tracer = tracer(&device, backend, transport);
            let rays = rays(5 * BATCH);
            // The first makes the kernels, and the buffers that transfers keep.
            tracer.trace(&rays).expect("results");
            let before = device.traffic();
            tracer.trace(&rays).expect("results");
            let found = device.traffic().since(before);
            // A ray that the driver's search loses is traced again in a second submission of its batch.
            let most = if backend == Backend::Bvh { 5 } else { 10 };
            let what = format!("{backend} {transport:?}: {found:?}");
            assert!((5..=most).contains(&found.submissions), "{what}");
            assert!(found.waits == found.submissions && found.buffers == 0, "{what}");
            let of_rays = 5 * u64::from(BATCH) * size_of::<Ray>() as u64;
            assert!((of_rays..of_rays + 5 * 600).contains(&found.bytes_to_device), "{what}");
            let exact = tracer.tally().exact;
            assert_eq!(exact > 0, transport != Transport::FirstOrder, "{what}: {exact} exact");
        }
    }
}
