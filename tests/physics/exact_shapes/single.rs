//! Single rays: the list of their crossings, and their sums of the first order.

use super::rays::{Passage, beside, first_order, hits, line};
use super::solids::{Kind, Solid};
use super::{KINDS, carbon, places, rays_around};
use crate::assemblies::Bench;
use crate::reference::surfaces::Random;
use crate::reference::vector::{add, length, scaled, sub, turned};
use crate::support::{CARBON, Worst, backends};
use beamlet::internals::trace::Ray;
use beamlet::scene::{Scene, Transport};
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
        let near = beside(hair).map(|by| first_order(solid, CARBON[1], ray, by, 0.0));
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

/// Two cylinders of opposite sign: T(x) = 2 sqrt(R² - x²) - 2 sqrt(r² - x²), as a cylinder with a bore of
/// vacuum that ends in it is; along the axis the height, or nothing in the bore.
#[test]
fn tube_is_a_cylinder_less_its_bore() {
    let bench = Bench::new();
    let [outer, inner, half] = [2e-3, 1.5e-3, 4e-3];
    let tube = Solid::new(Kind::Tube { outer, inner, half });
    let cut = [(outer, half), (inner, 0.95 * half)]
        .map(|(radius, half)| Solid::new(super::cylinder(radius, 2.0 * half)).object("", ""));
    let along = tube.clone().turned([1.0, 0.0, 0.0], -std::f64::consts::FRAC_PI_2);
    let mut slope = Worst::new("deflection by a tube of 2 mm, rad", 2e-12);
    let mut path = Worst::new("way through it, m", 6e-9);
    let mut nested = Worst::new("slope of a tube less that of nested cylinders, rad", 2e-12);
    let at = |k: u16| (f32::from(k) - 50.0) * 4.1e-5;
    let ray = |k| Ray { x: at(k), z: 0.0, slope_x: 0.0, slope_z: 0.0, pose: 0, key: 0 };
    let rays: Vec<Ray> = (0..=100).map(ray).collect();
    for (backend, transport) in backends()
        .into_iter()
        .flat_map(|it| [Transport::FirstOrder, Transport::Exact].map(|by| (it, by)))
    {
        let trace = |scene: &Scene| bench.tracer(backend, scene).trace(&rays).expect("results");
        let objects = cut.to_vec();
        let cylinders = trace(&super::scene(objects, &[CARBON, [0.0; 2]], transport));
        for ((ray, result), other) in
            rays.iter().zip(trace(&carbon(&tube, transport))).zip(&cylinders)
        {
            let x = f64::from(ray.x);
            let root = |radius: f64| (radius * radius - x * x).max(0.0).sqrt();
            let lens = |radius: f64| {
                if root(radius) > 0.0 { 2.0 * CARBON[1] * x / root(radius) } else { 0.0 }
            };
            let place = || format!("{backend}, {transport:?}, x = {x}");
            // Bent once, a ray meets the next surface some 1e-9 m beside the straight line.
            let room = if transport == Transport::Exact { 10.0 } else { 1.0 };
            let way = f64::from(result.optical_depth) / CARBON[0];
            path.take((way - 2.0 * (root(outer) - root(inner))) / room, place);
            let steep = (root(inner) / inner).max(if root(inner) > 0.0 {
                0.0
            } else {
                root(outer) / outer
            });
            if steep > 0.3 {
                let want = lens(outer) - lens(inner);
                slope.take((f64::from(result.slope_x) - want) / room, place);
            }
            // f32 holds slopes of 1e-5 to 6e-13.
            nested.take(f64::from(result.slope_x - other.slope_x), place);
        }
        for (ray, result) in rays.iter().zip(trace(&carbon(&along, transport))) {
            let across = f64::from(ray.x).abs();
            let place = || format!("{backend}, {transport:?}, along the axis, {across} m from it");
            let want = if (inner..outer).contains(&across) { 2.0 * half } else { 0.0 };
            path.take(f64::from(result.optical_depth) / CARBON[0] - want, place);
            slope.take(f64::from(result.slope_x).hypot(f64::from(result.slope_z)), place);
        }
    }
    slope.holds();
    path.holds();
    nested.holds();
    bench.end();
}

/// Written down: T(x) = 2 sqrt(R² - x²), deflection 2 delta x / sqrt(R² - x²).
#[test]
fn cylinder_and_sphere_are_the_lenses_of_the_textbook() {
    let bench = Bench::new();
    let mut slope = Worst::new("deflection by a cylinder and a sphere of 4 mm, rad", 1e-12);
    let mut path = Worst::new("way through them, m", 3e-9);
    let radius = 4e-3;
    for solid in [Solid::new(super::cylinder(radius, 16e-3)), Solid::new(super::sphere(radius))] {
        for backend in backends() {
            let mut tracer = bench.tracer(backend, &carbon(&solid, Transport::FirstOrder));
            let at = |k: u16| (f32::from(k) - 50.0) * 7.2e-5;
            let ray = |k| Ray { x: at(k), z: 0.0, slope_x: 0.0, slope_z: 0.0, pose: 0, key: 0 };
            let rays: Vec<Ray> = (0..=100).map(ray).collect();
            let (mut squares, mut count) = (0.0, 0.0);
            for (ray, result) in rays.iter().zip(tracer.trace(&rays).expect("results")) {
                let x = f64::from(ray.x);
                let root = (radius * radius - x * x).sqrt();
                let place = || format!("{backend}, {:?}, x = {x}", solid.kind);
                // Later surfaces of light that bends outwards: n < 1.
                let want = 2.0 * CARBON[1] * x / root;
                slope.take(f64::from(result.slope_x) - want, place);
                if x.abs() < 0.8 * radius {
                    squares += ((f64::from(result.slope_x) - want) / CARBON[1]).powi(2);
                    count += 1.0;
                }
                slope.take(f64::from(result.slope_z), place);
                path.take(f64::from(result.optical_depth) / CARBON[0] - 2.0 * root, place);
            }
            // The last row of the table of docs/physics.md, "Curved surfaces".
            let share = f64::sqrt(squares / count);
            println!("measured {backend}, {:?}: {share:.1e} of delta", solid.kind);
            assert!(share < 1e-6, "{share}");
        }
    }
    slope.holds();
    path.holds();
    bench.end();
}
