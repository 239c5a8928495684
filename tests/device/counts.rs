//! Counts of the work that tracing and whole runs give to a device with memory of its own: such a device is busy only
//! with few and large submissions.

use crate::support::{backends, engine_with};
use beamlet::internals::gpu::{Device, DeviceOptions, shaders};
use beamlet::internals::trace::{DeviceSample, MaterialTable, Ray, TraceKernels, Tracer};
use beamlet::scene::{Scene, Transport};
use beamlet::stack::ArraySink;
use beamlet::{Backend, Control, EngineOptions, RunProfile, geometry};
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
const BATCH: u32 = 512;

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

/// A rod and a box of facets: lines, and a few exact rays.
const ROD_AND_BOX: &str = r#"
source = { distance = "1.2 m", spot = "30 um", energy = "30 keV" }
detector = { distance = "1.8 m", pixels = [16, 16], pitch = "150 um" }
scan = { mask_offsets = ["0 um"] }
sampling = { tolerance = 1e-3 }
[[object]]
name = "rod"
shape = { cylinder = { radius = "0.2 mm", height = "2 mm" } }
material = "nylon 6"
[[object]]
name = "box"
shape = { box = { size = ["0.3 mm", "0.3 mm", "2 mm"] } }
position = ["-0.6 mm", "0 mm", "0 mm"]
material = "water"
"#;

/// A ball of facets before many pixels.
const BALL: &str = r#"
source = { distance = "1.2 m", spot = "30 um", energy = "30 keV" }
detector = { distance = "1.8 m", pixels = [128, 128], pitch = "18.75 um" }
scan = { mask_offsets = ["0 um"] }
sampling = { tolerance = 1e-3 }
[[object]]
name = "ball"
shape = { sphere = { radius = "0.7 mm", sides = 24 } }
material = "water"
"#;

/// Work of a staged run of equal views in bands of some rows, and the memory that was estimated for it.
fn work(views: usize, band_rows: u32) -> (RunProfile, u64) {
    let mut scene = Scene::from_toml(ROD_AND_BOX, ".").expect("a scene");
    scene.scan.angles = vec![0.2; views];
    work_of(&scene, EngineOptions::default().with_band_rows(band_rows))
}

/// Work of a staged run of a scene, and the memory that was estimated for it.
fn work_of(scene: &Scene, options: EngineOptions) -> (RunProfile, u64) {
    let options = options.with_backend(Backend::Bvh).with_staging(true).with_profile(true);
    let simulation = engine_with(options).prepare(scene).expect("a simulation");
    let record = simulation.run(&mut ArraySink::new(), Control::default()).expect("a run");
    (record.profile.expect("a profile"), simulation.memory().device_bytes)
}

/// Workgroups of all kernels.
fn groups(profile: &RunProfile) -> u64 {
    profile.all.kernels.values().map(|kernel| kernel.groups).sum()
}

#[test]
fn later_views_make_no_buffer_and_bands_divide_the_work_of_a_view() {
    let ((one, told), (four, _), (bands, _)) = (work(1, 16), work(4, 16), work(1, 4));
    let what = format!("{:?} {:?} {:?}", one.all, four.all, bands.all);
    let (first, all) = (one.all.traffic, four.all.traffic);
    assert_eq!(all.buffers, first.buffers, "{what}");
    // A view has the work of the first, its flat and set-up left out: 29 submissions when this was written, rounds of
    // lines and of exact rays.
    let of_view = |of: fn(beamlet::Traffic) -> u64| (of(all) - of(first)) / 3;
    assert!((1..=40).contains(&of_view(|it| it.submissions)), "{what}");
    assert!((1..=200_000).contains(&of_view(|it| it.bytes_to_device)), "{what}");
    assert!((1..=60_000).contains(&of_view(|it| it.bytes_to_host)), "{what}");
    let of_view = (groups(&four) - groups(&one)) / 3;
    assert!(of_view <= 120, "{of_view} workgroups: {what}");
    // Four bands have at most four times the submissions, and hardly more invocations.
    assert!(bands.all.traffic.submissions <= 4 * first.submissions, "{what}");
    assert!(groups(&bands) <= 4 * groups(&one), "{what}");
    // Buffers are those of the memory that is told, and a few small ones.
    let ratio = told as f64 / first.buffer_bytes as f64;
    assert!((0.8..1.25).contains(&ratio), "{told}: {what}");
}

#[test]
fn patches_share_the_submissions_of_their_rays() {
    let scene = Scene::from_toml(BALL, ".").expect("a scene");
    let all = work_of(&scene, EngineOptions::default()).0.all.traffic;
    // 75 when this was written, and 134 where each 1,024 patches had rounds of their own.
    assert!(all.submissions <= 90, "{all:?}");
    assert_eq!(all.waits, all.submissions, "{all:?}");
}
