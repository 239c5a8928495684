//! Single rays: the list of their crossings, and their sums of the first order.

use super::rays::{Passage, beside, first_order, hits, line};
use super::solids::{Kind, Solid};
use super::{KINDS, carbon, places, rays_around};
use crate::assemblies::Bench;
use crate::reference::surfaces::Random;
use crate::reference::vector::{add, length, scaled, sub, turned};
use crate::support::{CARBON, Worst, backends};
use beamlet::internals::trace::Ray;
use beamlet::scene::Transport;
use beamlet::{Backend, SurfaceCrossing};

/// Error of a crossing across the surface that f32 may leave, m. f32 holds a coordinate to 6e-8 of it: twice
/// for the place next to the axis, and twice for the root.
fn residual(solid: &Solid) -> f64 {
    1e-9_f64.max(2.4e-7 * (length(solid.position).hypot(solid.reach())))
}

/// The angle of a view as f32 holds its sine and cosine.
fn held(angle: f64) -> f64 {
    f64::from(angle.sin() as f32).atan2(f64::from(angle.cos() as f32))
}

/// True if the crossings of a ray are those of f64, or of a ray a hair beside it: objects apart,
/// entries and exits by turns, normals within what a hair and f32 turn them by.
fn is_listed(solid: &Solid, ray: &Ray, angle: f64, met: &[SurfaceCrossing]) -> bool {
    let hair = residual(solid);
    let turn = 1e-6 + 2.0 * hair / solid.roundness();
    beside(hair).into_iter().any(|by| {
        let want = hits(solid, ray, by, angle);
        want.len() == met.len()
            && want.iter().zip(met).all(|(want, met)| {
                let normal = met.normal.map(f64::from);
                met.entering == want.entering && length(sub(normal, want.normal)) < turn
            })
    })
}

#[test]
fn crossings_lie_on_the_surface_and_match_f64() {
    let bench = Bench::new();
    // A cone's side that a ray nearly follows costs convex shapes two more bits.
    let mut share = Worst::new("crossing over what f32 leaves", 4.0);
    let mut most = Worst::new("crossing, m", 6e-9);
    let mut random = Random::new(71);
    let (mut differ, mut rays_in_all, mut by_count) = (Vec::new(), 0, [0; 3]);
    for (name, kind) in KINDS {
        for (place, solid) in places(kind) {
            for angle in [0.0, 0.8] {
                let mut scene = carbon(&solid, Transport::FirstOrder);
                scene.scan.angles = vec![angle];
                let angle = held(angle);
                let rays = rays_around(&solid, 300, angle, &mut random);
                rays_in_all += rays.len();
                let finder = bench.finder(&scene);
                let visit = |i: usize, met: &[SurfaceCrossing]| {
                    let ray = &rays[i];
                    let what = || format!("{name}, {place}, {angle}, {ray:?}, {met:?}");
                    assert!(met.len().is_multiple_of(2) && met.len() <= 4, "{}", what());
                    by_count[met.len() / 2] += 1;
                    if !is_listed(&solid, ray, angle, met) {
                        differ.push(what());
                    }
                    let [o, d] = line(ray, [0.0; 2]).map(|v| turned(v, [0.0, 0.0, 1.0], angle));
                    for met in met {
                        let off = solid.distance(add(o, scaled(d, f64::from(met.y))));
                        // Along the ray f32 rounds y by itself.
                        share.take(off / residual(&solid), what);
                        most.take(off, what);
                    }
                };
                let rays: Vec<beamlet::Ray> = rays.iter().map(public).collect();
                finder.find(&rays, visit).expect("crossings");
            }
        }
    }
    println!("measured crossings: {by_count:?} of 0, 2 and 4, {} differ", differ.len());
    assert!(by_count[1] > rays_in_all / 3 && by_count[2] > 100, "{by_count:?}");
    share.holds();
    most.holds();
    // At a cosine of incidence of 0.05 and less y and the normal follow from a difference that f32
    // holds to 1e-4 of it or less.
    let few = rays_in_all / 5000;
    assert!(differ.len() <= few, "{} of {rays_in_all}: {:#?}", differ.len(), differ);
    bench.end();
}

fn public(ray: &Ray) -> beamlet::Ray {
    beamlet::Ray::new(ray.pose, [ray.x, ray.z], [ray.slope_x, ray.slope_z])
}

