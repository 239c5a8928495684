//! Rays through bodies that overlap, against integration along every ray in f64.

use super::{Bench, HAIR, SOURCE, exact, is_true, paths_of, random_rays, reference, scene};
use crate::reference::rays::{Order, Sample, Trace};
use crate::reference::surfaces::{Body, Mesh, Random, body, cuboid, prism, sphere};
use crate::support::backends;
use beamlet::scene::Transport;
use beamlet::{Backend, geometry};

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
