//! Rays traced in order against the f64 reference, which searches every triangle after every
//! bend: most of them within micrometres of silhouettes, where bent rays change facets.

#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "counts are small; rays are rounded to f32 as the engine takes them"
)]

use crate::assemblies::device_and_kernels;
use crate::reference::rays::{Order, Sample, Trace};
use crate::reference::scenes;
use crate::reference::silhouettes::{bumpy, cone, fibres, near_silhouettes, together, torus};
use crate::reference::stack::Setup;
use crate::reference::surfaces::{Body, Mesh, Random, body, cuboid, prism, sphere, wedge};
use crate::support::{CARBON, WATER, amount, backends, everything};
use beamlet::internals::gpu::Device;
use beamlet::internals::interface::{FLAG_EXACT, FLAG_UNBALANCED};
use beamlet::internals::trace::{
    DeviceSample, MaterialTable, Ray, RayResult, TraceKernels, Tracer,
};
use beamlet::scene::Transport;
use beamlet::{Backend, geometry};
use std::sync::Arc;

const SOURCE: f64 = 1.21;
const LEVER: f64 = 0.59;
/// Distance by which f32 may move a ray against the vertices, m.
const HAIR: f64 = 6e-10;

fn carbon(mesh: Mesh) -> Body {
    body(mesh.rounded(), CARBON[0], CARBON[1])
}

/// The bodies as the tracer takes them, past the checks of meshes that scenes pass through: those
/// take minutes on discs of thousands of slivers.
fn sample_of(bodies: &[Body]) -> geometry::Sample {
    let mut sample = geometry::Sample::default();
    for (object, Body { mesh, .. }) in (0..).zip(bodies) {
        let first = sample.vertices.len() as u32;
        sample.vertices.extend(&mesh.vertices);
        sample.triangles.extend(mesh.triangles.iter().map(|t| t.map(|v| v + first)));
        sample.triangle_component.resize(sample.triangles.len(), object);
        let outside = object.checked_sub(1);
        let mut component = geometry::Component::default();
        (component.object, component.outside) = (object, outside);
        (component.volume, component.area) = (mesh.volume(), mesh.area());
        sample.components.push(component);
    }
    sample
}

/// A device, for tracers of many samples.
struct Bench {
    device: Arc<Device>,
    kernels: Arc<TraceKernels>,
}

impl Bench {
    fn new() -> Self {
        let (device, kernels) = device_and_kernels();
        Self { device, kernels }
    }

    /// A tracer of bodies, each inside the one before it.
    fn tracer(&self, backend: Backend, bodies: &[Body], transport: Transport) -> Tracer {
        let mut setup = Setup::paper([16, 16]);
        (setup.sample_mask, setup.detector_mask) = (None, None);
        let mut scene = scenes::scene(&setup, bodies, &[0.0]);
        scene.sampling.transport = transport;
        let media = MaterialTable::of(&scene).expect("media");
        let query = backend == Backend::RayQuery;
        let sample = sample_of(bodies);
        let sample = DeviceSample::upload(
            &self.device,
            &scene,
            &sample,
            &beamlet::internals::geometry::across_edges(&sample),
            &media,
            query,
        );
        let sample = Arc::new(sample.expect("room"));
        Tracer::new(&self.device, &self.kernels, &sample, backend, transport, None, u32::MAX)
            .expect("a tracer")
    }

    fn end(self) {
        assert_eq!(self.device.validation_messages(), 0);
    }
}

/// The same ray in the reference, moved by a hair.
fn reference(sample: &Sample, ray: &Ray, by: [f64; 2]) -> Trace {
    let slope = [f64::from(ray.slope_x), f64::from(ray.slope_z)];
    let at = [f64::from(ray.x) + by[0], f64::from(ray.z) + by[1]];
    let from = [at[0] - SOURCE * slope[0], -SOURCE, at[1] - SOURCE * slope[1]];
    sample.trace(from, [slope[0], 1.0, slope[1]], LEVER, Order::Exact)
}

