//! Meshes and faceted shapes that stand in many places against the same as one flat mesh.

#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests")]
#![allow(clippy::cast_possible_truncation, reason = "rays are rounded to f32 as the engine's are")]

use crate::leaks::Watch;
use crate::reference::scenes;
use crate::reference::stack::Setup;
use crate::reference::surfaces::{Body, Mesh, Random, body, cuboid};
use crate::support::cuts::{Cut, bands, no_bit_changes};
use crate::support::{CARBON, WATER, Worst, amount, backends, engine, sample};
use beamlet::geometry;
use beamlet::internals::trace::{Ray, RayResult, trace};
use beamlet::scene::{
    self, Instances, Object, RandomRays, Scene, Scheme, Shape, ShapeOrMesh, Transport,
};
use std::fmt::Write;
use std::path::Path;

/// Distance of neighbours, m; copies reach at most 0.47 of it from their origins.
const PITCH: f64 = 140e-6;
/// Places along x, y, z: 308 of them.
const PLACES: [i32; 3] = [7, 11, 4];

/// A prism along z whose section is an L: not convex, with an edge that looks inwards.
fn bracket() -> Mesh {
    let unit = 25e-6;
    let section = [[1.0, 1.0], [1.0, 2.0], [0.0, 2.0], [0.0, 0.0], [2.0, 0.0], [2.0, 1.0]];
    let corner = |z: f64| section.map(|[x, y]| [(x - 1.0) * unit, (y - 1.0) * unit, z * unit]);
    let vertices = [corner(-0.8), corner(0.8)].concat();
    let mut triangles = Vec::new();
    for i in 0..6 {
        let j = (i + 1) % 6;
        triangles.extend([[i, j, j + 6], [i, j + 6, i + 6]]);
    }
    // Every corner is seen from the one that looks inwards.
    for i in 1..5 {
        triangles.extend([[0, i + 1, i], [6, i + 6, i + 7]]);
    }
    Mesh { vertices, triangles }
}

fn drum() -> ShapeOrMesh {
    Shape::Cylinder { radius: 25e-6, height: 60e-6, sides: Some(8) }.into()
}

/// Facets of a shape that stands alone, m.
fn facets(shape: ShapeOrMesh) -> Mesh {
    let mut scene = scenes::scene(&Setup::paper([4, 4]), &[], &[0.0]);
    scene.objects.push(Object::new("alone", shape, "gold"));
    let sample = geometry::load(&scene).unwrap();
    Mesh { vertices: sample.vertices, triangles: sample.triangles }
}

/// One place: position, scale, axis and angle.
type At = ([f64; 3], f64, [f64; 3], f64);

fn places() -> Vec<At> {
    let mut random = Random::new(7);
    let mut all = Vec::new();
    for x in 0..PLACES[0] {
        for y in 0..PLACES[1] {
            for z in 0..PLACES[2] {
                let cell = [x, y, z];
                let at = |axis: usize| {
                    (f64::from(cell[axis]) - 0.5 * f64::from(PLACES[axis] - 1)) * PITCH
                };
                let position = [0, 1, 2].map(at);
                let axis = [0; 3].map(|_| random.between(-1.0, 1.0));
                let scale = random.between(0.5, 1.6);
                all.push((position, scale, axis, random.between(-6.0, 6.0)));
            }
        }
    }
    all
}

fn write_places(path: &Path) {
    let mut text = "angle_rad,axis_x,axis_y,axis_z,x_m,y_m,z_m,scale\n".to_owned();
    for ([x, y, z], scale, [a, b, c], angle) in places() {
        writeln!(text, "{angle:e},{a:e},{b:e},{c:e},{x:e},{y:e},{z:e},{scale:e}").unwrap();
    }
    std::fs::write(path, text).unwrap();
}

/// All copies as one mesh.
fn flattened(of: &Mesh) -> Mesh {
    let mut all = Mesh { vertices: Vec::new(), triangles: Vec::new() };
    for (position, scale, axis, angle) in places() {
        let copy = of.clone().scaled(scale).turned(axis, angle).moved(position);
        let first = u32::try_from(all.vertices.len()).unwrap();
        all.triangles.extend(copy.triangles.iter().map(|t| t.map(|v| v + first)));
        all.vertices.extend(copy.vertices);
    }
    all
}

