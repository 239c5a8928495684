//! Objects that overlap, touch and coincide: at every point the one listed later wins.

#![expect(clippy::cast_possible_truncation, reason = "rays are rounded to f32 as the engine's are")]

use crate::reference::rays::{Order, Sample, Trace};
use crate::reference::scenes;
use crate::reference::stack::Setup;
use crate::reference::surfaces::{Body, Mesh, Random, body, cuboid, prism, sphere};
use crate::support::{CARBON, WATER, Worst, backends};
use beamlet::internals::gpu::{Device, DeviceOptions};
use beamlet::internals::interface::{
    FLAG_REFLECTED, FLAG_UNBALANCED, MOMENTS_HEAD, MOMENTS_PATH, MOMENTS_PER_MATERIAL,
};
use beamlet::internals::trace::{
    DeviceSample, MaterialTable, Ray, RayResult, TraceKernels, Tracer,
};
use beamlet::scene::{MaterialSpec, Scene, Transport};
use beamlet::{Backend, geometry};
use std::sync::Arc;

const SOURCE: f64 = 1.21;
const LEVER: f64 = 0.59;
/// What f32 may move a ray by against the vertices, m.
const HAIR: f64 = 1e-9;

/// A device, for tracers of many samples.
struct Bench {
    device: Arc<Device>,
    kernels: Arc<TraceKernels>,
}

impl Bench {
    fn new() -> Self {
        let validation = std::env::var_os("BEAMLET_VALIDATION").is_some();
        let device = Device::open(&DeviceOptions { validation, ..DeviceOptions::default() })
            .expect("a Vulkan device");
        let kernels = Arc::new(TraceKernels::new(&device));
        Self { device, kernels }
    }

    /// A tracer of a scene as it is loaded for a run.
    fn tracer(&self, backend: Backend, scene: &Scene) -> Tracer {
        let media = MaterialTable::of(scene).expect("media");
        let sample = geometry::load(scene).expect("a sample");
        let across = geometry::across_edges(&sample);
        let query = backend == Backend::RayQuery;
        let on_device =
            DeviceSample::upload(&self.device, scene, &sample, &across, &media, query, 1.0)
                .expect("room");
        let on_device = Arc::new(on_device);
        let transport = scene.sampling.transport;
        let tracer = Tracer::new(
            &self.device,
            &self.kernels,
            &on_device,
            backend,
            transport,
            None,
            u32::MAX,
        );
        tracer.expect("a tracer")
    }

    fn end(self) {
        assert_eq!(self.device.validation_messages(), 0);
    }
}

/// Way of a ray through every body, of a material of its own each, from the words of moments.
fn paths_of(words: &[u32], ray: usize, bodies: usize) -> Vec<f64> {
    // Material 0 is the surroundings.
    let of_ray =
        &words[ray * (MOMENTS_HEAD as usize + (bodies + 1) * MOMENTS_PER_MATERIAL as usize)..];
    let of_material = |k: usize| MOMENTS_HEAD as usize + (k + 1) * MOMENTS_PER_MATERIAL as usize;
    let path = |k: usize| f32::from_bits(of_ray[of_material(k) + MOMENTS_PATH as usize]);
    (0..bodies).map(|k| path(k).into()).collect()
}

fn scene(bodies: &[Body], transport: Transport) -> Scene {
    let mut setup = Setup::paper([16, 16]);
    (setup.sample_mask, setup.detector_mask) = (None, None);
    let mut scene = scenes::scene(&setup, bodies, &[0.0]);
    scene.sampling.transport = transport;
    scene
}

/// The same ray in the reference, moved by a hair.
fn reference(sample: &Sample, ray: &Ray, by: [f64; 2], order: Order) -> Trace {
    let slope = [f64::from(ray.slope_x), f64::from(ray.slope_z)];
    let at = [f64::from(ray.x) + by[0], f64::from(ray.z) + by[1]];
    let from = [at[0] - SOURCE * slope[0], -SOURCE, at[1] - SOURCE * slope[1]];
    sample.trace(from, [slope[0], 1.0, slope[1]], LEVER, order)
}

