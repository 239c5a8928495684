//! Objects that overlap, touch and coincide: at every point the one listed later wins.

#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "counts are small; rays are rounded to f32 as the engine takes them"
)]

mod cad;
mod contact;
mod overlap;

pub(crate) use contact::grazing_rays;

use crate::reference::rays::{Order, Sample, Trace};
use crate::reference::scenes;
use crate::reference::stack::Setup;
use crate::reference::surfaces::{Body, Random};
use beamlet::internals::gpu::{Device, DeviceOptions, shaders};
use beamlet::internals::interface::{
    FLAG_UNBALANCED, MOMENTS_BALANCE, MOMENTS_HEAD, MOMENTS_PATH, MOMENTS_PER_MATERIAL,
};
use beamlet::internals::trace::{
    CrossingFinder, DeviceSample, MaterialTable, Ray, RayResult, TraceKernels, Tracer,
};
use beamlet::scene::{Scene, Transport};
use beamlet::{Backend, geometry};
use std::sync::{Arc, OnceLock};

pub(super) const SOURCE: f64 = 1.21;
pub(super) const LEVER: f64 = 0.59;
/// Distance by which f32 may move a ray against the vertices, m.
pub(super) const HAIR: f64 = 1e-9;

/// A device, for tracers of many samples.
pub(super) struct Bench {
    device: Arc<Device>,
    kernels: Arc<TraceKernels>,
}

/// The device and the kernels of all benches: each kernel is made once.
pub(super) fn device_and_kernels() -> (Arc<Device>, Arc<TraceKernels>) {
    static SHARED: OnceLock<(Arc<Device>, Arc<TraceKernels>)> = OnceLock::new();
    let open = || {
        let validation = std::env::var_os("BEAMLET_VALIDATION").is_some();
        let device = Device::open(&DeviceOptions {
            validation,
            kernels: shaders::ALL,
            ..DeviceOptions::default()
        })
        .expect("a Vulkan device");
        let kernels = Arc::new(TraceKernels::new(&device));
        (device, kernels)
    };
    SHARED.get_or_init(open).clone()
}

impl Bench {
    pub(super) fn new() -> Self {
        let (device, kernels) = device_and_kernels();
        Self { device, kernels }
    }

    /// A scene as it is loaded for a run, on the device.
    pub(super) fn sample(&self, backend: Backend, scene: &Scene) -> Arc<DeviceSample> {
        let media = MaterialTable::of(scene).expect("media");
        let sample = geometry::load(scene).expect("a sample");
        let across = beamlet::internals::geometry::across_edges(&sample);
        let query = backend == Backend::RayQuery;
        let on_device = DeviceSample::upload(&self.device, scene, &sample, &across, &media, query);
        Arc::new(on_device.expect("room"))
    }

    /// A tracer of it.
    pub(super) fn tracer(&self, backend: Backend, scene: &Scene) -> Tracer {
        let sample = self.sample(backend, scene);
        let (kernels, transport) = (&self.kernels, scene.sampling.transport);
        let made = Tracer::new(&self.device, kernels, &sample, backend, transport, None, u32::MAX);
        made.expect("a tracer")
    }

    /// Sums of rays to first order through bodies of a material of its own each. Every ray is balanced at the first
    /// attempt.
    pub(super) fn traced(
        &self,
        backend: Backend,
        scene: &Scene,
        rays: &[Ray],
        bodies: usize,
    ) -> Vec<Traced> {
        let mut tracer = self.tracer(backend, scene);
        let (results, words) = tracer.trace_with_moments(rays).expect("results");
        let tally = tracer.tally();
        let failed = [tally.unbalanced, tally.not_finite, tally.dropped, tally.retraced];
        assert_eq!(failed, [0; 4], "{backend}");
        let of_each = words.chunks(MOMENTS_HEAD + (bodies + 1) * MOMENTS_PER_MATERIAL);
        let traced = |((ray, result), words): ((&Ray, RayResult), &[u32])| {
            assert_eq!(words[MOMENTS_BALANCE], 0, "{backend}, {ray:?}");
            // Material 0 is the surroundings.
            let at = |k: usize| MOMENTS_HEAD + (k + 1) * MOMENTS_PER_MATERIAL + MOMENTS_PATH;
            let paths = (0..bodies).map(|k| f32::from_bits(words[at(k)]).into()).collect();
            Traced { result, paths }
        };
        rays.iter().zip(results).zip(of_each).map(traced).collect()
    }