/// The scene with one flat mesh in a block of water, and the one with instances of it.
fn both(directory: &Path, prototype: ShapeOrMesh, mesh: &Mesh) -> [Scene; 2] {
    let path = directory.join("places.csv");
    write_places(&path);
    let bodies: [Body; 2] = [
        body(cuboid([1.3e-3, 1.8e-3, 0.8e-3]), WATER[0], WATER[1]),
        body(flattened(mesh), CARBON[0], CARBON[1]),
    ];
    let offsets = [-20e-6, 9e-6];
    let mut flat = scenes::scene(&Setup::paper([6, 3]), &bodies, &offsets);
    flat.scan.angles = vec![0.0, 1.1];
    flat.sampling.tolerance = Some(TOLERANCE);
    let mut many = flat.clone();
    many.objects[1].geometry = prototype;
    many.objects[1].instances = Some(Instances::File(path));
    [flat, many]
}

/// Both scenes of each prototype.
fn cases(directory: &Path) -> [(&'static str, [Scene; 2]); 2] {
    let mesh = bracket();
    let Mesh { vertices, triangles } = mesh.clone();
    let arrays = scene::Mesh::Arrays { vertices, triangles }.into();
    [
        ("brackets", both(directory, arrays, &mesh)),
        ("drums", both(directory, drum(), &facets(drum()))),
    ]
}

fn random_rays(count: usize, random: &mut Random) -> Vec<Ray> {
    let ray = |i: usize| {
        let (x, z) = (random.between(-0.55e-3, 0.55e-3), random.between(-0.3e-3, 0.3e-3));
        let slope = |at: f64, random: &mut Random| (at / 1.21 + random.between(-3e-5, 3e-5)) as f32;
        let (slope_x, slope_z) = (slope(x, random), slope(z, random));
        Ray { x: x as f32, z: z as f32, slope_x, slope_z, pose: u32::from(i % 2 == 1), key: 0 }
    };
    (0..count).map(ray).collect()
}

#[test]
fn instances_are_crossed_as_often_as_the_flat_mesh() {
    let directory = tempfile::tempdir().unwrap();
    let (count, most) = amount((40_000, 1), (200_000, 3));
    let rays = random_rays(count, &mut Random::new(11));
    for (name, scenes) in cases(directory.path()) {
        for backend in backends() {
            let engine = engine(backend);
            let [flat, many]: [Vec<RayResult>; 2] = scenes
                .each_ref()
                .map(|scene| trace(&engine.prepare(scene).unwrap(), &rays).unwrap());
            let of = |all: &[RayResult]| all.iter().map(|it| u64::from(it.crossings)).sum::<u64>();
            let differ = flat.iter().zip(&many).filter(|(a, b)| a.crossings != b.crossings);
            let differ = differ.count();
            println!("{name}, {backend}: {} crossings, {differ} rays differ", of(&many));
            assert!(of(&many) > 4 * rays.len() as u64, "{name}: rays meet few copies");
            // Corners are rounded to f32 in their own frame and in that of the sample, so that
            // edges are some 1e-11 m apart. Outlines are about 150 mm long in each mm2, and
            // 150 mm * 1e-11 m / 1 mm2 = 1.5e-6 of all rays pass between two edges: 0.3 of 200,000.
            assert!(differ <= most, "{name}, {backend}: {differ} rays");
        }
    }
}

/// Copies of one object, beside the mesh of them all: neighbouring rays are compared, and slopes
/// taken, where they cross the same bodies.
#[test]
fn rays_through_different_bodies_of_an_object_have_different_signatures() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("pair.csv");
    std::fs::write(&path, "x_um,y_um,z_um\n-60,0,0\n60,0,0\n").unwrap();
    let pair = [-60e-6, 60e-6].map(|x| facets(drum()).moved([x, 0.0, 0.0]));
    let [mut joined, second] = pair;
    let first = u32::try_from(joined.vertices.len()).unwrap();
    joined.triangles.extend(second.triangles.iter().map(|t| t.map(|v| v + first)));
    joined.vertices.extend(second.vertices);
    let Mesh { vertices, triangles } = joined;
    let ball = Shape::Sphere { radius: 25e-6, sides: None };
    let kinds = [
        (scene::Mesh::Arrays { vertices, triangles }.into(), false),
        (drum(), true),
        (ball.into(), true),
    ];
    let ray = |x: f32| Ray { x, z: 0.0, slope_x: 0.0, slope_z: 0.0, pose: 0, key: 0 };
    let rays = [-61e-6, -59e-6, 59e-6, 61e-6].map(ray);
    for (geometry, placed) in kinds {
        let mut scene = scenes::scene(&Setup::paper([4, 4]), &[], &[0.0]);
        let mut object = Object::new("pair", geometry, "gold");
        object.instances = placed.then(|| Instances::File(path.clone()));
        scene.objects.push(object);
        for backend in backends() {
            let traced = trace(&engine(backend).prepare(&scene).unwrap(), &rays).unwrap();
            assert!(traced.iter().all(|it| it.crossings == 2), "{backend}: {traced:?}");
            let [a, b, c, d] = [0, 1, 2, 3].map(|i| traced[i].signature);
            assert!(a == b && c == d && a != c, "{backend}: {:?}", [a, b, c, d]);
        }
    }
}

