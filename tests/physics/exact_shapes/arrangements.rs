//! Random arrangements (`BEAMLET_SCENES` times 16 of each of four kinds, 64 with `BEAMLET_ALL`)
//! of solids of seven kinds, each apart from the others in one of a few scenes, against
//! what lies inside along every ray in f64.

use super::nested::{are_listed, compared, interfaces, listed};
use super::solids::{Kind, Solid, cylinder, sphere};
use super::{direction, pick, ray_through, scene, scenes};
use crate::assemblies::{Bench, paths_of};
use crate::reference::surfaces::Random;
use crate::reference::vector::{Vector, add, length, scaled, turned};
use crate::support::{CARBON, WATER, backends, everything};
use beamlet::internals::interface::{MOMENTS_BALANCE, MOMENTS_HEAD, MOMENTS_PER_MATERIAL};
use beamlet::internals::trace::Ray;
use beamlet::scene::{MaterialSpec, Scene, Transport};
use beamlet::{Backend, SurfaceCrossing, geometry};

/// Columns and rows of the square of arrangements of a scene, which are so far apart that no ray
/// crosses two.
fn across() -> usize {
    if everything() { 8 } else { 4 }
}

const PITCH: f64 = 80e-6;

/// Scenes of one kind: how large solids are, over the micrometres below, and the middle of the scene.
struct Setting {
    name: &'static str,
    scale: f64,
    middle: Vector,
}

const SETTINGS: [Setting; 4] = [
    Setting { name: "5 um", scale: 1.0, middle: [0.0; 3] },
    Setting { name: "2 um", scale: 0.4, middle: [0.0; 3] },
    Setting { name: "100 um", scale: 20.0, middle: [0.0; 3] },
    Setting { name: "5 um, 10 mm off the axis", scale: 1.0, middle: [8e-3, 5e-3, -4e-3] },
];
/// Objects of an arrangement at most, each of a material of its own.
const MOST: usize = 5;
const RAYS: usize = 8;

/// Solids that overlap, touch, coincide or stand in one another, around the origin.
#[derive(Debug)]
struct Arrangement {
    solids: Vec<Solid>,
    middle: Vector,
    /// Number of its first object.
    first: usize,
}

fn any_kind(random: &mut Random, size: f64) -> Kind {
    let mut length = || size * random.between(0.4, 1.5);
    let (a, b, c) = (length(), length(), length());
    match pick(random, 8) {
        0 => Kind::Box([a, b, c]),
        1 => Kind::Prism { radius: 0.6 * a, half: 0.5 * b, sides: 3 + pick(random, 10) as u32 },
        2 => cylinder(0.5 * a, b),
        3 => sphere(0.5 * a),
        4 => Kind::Cone { bottom: 0.6 * a, top: 0.3 * b, half: 0.5 * c },
        5 => Kind::Ellipsoid([0.5 * a, 0.5 * b, 0.5 * c]),
        _ => Kind::Tube { outer: 0.5 * a, inner: 0.35 * a, half: 0.5 * b },
    }
}

/// Overlapping at random, up to three and more at a place.
fn anyhow(random: &mut Random, room: f64) -> Vec<Solid> {
    let one = |random: &mut Random| {
        let kind = any_kind(random, 8e-6);
        let place = scaled(direction(random), room * random.next());
        Solid::new(kind).turned(direction(random), random.between(0.0, 3.0)).at(place)
    };
    (0..2 + pick(random, MOST - 1)).map(|_| one(random)).collect()
}

