//! Random arrangements of solids, each apart from the others in a scene, against what lies inside along every ray
//! in f64: ways, lists of crossings and, of exact shapes alone, changes of slope.

use super::makers::{EXACT, MIXED, MOST, Maker};
use super::rays::{are_listed, beside, compared, error_among, first_order, moved};
use super::solids::Solid;
use super::{direction, ray_through, scene, scenes};
use crate::assemblies::Bench;
use crate::reference::surfaces::Random;
use crate::reference::vector::{Vector, add, length, scaled, turned};
use crate::support::{CARBON, WATER, backends, everything, sample};
use beamlet::internals::interface::RayResult;
use beamlet::internals::trace::{CrossingFinder, Ray};
use beamlet::scene::{MaterialSpec, Scene, Transport};
use beamlet::{Backend, SurfaceCrossing, geometry};

/// Scenes of one kind: a square of arrangements, so far apart that no ray crosses two.
pub(super) struct Setting {
    name: &'static str,
    makers: [(&'static str, Maker); 4],
    /// Factor of the sizes of the makers.
    scale: f64,
    middle: Vector,
    /// Distance of two arrangements, and of a ray from the middle of its own, before scaling, m.
    pitch: f64,
    reach: f64,
    rays: usize,
}

const fn mixed(name: &'static str, scale: f64, middle: Vector) -> Setting {
    Setting { name, makers: MIXED, scale, middle, pitch: 80e-6, reach: 10e-6, rays: 24 }
}

const fn crossing(name: &'static str, middle: Vector) -> Setting {
    Setting { name, makers: EXACT, scale: 1.0, middle, pitch: 8e-3, reach: 1.8e-3, rays: 12 }
}

const MIXED_SETTINGS: [Setting; 4] = [
    mixed("2 um", 0.4, [0.0; 3]),
    mixed("5 um", 1.0, [0.0; 3]),
    mixed("100 um", 20.0, [0.0; 3]),
    mixed("5 um, 10 mm off the axis", 1.0, [8e-3, 5e-3, -4e-3]),
];
pub(super) const CROSSING: Setting = crossing("shapes that cross", [0.0; 3]);
const FAR: Setting = crossing("shapes that cross, far from the axis", [3e-3, 9e-3, -2e-3]);

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

impl Arrangement {
    /// f32 holds places of 40 mm to 4 nm.
    pub(super) fn hair(&self) -> f64 {
        (2.4e-7 * length(self.middle)).max(3e-9)
    }
}

impl Setting {
    /// Columns and rows of the square.
    fn across(&self) -> usize {
        let few = if self.scale > 10.0 { 2 } else { 3 };
        if self.is_exact() || everything() { 8 } else { few }
    }

    fn is_exact(&self) -> bool {
        self.makers[1].0 == EXACT[1].0
    }

    pub(super) fn at(&self, middle: Vector) -> Self {
        Self { middle, ..*self }
    }

    pub(super) fn arrangements(&self, random: &mut Random) -> Vec<Arrangement> {
        let across = self.across();
        let mut first = 0;
        (0..across * across)
            .map(|number| {
                let (what, maker) = self.makers[number % 4];
                let solids = maker(random);
                // Every other one as a whole in a direction of its own.
                let upright = (number / 4).is_multiple_of(2);
                let turn = (direction(random), random.between(0.0, 3.0));
                let turn = (turn.0, if upright { 0.0 } else { turn.1 });
                let off = |it: usize| self.scale * self.pitch * (it as f64 - 0.5 * across as f64);
                let middle = add(self.middle, [off(number % across), 0.0, off(number / across)]);
                let place = |solid: Solid| {
                    let at = turned(scaled(solid.position, self.scale), turn.0, turn.1);
                    solid.scaled(self.scale).turned(turn.0, turn.1).at(add(at, middle))
                };
                let solids: Vec<Solid> = solids.into_iter().map(place).collect();
                first += solids.len();
                Arrangement { what, first: first - solids.len(), solids, middle, upright }
            })
            .collect()
    }

    /// Rays through arrangements, with the number of that.
    pub(super) fn rays(&self, all: &[Arrangement], random: &mut Random) -> Vec<(usize, Ray)> {
        let through = |of: usize, random: &mut Random| {
            let off = scaled(direction(random), self.scale * self.reach * random.next());
            (of, ray_through(add(all[of].middle, off), 0, 0.0, random))
        };
        (0..all.len() * self.rays).map(|i| through(i / self.rays, random)).collect()
    }
}

/// Constants of the materials of an arrangement.
const CONSTANTS: [[f64; 2]; MOST] = [CARBON, WATER, CARBON, WATER, CARBON];
/// Decrements of the materials of an arrangement.
pub(super) const DELTAS: [f64; MOST] = [CARBON[1], WATER[1], CARBON[1], WATER[1], CARBON[1]];

pub(super) fn scene_of(all: &[Arrangement], transport: Transport) -> Scene {
    let mut scene = scene(Vec::new(), &[], transport);
    for (k, [mu, delta]) in CONSTANTS.into_iter().enumerate() {
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

/// The largest error of the slope of a ray where rays beside it have equal slopes (else 0), rad.
fn bends_compared(solids: &[Solid], ray: &Ray, got: &RayResult, hair: f64) -> Result<f64, String> {
    let near = beside(hair).map(|by| first_order(solids, &DELTAS, &moved(ray, by), [0.0; 2]));
    let steep = near.iter().map(|it| it.grazing).fold(1.0, f64::min).max(1e-6);
    let room = 2e-13 + 8e-12 / steep.powi(2);
    let got = [got.slope_x, got.slope_z].map(f64::from);
    let error = |k: usize| error_among(&near.map(|it| it.slope[k]), got[k], room, 1e-10);
    let [x, z] = [error(0), error(1)];
    x.zip(z)
        .map(|(x, z)| x.max(z))
        .ok_or_else(|| format!("{ray:?}: {got:?} for {:?} in {solids:?}", near[0]))
}

/// Number of lists of crossings of rays through arrangements, and the lists that differ from the reference.
fn wrong_lists(
    finder: &CrossingFinder,
    all: &[Arrangement],
    rays: &[(usize, Ray)],
    errors: &[f64],
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
        if !are_listed(solids, ray, &met, errors[*of]) {
            wrong.push(format!("{of}: {ray:?} {met:?} in {solids:?}"));
        }
    };
    finder.find(&public, visit).expect("crossings");
    (visited, wrong)
}

/// Rays that differ from the reference, and how many were compared.
#[derive(Default)]
struct Found {
    ways: Vec<String>,
    bends: Vec<String>,
    lists: Vec<String>,
    compared: [usize; 2],
    arrangements: usize,
    cut: usize,
    /// Largest errors of ways, m, and slopes, rad, where rays beside are equal.
    worst: [f64; 2],
}

impl Found {
    fn take(&mut self, bench: &Bench, setting: &Setting, number: usize, random: &mut Random) {
        let mut all = setting.arrangements(random);
        if !everything() && scenes() == 1 {
            all.truncate(24);
        }
        let scene = scene_of(&all, Transport::FirstOrder);
        let sample = geometry::load(&scene).expect("a sample");
        let exact = setting.is_exact();
        assert!(!exact || sample.triangles.is_empty(), "an exact shape has become a mesh");
        let is_cut = |it: &&Arrangement| {
            sample.objects[it.first..][..it.solids.len()].iter().any(|it| !it.cut_by.is_empty())
        };
        self.cut += all.iter().filter(is_cut).count();
        self.arrangements += all.len();
        // Facets of cut shapes are off those by 1e-8 m; f32 holds places to 6e-8 of them.
        let of_f32 = 2.4e-7 * length(setting.middle);
        let error = |it: &Arrangement| match exact {
            true => it.hair(),
            false => (if is_cut(&it) { 4e-8 } else { 2e-9_f64 }).max(of_f32),
        };
        let errors: Vec<f64> = all.iter().map(error).collect();
        let rays = setting.rays(&all, random);
        let only: Vec<Ray> = rays.iter().map(|it| it.1).collect();
        for backend in backends() {
            if backend == Backend::RayQuery && !number.is_multiple_of(if exact { 8 } else { 4 }) {
                continue;
            }
            let traced = bench.traced(backend, &scene, &only, materials(&all));
            for ((of, ray), it) in rays.iter().zip(&traced) {
                let Arrangement { solids, what, .. } = &all[*of];
                let error = errors[*of];
                let way = compared(solids, ray, &it.paths, it.result.crossings, error);
                let bend = match exact {
                    true => bends_compared(solids, ray, &it.result, 2.0 * error),
                    false => Ok(0.0),
                };
                for ((found, worst), wrong) in [way, bend]
                    .into_iter()
                    .zip(&mut self.worst)
                    .zip([&mut self.ways, &mut self.bends])
                {
                    match found {
                        Ok(it) => *worst = worst.max(it),
                        Err(it) => wrong.push(format!("{backend}, scene {number}, {what}: {it}")),
                    }
                }
                self.compared[0] += 1;
            }
        }
        let (visited, wrong) = wrong_lists(&bench.finder(&scene), &all, &rays, &errors);
        self.lists.extend(wrong.into_iter().map(|it| format!("scene {number}, {it}")));
        self.compared[1] += visited;
    }

    /// Prints what was compared, and fails where anything differs.
    fn hold(self, name: &str) {
        let Self { ways, bends, lists, compared, arrangements, cut, worst } = self;
        println!(
            "measured {name}: {cut} of {arrangements} arrangements cut; {} ways and {} bends of {}, {} lists of {} \
             differ; the others by {:.2e} m and {:.2e} rad where rays beside are equal",
            ways.len(),
            bends.len(),
            compared[0],
            lists.len(),
            compared[1],
            worst[0],
            worst[1]
        );
        for it in ways.iter().take(3).chain(bends.iter().take(3)).chain(lists.iter().take(2)) {
            println!("{it}");
        }
        assert!(cut > arrangements / 2, "{cut} of {arrangements}");
        assert_eq!([ways.len(), bends.len(), lists.len()], [0; 3], "{name}");
    }
}

#[test]
fn paths_through_random_arrangements_match_points_in_solids() {
    let bench = Bench::new();
    // The smallest and those off the axis; all with `BEAMLET_ALL`.
    for setting in sample(MIXED_SETTINGS.iter().collect(), 3) {
        let mut random = Random::new(71);
        let mut found = Found::default();
        for number in 0..scenes() {
            found.take(&bench, setting, number, &mut random);
        }
        found.hold(setting.name);
    }
    bench.end();
}

#[test]
fn ways_and_bends_of_exact_shapes_that_cross_are_those_of_points_in_solids() {
    let bench = Bench::new();
    let mut random = Random::new(301);
    let mut found = Found::default();
    for number in 0..scenes() {
        let setting = if number % 4 == 3 { &FAR } else { &CROSSING };
        found.take(&bench, setting, number, &mut random);
    }
    found.hold(CROSSING.name);
    bench.end();
}
