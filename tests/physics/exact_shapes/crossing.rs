//! Exact shapes that cross, touch and coincide, two to five in an arrangement (`BEAMLET_SCENES` times
//! 64 arrangements), against what lies inside along every ray in f64: ways and first order.

use super::nested::{are_listed, compared, interfaces};
use super::rays::{beside, error_among, line, moved};
use super::solids::{Kind, Solid, cylinder, sphere};
use super::{direction, pick, ray_through, scene, scenes};
use crate::assemblies::{Bench, paths_of};
use crate::reference::surfaces::Random;
use crate::reference::vector::{Vector, add, dot, length, scaled, turned};
use crate::support::{CARBON, WATER, backends};
use beamlet::internals::interface::{
    MOMENTS_BALANCE, MOMENTS_HEAD, MOMENTS_PER_MATERIAL, RayResult,
};
use beamlet::internals::trace::{CrossingFinder, Ray};
use beamlet::scene::{MaterialSpec, Scene, Transport};
use beamlet::{Backend, SurfaceCrossing, geometry};
use std::f64::consts::FRAC_PI_2;

/// Columns and rows of the square of arrangements of a scene.
const ACROSS: usize = 8;
const PITCH: f64 = 8e-3;
const MOST: usize = 5;
const RAYS: usize = 12;

/// Solids around a point of the world.
#[derive(Debug)]
pub(super) struct Arrangement {
    what: &'static str,
    pub(super) solids: Vec<Solid>,
    pub(super) middle: Vector,
    /// Number of its first object.
    first: usize,
    /// Not turned as a whole.
    pub(super) upright: bool,
}

fn any_kind(random: &mut Random) -> Kind {
    let mut size = || 1e-3 * random.between(0.3, 1.2);
    let (a, b, c) = (size(), size(), size());
    match pick(random, 7) {
        0 | 1 => cylinder(a, 3.0 * b),
        2 => Kind::Cone { bottom: a, top: if b > c { 0.0 } else { 0.7 * b }, half: 1.5 * c },
        3 => sphere(a),
        4 => Kind::Ellipsoid([a, b, c]),
        _ => Kind::Tube { outer: a, inner: 0.7 * a, half: 1.5 * c },
    }
}

/// At random, up to five at a place.
fn anyhow(random: &mut Random) -> Vec<Solid> {
    let one = |random: &mut Random| {
        let place = scaled(direction(random), 1e-3 * random.next());
        Solid::new(any_kind(random)).turned(direction(random), random.between(0.0, 3.0)).at(place)
    };
    (0..2 + pick(random, MOST - 1)).map(|_| one(random)).collect()
}

/// A rod with a bore that leaves it, or ends in its faces, and what fills or lines that; one across.
fn bored(random: &mut Random) -> Vec<Solid> {
    let (radius, height) = (1e-3 * random.between(0.6, 1.2), 1e-3 * random.between(1.0, 3.0));
    let bore = radius * random.between(0.3, 0.9);
    let longer = [1.0, 1.0, 1.5, 0.8][pick(random, 4)];
    let mut solids =
        vec![Solid::new(cylinder(radius, height)), Solid::new(cylinder(bore, longer * height))];
    match pick(random, 4) {
        0 => solids.push(Solid::new(cylinder(bore, height))),
        1 => solids.push(Solid::new(Kind::Tube {
            outer: bore,
            inner: 0.8 * bore,
            half: 0.5 * longer * height,
        })),
        2 => solids.push(Solid::new(sphere(bore))),
        _ => {}
    }
    if pick(random, 2) == 0 {
        let across = Solid::new(cylinder(0.3 * radius, 4.0 * radius));
        solids.push(across.turned([1.0, 0.0, 0.0], FRAC_PI_2));
    }
    solids
}

/// Bores that graze a wall from inside, and balls that touch it, by 0, 1 nm, 0.1 um or 10 um.
fn grazing(random: &mut Random) -> Vec<Solid> {
    let (radius, height) = (1e-3 * random.between(0.6, 1.2), 1e-3 * random.between(1.0, 3.0));
    let by = [0.0, 1e-9, -1e-7, 1e-7, -1e-5, 1e-5][pick(random, 6)];
    let small = radius * random.between(0.2, 0.6);
    let off = radius - small + by;
    let mut solids = vec![
        Solid::new(cylinder(radius, height)),
        Solid::new(cylinder(small, height * random.between(0.8, 1.4))).at([off, 0.0, 0.0]),
    ];
    if pick(random, 2) == 0 {
        solids.push(Solid::new(sphere(small)).at([0.0, -(radius + small + by), 0.0]));
    }
    solids
}