    /// Rays whose paths through bodies, slopes or displacements differ from the reference.
    pub(super) fn wrong_rays(
        &self,
        backend: Backend,
        scene: &Scene,
        rays: &[Ray],
        bodies: &[Body],
    ) -> Vec<String> {
        let sample = Sample::brute_force(bodies, SOURCE, 0.0);
        let traced = self.traced(backend, scene, rays, bodies.len());
        let wrong = rays.iter().zip(traced).filter(|(ray, it)| !is_true(&sample, ray, it));
        wrong
            .map(|(ray, it)| {
                format!("{ray:?} {it:?} for {:?}", reference(&sample, ray, [0.0; 2], Order::First))
            })
            .collect()
    }

    /// Finder of the crossings of a scene.
    pub(super) fn finder(&self, scene: &Scene) -> CrossingFinder {
        let sample = self.sample(Backend::Bvh, scene);
        CrossingFinder::new(&self.device, &self.kernels, &sample, 64, u32::MAX).expect("a finder")
    }

    pub(super) fn end(self) {
        assert_eq!(self.device.validation_messages(), 0);
    }
}

/// Sums of a ray, and its way through every body, m.
#[derive(Debug)]
pub(super) struct Traced {
    pub(super) result: RayResult,
    pub(super) paths: Vec<f64>,
}

pub(super) fn scene(bodies: &[Body], transport: Transport) -> Scene {
    let mut setup = Setup::paper([16, 16]);
    (setup.sample_mask, setup.detector_mask) = (None, None);
    let mut scene = scenes::scene(&setup, bodies, &[0.0]);
    scene.sampling.transport = transport;
    scene
}

/// The same ray in the reference, moved by a hair.
pub(super) fn reference(sample: &Sample, ray: &Ray, by: [f64; 2], order: Order) -> Trace {
    let slope = [f64::from(ray.slope_x), f64::from(ray.slope_z)];
    let at = [f64::from(ray.x) + by[0], f64::from(ray.z) + by[1]];
    let from = [at[0] - SOURCE * slope[0], -SOURCE, at[1] - SOURCE * slope[1]];
    sample.trace(from, [slope[0], 1.0, slope[1]], LEVER, order)
}

pub(super) fn random_rays(count: usize, random: &mut Random) -> Vec<Ray> {
    let one = |random: &mut Random| {
        let [x, z] = [0; 2].map(|_| random.between(-1.8e-3, 1.8e-3));
        let slope = |at: f64| (at / SOURCE) as f32;
        Ray { x: x as f32, z: z as f32, slope_x: slope(x), slope_z: slope(z), pose: 0, key: 0 }
    };
    (0..count).map(|_| one(random)).collect()
}

/// True if path lengths in every body, the displacement and the slope are those of the reference,
/// or between those a hair beside the ray.
fn is_true(sample: &Sample, ray: &Ray, Traced { result, paths }: &Traced) -> bool {
    let near = [[0.0, 0.0], [HAIR, 0.0], [-HAIR, 0.0], [0.0, HAIR], [0.0, -HAIR]]
        .map(|by| reference(sample, ray, by, Order::First));
    let middle = &near[0];
    let steep = near.iter().map(|it| it.grazing).fold(1.0, f64::min).max(1e-4);
    let met = middle.crossings.max(2) as f64;
    let values = |trace: &Trace| {
        let mut all = trace.path.clone();
        all.extend([trace.displacement[0], trace.displacement[1]]);
        all
    };
    let got =
        paths.iter().copied().chain([result.displacement_x, result.displacement_z].map(f64::from));
    got.enumerate().all(|(k, got)| {
        let all = near.iter().map(|trace| values(trace)[k]);
        let low = all.clone().fold(f64::MAX, f64::min);
        let high = all.fold(f64::MIN, f64::max);
        let room = if k < paths.len() {
            met * 2e-9 / steep
        } else {
            1e-13 + met * 6e-7 * LEVER * 3e-6 / steep
        };
        (low - room..=high + room).contains(&got)
    })
}

pub(super) fn exact(
    bench: &Bench,
    backend: Backend,
    scene: &Scene,
    rays: &[Ray],
) -> Vec<RayResult> {
    let mut tracer = bench.tracer(backend, scene);
    let results = tracer.trace(rays).expect("results");
    let tally = tracer.tally();
    let failed = [tally.unbalanced, tally.unordered, tally.dropped, tally.not_finite];
    assert_eq!(failed, [0; 4]);
    assert!(results.iter().all(|it| it.flags & FLAG_UNBALANCED == 0));
    results
}
