//! Single rays: closed forms of simple bodies, and the engine's f32 walks against the f64
//! reference on the same rays through the same vertices.

#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "counts are small; rays are rounded to f32 as the engine takes them"
)]

use crate::reference::closed_form::{critical_angle, cylinder_deflection};
use crate::reference::rays::{Order, Sample, Trace};
use crate::reference::scenes;
use crate::reference::stack::Setup;
use crate::reference::surfaces::{Body, Mesh, Random, body, cuboid, cylinder, sphere, star, wedge};
use crate::support::{CARBON, Checked, WATER, Worst, amount, engine};
use beamlet::Backend;
use beamlet::internals::interface::{FLAG_EXACT, FLAG_REFLECTED};
use beamlet::internals::trace::{Moments, Ray, RayResult, moments};
use beamlet::material;
use beamlet::scene::{Scene, Transport};

/// Source to rotation centre, and rotation centre to analyser, m.
const SOURCE: f64 = 1.21;
const LEVER: f64 = 0.59;
/// Path lengths, m: coordinates of millimetres are held to 6e-11 m by f32, which steep facets
/// and their number magnify.
const PATH: f64 = 0.05e-6;
/// Slopes are allowed 1e-6 of their change and 1e-11 / c^2 rad at each surface, and do with a
/// twentieth: f32 holds normals to 6e-8.
const SHARE: f64 = 0.05;

fn carbon(mesh: Mesh) -> Body {
    body(mesh.rounded(), CARBON[0], CARBON[1])
}

/// The ray as the engine gets it: rounded to f32.
pub(crate) fn ray(x: f64, z: f64, slope: [f64; 2], view: u32) -> Ray {
    Ray {
        x: x as f32,
        z: z as f32,
        slope_x: slope[0] as f32,
        slope_z: slope[1] as f32,
        pose: view,
        key: 0,
    }
}

/// A cone-beam ray from the source's centre through (x, z) at the rotation centre.
fn cone(x: f64, z: f64) -> Ray {
    ray(x, z, [x / SOURCE, z / SOURCE], 0)
}

/// Traces on the software backend; the rays of `angles` other than 0 name their view.
fn trace(
    engine: &Checked,
    bodies: &[Body],
    angles: &[f64],
    transport: Transport,
    rays: &[Ray],
) -> (Vec<RayResult>, Moments) {
    // Bodies here may be wider than the space behind a mask.
    let mut setup = Setup::paper([16, 16]);
    setup.sample_mask = None;
    let mut scene = scenes::scene(&setup, bodies, &[0.0]);
    scene.scan.angles = angles.to_vec();
    scene.sampling.transport = transport;
    let simulation = engine.prepare(&scene).expect("a sample");
    moments(&simulation, rays).expect("results")
}

/// The very same ray in the reference, f32 numbers and all.
fn reference(sample: &Sample, ray: &Ray, order: Order) -> Trace {
    let slope = [f64::from(ray.slope_x), f64::from(ray.slope_z)];
    let from =
        [f64::from(ray.x) - SOURCE * slope[0], -SOURCE, f64::from(ray.z) - SOURCE * slope[1]];
    sample.trace(from, [slope[0], 1.0, slope[1]], LEVER, order)
}

/// Deviation of a slope that f32 may cause: 1e-6 of each change, and 1e-11 / c^2 rad at each surface.
fn slope_room(want: &Trace) -> f64 {
    let change = want.slope[0].hypot(want.slope[1]);
    1e-6 * change + want.crossings as f64 * 1e-11 / want.grazing.powi(2)
}

/// Compares rays with the reference; gives how many were compared.
#[derive(Debug)]
struct Deviations {
    slope: Worst,
    path: Worst,
    displacement: Worst,
    /// Rays whose crossings differ: an edge decided either way.
    other: usize,
    rays: usize,
}

