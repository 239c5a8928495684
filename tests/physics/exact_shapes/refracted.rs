//! Exact transport through exact shapes, alone beside their silhouettes and twice in one tube, crossing, touching and
//! coinciding, against Snell's law in f64 at one interface after the other.

use super::arrangements::{Arrangement, CROSSING, DELTAS, scene_of};
use super::rays::{Passage, beside, error_among, hits, snell};
use super::solids::{Kind, Solid, cylinder, sphere};
use super::{STRONG, direction, pick, ray_through, rays_around, scene, scenes};
use crate::assemblies::{Bench, exact};
use crate::reference::surfaces::Random;
use crate::reference::vector::{Vector, add, scaled};
use crate::support::{CARBON, amount, backends, everything};
use beamlet::Backend;
use beamlet::internals::interface::{FLAG_REFLECTED, RayResult};
use beamlet::internals::trace::Ray;
use beamlet::scene::Transport;
use std::f64::consts::TAU;

/// Rays along the caps of an arrangement.
const GRAZING: usize = 12;
/// Distance by which f32 may move a ray against a shape within 6 mm of the axis, m.
const HAIR: f64 = 5e-10;

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
    let count = |s: f64| hits(solid, &moved(s), [0.0; 2], 0.0).len();
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

/// Rays at 0.02 to 2 mrad to caps of upright arrangements, on and beside them: carbon reflects below 0.96 mrad,
/// and rays at less would run along a cap within the rounding of f32.
fn along_caps(all: &[Arrangement], random: &mut Random) -> Vec<(usize, Ray)> {
    let mut rays = Vec::new();
    for (of, it) in all.iter().enumerate().filter(|(_, it)| it.upright) {
        for _ in 0..GRAZING {
            let solid = &it.solids[pick(random, it.solids.len())];
            let (radius, half) = match solid.kind {
                Kind::Cone { bottom, top, half } => (bottom.max(top), half),
                Kind::Tube { outer, half, .. } => (outer, half),
                _ => continue,
            };
            let (sin, cos) = random.between(0.0, TAU).sin_cos();
            let out = radius * random.between(0.0, 1.2);
            let end = half * [-1.0, 1.0][pick(random, 2)];
            let [x, y, z] = solid.world([out * cos, out * sin, end]);
            let steep = random.between(2e-5, 2e-3) * [-1.0, 1.0][pick(random, 2)];
            let slope = [random.between(-0.05, 0.05), steep];
            let [slope_x, slope_z] = slope.map(|it| it as f32);
            let [x, z] =
                [x - f64::from(slope_x) * y, z - f64::from(slope_z) * y].map(|it| it as f32);
            rays.push((of, Ray { x, z, slope_x, slope_z, pose: 0, key: 0 }));
        }
    }
    rays
}

/// Results that differ from Snell's law, and how many were compared.
#[derive(Default)]
struct Found {
    wrong: Vec<String>,
    compared: usize,
    unclear: usize,
    reflected: usize,
    /// Rays that cross one solid twice.
    twice: usize,
    /// Largest error of a slope at cosines of incidence above 0.05, rad.
    worst: f64,
}

impl Found {
    /// Compares a ray that all rays a hair beside it follow: not at a silhouette or at the critical angle, where f32 may
    /// decide either way, nor between surfaces that are less than 50 nm apart.
    fn take(&mut self, solids: &[Solid], deltas: &[f64], rays: (&Ray, &RayResult), hair: f64) {
        let (ray, result) = rays;
        let near: Option<Vec<Passage>> =
            beside(hair).into_iter().map(|by| snell(solids, deltas, ray, by)).collect();
        let alike = |near: &Vec<Passage>| {
            let kind = |it: &Passage| (it.crossings, it.reflected);
            near.iter().all(|it| kind(it) == kind(&near[0]) && it.nearest > 5e-8)
        };
        let Some(near) = near.filter(alike) else {
            self.unclear += 1;
            return;
        };
        let first = &near[0];
        self.compared += 1;
        self.reflected += usize::from(first.reflected);
        self.twice += usize::from(solids.len() == 1 && first.crossings == 4);
        let steep = near.iter().map(|it| it.grazing).fold(1.0, f64::min).max(1e-6);
        let change =
            near.iter().flat_map(|it| it.slope).fold(0.0_f64, |most, it| most.max(it.abs()));
        let delta = deltas.iter().copied().fold(0.0, f64::max);
        let room = 2e-13 + 8e-12 * (delta / CARBON[1]).max(1.0) / steep.powi(2) + 1e-6 * change;
        let got = [result.slope_x, result.slope_z, result.displacement_x, result.displacement_z];
        // Surfaces that coincide are counted, and are one interface.
        let crossings = result.crossings as usize;
        let counted =
            crossings == first.crossings || (first.coincide && crossings > first.crossings);
        let mut is_wrong = !counted || (result.flags & FLAG_REFLECTED != 0) != first.reflected;
        for (k, got) in got.into_iter().enumerate() {
            let values: Vec<f64> = near.iter().map(|it| it.values()[k]).collect();
            let most = values.iter().fold(0.0_f64, |most, it| most.max(it.abs()));
            let room = if k < 2 { room } else { 0.6 * room + 1e-6 * most };
            match error_among(&values, f64::from(got), room, 1e-10) {
                Some(error) if k < 2 && steep > 0.05 => self.worst = self.worst.max(error),
                Some(_) => {}
                None => is_wrong = true,
            }
        }
        if is_wrong {
            self.wrong.push(format!("{ray:?} {result:?} for {first:?} in {solids:?}"));
        }
    }