/// Rods end to end, with faces in one plane, and a ball across a joint.
fn stacked(random: &mut Random) -> Vec<Solid> {
    let mut z = -1.5e-3;
    let mut solids: Vec<Solid> = (0..2 + pick(random, 2))
        .map(|_| {
            let height = 1e-3 * random.between(0.5, 1.5);
            let radius = 1e-3 * random.between(0.4, 1.2);
            let kind = match pick(random, 3) {
                0 => Kind::Tube { outer: radius, inner: 0.6 * radius, half: 0.5 * height },
                1 => Kind::Cone { bottom: radius, top: 0.6 * radius, half: 0.5 * height },
                _ => cylinder(radius, height),
            };
            z += height;
            Solid::new(kind).at([0.0, 0.0, z - 0.5 * height])
        })
        .collect();
    if pick(random, 2) == 0 {
        let at = [0.0, 0.0, solids[0].position[2] + 0.3e-3];
        solids.push(Solid::new(sphere(0.5e-3)).at(at));
    }
    solids
}

pub(super) fn arrangements(middle: Vector, random: &mut Random) -> Vec<Arrangement> {
    let mut first = 0;
    (0..ACROSS * ACROSS)
        .map(|number| {
            let (what, solids) = match number % 4 {
                0 => ("at random", anyhow(random)),
                1 => ("bored", bored(random)),
                2 => ("grazing", grazing(random)),
                _ => ("stacked", stacked(random)),
            };
            // Every other one as a whole in a direction of its own.
            let upright = (number / 4).is_multiple_of(2);
            let turn = (direction(random), random.between(0.0, 3.0));
            let turn = (turn.0, if upright { 0.0 } else { turn.1 });
            let off = |it: usize| PITCH * (it as f64 - 0.5 * ACROSS as f64);
            let middle = add(middle, [off(number % ACROSS), 0.0, off(number / ACROSS)]);
            let place = |solid: Solid| {
                let at = add(turned(solid.position, turn.0, turn.1), middle);
                solid.turned(turn.0, turn.1).at(at)
            };
            let solids: Vec<Solid> = solids.into_iter().map(place).collect();
            first += solids.len();
            Arrangement { what, first: first - solids.len(), solids, middle, upright }
        })
        .collect()
}

fn constants(k: usize) -> [f64; 2] {
    if k.is_multiple_of(2) { CARBON } else { WATER }
}

pub(super) fn scene_of(all: &[Arrangement], transport: Transport) -> Scene {
    let mut scene = scene(Vec::new(), &[], transport);
    for k in 0..MOST {
        let [mu, delta] = constants(k);
        scene.materials.insert(format!("material {k}"), MaterialSpec::Constants { mu, delta });
    }
    for Arrangement { solids, first, .. } in all {
        let object = |(k, it): (usize, &Solid)| {
            it.object(&format!("{}", first + k), &format!("material {k}"))
        };
        scene.objects.extend(solids.iter().enumerate().map(object));
    }
    scene
}

/// Materials of the scene of arrangements.
pub(super) fn materials(all: &[Arrangement]) -> usize {
    all.iter().map(|it| it.solids.len()).max().unwrap_or_default()
}

/// Rays through arrangements, with the number of that.
pub(super) fn rays_through(all: &[Arrangement], random: &mut Random) -> Vec<(usize, Ray)> {
    let through = |of: usize, random: &mut Random| {
        let off = scaled(direction(random), 1.8e-3 * random.next());
        (of, ray_through(add(all[of].middle, off), 0, 0.0, random))
    };
    (0..all.len() * RAYS).map(|i| through(i / RAYS, random)).collect()
}

pub(super) fn delta_of(medium: Option<usize>) -> f64 {
    medium.map_or(0.0, |k| constants(k)[1])
}

/// Change of slope to first order, and the least cosine of incidence.
fn first_order(solids: &[Solid], ray: &Ray) -> ([f64; 2], f64) {
    let d = line(ray, [0.0; 2])[1];
    let square = dot(d, d);
    let (mut slope, mut grazing) = ([0.0; 2], 1.0_f64);
    for it in interfaces(solids, ray, 0.0) {
        let along = dot(it.normal, d);
        grazing = grazing.min(along.abs() / square.sqrt());
        let step = delta_of(it.media[1]) - delta_of(it.media[0]);
        for (k, axis) in [0, 2].into_iter().enumerate() {
            let tangent = (it.normal[axis] - it.normal[1] * d[axis]) / along;
            slope[k] -= step * square * tangent;
        }
    }
    (slope, grazing)
}

/// The largest error of the slope of a ray, as [`error_among`] has it.
pub(super) fn slope_error(near: &[[f64; 2]; 5], got: [f64; 2], room: f64) -> Option<f64> {
    let error = |k: usize| error_among(&near.map(|it| it[k]), got[k], room, 1e-10);
    Some(error(0)?.max(error(1)?))
}

/// f32 holds places of 40 mm to 4 nm.
pub(super) fn hair(all: &Arrangement) -> f64 {
    (2.4e-7 * length(all.middle)).max(3e-9)
}

