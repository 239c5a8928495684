//! Exact shapes that cross, touch and coincide, two to five in an arrangement (`BEAMLET_SCENES` times
//! 64 arrangements), against what lies inside along every ray in f64: ways, first order and Snell's law.

use super::nested::{are_listed, differs, interfaces};
use super::rays::{Passage, line};
use super::solids::{Kind, Solid, cylinder, sphere};
use super::{direction, ray_through, scene};
use crate::assemblies::{Bench, exact, paths_of};
use crate::reference::surfaces::Random;
use crate::reference::vector::{Vector, add, dot, length, scaled, sub, turned, unit};
use crate::support::{CARBON, WATER, backends};
use beamlet::internals::interface::{
    FLAG_REFLECTED, MOMENTS_BALANCE, MOMENTS_HEAD, MOMENTS_PER_MATERIAL, RayResult,
};
use beamlet::internals::trace::Ray;
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
struct Arrangement {
    what: &'static str,
    solids: Vec<Solid>,
    middle: Vector,
    /// Number of its first object.
    first: usize,
}

fn pick(random: &mut Random, count: usize) -> usize {
    (random.next() * count as f64) as usize
}

fn any_kind(random: &mut Random) -> Kind {
    let mut size = || 1e-3 * random.between(0.3, 1.2);
    let (a, b, c) = (size(), size(), size());
    match pick(random, 7) {
        0 | 1 => cylinder(a, 3.0 * b),
        2 => Kind::Cone { bottom: a, top: if b > c { 0.0 } else { 0.7 * b }, half: 1.5 * c },
        3 => sphere(a),
        4 => Kind::Ellipsoid([a, b, c]),
        5 => Kind::Torus { ring: a + 0.5 * b, tube: 0.4 * b },
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

fn arrangements(middle: Vector, random: &mut Random) -> Vec<Arrangement> {
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
            let turn =
                (direction(random), random.between(0.0, 3.0) * f64::from(number as u32 / 4 % 2));
            let off = |it: usize| PITCH * (it as f64 - 0.5 * ACROSS as f64);
            let middle = add(middle, [off(number % ACROSS), 0.0, off(number / ACROSS)]);
            let place = |solid: Solid| {
                let at = add(turned(solid.position, turn.0, turn.1), middle);
                solid.turned(turn.0, turn.1).at(at)
            };
            let solids: Vec<Solid> = solids.into_iter().map(place).collect();
            first += solids.len();
            Arrangement { what, first: first - solids.len(), solids, middle }
        })
        .collect()
}

fn constants(k: usize) -> [f64; 2] {
    if k.is_multiple_of(2) { CARBON } else { WATER }
}