/// Tolerance of the comparison of instances with the flat mesh.
const TOLERANCE: f64 = 1e-3;

#[test]
fn light_through_instances_equals_the_flat_mesh() {
    // Corners 1e-11 m apart change a path by some 1e-10 m (5e-9 of the light) and a slope by
    // 1e-11 m / 25 um of 4.6e-7 (1e-13 m on the detector); but of two intervals of a row whose errors are equal to
    // rounding either may be halved, so that values differ by a part of the tolerance.
    let mut cells =
        Worst::new("light of instances less that of the flat mesh, cells", TOLERANCE / 3.0);
    // A single ray beside an edge can meet the other facet. It then lands some 1e-7 m elsewhere, a
    // hundredth of the edge's blur, and is one of 360 of its pixel: 3e-5 of 0.2 of open beam.
    let mut random = Worst::new("light of instances less that of the flat mesh, random", 1e-5);
    let directory = tempfile::tempdir().unwrap();
    let schemes = [Scheme::Cells, Scheme::Random];
    let all = backends().into_iter().flat_map(|it| schemes.map(|scheme| (scheme, it)));
    let single = schemes.into_iter().zip(backends().into_iter().cycle());
    // Cells on one backend, random rays on the other; each on both with `BEAMLET_ALL`.
    let runs: Vec<_> = amount(single.collect(), all.collect());
    for (name, mut scenes) in cases(directory.path()) {
        for &(scheme, backend) in &runs {
            let engine = engine(backend);
            let [flat, many] = scenes.each_mut().map(|scene| {
                scene.sampling.scheme = scheme;
                scene.sampling.rays = RandomRays::Grid([90, 4]);
                engine.simulate(scene).unwrap()
            });
            let worst = if scheme == Scheme::Cells { &mut cells } else { &mut random };
            // Open beam is 1.
            for (at, value) in many.sample.indexed_iter() {
                let deviation = f64::from(*value) - f64::from(flat.sample[at]);
                worst.take(deviation, || format!("{name}, {scheme:?}, {backend}, {at:?}"));
            }
        }
    }
    cells.holds();
    random.holds();
}

#[test]
fn bands_and_threads_change_no_bit_of_instances() {
    let directory = tempfile::tempdir().unwrap();
    let [(_, [_, mut scene]), _] = cases(directory.path());
    scene.scan.angles.truncate(amount(1, 2));
    scene.sampling.tolerance = Some(amount(1e-2, TOLERANCE));
    for scheme in sample(vec![Scheme::Cells, Scheme::Random], 2) {
        scene.sampling.scheme = scheme;
        scene.sampling.rays = RandomRays::Grid([30, 4]);
        let cuts = [Cut { batch: Some(997), threads: Some(5), ..bands(1) }];
        no_bit_changes(&format!("{scheme:?}"), &scene, &cuts);
    }
}

/// Traces so many rays of each case on each backend; every one is balanced at the first attempt.
fn never_leak(count: usize) {
    let directory = tempfile::tempdir().unwrap();
    for (_, [_, mut scene]) in cases(directory.path()) {
        scene.sampling.transport = Transport::FirstOrder;
        for backend in backends() {
            let mut watch = Watch::of(backend, &scene);
            let mut random = Random::new(23);
            let mut left = count;
            while left > 0 {
                let now = left.min(1 << 18);
                watch.trace(&random_rays(now, &mut random));
                left -= now;
            }
            assert_eq!(watch.end(), count);
        }
    }
}

#[test]
fn instances_never_leak() {
    never_leak(amount(80_000, 250_000));
}

/// Rays of each of two cases on each of two backends: a quarter of `BEAMLET_RAYS`, 1e8.
#[test]
#[ignore = "an hour: see docs/developers/validation.md"]
fn instances_never_leak_over_many_rays() {
    let rays = std::env::var("BEAMLET_RAYS").map_or(100_000_000, |text| text.parse().unwrap());
    never_leak(rays / 4);
}
