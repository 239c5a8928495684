//! Exact transport against Snell's law in f64: beside silhouettes, totally reflected, and twice in
//! one tube.

use super::rays::{Passage, beside, snell};
use super::solids::{Kind, Solid, cylinder, sphere};
use super::{direction, ray_through, rays_around, scene};
use crate::assemblies::{Bench, exact};
use crate::reference::surfaces::Random;
use crate::reference::vector::{Vector, add, scaled};
use crate::support::{amount, backends};
use beamlet::Backend;
use beamlet::internals::interface::{FLAG_REFLECTED, RayResult};
use beamlet::internals::trace::Ray;
use beamlet::scene::Transport;

/// Distance by which f32 may move a ray against a shape within 6 mm of the axis, m.
const HAIR: f64 = 5e-10;

/// Ten times carbon's at 30 keV: rays under 3 mrad are totally reflected.
const STRONG: [f64; 2] = [50.0, 4.6e-6];

fn solids() -> Vec<(&'static str, Solid)> {
    let tilted = |kind| Solid::new(kind).turned([1.0, 0.3, 0.2], 0.6).at([0.7e-3, 1.9e-3, -0.4e-3]);
    let tube = Kind::Tube { outer: 2e-3, inner: 1.2e-3, half: 4e-3 };
    vec![
        ("cylinder", Solid::new(cylinder(2e-3, 8e-3))),
        ("tilted cylinder", tilted(cylinder(2e-3, 8e-3))),
        ("sphere", Solid::new(sphere(2e-3))),
        ("sphere off the axis", tilted(sphere(2e-3))),
        ("tube", Solid::new(tube)),
        ("tilted tube", tilted(tube)),
        ("tube nearly along the beam", Solid::new(tube).turned([1.0, 0.0, 0.0], 1.5)),
    ]
}

/// A ray moved sideways to a silhouette of the solid, or a random one, and from there by 0.1 nm to
/// 0.1 mm.
fn beside_silhouette(solid: &Solid, random: &mut Random) -> Option<Ray> {
    let at = |random: &mut Random| -> Vector {
        add(solid.position, scaled(direction(random), solid.reach() * random.next()))
    };
    let (mut from, mut to) = (ray_through(at(random), 0, 0.0, random), at(random));
    (from.slope_x, from.slope_z) = (from.x / 1.21, from.z / 1.21);
    to[1] = 0.0;
    let moved = |s: f64| {
        let [x, z] = [f64::from(from.x), f64::from(from.z)];
        Ray { x: (x + s * (to[0] - x)) as f32, z: (z + s * (to[2] - z)) as f32, ..from }
    };
    let count = |s: f64| super::rays::hits(solid, &moved(s), [0.0; 2], 0.0).len();
    let [mut low, mut high] = [0.0, 1.0];
    let first = count(low);
    if first == count(high) {
        return None;
    }
    for _ in 0..40 {
        let middle = 0.5 * (low + high);
        *if count(middle) == first { &mut low } else { &mut high } = middle;
    }
    let side = if random.next() < 0.5 { 1.0 } else { -1.0 };
    let off = side * 10.0_f64.powf(random.between(-10.0, -4.0)) / 2e-3;
    Some(moved((low + off).clamp(0.0, 1.0)))
}

/// True if all rays a hair beside pass alike: not at a silhouette or at the critical angle, where
/// f32 may decide either way.
fn is_clear(near: &[Passage]) -> bool {
    near.len() == beside(HAIR).len()
        && near
            .iter()
            .all(|it| (it.crossings, it.reflected) == (near[0].crossings, near[0].reflected))
}

/// True if a result lies between those of Snell's law a hair beside the ray.
fn is_true(near: &[Passage], result: &RayResult, delta: f64) -> bool {
    let got = [result.slope_x, result.slope_z, result.displacement_x, result.displacement_z];
    let reflected = result.flags & FLAG_REFLECTED != 0;
    let same =
        |it: &&Passage| it.crossings == result.crossings as usize && it.reflected == reflected;
    let like: Vec<&Passage> = near.iter().filter(same).collect();
    let Some(first) = like.first() else { return near.is_empty() };
    let steep = like.iter().map(|it| it.grazing).fold(1.0, f64::min).max(1e-6);
    let change = first.slope[0].hypot(first.slope[1]);
    // As for triangles: 1e-6 of the change and 1e-11/c² rad for each crossing at carbon's delta.
    let share = delta / 4.6e-7 / steep.powi(2);
    let room = 1e-6 * change + first.crossings as f64 * 1e-12 * share.min(1e-3 / 1e-12);
    (0..4).all(|k| {
        let of = like.iter().map(|it| it.values()[k]);
        let (low, high) = (of.clone().fold(f64::MAX, f64::min), of.fold(f64::MIN, f64::max));
        let room = if k < 2 { room } else { 0.6 * room + 1e-6 * high.abs().max(low.abs()) };
        // The range of five rays is that of the hair; beside a square root it may be twice it.
        let room = room + (high - low);
        (low - room..=high + room).contains(&f64::from(got[k]))
    })
}

#[test]
fn rays_refract_and_reflect_by_snells_law_at_exact_surfaces() {
    let bench = Bench::new();
    for backend in backends() {
        let mut random = Random::new(91);
        let (mut reflected, mut twice, mut rays_in_all, mut unclear) = (0, 0, 0, 0);
        let mut wrong = Vec::new();
        for (name, solid) in solids() {
            let most = if backend == Backend::Bvh { 250 } else { 60 };
            let most = amount(most / 5, most);
            let mut rays: Vec<Ray> =
                std::iter::repeat_with(|| beside_silhouette(&solid, &mut random))
                    .flatten()
                    .take(most)
                    .collect();
            rays.extend(rays_around(&solid, most / 4, 0.0, &mut random));
            for constants in [crate::support::CARBON, STRONG] {
                let objects = vec![solid.object("solid", "")];
                let scene = scene(objects, &[constants], Transport::Exact);
                let results = exact(&bench, backend, &scene, &rays);
                for (ray, result) in rays.iter().zip(&results) {
                    let near: Vec<Passage> = beside(HAIR)
                        .into_iter()
                        .filter_map(|by| snell(&solid, constants[1], ray, by))
                        .collect();
                    rays_in_all += 1;
                    if !is_clear(&near) {
                        unclear += 1;
                        continue;
                    }
                    reflected += usize::from(result.flags & FLAG_REFLECTED != 0);
                    twice += usize::from(result.crossings == 4);
                    if !is_true(&near, result, constants[1]) {
                        let want = near.first();
                        wrong.push(format!("{backend}, {name}: {ray:?} {result:?} for {want:?}"));
                    }
                }
            }
        }
        println!(
            "measured {backend}: {rays_in_all} rays, {reflected} reflected, {twice} twice in \
             one shape, {unclear} not clear, {} differ",
            wrong.len()
        );
        assert!(unclear < rays_in_all / 4);
        assert!(reflected > rays_in_all / 100 && twice > rays_in_all / 50);
        assert!(
            wrong.is_empty(),
            "{} of {rays_in_all}: {:#?}",
            wrong.len(),
            &wrong[..wrong.len().min(4)]
        );
    }
    bench.end();
}