/// On a grid of 2 um: faces, edges and corners that coincide, axes in common.
fn on_a_grid(random: &mut Random) -> Vec<Solid> {
    let unit = 2e-6;
    let whole = |random: &mut Random, count: usize| unit * (1 + pick(random, count)) as f64;
    let one = |random: &mut Random| {
        let size = [0; 3].map(|_| 2.0 * whole(random, 3));
        let kind = match pick(random, 4) {
            0 | 1 => Kind::Box(size),
            2 => Kind::Prism { radius: 0.5 * size[0], half: 0.5 * size[2], sides: 6 },
            _ => cylinder(0.5 * size[0], size[2]),
        };
        let place = [0; 3].map(|_| whole(random, 4) - 3.0 * unit);
        Solid::new(kind).at(place)
    };
    (0..2 + pick(random, MOST - 1)).map(|_| one(random)).collect()
}

/// One in the other, the order of some the other way round, and one across.
fn nested(random: &mut Random) -> Vec<Solid> {
    let turn = (direction(random), random.between(0.0, 3.0));
    let mut solids: Vec<Solid> = (0..3)
        .map(|k| {
            let size = 16e-6 * 0.5_f64.powi(k);
            let kind = match pick(random, 3) {
                0 => Kind::Box([size; 3]),
                1 => cylinder(0.5 * size, size),
                _ => sphere(0.5 * size),
            };
            Solid::new(kind).turned(turn.0, turn.1)
        })
        .collect();
    if pick(random, 2) == 0 {
        solids.swap(0, 1);
    }
    if pick(random, 2) == 0 {
        solids.extend(anyhow(random, 10e-6).into_iter().take(1));
    }
    solids
}

/// Stacked face to face, of sections of their own.
fn stacked(random: &mut Random) -> Vec<Solid> {
    let mut z = -8e-6;
    (0..2 + pick(random, MOST - 1))
        .map(|_| {
            let height = 1e-6 * (2 + pick(random, 4)) as f64;
            let width = random.between(3e-6, 14e-6);
            let kind = match pick(random, 3) {
                0 => Kind::Box([width, 1.1 * width, height]),
                1 => Kind::Prism { radius: width, half: 0.5 * height, sides: 8 },
                _ => cylinder(0.5 * width, height),
            };
            z += height;
            Solid::new(kind).at([0.0, 0.0, z - 0.5 * height])
        })
        .collect()
}

/// A solid of a size of its own, m, made larger.
fn enlarged(solid: Solid, by: f64) -> Solid {
    let kind = match solid.kind {
        Kind::Box(size) => Kind::Box(size.map(|it| it * by)),
        Kind::Prism { radius, half, sides } => {
            Kind::Prism { radius: radius * by, half: half * by, sides }
        }
        Kind::Cone { bottom, top, half } => {
            Kind::Cone { bottom: bottom * by, top: top * by, half: half * by }
        }
        Kind::Ellipsoid(axes) => Kind::Ellipsoid(axes.map(|it| it * by)),
        Kind::Tube { outer, inner, half } => {
            Kind::Tube { outer: outer * by, inner: inner * by, half: half * by }
        }
    };
    Solid { kind, position: scaled(solid.position, by), ..solid }
}

fn arrangements(setting: &Setting, random: &mut Random) -> Vec<Arrangement> {
    let mut first = 0;
    (0..across() * across())
        .map(|number| {
            let solids = match number % 4 {
                0 => anyhow(random, 8e-6),
                1 => on_a_grid(random),
                2 => nested(random),
                _ => stacked(random),
            };
            // Every other one as a whole in a direction of its own.
            let turn =
                (direction(random), random.between(0.0, 3.0) * f64::from(number as u32 / 4 % 2));
            let off = |it: usize| setting.scale * PITCH * (it as f64 - 0.5 * across() as f64);
            let middle = add(setting.middle, [off(number % across()), 0.0, off(number / across())]);
            let place = |solid: Solid| {
                let solid = enlarged(solid, setting.scale);
                let at = add(turned(solid.position, turn.0, turn.1), middle);
                solid.turned(turn.0, turn.1).at(at)
            };
            let solids: Vec<Solid> = solids.into_iter().map(place).collect();
            first += solids.len();
            Arrangement { first: first - solids.len(), solids, middle }
        })
        .collect()
}

