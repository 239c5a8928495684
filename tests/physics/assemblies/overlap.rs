//! Rays through bodies that overlap, against integration along every ray in f64.

use super::{Bench, HAIR, SOURCE, exact, random_rays, reference, scene};
use crate::reference::rays::{Order, Sample, Trace};
use crate::reference::surfaces::{Body, Mesh, Random, body, cuboid, prism, sphere};
use crate::reference::vector::{cross, dot, sub, unit};
use crate::support::{amount, backends};
use beamlet::internals::trace::Ray;
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
    let (scenes, rays_each) = (amount(100, 400), 200);
    for backend in backends() {
        let mut random = Random::new(17);
        let (mut wrong, mut compared, mut cut) = (Vec::new(), 0, 0);
        for number in 0..scenes {
            let bodies = random_bodies(&mut random);
            let rays = random_rays(rays_each, &mut random);
            if backend == Backend::RayQuery && number >= scenes / 10 {
                continue;
            }
            let scene = scene(&bodies, Transport::FirstOrder);
            cut += usize::from(
                geometry::load(&scene)
                    .expect("a sample")
                    .objects
                    .iter()
                    .any(|it| !it.cut_by.is_empty()),
            );
            compared += rays.len();
            let found = bench.wrong_rays(backend, &scene, &rays, &bodies);
            wrong.extend(found.into_iter().map(|it| format!("{number}: {it}")));
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
fn exact_rays_through_touching_bodies_match_the_reference() {
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

/// Where a ray comes into another medium: the body that wins there, y, and the normal of the
/// surface, either way round.
type Interface = (Option<usize>, f64, [f64; 3]);

/// Interfaces from crossings in order: body, whether it is entered, y and normal. Stretches of
/// less than 0.1 um are left out, and so is what does not change the medium.
fn interfaces(crossings: &[(usize, bool, f64, [f64; 3])], bodies: usize) -> Vec<Interface> {
    let mut depth = vec![0; bodies];
    let mut found: Vec<Interface> = Vec::new();
    for &(body, entering, y, normal) in crossings {
        depth[body] += if entering { 1 } else { -1 };
        let medium = depth.iter().rposition(|count| *count > 0);
        while found.last().is_some_and(|last| y - last.1 < 1e-7) {
            found.pop();
        }
        if found.last().and_then(|last| last.0) != medium {
            found.push((medium, y, normal));
        }
    }
    found
}

/// The interfaces of the bodies as they are, uncut.
fn true_interfaces(bodies: &[Body], sample: &Sample, ray: &Ray, by: [f64; 2]) -> Vec<Interface> {
    let mut of_triangle = Vec::new();
    for (index, body) in bodies.iter().enumerate() {
        of_triangle.extend((0..body.mesh.triangles.len()).map(|it| (index, it)));
    }
    let direction = [f64::from(ray.slope_x), 1.0, f64::from(ray.slope_z)];
    let crossing = |&(triangle, y): &(usize, f64)| {
        let (body, triangle) = of_triangle[triangle];
        let [a, b, c] = bodies[body].mesh.corners(triangle);
        let normal = unit(cross(sub(b, a), sub(c, a)));
        (body, dot(normal, direction) < 0.0, y, normal)
    };
    let met = reference(sample, ray, by, Order::First).met;
    interfaces(&met.iter().map(crossing).collect::<Vec<_>>(), bodies.len())
}

#[test]
fn rays_cross_the_interfaces_of_the_bodies_listed_last() {
    let bench = Bench::new();
    let mut random = Random::new(23);
    let (mut compared, mut wrong) = (0, Vec::new());
    for _ in 0..200 {
        let bodies = random_bodies(&mut random);
        let rays = random_rays(100, &mut random);
        let sample = Sample::brute_force(&bodies, SOURCE, 0.0);
        let visit = |index: usize, met: &[beamlet::SurfaceCrossing]| {
            let crossing = |it: &beamlet::SurfaceCrossing| {
                (it.object as usize, it.entering, f64::from(it.y), it.normal.map(f64::from))
            };
            let got = interfaces(&met.iter().map(crossing).collect::<Vec<_>>(), bodies.len());
            let is = |by: [f64; 2]| {
                let want = true_interfaces(&bodies, &sample, &rays[index], by);
                let same = |(got, want): (&Interface, &Interface)| {
                    let along = dot(got.2, want.2).abs();
                    got.0 == want.0 && (got.1 - want.1).abs() < 1e-7 && along > 0.999
                };
                got.len() == want.len() && got.iter().zip(&want).all(same)
            };
            compared += got.len();
            let ways = [[0.0, 0.0], [HAIR, 0.0], [-HAIR, 0.0], [0.0, HAIR], [0.0, -HAIR]];
            if !ways.into_iter().any(is) {
                let want = true_interfaces(&bodies, &sample, &rays[index], [0.0; 2]);
                wrong.push(format!("{:?}: {got:?} for {want:?}", rays[index]));
            }
        };
        let public =
            |ray: &Ray| beamlet::Ray::new(ray.pose, [ray.x, ray.z], [ray.slope_x, ray.slope_z]);
        let public: Vec<_> = rays.iter().map(public).collect();
        let finder = bench.finder(&scene(&bodies, Transport::FirstOrder));
        finder.find(&public, visit).expect("crossings");
    }
    println!("measured: {} rays differ, {compared} interfaces", wrong.len());
    // Where a ray crosses two edges within rounding, or a sliver, neither order is the right one.
    assert!(compared > 15_000 && wrong.len() <= 2, "{} differ: {:#?}", wrong.len(), wrong.first());
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
            let wrong = bench.wrong_rays(Backend::Bvh, &scene, &rays, &bodies);
            assert!(wrong.is_empty(), "{phase} {height}: {:?}", &wrong[..wrong.len().min(3)]);
        }
    }
    bench.end();
}