/// Deviations from sums of the first order.
struct FirstOrder {
    path: Worst,
    slope: Worst,
    displacement: Worst,
    interior: Worst,
    differ: Vec<String>,
    interior_rays: usize,
}

impl FirstOrder {
    fn new() -> Self {
        Self {
            path: Worst::new("first order, way times the least cosine over a hair's share", 1.0),
            slope: Worst::new("first order, slope over what f32 and a hair allow", 1.0),
            displacement: Worst::new("first order, displacement over the same", 1.0),
            interior: Worst::new("first order, slope of interior rays, rad", 5e-12),
            differ: Vec::new(),
            interior_rays: 0,
        }
    }

    /// Takes a ray: path, and slope and displacement.
    fn take(&mut self, solid: &Solid, ray: &Ray, path: f64, got: [f64; 4], count: u32, what: &str) {
        let hair = residual(solid);
        let near =
            beside(hair).map(|by| first_order(std::slice::from_ref(solid), &CARBON[1..], ray, by));
        let what = |want: &Passage| format!("{what}, {ray:?}: {path} {got:?} for {want:?}");
        let Some(want) = near.iter().find(|it| it.crossings == count as usize) else {
            self.differ.push(what(&near[0]));
            return;
        };
        if count == 0 {
            assert!(
                got.iter().all(|it| it.to_bits() << 1 == 0) && path.to_bits() << 1 == 0,
                "{}",
                what(want)
            );
            return;
        }
        let [o, d] = line(ray, [0.0; 2]);
        let round = hits(solid, ray, [0.0; 2], 0.0)
            .iter()
            .map(|hit| solid.roundness_at(add(o, scaled(d, hit.t))))
            .fold(f64::MAX, f64::min);
        // Steep surfaces beside the ray: what the hair changes, twice. f32: 1e-6 of the change, and
        // 1e-11/c² rad for each crossing (docs/developers/validation.md).
        let spread = |value: &dyn Fn(&Passage) -> f64| {
            let of = near.iter().filter(|it| it.crossings == count as usize).map(value);
            let centre = value(want);
            of.fold(0.0_f64, |most, it| most.max((it - centre).abs()))
        };
        let steep = near.iter().map(|it| it.grazing).fold(1.0, f64::min).max(1e-6);
        let room = 2.0 * spread(&|it| it.path) + 2.0 * f64::from(count) * hair / steep;
        self.path.take((path - want.path) / room, || what(want));
        let change = want.slope[0].hypot(want.slope[1]);
        let of_f32 = 1e-6 * change + f64::from(count) * 1e-11 * CARBON[1] / 4.6e-7 / steep.powi(2);
        for (k, value) in got.into_iter().enumerate() {
            let off = value - want.values()[k];
            let room = 2.0 * spread(&|it| it.values()[k])
                + if k < 2 { of_f32 } else { 0.6 * of_f32 + 1e-6 * want.values()[k].abs() };
            let worst = if k < 2 { &mut self.slope } else { &mut self.displacement };
            worst.take(off / room, || what(want));
            // Half a radius from a silhouette and more, as far as pixels are concerned.
            if k < 2 && steep > 0.3 && round > 0.15e-3 && spread(&|it| it.slope[k]) < 1e-12 {
                self.interior_rays += 1;
                self.interior.take(off, || what(want));
            }
        }
    }
}

#[test]
fn first_order_sums_match_f64_on_both_backends() {
    let bench = Bench::new();
    let mut all = FirstOrder::new();
    for backend in backends() {
        let mut random = Random::new(72);
        for (name, kind) in KINDS {
            for (place, solid) in places(kind) {
                let share = if backend == Backend::Bvh { 1 } else { 5 };
                let rays = rays_around(&solid, 2000 / share, 0.0, &mut random);
                let scene = carbon(&solid, Transport::FirstOrder);
                for (ray, it) in rays.iter().zip(bench.traced(backend, &scene, &rays, 1)) {
                    let (result, path) = (it.result, it.paths[0]);
                    let depth = f64::from(result.optical_depth) / CARBON[0];
                    assert!((path - depth).abs() <= 3e-7 * path, "{path} {depth}");
                    let got = [
                        result.slope_x,
                        result.slope_z,
                        result.displacement_x,
                        result.displacement_z,
                    ];
                    let what = format!("{backend}, {name}, {place}");
                    all.take(&solid, ray, path, got.map(f64::from), result.crossings, &what);
                }
            }
        }
    }
    println!("measured interior rays: {}, differ: {}", all.interior_rays, all.differ.len());
    all.path.holds();
    all.slope.holds();
    all.displacement.holds();
    all.interior.holds();
    assert!(all.differ.is_empty(), "{:#?}", &all.differ[..1]);
    bench.end();
}