fn scene_of(all: &[Arrangement]) -> Scene {
    let mut scene = scene(Vec::new(), &[], Transport::FirstOrder);
    for k in 0..MOST {
        let [mu, delta] = if k % 2 == 0 { CARBON } else { WATER };
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

/// Rays that differ.
#[derive(Default)]
struct Differing {
    ways: Vec<String>,
    lists: Vec<String>,
    compared: [usize; 2],
    cut: usize,
}

impl Differing {
    fn take(&mut self, bench: &Bench, setting: &Setting, number: usize, random: &mut Random) {
        let all = arrangements(setting, random);
        let scene = scene_of(&all);
        let sample = geometry::load(&scene).expect("a sample");
        let is_cut = |it: &&Arrangement| {
            sample.objects[it.first..][..it.solids.len()].iter().any(|it| !it.cut_by.is_empty())
        };
        self.cut += all.iter().filter(is_cut).count();
        // Facets that stand for cut shapes are off those by 1e-8 m; f32 holds places to 6e-8 of them.
        let of_f32 = 2.4e-7 * length(setting.middle);
        let error = |it: &Arrangement| (if is_cut(&it) { 4e-8 } else { 2e-9_f64 }).max(of_f32);
        let errors: Vec<f64> = all.iter().map(error).collect();
        let through = |of: usize, random: &mut Random| {
            let off = scaled(direction(random), setting.scale * 10e-6 * random.next());
            (of, ray_through(add(all[of].middle, off), 0, 0.0, random))
        };
        let rays: Vec<(usize, Ray)> =
            (0..all.len() * RAYS).map(|i| through(i / RAYS, random)).collect();
        let only: Vec<Ray> = rays.iter().map(|it| it.1).collect();
        for backend in backends() {
            if backend == Backend::RayQuery && !number.is_multiple_of(4) {
                continue;
            }
            let (results, words) =
                bench.tracer(backend, &scene).trace_with_moments(&only).expect("results");
            let stride = MOMENTS_HEAD + (MOST + 1) * MOMENTS_PER_MATERIAL;
            for (i, (of, ray)) in rays.iter().enumerate() {
                let solids = &all[*of].solids;
                assert_eq!(words[i * stride + MOMENTS_BALANCE], 0, "{ray:?}, {solids:?}");
                let got = paths_of(&words, i, MOST);
                self.ways.extend(
                    compared(solids, ray, &got, results[i].crossings, errors[*of])
                        .err()
                        .map(|it| format!("{backend}, scene {number}, {of}: {it}")),
                );
                self.compared[0] += 1;
            }
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
            self.compared[1] += 1;
            if !are_listed(solids, ray, &met, errors[*of]) {
                let least = 3.0 * errors[*of];
                self.lists.push(format!(
                    "scene {number}, {of}: {ray:?} {met:?}, listed {:?} for {:?} in {solids:?}",
                    listed(&met, solids.len(), least),
                    interfaces(solids, ray, least),
                ));
            }
        };
        bench.finder(&scene).find(&public, visit).expect("crossings");
    }
}

#[test]
fn paths_through_random_arrangements_match_points_in_solids() {
    let scenes = scenes();
    let bench = Bench::new();
    let mut wrong = 0;
    for setting in &SETTINGS {
        let mut random = Random::new(71);
        let mut found = Differing::default();
        for number in 0..scenes {
            found.take(&bench, setting, number, &mut random);
        }
        println!(
            "measured arrangements of {}: {} of {} cut, {} of {} ways and {} of {} lists differ",
            setting.name,
            found.cut,
            scenes * across() * across(),
            found.ways.len(),
            found.compared[0],
            found.lists.len(),
            found.compared[1]
        );
        for it in found.ways.iter().chain(&found.lists).take(4) {
            println!("{it}");
        }
        assert!(found.cut > scenes * across() * across() / 2);
        wrong += found.ways.len() + found.lists.len();
    }
    assert_eq!(wrong, 0);
    bench.end();
}