fn bends_compared(solids: &[Solid], ray: &Ray, got: &RayResult, hair: f64) -> Result<f64, String> {
    let near = beside(hair).map(|by| first_order(solids, &moved(ray, by)));
    let steep = near.iter().map(|it| it.1).fold(1.0, f64::min).max(1e-6);
    let room = 2e-13 + 8e-12 / steep.powi(2);
    let got = [got.slope_x, got.slope_z].map(f64::from);
    slope_error(&near.map(|it| it.0), got, room)
        .ok_or_else(|| format!("{ray:?}: {got:?} for {:?} in {solids:?}", near[0]))
}

/// Number of lists of crossings of rays through arrangements, and the lists that differ from the reference.
fn wrong_lists(
    finder: &CrossingFinder,
    all: &[Arrangement],
    rays: &[(usize, Ray)],
) -> (usize, Vec<String>) {
    let public: Vec<beamlet::Ray> = rays
        .iter()
        .map(|(_, ray)| beamlet::Ray::new(0, [ray.x, ray.z], [ray.slope_x, ray.slope_z]))
        .collect();
    let (mut visited, mut wrong) = (0, Vec::new());
    let visit = |i: usize, met: &[SurfaceCrossing]| {
        let (of, ray) = &rays[i];
        let Arrangement { solids, first, .. } = &all[*of];
        let own = |it: &SurfaceCrossing| {
            let mut own = *it;
            own.object -= *first as u32;
            own
        };
        let met: Vec<SurfaceCrossing> = met.iter().map(own).collect();
        visited += 1;
        if !are_listed(solids, ray, &met, hair(&all[*of])) {
            wrong.push(format!("{of}: {ray:?} {met:?} in {solids:?}"));
        }
    };
    finder.find(&public, visit).expect("crossings");
    (visited, wrong)
}

#[test]
fn ways_and_bends_of_exact_shapes_that_cross_are_those_of_points_in_solids() {
    let bench = Bench::new();
    let mut random = Random::new(301);
    let (mut count, mut crossing, mut worst) = ([0; 3], 0, [0.0_f64; 2]);
    let (mut ways, mut bends, mut lists) = (Vec::new(), Vec::new(), Vec::new());
    for number in 0..scenes() {
        let far = if number % 4 == 3 { [3e-3, 9e-3, -2e-3] } else { [0.0; 3] };
        let all = arrangements(far, &mut random);
        let scene = scene_of(&all, Transport::FirstOrder);
        let sample = geometry::load(&scene).expect("a sample");
        assert!(sample.triangles.is_empty(), "an exact shape has become a mesh");
        crossing += sample.objects.iter().filter(|it| !it.cut_by.is_empty()).count();
        let rays = rays_through(&all, &mut random);
        let only: Vec<Ray> = rays.iter().map(|it| it.1).collect();
        for backend in backends() {
            if backend == Backend::RayQuery && number > 0 && number % 8 != 0 {
                continue;
            }
            let mut tracer = bench.tracer(backend, &scene);
            let (results, words) = tracer.trace_with_moments(&only).expect("results");
            let materials = materials(&all);
            let stride = MOMENTS_HEAD + (materials + 1) * MOMENTS_PER_MATERIAL;
            for (i, (of, ray)) in rays.iter().enumerate() {
                let Arrangement { solids, what, .. } = &all[*of];
                assert_eq!(words[i * stride + MOMENTS_BALANCE], 0, "{ray:?}, {solids:?}");
                let got = paths_of(&words, i, materials);
                let told = |it: String| format!("{backend}, scene {number}, {what}: {it}");
                let error = hair(&all[*of]);
                let way = compared(solids, ray, &got, results[i].crossings, error);
                let bend = bends_compared(solids, ray, &results[i], 2.0 * error);
                for ((found, worst), wrong) in
                    [way, bend].into_iter().zip(&mut worst).zip([&mut ways, &mut bends])
                {
                    match found {
                        Ok(it) => *worst = worst.max(it),
                        Err(it) => wrong.push(told(it)),
                    }
                }
                count[0] += 1;
            }
            let tally = tracer.tally();
            let failed = [tally.unbalanced, tally.not_finite, tally.dropped, tally.retraced];
            assert_eq!(failed, [0; 4], "{backend}");
        }
        let (visited, wrong) = wrong_lists(&bench.finder(&scene), &all, &rays);
        lists.extend(wrong.into_iter().map(|it| format!("scene {number}, {it}")));
        count[1] += visited;
        count[2] += all.len();
    }
    println!(
        "measured crossing shapes: {} arrangements, {crossing} shapes crossed by later ones; {} ways and {} \
         bends of {}, {} lists of {} differ; the others by {:.2e} m and {:.2e} rad where rays beside are equal",
        count[2],
        ways.len(),
        bends.len(),
        count[0],
        lists.len(),
        count[1],
        worst[0],
        worst[1]
    );
    for it in ways.iter().take(3).chain(bends.iter().take(3)).chain(lists.iter().take(2)) {
        println!("{it}");
    }
    assert!(crossing > count[2] / 2);
    assert_eq!([ways.len(), bends.len(), lists.len()], [0; 3]);
    bench.end();
}