/// T(x) = 2 sqrt(R² - x²) and a deflection of 2 delta x / sqrt(R² - x²) of a cylinder and of a sphere; of a tube those of
/// its outside less those of its bore. Along the axis of the tube its height, or nothing in the bore.
#[test]
fn cylinder_sphere_and_tube_are_the_lenses_of_the_textbook() {
    let bench = Bench::new();
    let mut slope = Worst::new("deflection by lenses of the textbook, rad", 1e-12);
    let mut path = Worst::new("way through them, m", 6e-9);
    let [outer, inner, half] = [2e-3, 1.5e-3, 4e-3];
    let tube = Solid::new(Kind::Tube { outer, inner, half });
    let lenses = [
        (Solid::new(super::cylinder(4e-3, 16e-3)), [4e-3, 0.0]),
        (Solid::new(super::sphere(4e-3)), [4e-3, 0.0]),
        (tube.clone(), [outer, inner]),
    ];
    let along = tube.turned([1.0, 0.0, 0.0], -std::f64::consts::FRAC_PI_2);
    let rays = |reach: f64| -> Vec<Ray> {
        let x = |k: i32| (0.02 * reach * f64::from(k)) as f32;
        let ray = |k| Ray { x: x(k), z: 0.0, slope_x: 0.0, slope_z: 0.0, pose: 0, key: 0 };
        (-50..=50).map(ray).collect()
    };
    for (backend, transport) in backends()
        .into_iter()
        .flat_map(|it| [Transport::FirstOrder, Transport::Exact].map(|by| (it, by)))
    {
        let trace = |solid: &Solid, rays: &[Ray]| {
            bench.tracer(backend, &carbon(solid, transport)).trace(rays).expect("results")
        };
        // Bent once, a ray meets the next surface some 1e-9 m beside the straight line.
        let room = if transport == Transport::Exact { 20.0 } else { 1.0 };
        for (solid, radii) in &lenses {
            let (mut squares, mut count) = (0.0, 0.0);
            let rays = rays(0.9 * radii[0]);
            for (ray, result) in rays.iter().zip(trace(solid, &rays)) {
                let x = f64::from(ray.x);
                let root = radii.map(|radius| (radius * radius - x * x).max(0.0).sqrt());
                let place = || format!("{backend}, {transport:?}, {:?}, x = {x}", solid.kind);
                let way = f64::from(result.optical_depth) / CARBON[0];
                path.take((way - 2.0 * (root[0] - root[1])) / room, place);
                slope.take(f64::from(result.slope_z), place);
                // Later surfaces of light that bends outwards: n < 1.
                let lens = |root: f64| if root > 0.0 { 2.0 * x / root } else { 0.0 };
                let off = f64::from(result.slope_x) - CARBON[1] * (lens(root[0]) - lens(root[1]));
                if root[1] == 0.0 || root[1] > 0.3 * radii[1] {
                    slope.take(off / room, place);
                    squares += (off / CARBON[1]).powi(2);
                    count += 1.0;
                }
            }
            // The last row of the table of docs/physics.md, "Curved surfaces".
            let share = f64::sqrt(squares / count);
            println!("measured {backend}, {:?}: {share:.1e} of delta", solid.kind);
            assert!(transport == Transport::Exact || share < 1e-6, "{share}");
        }
        let rays = rays(1.1 * outer);
        for (ray, result) in rays.iter().zip(trace(&along, &rays)) {
            let across = f64::from(ray.x).abs();
            let place = || format!("{backend}, {transport:?}, along the axis, {across} m from it");
            let want = if (inner..outer).contains(&across) { 2.0 * half } else { 0.0 };
            path.take(f64::from(result.optical_depth) / CARBON[0] - want, place);
            slope.take(f64::from(result.slope_x).hypot(f64::from(result.slope_z)), place);
        }
    }
    slope.holds();
    path.holds();
    bench.end();
}
