//! Rays beside the curves in which exact shapes cross, beside their edges and silhouettes: each shape is left
//! as often as it is entered, and the media along each ray are contiguous.

use super::arrangements::{Arrangement, CROSSING, materials, scene_of};
use super::rays::{interfaces, line, moved};
use super::{direction, pick, ray_through, scenes};
use crate::assemblies::{Bench, Traced};
use crate::reference::surfaces::Random;
use crate::reference::vector::{add, scaled};
use crate::support::backends;
use beamlet::Backend;
use beamlet::internals::trace::Ray;
use beamlet::scene::Transport;

/// Rays about a border: neighbours in f32, ten by ten.
const ACROSS: i32 = 10;
/// Shapes lie 30 mm behind the place where y is 0, and none reaches farther than 4 mm: an interface without its
/// counterpart adds 26 mm to the way through a material, or takes them from it.
const FAR: f64 = 30e-3;
const LONGEST: f64 = 8e-3;
const BATCH: usize = 200_000;

/// The media along a ray.
fn media(it: &Arrangement, ray: &Ray) -> Vec<Option<usize>> {
    interfaces(&it.solids, line(ray, [0.0; 2]), 0.0).iter().map(|it| it.media[1]).collect()
}

/// A ray beside which, by the rounding of f32, the media change.
fn border(it: &Arrangement, random: &mut Random) -> Option<Ray> {
    let off = scaled(direction(random), 1.5e-3 * random.next());
    let mut ray = ray_through(add(it.middle, off), 0, 0.0, random);
    if pick(random, 4) == 0 {
        (ray.slope_x, ray.slope_z) = (0.0, 0.0);
    }
    let by = [random.between(-1e-3, 1e-3), random.between(-1e-3, 1e-3)];
    let before = media(it, &ray);
    let (mut low, mut high) = (0.0, 1.0);
    if media(it, &moved(&ray, by)) == before {
        return None;
    }
    // 1 mm over 2^20 is 1 nm.
    for _ in 0..20 {
        let middle = f64::midpoint(low, high);
        let changed = media(it, &moved(&ray, by.map(|it| middle * it))) != before;
        (low, high) = if changed { (low, middle) } else { (middle, high) };
    }
    Some(moved(&ray, by.map(|it| high * it)))
}

fn about(ray: Ray) -> impl Iterator<Item = Ray> {
    let beside = |value: f32, steps: i32| {
        (0..steps.abs()).fold(value, |it, _| if steps < 0 { it.next_down() } else { it.next_up() })
    };
    let step = |k: i32| k - ACROSS / 2;
    (0..ACROSS * ACROSS).map(move |k| Ray {
        x: beside(ray.x, step(k % ACROSS)),
        z: beside(ray.z, step(k / ACROSS)),
        ..ray
    })
}

/// 2 million rays a scene, a twentieth of them in the only scene of a short run.
#[test]
fn rays_beside_the_curves_in_which_shapes_cross_balance() {
    let bench = Bench::new();
    let mut random = Random::new(307);
    let each = if scenes() > 1 { 640 } else { 32 };
    let mut total = 0_usize;
    for number in 0..scenes() {
        let all = CROSSING.at([0.0, FAR, 0.0]).arrangements(&mut random);
        let scene = scene_of(&all, Transport::FirstOrder);
        let materials = materials(&all);
        let of = |k: usize| k % all.len();
        let borders = (0..all.len() * each).filter_map(|k| border(&all[of(k)], &mut random));
        let rays: Vec<Ray> = borders.flat_map(about).collect();
        for backend in backends() {
            if backend == Backend::RayQuery && !number.is_multiple_of(8) {
                continue;
            }
            let some = if backend == Backend::Bvh { rays.len() } else { rays.len() / 4 };
            let mut crossed = 0;
            for rays in rays[..some].chunks(BATCH) {
                let traced = bench.traced(backend, &scene, rays, materials);
                crossed += traced.iter().filter(|it| it.result.crossings > 0).count();
                for (ray, Traced { paths, .. }) in rays.iter().zip(&traced) {
                    let ok = |way: &f64| (-1e-7..LONGEST).contains(way);
                    assert!(paths.iter().all(ok), "{backend}, scene {number}: {ray:?} {paths:?}");
                }
            }
            assert!(crossed > some / 2, "{crossed} of {some}");
            total += some;
        }
    }
    println!("measured balance beside crossing curves: 0 of {total} rays");
    assert!(total > scenes() * 50_000, "{total}");
    bench.end();
}