/// One of the shapes, turned at random, of a material of its own.
fn random_body(random: &mut Random) -> Body {
    let size = random.between(0.3e-3, 1.5e-3);
    let mesh = match (random.next() * 4.0) as u32 {
        0 => cuboid([size, random.between(0.2e-3, 2e-3), random.between(0.2e-3, 2e-3)]),
        1 => prism(size, random.between(0.5e-3, 3e-3), 3 + (random.next() * 40.0) as u32, 0.3),
        2 => sphere(size, 1),
        _ => sphere(size, 2),
    };
    let axis = [random.next(), random.next() - 0.5, random.next() + 0.1];
    let place = [0; 3].map(|_| random.between(-1e-3, 1e-3));
    let mesh = mesh.turned(axis, random.between(0.0, 6.0)).moved(place);
    body(mesh.rounded(), random.between(5.0, 80.0), random.between(1e-7, 6e-7))
}

/// Bodies one face of which lies on the first one's, in parts or wholly, or the first once more.
fn touching_body(first: [f64; 3], turn: ([f64; 3], f64), random: &mut Random) -> Body {
    let half = first.map(|it| 0.5 * it);
    let size = [0, 1, 2]
        .map(|k| if random.next() < 0.4 { first[k] } else { first[k] * random.between(0.2, 1.5) });
    let axis = (random.next() * 3.0) as usize;
    let mut place = [0, 1, 2].map(|k| half[k] * random.between(-1.0, 1.0));
    // Outside against a face, inside against it, or across it.
    place[axis] = match (random.next() * 3.0) as u32 {
        0 => half[axis] + 0.5 * size[axis],
        1 => half[axis] - 0.5 * size[axis],
        _ => half[axis],
    };
    let mesh = cuboid(size).moved(place).turned(turn.0, turn.1);
    body(mesh.rounded(), random.between(5.0, 80.0), random.between(1e-7, 6e-7))
}

fn random_bodies(random: &mut Random) -> Vec<Body> {
    let count = 2 + (random.next() * 3.0) as usize;
    if random.next() < 0.5 {
        return (0..count).map(|_| random_body(random)).collect();
    }
    let first = [0; 3].map(|_| random.between(0.5e-3, 2e-3));
    let turn =
        ([1.0, random.next(), random.next()], random.between(0.0, 3.0) * random.next().round());
    let mut bodies = vec![body(cuboid(first).turned(turn.0, turn.1).rounded(), 51.0, 4.6e-7)];
    bodies.extend((1..count).map(|_| touching_body(first, turn, random)));
    if random.next() < 0.3 {
        bodies.push(random_body(random));
    }
    bodies
}

fn random_rays(count: usize, random: &mut Random) -> Vec<Ray> {
    let one = |random: &mut Random| {
        let [x, z] = [0; 2].map(|_| random.between(-1.8e-3, 1.8e-3));
        let slope = |at: f64| (at / SOURCE) as f32;
        Ray { x: x as f32, z: z as f32, slope_x: slope(x), slope_z: slope(z), view: 0 }
    };
    (0..count).map(|_| one(random)).collect()
}

