//! Closed bodies are left as often as they are entered, whatever edge, vertex or stack of sheets
//! a ray runs through.

#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "counts are small; rays are rounded to f32 as the engine takes them"
)]

use crate::reference::scenes;
use crate::reference::stack::Setup;
use crate::reference::surfaces::{Body, Mesh, Random, body, cuboid, star};
use crate::support::{CARBON, Worst, amount, backends, engine};
use crate::transport::ray;
use beamlet::internals::gpu::{Device, DeviceOptions, shaders};
use beamlet::internals::interface::{FLAG_DROPPED, FLAG_UNBALANCED};
use beamlet::internals::trace::{
    DeviceSample, MaterialTable, Ray, RayResult, TraceKernels, Tracer, moments,
};
use beamlet::scene::{Scene, Transport};
use beamlet::{Backend, geometry};
use std::collections::HashMap;
use std::sync::Arc;

/// Words of a ray's moments before those of its materials: signature, balance, flags, crossings.
const HEAD: usize = 4;
/// Words of each material.
const PER_MATERIAL: usize = 5;

fn scene_of(bodies: &[Body], angles: &[f64], transport: Transport) -> Scene {
    let mut setup = Setup::paper([16, 16]);
    setup.sample_mask = None;
    let mut scene = scenes::scene(&setup, bodies, &[0.0]);
    scene.scan.angles = angles.to_vec();
    scene.sampling.transport = transport;
    scene
}

/// A tracer with its own device, so that its tally can be read.
pub(crate) struct Watch {
    device: Arc<Device>,
    tracer: Tracer,
    materials: usize,
    rays: usize,
    met: usize,
}

impl Watch {
    fn new(backend: Backend, bodies: &[Body], angles: &[f64]) -> Self {
        Self::of(backend, &scene_of(bodies, angles, Transport::FirstOrder))
    }

    /// Watch of a scene, whose rays are traced in the first order.
    pub(crate) fn of(backend: Backend, scene: &Scene) -> Self {
        let validation = std::env::var_os("BEAMLET_VALIDATION").is_some();
        let device = Device::open(&DeviceOptions {
            validation,
            kernels: shaders::ALL,
            ..DeviceOptions::default()
        })
        .expect("a Vulkan device");
        let sample = geometry::load(scene).expect("a sample");
        let media = MaterialTable::of(scene).expect("media");
        let query = backend == Backend::RayQuery;
        let sample = Arc::new(
            DeviceSample::upload(
                &device,
                scene,
                &sample,
                &beamlet::internals::geometry::across_edges(&sample),
                &media,
                query,
            )
            .expect("room"),
        );
        let kernels = Arc::new(TraceKernels::new(&device));
        let transport = Transport::FirstOrder;
        let tracer = Tracer::new(&device, &kernels, &sample, backend, transport, None, u32::MAX);
        let materials = sample.materials as usize;
        Self { device, tracer: tracer.expect("a tracer"), materials, rays: 0, met: 0 }
    }

    /// Traces rays; every one of them must be balanced.
    pub(crate) fn trace(&mut self, rays: &[Ray]) {
        let (results, words) = self.tracer.trace_with_moments(rays).expect("results");
        let stride = HEAD + self.materials * PER_MATERIAL;
        for ((ray, result), words) in rays.iter().zip(&results).zip(words.chunks(stride)) {
            assert_eq!(words[1], 0, "{ray:?} left a body other than as often as it entered");
            assert_eq!(result.flags & FLAG_UNBALANCED, 0, "{ray:?}");
            assert_eq!(result.crossings % 2, 0, "{ray:?}");
            self.met += usize::from(result.crossings > 0);
        }
        self.rays += rays.len();
    }

    /// No ray may have needed another attempt, either.
    pub(crate) fn end(self) -> usize {
        let tally = self.tracer.tally();
        assert_eq!((tally.unbalanced, tally.not_finite, tally.dropped), (0, 0, 0));
        assert_eq!(tally.retraced, 0, "rays were traced again");
        assert!(self.met * 3 > self.rays, "{} of {} rays met a body", self.met, self.rays);
        drop(self.tracer);
        assert_eq!(self.device.validation_messages(), 0);
        self.rays
    }
}

