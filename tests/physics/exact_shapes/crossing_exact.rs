//! Exact transport through exact shapes that cross, touch and coincide, against Snell's law in f64 at one
//! interface after the other.

use super::arrangements::{Arrangement, CROSSING, delta_of, scene_of, slope_error};
use super::rays::{Passage, bend, beside, line, refracted};
use super::solids::{Kind, Solid, cylinder};
use super::{pick, scene, scenes};
use crate::assemblies::{Bench, exact};
use crate::reference::surfaces::Random;
use crate::reference::vector::{add, dot, scaled, sub, unit};
use crate::support::backends;
use beamlet::Backend;
use beamlet::internals::interface::FLAG_REFLECTED;
use beamlet::internals::trace::Ray;
use beamlet::scene::Transport;
use std::f64::consts::TAU;

/// Rays along the caps of an arrangement.
const GRAZING: usize = 12;
/// Surfaces coincide on a ray, m: f64 holds crossings at 1 mrad to 1e-13 m.
const SAME: f64 = 1e-11;

/// Passage by Snell's law at one interface after the other, on the bent ray, and how near two surfaces are
/// on it that do not coincide, and whether any coincide. `None`: it does not get out.
fn snell(solids: &[Solid], ray: &Ray, by: [f64; 2]) -> Option<(Passage, f64, bool)> {
    let [mut o, d] = line(ray, by);
    let mut d = unit(d);
    o = sub(o, scaled(d, 1.0));
    let (mut passage, mut nearest) = (Passage { grazing: 1.0, ..Passage::default() }, 1.0_f64);
    let mut coincide = false;
    let mut medium: Option<usize> = None;
    for _ in 0..200 {
        let mut hits: Vec<_> = solids.iter().flat_map(|it| it.hits(o, d)).collect();
        hits.retain(|hit| hit.t > SAME);
        hits.sort_by(|a, b| a.t.total_cmp(&b.t));
        let behind = |k: usize| {
            let from = hits[k].t + SAME;
            let end = hits.iter().find(|it| it.t > from).map_or(from + 1.0, |it| it.t);
            let middle = add(o, scaled(d, hits[k].t.midpoint(end)));
            solids.iter().rposition(|it| it.distance(middle) < 0.0)
        };
        let Some(first) = (0..hits.len()).find(|k| behind(*k) != medium) else {
            return medium.is_none().then_some((passage, nearest, coincide));
        };
        let gaps = hits.windows(2).map(|pair| pair[1].t - pair[0].t);
        coincide |= gaps.clone().any(|it| it <= SAME);
        nearest = nearest.min(gaps.filter(|it| *it > SAME).fold(1.0, f64::min));
        let hit = hits[first];
        let after_medium = behind(first);
        o = add(o, scaled(d, hit.t));
        passage.crossings += 1;
        let cosine = dot(hit.normal, d);
        let along = if cosine > 0.0 { hit.normal } else { scaled(hit.normal, -1.0) };
        passage.grazing = passage.grazing.min(cosine.abs());
        let (after, reflected) = refracted(d, along, [delta_of(medium), delta_of(after_medium)]);
        passage.reflected |= reflected;
        medium = if reflected { medium } else { after_medium };
        bend(&mut passage, d, after, o[1]);
        d = unit(after);
    }
    None
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

/// Rays that cross the same interfaces as the rays a hair beside them, where two surfaces on the ray coincide or
/// lie at least 50 nm apart.
#[test]
fn exact_rays_through_crossing_shapes_follow_snells_law() {
    let bench = Bench::new();
    let mut random = Random::new(303);
    let (mut compared, mut unclear, mut reflected, mut worst) = (0, 0, 0, 0.0_f64);
    let mut wrong = Vec::new();
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
            let results = exact(&bench, backend, &scene, &only);
            for ((of, ray), result) in rays.iter().zip(&results) {
                let solids = &all[*of].solids;
                let hair = all[*of].hair();
                let near: Option<Vec<(Passage, f64, bool)>> =
                    beside(hair).into_iter().map(|by| snell(solids, ray, by)).collect();
                let alike = |near: &Vec<(Passage, f64, bool)>| {
                    near.iter().all(|(it, gap, _)| {
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
                let slopes: [[f64; 2]; 5] = std::array::from_fn(|side| near[side].0.slope);
                let change = slopes.iter().flatten().fold(0.0_f64, |most, it| most.max(it.abs()));
                let room = 2e-13 + 8e-12 / steep.powi(2) + 1e-6 * change;
                let got = [result.slope_x, result.slope_z].map(f64::from);
                let found = slope_error(&slopes, got, room);
                if steep > 0.05 {
                    worst = worst.max(found.unwrap_or(0.0));
                }
                // Surfaces that coincide are counted, and are one interface.
                let crossings = result.crossings as usize;
                let counted = crossings == near[0].0.crossings
                    || (near[0].2 && crossings > near[0].0.crossings);
                let same = counted && (result.flags & FLAG_REFLECTED != 0) == near[0].0.reflected;
                if found.is_none() || !same {
                    let want = &near[0];
                    wrong.push(format!("{backend}: {ray:?} {result:?} for {want:?} in {solids:?}"));
                }
            }
        }
    }
    println!(
        "measured exact transport through crossing shapes: {} of {compared} differ, {unclear} not clear, \
         {reflected} reflected; others at a cosine above 0.05 by {worst:.2e} rad",
        wrong.len()
    );
    wrong.iter().take(3).for_each(|it| println!("{it}"));
    assert!(compared > unclear && reflected > compared / 50 && wrong.is_empty());
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
        Ray { x, z: 2e-3, slope_x: 0.0, slope_z: slope, pose: 0, key: 0 }
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