/// True if a result is that of the reference, or lies between those a hair beside the ray. Slopes
/// are held to 1e-6 of their change: facets side by side differ by 4e-4 at least.
fn is_true(sample: &Sample, ray: &Ray, result: &RayResult) -> bool {
    let got = [result.slope_x, result.slope_z, result.displacement_x, result.displacement_z]
        .map(f64::from);
    let [mut low, mut high] = [[f64::MAX; 4], [f64::MIN; 4]];
    let ways = [[0.0, 0.0], [HAIR, 0.0], [-HAIR, 0.0], [0.0, HAIR], [0.0, -HAIR]];
    ways.into_iter().any(|by| {
        let want = reference(sample, ray, by);
        let change = want.slope[0].hypot(want.slope[1]);
        let room = 1e-6 * change + want.crossings as f64 * 1e-11 / want.grazing.powi(2);
        let [s, d] = [want.slope, want.displacement];
        for (k, value) in [s[0], s[1], d[0], d[1]].into_iter().enumerate() {
            let room = if k < 2 { room } else { room * LEVER + 1e-6 * value.abs() };
            low[k] = low[k].min(value - room);
            high[k] = high[k].max(value + room);
        }
        (0..4).all(|k| low[k] <= got[k] && got[k] <= high[k])
    })
}

/// The scenes: name, bodies, and the share of flagged rays that may differ because the bent ray
/// meets what the straight one misses. Rays here crowd where that happens.
fn all() -> Vec<(String, Vec<Body>, f64)> {
    let mut all = Vec::new();
    for (i, sides) in [64, 300, 1024, 4096, 16_384].into_iter().enumerate() {
        for tilt in 0..8 {
            let [a, b] = [0.3 * f64::from(tilt - 4) + 0.01, 0.05 * f64::from(5 * tilt) + 0.013];
            let mesh = prism(2.7e-3, 8e-3, sides, 0.3);
            let mesh = mesh.turned([0.0, 1.0, 0.0], a).turned([1.0, 0.0, 0.0], b);
            if tilt < 8 >> (i / 3) {
                all.push((format!("prism of {sides} sides, tilt {tilt}"), vec![carbon(mesh)], 0.0));
            }
        }
    }
    // A wedge moves light by tens of nanometres before it gets to the rim behind: many facets.
    for (sides, tilt) in [(1024, 0.0), (4096, 0.2), (16_384, -0.1)] {
        let before = wedge(8e-3, 1.4, 8e-3).moved([-4e-3, -50e-3, 0.0]);
        let prism = prism(2.7e-3, 8e-3, sides, 0.3).turned([0.0, 1.0, 0.0], tilt);
        let both = carbon(together([before, prism].into_iter()));
        all.push((format!("prism of {sides} sides behind a wedge"), vec![both], 0.03));
    }
    let tilted = |mesh: Mesh, angle: f64| carbon(mesh.turned([1.0, 0.3, 0.2], angle));
    all.push(("cone".into(), vec![tilted(cone(3e-3, 5e-3, 500), 0.4)], 0.0));
    all.push(("torus".into(), vec![tilted(torus([2.5e-3, 0.8e-3], [120, 60]), 0.5)], 0.03));
    all.push(("thin torus".into(), vec![tilted(torus([2.5e-3, 0.1e-3], [400, 30]), 1.2)], 0.03));
    let hollow = body(sphere(1.98e-3, 5).rounded(), 0.0, 0.0);
    all.push(("shell".into(), vec![carbon(sphere(2e-3, 5)), hollow], 0.03));
    for angle in [1e-3, 4e-3, 0.02] {
        let plate = cuboid([0.2e-3, 6e-3, 5e-3]).turned([0.1, 0.0, 1.0], angle);
        all.push((format!("plate at {angle} rad"), vec![carbon(plate)], 0.0));
    }
    all.push(("bumpy sphere".into(), vec![carbon(bumpy(3e-3, 5))], 0.03));
    let water = body(sphere(1e-3, 4).rounded(), WATER[0], WATER[1]);
    all.push(("ball in a block".into(), vec![carbon(cuboid([4e-3; 3])), water], 0.0));
    for angle in [0.0_f64, 0.47] {
        let bundle = fibres(100, 2.5e-6, 16).turned([0.0, 0.0, 1.0], angle);
        all.push((format!("fibres at {angle} rad"), vec![carbon(bundle)], 0.03));
    }
    all
}