/// A cube of edge `2 half * step` whose faces are grids of `2 half` squares a side, each cut in
/// two: coordinates are small multiples of a power of two, so that grid-aligned rays run exactly
/// through vertices and edges, and within faces.
fn grid_cube(half: i32, step: f64) -> Mesh {
    let mut numbers: HashMap<[i32; 3], u32> = HashMap::new();
    let mut mesh = Mesh { vertices: Vec::new(), triangles: Vec::new() };
    for axis in 0..3 {
        for side in [-half, half] {
            for i in -half..half {
                for j in -half..half {
                    let mut at = |i: i32, j: i32| {
                        let mut place = [0; 3];
                        (place[axis], place[(axis + 1) % 3], place[(axis + 2) % 3]) = (side, i, j);
                        *numbers.entry(place).or_insert_with(|| {
                            mesh.vertices.push(place.map(|c| f64::from(c) * step));
                            mesh.vertices.len() as u32 - 1
                        })
                    };
                    let (a, b) = (at(i, j), at(i + 1, j));
                    let (c, d) = (at(i + 1, j + 1), at(i, j + 1));
                    let square = [[a, b, c], [a, c, d]];
                    let turn = |t: [u32; 3]| if side > 0 { t } else { [t[0], t[2], t[1]] };
                    mesh.triangles.extend(square.map(turn));
                }
            }
        }
    }
    mesh
}

/// Rays in chunks that fit memory, until `count` have been traced.
fn run(watch: &mut Watch, count: usize, mut next: impl FnMut(usize) -> Ray) {
    let mut done = 0;
    while done < count {
        let n = (count - done).min(1 << 19);
        let rays: Vec<Ray> = (done..done + n).map(&mut next).collect();
        watch.trace(&rays);
        done += n;
    }
}

/// 100,000 rays in all, ten million with `BEAMLET_ALL`: half through the grid's own vertices and edges, a quarter through
/// vertices, edges and insides of a rough ball, a quarter at random.
#[test]
fn closed_mesh_never_leaks() {
    let step = 2.0_f64.powi(-13);
    let half = 16;
    let grid = [body(grid_cube(half, step), CARBON[0], CARBON[1])];
    let rough = star(0.8e-3, 1.5e-3, 5, 4).rounded();
    let ball = [body(rough.clone(), CARBON[0], CARBON[1])];
    let angles = [0.0, 0.5, std::f64::consts::FRAC_PI_4, std::f64::consts::FRAC_PI_2];
    let mut total = 0;
    let all = backends();
    let whole = amount(100_000, 10_000_000);
    // A driver's ray query is slower on a CPU: a fifth of the rays serve it.
    for backend in &all {
        let share = match backend {
            Backend::RayQuery => whole / 5,
            Backend::Bvh if all.len() == 1 => whole,
            Backend::Bvh => whole / 5 * 4,
        };
        let mut watch = Watch::new(*backend, &grid, &angles);
        // Quarter steps: vertices, edges, diagonals, insides, and the rim itself.
        let places = 8 * half + 3;
        let slopes = [0.0, 2.0_f64.powi(-10), -2.0_f64.powi(-10), 3.0 * 2.0_f64.powi(-10)];
        run(&mut watch, share / 2, |i| {
            let i32_of = |n: usize| i32::try_from(n).expect("small");
            let side = places as usize;
            let at = |n: usize| f64::from(i32_of(n % side) - 4 * half - 1) * 0.25 * step;
            let lap = i / (side * side);
            let slope = [slopes[lap % 4], slopes[lap / 4 % 4]];
            // Mostly the view whose sines and cosines are exact.
            let view = if lap % 3 == 2 { (lap / 3 % 4) as u32 } else { 0 };
            // Through the grid of the entry face, at y = -half * step, in view 0.
            let y = -f64::from(half) * step;
            ray(at(i) - slope[0] * y, at(i / side) - slope[1] * y, slope, view)
        });
        total += watch.end();
        let mut watch = Watch::new(*backend, &ball, &angles);
        let mut random = Random::new(8);
        run(&mut watch, share / 4, |i| {
            // Aimed at a vertex, at a point of an edge, or next to one by a hair.
            let corners = rough.corners(i % rough.triangles.len());
            let share = [0.0, 0.5, random.next()][i % 3];
            let hair = [0.0, 1e-10, -1e-10, 1e-9][i / 7 % 4];
            let p: Vec<f64> =
                (0..3).map(|k| corners[0][k] * (1.0 - share) + corners[1][k] * share).collect();
            let slope = if i % 2 == 0 { [0.0; 2] } else { [p[0] / 1.21, p[2] / 1.21] };
            ray(p[0] - slope[0] * p[1] + hair, p[2] - slope[1] * p[1], slope, 0)
        });
        run(&mut watch, share / 4, |i| {
            let (x, z) = (random.between(-1.5e-3, 1.5e-3), random.between(-1.5e-3, 1.5e-3));
            ray(x, z, [x / 1.21, z / 1.21], (i % 4) as u32)
        });
        total += watch.end();
    }
    assert_eq!(total, whole);
}