impl Deviations {
    fn new(names: [&'static str; 3]) -> Self {
        Self {
            slope: Worst::new(names[0], SHARE),
            path: Worst::new(names[1], PATH),
            displacement: Worst::new(names[2], SHARE),
            other: 0,
            rays: 0,
        }
    }

    fn holds(self) {
        self.slope.holds();
        self.path.holds();
        self.displacement.holds();
    }

    fn take(&mut self, result: &RayResult, path: Option<f64>, want: &Trace, place: &str) {
        self.rays += 1;
        assert!(want.balanced, "{place}");
        if result.crossings as usize != want.crossings {
            self.other += 1;
            return;
        }
        if want.crossings == 0 {
            assert_eq!(bytes(result), [0; 5], "{place}");
            return;
        }
        let room = slope_room(want);
        let got = [result.slope_x, result.slope_z].map(f64::from);
        let shift = [result.displacement_x, result.displacement_z].map(f64::from);
        for k in 0..2 {
            let place = || format!("{place}: {result:?} for {want:?}");
            self.slope.take((got[k] - want.slope[k]) / room, place);
            // The lever is rounded to f32, and the hit moves by the slope's error before it.
            let room = room * LEVER + 1e-6 * want.displacement[k].abs();
            self.displacement.take((shift[k] - want.displacement[k]) / room, place);
        }
        if let Some(path) = path {
            let want: f64 = want.path.iter().sum();
            self.path.take(path - want, || format!("{place}: {result:?}"));
        }
    }
}

#[test]
fn slab_attenuates_by_its_thickness() {
    let mut worst = Worst::new("transport, slab, path length (m)", PATH);
    let slab = [carbon(cuboid([8e-3, 5e-3, 8e-3]))];
    let mut random = Random::new(1);
    let rays: Vec<Ray> =
        (0..2000).map(|_| cone(random.between(-3e-3, 3e-3), random.between(-3e-3, 3e-3))).collect();
    let (results, moments) = trace(&engine(Backend::Bvh), &slab, &[0.0], Transport::Auto, &rays);
    for (i, (ray, result)) in rays.iter().zip(&results).enumerate() {
        let slope = [ray.slope_x, ray.slope_z].map(f64::from);
        let want = 5e-3 * (1.0 + slope[0] * slope[0] + slope[1] * slope[1]).sqrt();
        worst.take(f64::from(moments.of(i, 1).path) - want, || format!("{ray:?}"));
        worst.take(f64::from(result.optical_depth) / CARBON[0] - want, || format!("{ray:?}"));
        // The surroundings lose what the slab takes.
        worst.take(f64::from(moments.of(i, 0).path) + want, || format!("{ray:?}"));
        // Both faces bend alike, backwards and forwards, 5 mm apart.
        assert!(
            result.slope_x.abs() < 1e-14
                && result.displacement_x.abs() < 1.1 * 5e-3 * 4.6e-7 * 3e-3
        );
    }
    worst.holds();
}

#[test]
fn wedge_turns_light_by_delta_times_tan_angle() {
    // Snell's law at the one inclined face; f32 holds the tangent to 1e-7.
    let mut exact = Worst::new("transport, wedge, exact slope, relative", 1e-6);
    let mut first = Worst::new("transport, wedge, first order slope, relative", 1e-6);
    let mut lever = Worst::new("transport, wedge, displacement, relative", 1e-6);
    let engine = engine(Backend::Bvh);
    for angle in [0.1_f64, 0.5, 1.0, 1.4] {
        let mesh = wedge(2e-3, angle, 2e-3).moved([-1e-3, 0.0, 0.0]).rounded();
        let bodies = [body(mesh, CARBON[0], CARBON[1])];
        let rays = [ray(0.3e-3, 0.1e-3, [0.0; 2], 0)];
        let run = |transport| trace(&engine, &bodies, &[0.0], transport, &rays).0[0];
        let place = || format!("{angle} rad");
        let want = (((1.0 - CARBON[1]) * angle.sin()).asin() - angle).tan();
        let got = run(Transport::Exact);
        exact.take(f64::from(got.slope_x) / want - 1.0, place);
        let want = -CARBON[1] * angle.tan();
        let got = run(Transport::FirstOrder);
        first.take(f64::from(got.slope_x) / want - 1.0, place);
        let want = want * (LEVER - 1.3e-3 * angle.tan());
        lever.take(f64::from(got.displacement_x) / want - 1.0, place);
    }
    exact.holds();
    first.holds();
    lever.holds();
}

#[test]
fn cylinder_and_sphere_deflect_as_lenses() {
    // Facets: 20,000 around are 1.6e-4 of the angle at x = 0.87 R and 4,000 are 8e-4, 20 * 4^7
    // triangles 4 mrad across are 1 %.
    let (sides, turn) = amount((4_000, 1e-3), (20_000, 2e-4));
    let (levels, width) = amount((6, 3e-2), (7, 1.5e-2));
    for (mesh, facets, name) in [
        (cylinder(4e-3, 16e-3, sides, 0.25), turn, "transport, cylinder, displacement, relative"),
        (sphere(4e-3, levels), width, "transport, sphere, displacement, relative"),
    ] {
        let mut worst = Worst::new(name, facets);
        let mut chord = Worst::new("transport, round bodies, chord (m)", 1e-6);
        let bodies = [body(mesh, CARBON[0], CARBON[1])];
        let heights = [-3.5e-3_f64, -2.0e-3, 0.5e-3, 3e-3];
        let rays: Vec<Ray> = heights.iter().map(|&x| ray(x, 0.01e-3, [0.0; 2], 0)).collect();
        let engine = engine(Backend::Bvh);
        let scale = cylinder_deflection(CARBON[1], 4e-3, 3.5e-3) * LEVER;
        for transport in [Transport::FirstOrder, Transport::Exact] {
            let (results, moments) = trace(&engine, &bodies, &[0.0], transport, &rays);
            for (i, &x) in heights.iter().enumerate() {
                let want = cylinder_deflection(CARBON[1], 4e-3, x) * LEVER;
                let got = f64::from(results[i].displacement_x);
                assert!(got.signum() == x.signum(), "delta > 0 spreads light");
                worst.take((got - want) / scale, || format!("x = {x}: {got} for {want}"));
                let want = 2.0 * (16e-6 - x * x).sqrt();
                chord.take(f64::from(moments.of(i, 1).path) - want, || format!("x = {x}"));
            }
        }
        worst.holds();
        chord.holds();
    }
}

#[test]
fn nested_shells_and_voids_count_where_nothing_lies_inside() {
    let shells = [
        carbon(cylinder(3e-3, 8e-3, 64, 0.1)),
        body(cuboid([2e-3; 3]).rounded(), WATER[0], WATER[1]),
        body(cuboid([1e-3; 3]).rounded(), 0.0, 0.0),
    ];
    let mut deviations = Worst::new("transport, shells and void, path (m)", PATH);
    let mut random = Random::new(2);
    let rays: Vec<Ray> = (0..500)
        .map(|_| cone(random.between(-2.5e-3, 2.5e-3), random.between(-1.5e-3, 1.5e-3)))
        .collect();
    let sample = Sample::new(&shells, SOURCE, 0.0);
    let engine = engine(Backend::Bvh);
    for (transport, order) in
        [(Transport::FirstOrder, Order::First), (Transport::Exact, Order::Exact)]
    {
        let (results, moments) = trace(&engine, &shells, &[0.0], transport, &rays);
        for (i, ray) in rays.iter().enumerate() {
            let want = reference(&sample, ray, order);
            assert_eq!((moments.balance(i), want.balanced), (0, true));
            for (body, want) in want.path.iter().enumerate() {
                let got = f64::from(moments.of(i, body + 1).path);
                deviations.take(got - want, || format!("body {body}, {ray:?}"));
            }
            let depth = f64::from(results[i].optical_depth) - want.optical_depth;
            deviations.take(depth / CARBON[0], || format!("depth, {transport:?}, {ray:?}"));
        }
    }
    deviations.holds();
    // A ball of void in a block turns light as the ball in empty space would, but backwards.
    let mut void = Worst::new("transport, void against solid, slope (rad)", 1e-13);
    let ball = sphere(1e-3, 4);
    let hollow = [carbon(cuboid([4e-3; 3])), body(ball.clone().rounded(), 0.0, 0.0)];
    let rays = [ray(0.6e-3, 0.1e-3, [0.0; 2], 0)];
    let run = |bodies: &[Body]| trace(&engine, bodies, &[0.0], Transport::FirstOrder, &rays).0[0];
    let (a, b) = (run(&hollow), run(&[carbon(ball)]));
    void.take(f64::from(a.slope_x + b.slope_x), || format!("{a:?} and {b:?}"));
    assert!(b.slope_x > 1e-7);
    void.holds();
}

#[test]
fn flat_face_reflects_below_the_critical_angle_and_refracts_above() {
    // Slopes near 1e-3 are held to 6e-11 rad by f32, and twice that comes back; refraction near
    // the critical angle magnifies it by slope / slope out.
    let mut worst = Worst::new("transport, flat face near the critical angle (rad)", 2e-9);
    let slab = cuboid([2e-3, 8e-3, 4e-3]).moved([-1e-3, 0.0, 0.0]);
    let bodies = [body(slab.rounded(), CARBON[0], CARBON[1])];
    let critical = critical_angle(CARBON[1]);
    let engine = engine(Backend::Bvh);
    for share in [0.2, 0.9, 0.99, 1.01, 1.1, 2.0, 10.0] {
        let slope = f64::from((share * critical).tan() as f32);
        // Meets the face x = 0 at y = 0.
        let rays = [ray(0.0, 0.0, [-slope, 0.0], 0)];
        let result = trace(&engine, &bodies, &[0.0], Transport::Auto, &rays).0[0];
        assert!(
            result.flags & FLAG_EXACT != 0,
            "{share} of the critical angle is not traced again"
        );
        let (got, depth) = (f64::from(result.slope_x), result.optical_depth);
        let want = if share < 1.0 {
            assert!(result.flags & FLAG_REFLECTED != 0 && depth == 0.0, "{share}: {result:?}");
            2.0 * slope
        } else {
            assert!(result.flags & FLAG_REFLECTED == 0 && depth > 0.0, "{share}: {result:?}");
            // Out of the back face: cos is kept times n, from the face's side to its back.
            let n = 1.0 - CARBON[1];
            let grazing = slope.atan();
            slope - (grazing.sin().powi(2) - CARBON[1] * (1.0 + n)).sqrt().asin().tan()
        };
        worst.take(got - want, || format!("{share} of the critical angle: {got:e} for {want:e}"));
    }
    worst.holds();
}

/// Rays all over a body of radius `reach`, from the source or parallel.
fn rays_over(reach: f64, count: usize, views: u32, random: &mut Random) -> Vec<Ray> {
    (0..count)
        .map(|i| {
            let (x, z) = (random.between(-reach, reach), random.between(-reach, reach));
            let slope = if i % 2 == 0 { [x / SOURCE, z / SOURCE] } else { [0.0; 2] };
            ray(x, z, slope, i as u32 % views)
        })
        .collect()
}

#[test]
fn f32_walk_is_the_f64_walk_on_random_meshes() {
    let mut first = Deviations::new([
        "transport, first order slope, share of 1e-6 + 1e-11/c2",
        "transport, first order path (m)",
        "transport, first order displacement, share of room",
    ]);
    let mut exact = Deviations::new([
        "transport, exact slope, share of 1e-6 + 1e-11/c2",
        "transport, exact path (m)",
        "transport, exact displacement, share of room",
    ]);
    let engine = engine(Backend::Bvh);
    let mut random = Random::new(11);
    for seed in 0..8 {
        // Rough balls of 320 to 5,120 facets, near one another.
        let levels = 2 + (seed % 3) as u32;
        let bodies: Vec<Body> = (0..2)
            .map(|i| {
                let at = 3.2e-3 * (f64::from(i) - 0.5);
                carbon(star(0.8e-3, 1.5e-3, levels, 2 * seed + i as u64).moved([0.0, at, 0.3 * at]))
            })
            .collect();
        let sample = Sample::new(&bodies, SOURCE, 0.0);
        let rays = rays_over(1.6e-3, 4000, 1, &mut random);
        for (deviations, transport, order) in [
            (&mut first, Transport::FirstOrder, Order::First),
            (&mut exact, Transport::Exact, Order::Exact),
        ] {
            let (results, moments) = trace(&engine, &bodies, &[0.0], transport, &rays);
            for (i, ray) in rays.iter().enumerate() {
                let want = reference(&sample, ray, order);
                // The exact walk gives no path, but this depth is of one material.
                let path = match order {
                    Order::First => (1..3).map(|m| f64::from(moments.of(i, m).path)).sum(),
                    Order::Exact => f64::from(results[i].optical_depth) / CARBON[0],
                };
                deviations.take(&results[i], Some(path), &want, &format!("seed {seed}, {ray:?}"));
            }
        }
    }
    // An edge within the rounding of f32 is on either side: 1e-10 m of edges 0.1 mm apart.
    assert_eq!(first.other, 0, "of {}", first.rays);
    assert!(exact.other <= 5, "{} of {}", exact.other, exact.rays);
    first.holds();
    exact.holds();
}

#[test]
fn f32_walk_is_the_f64_walk_in_turned_views() {
    // Turning vertices in f32 moves them by 1e-10 m, and normals by 6e-8 of their length: slopes
    // change by delta * 6e-8 / c^2, 3e-14 / c^2, within the 1e-11 / c^2.
    let mut first = Deviations::new([
        "transport, turned view, slope, share of 1e-6 + 1e-11/c2",
        "transport, turned view, path (m)",
        "transport, turned view, displacement, share of room",
    ]);
    let engine = engine(Backend::Bvh);
    let angles = [0.0, 0.4, 1.9, 4.0, std::f64::consts::PI];
    let mut random = Random::new(12);
    let bodies = [carbon(star(0.8e-3, 1.5e-3, 3, 77).moved([0.4e-3, -0.2e-3, 0.1e-3]))];
    let samples = angles.map(|angle| Sample::new(&bodies, SOURCE, angle));
    let rays = rays_over(1.6e-3, 10_000, 5, &mut random);
    let (results, moments) = trace(&engine, &bodies, &angles, Transport::FirstOrder, &rays);
    for (i, ray) in rays.iter().enumerate() {
        let want = reference(&samples[ray.pose as usize], ray, Order::First);
        let path = f64::from(moments.of(i, 1).path);
        first.take(&results[i], Some(path), &want, &format!("{ray:?}"));
    }
    assert!(first.other <= 1, "{} of {}", first.other, first.rays);
    first.holds();
}

#[test]
fn first_order_departs_from_exact_by_second_order_alone() {
    // The error of the first order at a surface is delta^2 / (2 c^3), the flag's 1e-9 rad.
    let mut worst = Worst::new("transport, auto against exact, slope (rad)", 3e-9);
    let engine = engine(Backend::Bvh);
    let bodies = [carbon(star(0.8e-3, 1.5e-3, 3, 5))];
    let rays = rays_over(1.6e-3, 20_000, 1, &mut Random::new(3));
    let run = |transport| trace(&engine, &bodies, &[0.0], transport, &rays).0;
    let (auto, exact) = (run(Transport::Auto), run(Transport::Exact));
    let mut again = 0;
    for ((ray, a), e) in rays.iter().zip(&auto).zip(&exact) {
        if a.flags & FLAG_EXACT != 0 {
            again += 1;
            assert_eq!(bytes(a), bytes(e), "{ray:?}");
        } else if a.crossings == e.crossings {
            worst.take(f64::from(a.slope_x - e.slope_x), || format!("{ray:?}"));
            worst.take(f64::from(a.slope_z - e.slope_z), || format!("{ray:?}"));
        }
    }
    assert!((1..2000).contains(&again), "{again} rays were traced again");
    worst.holds();
}

fn bytes(result: &RayResult) -> [u32; 5] {
    [
        result.optical_depth,
        result.displacement_x,
        result.displacement_z,
        result.slope_x,
        result.slope_z,
    ]
    .map(f32::to_bits)
}

/// Rays through 50 fibres on average: nanometres by which they are bent decide how they meet a rim.
/// Followed in order, those that the straight line takes to a rim were bent off it, 2 % of all, and
/// no others onto it: 514 angles of 831 from 40 times the least on were left.
#[test]
fn wide_angles_behind_many_bodies_are_as_frequent_as_to_first_order() {
    let engine = engine(Backend::Bvh);
    let scene = |transport: &str| {
        let text = format!(
            "{}\n[detector]\ndistance = \"1.8 m\"\npixels = [16, 1]\npitch = \"150 um\"\n\
             [scan]\nmask_offsets = [\"0 um\"]\n[sampling]\ntransport = \"{transport}\"\n\
             [[object]]\nname = \"matrix\"\nmaterial = \"polyethylene\"\n\
             shape = {{ box = {{ size = [\"2 mm\", \"2.2 mm\", \"2 mm\"] }} }}\n\
             [[object]]\nname = \"fibres\"\nmaterial = \"carbon\"\n\
             shape = {{ cylinder = {{ radius = \"2.5 um\", height = \"1 mm\" }} }}\n\
             instances = {{ packing = \"parallel-fibres\", count = 10000, seed = 1, \
             region = {{ box = {{ size = [\"1 mm\", \"1.96 mm\", \"1 mm\"] }} }} }}\n",
            include_str!("../support/masks.toml"),
        );
        Scene::from_toml(&text, ".").expect("a scene")
    };
    let delta = |name: &str| material::of_builtin(name, &[30.0]).expect("a material")[0].delta;
    let bend = 2.0 * (delta("carbon") - delta("polyethylene"));
    let count = 40_000;
    let place = |i: i32| 0.9e-3 * (f64::from(i) / f64::from(count) - 0.5);
    let rays: Vec<Ray> = (0..count).map(|i| cone(place(i), 1e-6)).collect();
    let [auto, first_order] = ["auto", "first-order"].map(|transport| {
        let scene = scene(transport);
        let simulation = engine.prepare(&scene).expect("a sample");
        moments(&simulation, &rays).expect("results").0
    });
    let wide = |results: &[RayResult]| {
        let angles = results.iter().map(|result| f64::from(result.slope_x).abs());
        angles.filter(|angle| *angle > 40.0 * bend).count() as f64
    };
    let [got, want] = [wide(&auto), wide(&first_order)];
    // One fibre alone bends 1 in 3,200 rays as far; the others, by 12 times the least angle (root mean
    // square), make that 1 + 3 (12 / 40)^2 times as many.
    let share = 50.0 / 3200.0 * 1.27;
    assert!((want / f64::from(count) / share - 1.0).abs() < 0.12, "{want}");
    // Those that meet a rim at less than a tenth of the grazing incidence may go elsewhere.
    assert!((got / want - 1.0).abs() < 0.03, "{got} of {want}");
}