    #[track_caller]
    fn hold(self, name: &str) {
        let Self { wrong, compared, unclear, reflected, twice, worst } = self;
        println!(
            "measured {name}: {} of {compared} differ, {unclear} not clear, {reflected} reflected, {twice} twice in one \
             shape; others at a cosine above 0.05 by {worst:.2e} rad",
            wrong.len()
        );
        wrong.iter().take(3).for_each(|it| println!("{it}"));
        assert!(compared > unclear && reflected > compared / 100 && wrong.is_empty(), "{name}");
    }
}

/// Rays beside silhouettes through one solid, of carbon and of a material that refracts ten times as much.
#[test]
fn rays_refract_and_reflect_by_snells_law_at_exact_surfaces() {
    let bench = Bench::new();
    let mut found = Found::default();
    for backend in backends() {
        let mut random = Random::new(91);
        // Tubes alone by ray query; all with `BEAMLET_ALL`.
        let alone = backend == Backend::RayQuery && !everything();
        for (name, solid) in solids().into_iter().filter(|it| !alone || it.0.contains("tube")) {
            let most = if backend == Backend::Bvh { 250 } else { 60 };
            let most = amount(most / 5, most);
            let some = std::iter::repeat_with(|| beside_silhouette(&solid, &mut random)).flatten();
            let mut rays: Vec<Ray> = some.take(most).collect();
            rays.extend(rays_around(&solid, most / 4, 0.0, &mut random));
            for constants in [CARBON, STRONG] {
                let scene = scene(vec![solid.object(name, "")], &[constants], Transport::Exact);
                let results = exact(&bench, backend, &scene, &rays);
                let solids = std::slice::from_ref(&solid);
                rays.iter()
                    .zip(&results)
                    .for_each(|it| found.take(solids, &constants[1..], it, HAIR));
            }
        }
    }
    assert!(found.twice > found.compared / 50, "{} of {}", found.twice, found.compared);
    found.hold("exact transport through single shapes");
    bench.end();
}

/// Rays that cross the same interfaces as the rays a hair beside them, where two surfaces on the ray coincide or
/// lie at least 50 nm apart.
#[test]
fn exact_rays_through_crossing_shapes_follow_snells_law() {
    let bench = Bench::new();
    let mut random = Random::new(303);
    let mut found = Found::default();
    for number in 0..scenes() {
        let all = CROSSING.arrangements(&mut random);
        let scene = scene_of(&all, Transport::Exact);
        let mut rays = CROSSING.rays(&all, &mut random);
        rays.extend(along_caps(&all, &mut random));
        let only: Vec<Ray> = rays.iter().map(|it| it.1).collect();
        for backend in backends() {
            if backend == Backend::RayQuery && number > 0 && number % 8 != 0 {
                continue;
            }
            for ((of, ray), result) in rays.iter().zip(&exact(&bench, backend, &scene, &only)) {
                found.take(&all[*of].solids, &DELTAS, (ray, result), all[*of].hair());
            }
        }
    }
    assert!(found.reflected > found.compared / 50, "{} of {}", found.reflected, found.compared);
    found.hold("exact transport through crossing shapes");
    bench.end();
}