fn results(
    backend: Backend,
    bodies: &[Body],
    transport: Transport,
    rays: &[Ray],
) -> (Vec<RayResult>, Vec<(f64, u32, u32)>) {
    let engine = engine(backend);
    let mut scene = scene_of(bodies, &[0.0], transport);
    // Sheets that lie on one another are a defect of a mesh; the walks count them all the same.
    scene.objects.iter_mut().for_each(|object| object.allow_defects = true);
    let simulation = engine.prepare(&scene).expect("a sample");
    let (results, moments) = moments(&simulation, rays).expect("results");
    let each = (0..rays.len())
        .map(|i| (f64::from(moments.of(i, 1).path), moments.balance(i), moments.crossings(i)))
        .collect();
    (results, each)
}

/// One mesh of many boxes; no vertex of one is a vertex of another.
fn boxes(each: impl Iterator<Item = ([f64; 3], [f64; 3])>) -> Mesh {
    let mut all = Mesh { vertices: Vec::new(), triangles: Vec::new() };
    for (size, at) in each {
        let one = cuboid(size).moved(at);
        let first = all.vertices.len() as u32;
        all.vertices.extend(one.vertices);
        all.triangles.extend(one.triangles.iter().map(|t| t.map(|v| v + first)));
    }
    all
}

/// Rays through a body near its axis: every one counts these crossings and has this length in it, on all backends.
fn all_crossings_count(
    mut worst: Worst,
    mesh: Mesh,
    crossings: u32,
    length: f64,
    random: &mut Random,
) {
    let bodies = [body(mesh, CARBON[0], CARBON[1])];
    let rays: Vec<Ray> = (0..64)
        .map(|_| {
            let (x, z) = (random.between(-0.4e-3, 0.4e-3), random.between(-0.4e-3, 0.4e-3));
            ray(x, z, [x / 1.21, z / 1.21], 0)
        })
        .collect();
    for backend in backends() {
        for transport in [Transport::FirstOrder, Transport::Exact] {
            let (results, moments) = results(backend, &bodies, transport, &rays);
            for ((ray, result), (path, balance, counted)) in rays.iter().zip(&results).zip(moments)
            {
                assert_eq!(
                    (balance, counted, result.crossings),
                    (0, crossings, crossings),
                    "{ray:?}"
                );
                assert_eq!(result.flags & (FLAG_UNBALANCED | FLAG_DROPPED), 0);
                let slope = [ray.slope_x, ray.slope_z].map(f64::from);
                let want = length * (1.0 + slope[0] * slope[0] + slope[1] * slope[1]).sqrt();
                worst.take(path - want, || format!("{backend}, {transport:?}, {ray:?}"));
                let depth = f64::from(result.optical_depth) / CARBON[0];
                worst.take(depth - want, || format!("{backend}, {transport:?}, {ray:?}"));
            }
        }
    }
    worst.holds();
}

#[test]
fn ray_with_2000_crossings_counts_them_all() {
    let plates =
        boxes((0..1000).map(|i| ([1e-3, 2e-6, 1e-3], [0.0, 4e-6 * f64::from(i) - 2e-3, 0.0])));
    // 2,000 places of up to 2 mm, each held to 6e-11 m, some of which sum up in f32.
    let worst = Worst::new("leaks, 2,000 crossings, path (m)", 0.05e-6);
    all_crossings_count(worst, plates.rounded(), 2000, 2e-3, &mut Random::new(5));
}

#[test]
fn ray_through_300_coincident_sheets_counts_both_sides_of_each() {
    // 301 boxes stacked face on face in one object: 300 pairs of sheets at the very same place.
    let mut stack = boxes((0..301).map(|i| {
        let width = 1e-3 + 1e-5 * f64::from(i % 7);
        ([width, 8e-6, width], [1e-6 * f64::from(i % 5), 8e-6 * f64::from(i) - 1.2e-3, 0.0])
    }));
    // A lone triangle, far from the rays: parts of an open mesh are not united.
    let first = stack.vertices.len() as u32;
    stack.vertices.extend([[3e-3, 0.0, 0.0], [3.1e-3, 0.0, 0.0], [3e-3, 0.0, 1e-4]]);
    stack.triangles.push([first, first + 1, first + 2]);
    let worst = Worst::new("leaks, 300 coincident pairs, path (m)", 0.05e-6);
    all_crossings_count(worst, stack, 602, 301.0 * 8e-6, &mut Random::new(6));
}