fn scene_of(all: &[Arrangement], transport: Transport) -> Scene {
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

/// Rays through arrangements, with the number of that.
fn rays_through(all: &[Arrangement], random: &mut Random) -> Vec<(usize, Ray)> {
    let through = |of: usize, random: &mut Random| {
        let off = scaled(direction(random), 1.8e-3 * random.next());
        (of, ray_through(add(all[of].middle, off), 0, 0.0, random))
    };
    (0..all.len() * RAYS).map(|i| through(i / RAYS, random)).collect()
}

fn delta_of(medium: Option<usize>) -> f64 {
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

fn moved(ray: &Ray, by: [f64; 2]) -> Ray {
    let to = |x: f32, by: f64| (f64::from(x) + by) as f32;
    Ray { x: to(ray.x, by[0]), z: to(ray.z, by[1]), ..*ray }
}

const SIDES: [[f64; 2]; 5] = [[0.0; 2], [1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]];

/// Error of the slope of a ray, if it differs by more than the slope of a ray 4 nm beside.
fn bends_differ(solids: &[Solid], ray: &Ray, result: &RayResult, hair: f64) -> Option<String> {
    let near = SIDES.map(|by| first_order(solids, &moved(ray, by.map(|it| it * hair))));
    let steep = near.iter().map(|it| it.1).fold(1.0, f64::min).max(1e-6);
    let room = 2e-13 + 8e-12 / steep.powi(2);
    let got = [result.slope_x, result.slope_z].map(f64::from);
    let ok = (0..2).all(|k| {
        let of = near.iter().map(|it| it.0[k]);
        let (low, high) = (of.clone().fold(f64::MAX, f64::min), of.fold(f64::MIN, f64::max));
        let room = room + (high - low);
        (low - room..=high + room).contains(&got[k])
    });
    (!ok).then(|| format!("{ray:?}: {got:?} for {:?} in {solids:?}", near[0]))
}

#[test]
fn ways_and_bends_of_exact_shapes_that_cross_are_those_of_points_in_solids() {
    let scenes: usize = std::env::var("BEAMLET_SCENES").map_or(1, |it| it.parse().unwrap());
    let bench = Bench::new();
    let mut random = Random::new(301);
    let (mut compared, mut crossing) = ([0; 3], 0);
    let (mut ways, mut bends, mut lists) = (Vec::new(), Vec::new(), Vec::new());
    for number in 0..scenes {
        let far = if number % 4 == 3 { [3e-3, 9e-3, -2e-3] } else { [0.0; 3] };
        let all = arrangements(far, &mut random);
        let scene = scene_of(&all, Transport::FirstOrder);
        let sample = geometry::load(&scene).expect("a sample");
        assert!(sample.triangles.is_empty(), "an exact shape has become a mesh");
        crossing += sample.objects.iter().filter(|it| !it.cut_by.is_empty()).count();
        let rays = rays_through(&all, &mut random);
        let only: Vec<Ray> = rays.iter().map(|it| it.1).collect();
        // f32 holds places of 40 mm to 4 nm.
        let error = |it: &Arrangement| (2.4e-7 * length(it.middle)).max(3e-9);
        for backend in backends() {
            if backend == Backend::RayQuery && number > 0 && number % 8 != 0 {
                continue;
            }
            let mut tracer = bench.tracer(backend, &scene);
            let (results, words) = tracer.trace_with_moments(&only).expect("results");
            let stride = MOMENTS_HEAD + (MOST + 1) * MOMENTS_PER_MATERIAL;
            for (i, (of, ray)) in rays.iter().enumerate() {
                let Arrangement { solids, what, .. } = &all[*of];
                assert_eq!(words[i * stride + MOMENTS_BALANCE], 0, "{ray:?}, {solids:?}");
                let got = paths_of(&words, i, MOST);
                let told = |it: String| format!("{backend}, scene {number}, {what}: {it}");
                let error = error(&all[*of]);
                ways.extend(differs(solids, ray, &got, results[i].crossings, error).map(told));
                bends.extend(bends_differ(solids, ray, &results[i], 2.0 * error).map(told));
                compared[0] += 1;
            }
            let tally = tracer.tally().expect("a tally");
            let failed = [tally.unbalanced, tally.not_finite, tally.dropped, tally.retraced];
            assert_eq!(failed, [0; 4], "{backend}");
        }
        let public: Vec<beamlet::Ray> = only
            .iter()
            .map(|ray| beamlet::Ray::new(0, [ray.x, ray.z], [ray.slope_x, ray.slope_z]))
            .collect();
        let visit = |i: usize, met: &[SurfaceCrossing]| {
            let (of, ray) = &rays[i];
            let Arrangement { solids, first, .. } = &all[*of];
            let own = |it: &SurfaceCrossing| {
                let mut own = *it;
                own.object -= *first as u32;
                own
            };
            let met: Vec<SurfaceCrossing> = met.iter().map(own).collect();
            compared[1] += 1;
            if !are_listed(solids, ray, &met, error(&all[*of])) {
                lists.push(format!("scene {number}, {of}: {ray:?} {met:?} in {solids:?}"));
            }
        };
        bench.finder(&scene).find(&public, visit).expect("crossings");
        compared[2] += all.len();
    }
    println!(
        "measured crossing shapes: {} arrangements, {crossing} shapes crossed by later ones; {} ways and {} \
         bends of {}, {} lists of {} differ",
        compared[2],
        ways.len(),
        bends.len(),
        compared[0],
        lists.len(),
        compared[1]
    );
    for it in ways.iter().take(3).chain(bends.iter().take(3)).chain(lists.iter().take(2)) {
        println!("{it}");
    }
    assert!(crossing > compared[2] / 2);
    assert_eq!([ways.len(), bends.len(), lists.len()], [0; 3]);
    bench.end();
}

/// By Snell's law at one interface after the other, on the bent ray; layers thinner than
/// 5 nm across are none. `None`: it does not get out.
fn snell(solids: &[Solid], ray: &Ray, by: [f64; 2]) -> Option<(Passage, f64)> {
    let [mut o, d] = line(ray, by);
    let mut d = unit(d);
    o = sub(o, scaled(d, 1.0));
    let (mut passage, mut nearest) = (Passage { grazing: 1.0, ..Passage::default() }, 1.0_f64);
    let mut medium: Option<usize> = None;
    for _ in 0..200 {
        let mut hits: Vec<_> = solids.iter().flat_map(|it| it.hits(o, d)).collect();
        hits.retain(|hit| hit.t > 1e-11);
        hits.sort_by(|a, b| a.t.total_cmp(&b.t));
        let behind = |k: usize| {
            let end = hits.get(k + 1).map_or(hits[k].t + 1.0, |it| it.t);
            let middle = add(o, scaled(d, hits[k].t.midpoint(end)));
            solids.iter().rposition(|it| it.distance(middle) < 0.0)
        };
        let Some(first) = (0..hits.len()).find(|k| behind(*k) != medium) else {
            return medium.is_none().then_some((passage, nearest));
        };
        // How near another surface is, across: orders of surfaces in contact are not compared.
        let gaps = hits.windows(2).map(|pair| pair[1].t - pair[0].t);
        nearest = nearest.min(gaps.fold(1.0, f64::min));
        let hit = hits[first];
        let after_medium = behind(first);
        o = add(o, scaled(d, hit.t));
        passage.crossings += 1;
        let cosine = dot(hit.normal, d);
        let along = if cosine > 0.0 { hit.normal } else { scaled(hit.normal, -1.0) };
        let cosine = cosine.abs();
        passage.grazing = passage.grazing.min(cosine);
        let [from, to] = [delta_of(medium), delta_of(after_medium)];
        let ratio = (1.0 - from) / (1.0 - to);
        let tangent = sub(d, scaled(along, cosine));
        let square = cosine * cosine - (ratio - 1.0) * (ratio + 1.0) * dot(tangent, tangent);
        let after = if square < 0.0 {
            passage.reflected = true;
            sub(d, scaled(along, 2.0 * cosine))
        } else {
            medium = after_medium;
            add(scaled(tangent, ratio), scaled(along, square.sqrt()))
        };
        for (k, axis) in [0, 2].into_iter().enumerate() {
            let change = sub(after, d);
            passage.slope[k] += (change[axis] - change[1] * d[axis] / d[1]) / after[1];
        }
        d = unit(after);
    }
    None
}

/// Exact transport through the same arrangements: rays whose neighbours a hair beside pass alike, and
/// which no two surfaces cross within 50 nm.
#[test]
fn exact_rays_through_crossing_shapes_follow_snells_law() {
    let scenes: usize = std::env::var("BEAMLET_SCENES").map_or(1, |it| it.parse().unwrap());
    let bench = Bench::new();
    let mut random = Random::new(303);
    let (mut compared, mut unclear, mut reflected) = (0, 0, 0);
    let mut wrong = Vec::new();
    for number in 0..scenes {
        let all = arrangements([0.0; 3], &mut random);
        let scene = scene_of(&all, Transport::Exact);
        let rays = rays_through(&all, &mut random);
        let only: Vec<Ray> = rays.iter().map(|it| it.1).collect();
        for backend in backends() {
            if backend == Backend::RayQuery && number > 0 && number % 8 != 0 {
                continue;
            }
            let results = exact(&bench, backend, &scene, &only);
            for ((of, ray), result) in rays.iter().zip(&results) {
                let solids = &all[*of].solids;
                let hair = (2.4e-7 * length(all[*of].middle)).max(2e-9);
                let near: Option<Vec<(Passage, f64)>> =
                    SIDES.iter().map(|by| snell(solids, ray, by.map(|it| it * hair))).collect();
                let alike = |near: &Vec<(Passage, f64)>| {
                    near.iter().all(|(it, gap)| {
                        let first = &near[0].0;
                        (it.crossings, it.reflected) == (first.crossings, first.reflected)
                            && *gap > 5e-8
                    })
                };
                let Some(near) = near.filter(alike) else {
                    unclear += 1;
                    continue;
                };
                compared += 1;
                reflected += usize::from(near[0].0.reflected);
                let steep = near.iter().map(|it| it.0.grazing).fold(1.0, f64::min).max(1e-6);
                let room = 2e-13 + 8e-12 / steep.powi(2);
                let got = [result.slope_x, result.slope_z].map(f64::from);
                let ok = (0..2).all(|k| {
                    let of = near.iter().map(|it| it.0.slope[k]);
                    let low = of.clone().fold(f64::MAX, f64::min);
                    let high = of.fold(f64::MIN, f64::max);
                    let room = room + (high - low) + 1e-6 * high.abs().max(low.abs());
                    (low - room..=high + room).contains(&got[k])
                });
                let same = result.crossings as usize == near[0].0.crossings
                    && (result.flags & FLAG_REFLECTED != 0) == near[0].0.reflected;
                if !(ok && same) {
                    let want = &near[0];
                    wrong.push(format!("{backend}: {ray:?} {result:?} for {want:?} in {solids:?}"));
                }
            }
        }
    }
    println!(
        "measured exact transport through crossing shapes: {} of {compared} differ, {unclear} not clear, \
         {reflected} reflected",
        wrong.len()
    );
    wrong.iter().take(3).for_each(|it| println!("{it}"));
    assert!(compared > unclear && wrong.is_empty());
    bench.end();
}

/// The mouth of a bore in the face of a rod holds nothing that reflects: rays at 0.3 mrad to the face.
#[test]
fn mouth_of_a_bore_does_not_reflect() {
    let bench = Bench::new();
    let tilt = |solid: Solid| solid.turned([0.0, 0.0, 1.0], 0.4);
    let solids = [tilt(Solid::new(cylinder(2e-3, 4e-3))), tilt(Solid::new(cylinder(1.5e-3, 4e-3)))];
    // Into the mouth from above, through the middle of the upper face.
    let slope = -0.3e-3_f32;
    let ray = |k: u16| {
        let x = (f32::from(k) - 50.0) * 2e-5;
        Ray { x, z: 2e-3, slope_x: 0.0, slope_z: slope, view: 0, key: 0 }
    };
    let rays: Vec<Ray> = (0..=100).map(ray).collect();
    let strong = [50.0, 4.6e-6];
    for backend in backends() {
        let objects: Vec<_> =
            solids.iter().enumerate().map(|(k, it)| it.object(&format!("{k}"), "")).collect();
        for constants in [[strong, [0.0; 2]], [strong, strong]] {
            let scene = scene(objects.clone(), &constants, Transport::Exact);
            let results = exact(&bench, backend, &scene, &rays);
            let met: Vec<bool> = results.iter().map(|it| it.flags & FLAG_REFLECTED != 0).collect();
            // Where the bore is empty rays go through its mouth; where it is filled the face reflects.
            let filled = constants[1][1] > 0.0;
            assert!(met.iter().all(|it| *it == filled), "{backend}, {filled}: {met:?}");
        }
    }
    bench.end();
}
