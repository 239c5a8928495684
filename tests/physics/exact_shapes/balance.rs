//! Rays through edges of caps, tips of cones, along sides and through the holes of tubes: every shape is
//! left as often as it is entered.

use super::solids::{Kind, Solid};
use super::{KINDS, carbon, direction, places, ray_through};
use crate::assemblies::Bench;
use crate::reference::surfaces::Random;
use crate::reference::vector::{Vector, add, scaled};
use crate::support::{amount, backends};
use beamlet::Backend;
use beamlet::internals::trace::Ray;
use beamlet::scene::Transport;
use std::f64::consts::TAU;

/// A place of the own frame where decisions are close, moved by a hair or not.
fn delicate(kind: Kind, random: &mut Random) -> Vector {
    let turn = random.next() * TAU;
    let (sin, cos) = turn.sin_cos();
    let end = if random.next() < 0.5 { -1.0 } else { 1.0 };
    let p = match kind {
        Kind::Box(size) => scaled(size, 0.5),
        Kind::Prism { radius, half, .. } => [radius, 0.0, end * half],
        Kind::Cone { bottom, top, half } => {
            // An edge or the tip; or a point of the side.
            let z = if random.next() < 0.6 { end * half } else { random.between(-half, half) };
            let radius = 0.5 * (top + bottom) + (top - bottom) / (2.0 * half) * z;
            [radius * cos, radius * sin, z]
        }
        Kind::Ellipsoid(axes) => {
            let on = direction(random);
            [0, 1, 2].map(|k| on[k] * axes[k])
        }
        Kind::Tube { outer, inner, half } => {
            // An edge of the bore, the outer edge, the wall of the bore, or the middle of its mouth.
            let places =
                [(inner, end * half), (outer, end * half), (inner, 0.3 * half), (0.0, end * half)];
            let (to, z) = places[(random.next() * 4.0) as usize];
            [to * cos, to * sin, z]
        }
    };
    let hair = [0.0, 0.0, 1e-10, 1e-9, 1e-7][(random.next() * 5.0) as usize];
    add(p, scaled(direction(random), hair))
}

/// Along the surface in one of three cases.
fn ray(solid: &Solid, angles: &[f64], random: &mut Random) -> Ray {
    let view = (random.next() * angles.len() as f64) as u32;
    let angle = angles[view as usize];
    let at = solid.world(delicate(solid.kind, random));
    let mut ray = ray_through(at, view, angle, random);
    if random.next() < 0.3 {
        let [x, _, z] = crate::reference::vector::turned(at, [0.0, 0.0, 1.0], -angle);
        (ray.x, ray.z, ray.slope_x, ray.slope_z) = (x as f32, z as f32, 0.0, 0.0);
    }
    ray
}

#[test]
fn rays_through_edges_tips_and_holes_leave_what_they_enter() {
    let bench = Bench::new();
    let mut random = Random::new(81);
    // Some views look along axes of untilted shapes.
    let mut angles = vec![0.0, TAU / 4.0, TAU / 8.0];
    angles.extend((0..30).map(|_| random.between(0.0, TAU)));
    let mut total = 0;
    // By the tree; by ray query, too, with `BEAMLET_ALL`.
    for backend in amount(vec![Backend::Bvh], backends()) {
        let each = if backend == Backend::Bvh { 19_000 } else { 2_600 } / amount(8, 1);
        let mut crossed = 0;
        for (name, kind) in KINDS {
            for (place, solid) in places(kind) {
                let mut scene = carbon(&solid, Transport::FirstOrder);
                scene.scan.angles.clone_from(&angles);
                let rays: Vec<Ray> = (0..each).map(|_| ray(&solid, &angles, &mut random)).collect();
                for (ray, it) in rays.iter().zip(bench.traced(backend, &scene, &rays, 1)) {
                    let result = it.result;
                    let what = || format!("{backend}, {name}, {place}, {ray:?}: {result:?}");
                    assert!(result.crossings.is_multiple_of(2), "{}", what());
                    assert!(result.crossings <= 4, "{}", what());
                    assert!(result.slope_x.is_finite() && result.slope_z.is_finite(), "{}", what());
                    crossed += u64::from(result.crossings > 0);
                }
                total += rays.len();
            }
        }
        println!("measured {backend}: {crossed} rays cross");
        assert!(crossed > 60 * each / 4);
    }
    assert!(total >= amount(125_000, 1_000_000), "{total}");
    bench.end();
}