#[test]
fn rays_in_order_take_the_way_of_the_f64_reference() {
    let bench = Bench::new();
    for backend in backends() {
        // A driver's ray query is slower on a CPU.
        let most = if backend == Backend::Bvh { 150 } else { 15 };
        // The reference takes the time.
        let most = if everything() { most } else { most / 5 };
        let mut random = Random::new(31);
        let mut compared = 0;
        let mut failed = Vec::new();
        // It searches every triangle.
        let few = |bodies: &[Body]| bodies.iter().all(|it| it.mesh.triangles.len() < 60_000);
        for (name, bodies, allowed) in all().into_iter().filter(|it| everything() || few(&it.1)) {
            let sample = Sample::brute_force(&bodies, SOURCE, 0.0);
            let rays = near_silhouettes(&bodies, SOURCE, 2000, &mut random);
            let results =
                bench.tracer(backend, &bodies, Transport::Auto).trace(&rays).expect("results");
            let flagged =
                rays.iter().zip(&results).filter(|(_, result)| result.flags & FLAG_EXACT != 0);
            let flagged: Vec<(&Ray, &RayResult)> = flagged.take(most).collect();
            assert!(
                flagged.iter().all(|(_, result)| result.flags & FLAG_UNBALANCED == 0),
                "{name}"
            );
            let wrong: Vec<_> =
                flagged.iter().filter(|(ray, result)| !is_true(&sample, ray, result)).collect();
            println!("measured {backend}, {name}: {} of {} differ", wrong.len(), flagged.len());
            compared += flagged.len();
            // The only way to differ is what the bent ray meets and the straight one misses.
            let too_many = wrong.len() as f64 > (allowed * flagged.len() as f64).ceil();
            for (ray, result) in wrong {
                let want = reference(&sample, ray, [0.0; 2]);
                if too_many || want.crossings <= result.crossings as usize {
                    failed.push(format!("{backend}, {name}: {ray:?} {result:?} for {want:?}"));
                }
            }
        }
        assert!(compared > 20 * most, "{compared} rays in order");
        assert!(failed.is_empty(), "{failed:#?}");
    }
    bench.end();
}

/// Cylinders and prisms of many sides, tilted in x and z and towards the beam.
fn tilted() -> [(&'static str, Body); 3] {
    let axis = [0.342_f64, 0.278, -0.898];
    let away = (axis[0].hypot(axis[1])).atan2(axis[2]);
    let cylinder = prism(1.5e-3, 24e-3, 4096, 0.5).turned([-axis[1], axis[0], 0.0], away);
    let carbon_prism = |sides| {
        let prism = prism(2.7e-3, 24e-3, sides, 0.5);
        carbon(prism.turned([0.0, 1.0, 0.0], 17.0_f64.to_radians()).turned([1.0, 0.0, 0.0], 0.4))
    };
    [
        ("cylinder of 4,096 sides", body(cylinder.rounded(), 25.175, 2.4462e-7)),
        ("prism of 300 sides", carbon_prism(300)),
        ("prism of 2,048 sides", carbon_prism(2048)),
    ]
}

/// Traces rays beside the silhouettes of tilted prisms, all of them in order: each must leave
/// what it enters. Gives how many went in order, and how many of those needed another attempt.
fn follow_around_silhouettes(each: usize) -> [u64; 2] {
    let bench = Bench::new();
    let mut counts = [0; 2];
    for backend in backends() {
        let each = if backend == Backend::Bvh { each } else { each / 10 };
        for (name, prism) in tilted() {
            let bodies = [prism];
            let mut tracer = bench.tracer(backend, &bodies, Transport::Exact);
            let mut random = Random::new(41);
            let mut left = each;
            while left > 0 {
                let rays = near_silhouettes(&bodies, SOURCE, left.min(10_000), &mut random);
                tracer.trace(&rays).expect("results");
                left -= rays.len();
            }
            let tally = tracer.tally();
            let failed = [tally.unbalanced, tally.unordered, tally.dropped, tally.not_finite];
            assert_eq!(failed, [0; 4], "{backend}, {name}");
            counts[0] += tally.exact;
            counts[1] += tally.retraced;
        }
    }
    bench.end();
    counts
}

#[test]
fn no_ray_is_lost_at_the_silhouettes_of_tilted_prisms() {
    let each = amount(10_000, 60_000);
    let [exact, retraced] = follow_around_silhouettes(each);
    println!("measured rays in order: {exact}, traced again: {retraced}");
    assert!(
        exact >= 3 * each as u64 && retraced * 200 < exact,
        "{retraced} of {exact} traced again"
    );
}

#[test]
#[ignore = "a quarter of an hour of processor time"]
fn hundred_million_rays_in_order_leave_what_they_enter() {
    let [exact, _] = follow_around_silhouettes(33_000_000);
    assert!(exact >= 99_000_000, "{exact}");
}