/// Whether path lengths in every body, the displacement and the slope are those of the reference,
/// or between those a hair beside the ray.
fn is_true(sample: &Sample, ray: &Ray, result: &RayResult, paths: &[f64]) -> bool {
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

#[test]
fn where_bodies_overlap_the_later_one_wins_along_every_ray() {
    let bench = Bench::new();
    let (scenes, rays_each) = (400, 200);
    for backend in backends() {
        let mut random = Random::new(17);
        let (mut wrong, mut compared, mut cut) = (Vec::new(), 0, 0);
        for number in 0..scenes {
            let bodies = random_bodies(&mut random);
            let rays = random_rays(rays_each, &mut random);
            if backend == Backend::RayQuery && number >= 40 {
                continue;
            }
            let scene = scene(&bodies, Transport::FirstOrder);
            let mut tracer = bench.tracer(backend, &scene);
            cut += usize::from(
                geometry::load(&scene)
                    .expect("a sample")
                    .objects
                    .iter()
                    .any(|it| !it.cut_by.is_empty()),
            );
            let (results, words) = tracer.trace_with_moments(&rays).expect("results");
            let tally = tracer.tally().expect("a tally");
            assert_eq!([tally.unbalanced, tally.not_finite], [0; 2], "scene {number}");
            let sample = Sample::brute_force(&bodies, SOURCE, 0.0);
            for (index, (ray, result)) in rays.iter().zip(&results).enumerate() {
                let paths = paths_of(&words, index, bodies.len());
                compared += 1;
                if !is_true(&sample, ray, result, &paths) {
                    let want = reference(&sample, ray, [0.0; 2], Order::First);
                    wrong.push(format!("{number}: {ray:?} {result:?} {paths:?} for {want:?}"));
                }
            }
        }
        println!(
            "measured {backend}: {} of {compared} differ, {cut} scenes with cuts",
            wrong.len()
        );
        assert!(wrong.is_empty(), "{:#?}", &wrong[..wrong.len().min(5)]);
    }
    bench.end();
}

/// Mu and delta of the block below: less than those of the carbon around it, which reflects rays
/// within 0.85 mrad.
const LIGHT: [f64; 2] = [20.0, 1e-7];

/// Two halves of a block, their faces `gap` apart and turned by half a milliradian against the
/// beam.
fn halves(gap: f64, turned_around: bool) -> Vec<Body> {
    let half = |side: f64| {
        let mesh = cuboid([1e-3, 8e-3, 2e-3]).moved([side * 0.5e-3 + side * 0.5 * gap, 0.0, 0.0]);
        // Not rounded: at 5 mm f32 is 0.5 nm.
        body(mesh.turned([0.0, 0.0, 1.0], 5e-4), LIGHT[0], LIGHT[1])
    };
    let mut both = vec![half(-1.0), half(1.0)];
    if turned_around {
        both.reverse();
    }
    both
}

/// Rays that cross the gap near the middle of the block.
fn grazing_rays() -> Vec<Ray> {
    let at = |k: i32| 0.4e-6 * (f64::from(k) / 20.0);
    let ray = |k: i32| Ray { x: at(k) as f32, z: 0.3e-3, slope_x: 0.0, slope_z: 0.0, view: 0 };
    (-20..=20).map(ray).collect()
}

fn exact(bench: &Bench, backend: Backend, scene: &Scene, rays: &[Ray]) -> Vec<RayResult> {
    let mut tracer = bench.tracer(backend, scene);
    let results = tracer.trace(rays).expect("results");
    let tally = tracer.tally().expect("a tally");
    let failed = [tally.unbalanced, tally.unordered, tally.dropped, tally.not_finite];
    assert_eq!(failed, [0; 4]);
    assert!(results.iter().all(|it| it.flags & FLAG_UNBALANCED == 0));
    results
}

#[test]
fn gap_of_two_nanometres_changes_nothing_and_one_of_a_hundred_reflects() {
    let bench = Bench::new();
    let rays = grazing_rays();
    let in_carbon = |bodies: &[Body]| {
        let mut scene = scene(bodies, Transport::Exact);
        let carbon = MaterialSpec::Constants { mu: CARBON[0], delta: CARBON[1] };
        scene.materials.insert("around".to_owned(), carbon);
        scene.surroundings = "around".to_owned();
        scene
    };
    for backend in backends() {
        let whole =
            body(cuboid([2e-3, 8e-3, 2e-3]).turned([0.0, 0.0, 1.0], 5e-4), LIGHT[0], LIGHT[1]);
        let solid = exact(&bench, backend, &in_carbon(&[whole]), &rays);
        let mut worst = Worst::new("slope behind halves that touch, rad", 1e-13);
        let mut depth = Worst::new("depth of halves that touch", 1e-6);
        for gap in [-1e-6, -2e-9, 0.0, 2e-9] {
            for turned in [false, true] {
                let halved = exact(&bench, backend, &in_carbon(&halves(gap, turned)), &rays);
                for (ray, (one, two)) in rays.iter().zip(solid.iter().zip(&halved)) {
                    let place = || format!("{backend}, gap {gap}, {turned}, {ray:?}");
                    assert_eq!(two.flags & FLAG_REFLECTED, 0, "{}", place());
                    worst.take(f64::from(one.slope_x - two.slope_x), place);
                    depth.take(f64::from(one.optical_depth - two.optical_depth), place);
                }
            }
        }
        worst.holds();
        depth.holds();
        for turned in [false, true] {
            let apart = exact(&bench, backend, &in_carbon(&halves(1e-7, turned)), &rays);
            let reflected = apart.iter().filter(|it| it.flags & FLAG_REFLECTED != 0).count();
            assert_eq!(reflected, rays.len(), "{backend}, {turned}");
        }
    }
    bench.end();
}

#[test]
fn exact_rays_cross_touching_bodies_as_the_reference_says() {
    let bench = Bench::new();
    for backend in backends() {
        let mut random = Random::new(5);
        let (mut compared, mut wrong) = (0, Vec::new());
        for number in 0..60 {
            let bodies = random_bodies(&mut random);
            let rays = random_rays(100, &mut random);
            if backend == Backend::RayQuery && number >= 10 {
                continue;
            }
            let results = exact(&bench, backend, &scene(&bodies, Transport::Exact), &rays);
            let sample = Sample::brute_force(&bodies, SOURCE, 0.0);
            for (ray, result) in rays.iter().zip(&results) {
                let near = [[0.0, 0.0], [HAIR, 0.0], [-HAIR, 0.0], [0.0, HAIR], [0.0, -HAIR]]
                    .map(|by| reference(&sample, ray, by, Order::Exact));
                compared += 1;
                let steep = near.iter().map(|it| it.grazing).fold(1.0, f64::min).max(1e-4);
                let is = |got: f32, of: fn(&Trace) -> f64, room: f64| {
                    let low = near.iter().map(of).fold(f64::MAX, f64::min) - room;
                    let high = near.iter().map(of).fold(f64::MIN, f64::max) + room;
                    (low..=high).contains(&f64::from(got))
                };
                let met = near[0].crossings.max(2) as f64;
                let room = met * (1e-13 + 3e-12 / steep);
                if !(is(result.slope_x, |it| it.slope[0], room)
                    && is(result.slope_z, |it| it.slope[1], room)
                    && is(result.optical_depth, |it| it.optical_depth, met * 2e-7 / steep))
                {
                    wrong.push(format!("{number}: {ray:?} {result:?} for {:?}", near[0]));
                }
            }
        }
        println!("measured {backend}: {} of {compared} differ", wrong.len());
        assert!(wrong.len() * 1000 <= compared, "{:#?}", &wrong[..wrong.len().min(5)]);
    }
    bench.end();
}

/// Plates face to face, one on the other.
fn plates(count: u32, turn: f64, of: impl Fn(u32) -> [f64; 2]) -> Vec<Body> {
    let thickness = 4e-3 / f64::from(count);
    let plate = |k: u32| {
        let y = (f64::from(k) + 0.5) * thickness - 2e-3;
        let mesh = cuboid([3e-3, thickness, 2e-3]).moved([0.0, y, 0.0]);
        let [mu, delta] = of(k);
        body(mesh.turned([0.3, 0.2, 1.0], turn).rounded(), mu, delta)
    };
    (0..count).map(plate).collect()
}

#[test]
fn hundred_plates_face_to_face_are_the_one_block() {
    let engine = crate::support::engine(Backend::Bvh);
    let setup = Setup::paper([32, 16]);
    let offsets = [-2e-5, 0.0, 1e-5];
    for turn in [0.0, 0.4] {
        let stack = |bodies: &[Body]| {
            let stacks =
                engine.simulate(&scenes::scene(&setup, bodies, &offsets)).expect("a stack");
            let tally = &stacks.record.tally;
            assert_eq!(
                [tally.unbalanced, tally.unordered, tally.dropped, tally.not_finite],
                [0; 4]
            );
            stacks.sample
        };
        let block = body(
            cuboid([3e-3, 4e-3, 2e-3]).turned([0.3, 0.2, 1.0], turn).rounded(),
            CARBON[0],
            CARBON[1],
        );
        let one = stack(&[block]);
        let many = stack(&plates(100, turn, |_| CARBON));
        let two = stack(&plates(2, turn, |_| CARBON));
        let mut worst = Worst::new("plates against the block, of open beam", 5e-4);
        for ((place, one), (many, two)) in one.indexed_iter().zip(many.iter().zip(&two)) {
            worst.take(f64::from(one - many), || format!("100 plates, turn {turn}, {place:?}"));
            worst.take(f64::from(one - two), || format!("2 plates, turn {turn}, {place:?}"));
        }
        worst.holds();
        let mixed = plates(100, turn, |k| if k % 2 == 0 { CARBON } else { WATER });
        let _ = stack(&mixed);
    }
}

/// A plate with a bore of 64 sides, as one closed surface.
fn bored_plate(radius: f64, sides: u32, phase: f64) -> Mesh {
    let (half, high) = (3e-3, 0.5e-3);
    let step = std::f64::consts::TAU / f64::from(sides);
    // As many points on the rim of the plate as on the bore: the square, point by point.
    let ring = |k: u32, z: f64| {
        let (sin, cos) = (step * (f64::from(k) + phase)).sin_cos();
        [radius * cos, radius * sin, z]
    };
    let rim = |k: u32, z: f64| {
        let (sin, cos) = (step * f64::from(k)).sin_cos();
        let far = half / sin.abs().max(cos.abs());
        [far * cos, far * sin, z]
    };
    let mut mesh = Mesh { vertices: Vec::new(), triangles: Vec::new() };
    for z in [-high, high] {
        mesh.vertices.extend((0..sides).map(|k| ring(k, z)));
        mesh.vertices.extend((0..sides).map(|k| rim(k, z)));
    }
    let n = sides;
    for i in 0..n {
        let j = (i + 1) % n;
        let mut quad =
            |a: u32, b: u32, c: u32, d: u32| mesh.triangles.extend([[a, b, c], [a, c, d]]);
        quad(n + i, n + j, 3 * n + j, 3 * n + i); // outside
        quad(j, i, 2 * n + i, 2 * n + j); // bore
        quad(i, j, n + j, n + i); // below
        quad(2 * n + j, 2 * n + i, 3 * n + i, 3 * n + j); // above
    }
    mesh
}

#[test]
fn bolt_in_its_bore_is_the_solid_plate_with_the_bolt() {
    let bench = Bench::new();
    let turned = |mesh: Mesh| mesh.turned([1.0, 0.3, 0.5], 0.8).rounded();
    for (phase, height) in [(0.0, 1e-3), (0.0, 3e-3), (0.31, 1e-3), (0.5, 3e-3)] {
        let plate = body(turned(bored_plate(2.5e-3, 64, 0.0)), 30.0, 3e-7);
        let bolt = body(turned(prism(2.5e-3, height, 64, phase)), 60.0, 5e-7);
        for bodies in [vec![plate.clone(), bolt.clone()], vec![bolt, plate]] {
            let mut random = Random::new(3);
            let rays = random_rays(3000, &mut random);
            let scene = scene(&bodies, Transport::FirstOrder);
            let mut tracer = bench.tracer(Backend::Bvh, &scene);
            let (results, words) = tracer.trace_with_moments(&rays).expect("results");
            assert_eq!(tracer.tally().expect("a tally").unbalanced, 0);
            let sample = Sample::brute_force(&bodies, SOURCE, 0.0);
            let wrong: Vec<_> = rays
                .iter()
                .zip(&results)
                .enumerate()
                .filter(|(index, (ray, result))| {
                    let paths = paths_of(&words, *index, 2);
                    !is_true(&sample, ray, result, &paths)
                })
                .collect();
            assert!(wrong.is_empty(), "{phase} {height}: {:?}", &wrong[..wrong.len().min(3)]);
        }
    }
    bench.end();
}
