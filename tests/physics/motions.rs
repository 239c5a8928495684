//! Samples that a motion tilts in a view against the same samples that their placements tilt.

#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests")]
#![allow(clippy::cast_possible_truncation, reason = "rays are rounded to f32 as the engine's are")]

use crate::reference::scenes;
use crate::reference::stack::Setup;
use crate::reference::surfaces::{body, cuboid, prism, star};
use crate::support::{CARBON, WATER, Worst, amount, backends, engine, everything, sample};
use beamlet::internals::trace::{Moment, Ray, moments, trace};
use beamlet::scene::{
    self, Fly, Instances, MaterialSpec, Motion, Normals, Object, RandomRays, RotationAxis, Scene,
    Scheme, Shape, ShapeOrMesh, Transport,
};
use beamlet::{Backend, Simulation};
use std::fmt::Write;
use std::path::Path;

/// Axis, angle (rad) and translation (m) of each view.
const MOVES: [([f64; 3], f64, [f64; 3]); 2] =
    [([1.0, -2.0, 0.5], 0.7, [30e-6, -0.4e-3, -20e-6]), ([1.0, 0.1, 0.0], -0.5, [0.0; 3])];
const ANGLES: [f64; 2] = [0.0, 1.1];

fn motion(view: usize) -> Motion {
    let (axis, angle, by) = MOVES[view];
    Motion::about(axis, angle).unwrap().then(&Motion::translation(by))
}

/// The scene whose views move the sample, and the one whose placements hold it as in one view.
fn moved(rest: &Scene) -> Scene {
    let mut scene = rest.clone();
    scene.scan.angles = ANGLES.to_vec();
    scene.scan.motions = [0, 1].map(motion).to_vec();
    scene
}

fn placed(rest: &Scene, view: usize) -> Scene {
    let mut scene = rest.clone();
    let (axis, angle, _) = MOVES[view];
    scene.scan.angles = vec![ANGLES[view]];
    for object in &mut scene.objects {
        object.placement.rotate.push((axis, angle));
        object.placement.position = motion(view).point(object.placement.position);
    }
    scene
}

fn at(object: impl Into<ShapeOrMesh>, position: [f64; 3]) -> Object {
    let mut object = Object::new("body", object, "carbon");
    object.placement.position = position;
    object.placement.rotate = vec![([0.3, 1.0, 0.2], 0.4)];
    object
}

fn mesh(mesh: crate::reference::surfaces::Mesh) -> ShapeOrMesh {
    let (vertices, triangles) = (mesh.vertices, mesh.triangles);
    scene::Mesh::Arrays { vertices, triangles }.into()
}

fn write_places(path: &Path) {
    let mut text = String::from("x_um,y_um,z_um,scale,axis_x,axis_y,axis_z,angle_deg\n");
    for k in 0..12_i32 {
        let [x, y, z] = [k % 2, k / 2 % 3, k / 6].map(|at| 110 * at);
        writeln!(text, "{},{},{},1.{k},1,{},2,{}", x - 55, y - 110, z - 55, k % 3, 17 * k).unwrap();
    }
    std::fs::write(path, text).unwrap();
}

fn many(object: impl Into<ShapeOrMesh>, directory: &Path) -> Object {
    let path = directory.join("places.csv");
    write_places(&path);
    let mut object = at(object, [20e-6, 0.2e-3, 10e-6]);
    object.instances = Some(Instances::File(path));
    object
}

/// Scenes at rest, by what they hold.
fn cases(directory: &Path) -> Vec<(&'static str, Scene)> {
    let of = |setup: &Setup, objects: Vec<Object>| {
        let mut scene = scenes::scene(setup, &[], &[-16e-6, 7e-6]);
        for (name, [mu, delta]) in [("carbon", CARBON), ("water", WATER)] {
            scene.materials.insert(name.into(), MaterialSpec::Constants { mu, delta });
        }
        scene.objects = objects;
        for (number, object) in scene.objects.iter_mut().enumerate() {
            object.name = format!("body {number}");
        }
        scene
    };
    let setup = Setup::paper([4, 3]);
    let with = |objects| of(&setup, objects);
    let frusta = vec![
        at(Shape::Cylinder { radius: 0.12e-3, height: 0.3e-3, sides: None }, [-40e-6, 0.0, 0.0]),
        at(
            Shape::Cone { radius: 0.1e-3, top_radius: 0.0, height: 0.3e-3, sides: None },
            [60e-6, 0.5e-3, 20e-6],
        ),
        at(
            Shape::Tube { outer: 60e-6, inner: 40e-6, height: 0.2e-3, sides: None },
            [-0.15e-3, -0.4e-3, 20e-6],
        ),
    ];
    let round =
        vec![at(Shape::Ellipsoid { semi_axes: [0.1e-3, 0.15e-3, 0.2e-3], sides: None }, [0.0; 3])];
    // It is higher than the field: tilted, its walls throw light out of the rows beside the detector.
    // These are traced for no other light, since the spot does not blur rows.
    let upright = Object::new("rod", mesh(prism(0.19e-3, 3e-3, 3, 0.2)), "carbon");
    let mut sharp = Setup::paper([4, 3]);
    sharp.spot[1] = 0.0;
    let mut smooth = at(Shape::Sphere { radius: 0.15e-3, sides: Some(24) }, [0.0; 3]);
    smooth.normals = Normals::Smooth;
    let mut bath = with(vec![at(mesh(star(0.1e-3, 0.15e-3, 2, 3)), [0.0; 3])]);
    bath.fill_region(Shape::Cylinder { radius: 0.4e-3, height: 0.5e-3, sides: Some(7) }, "water");
    vec![
        ("mesh", with(vec![at(mesh(star(0.1e-3, 0.17e-3, 2, 5)), [0.0; 3])])),
        ("upright mesh", of(&sharp, vec![upright])),
        ("frusta", with(frusta)),
        ("ellipsoid", with(round)),
        ("meshes in many places", with(vec![many(mesh(cuboid([60e-6, 40e-6, 30e-6])), directory)])),
        (
            "ellipsoids in many places",
            with(vec![many(
                Shape::Ellipsoid { semi_axes: [24e-6, 36e-6, 30e-6], sides: None },
                directory,
            )]),
        ),
        ("smooth", with(vec![smooth])),
        ("surroundings", bath),
    ]
}

/// Rays from the source through a grid of the field.
fn rays(view: u32) -> Vec<Ray> {
    let slope = |k: u16, n: u16| (0.4e-3 * ((f32::from(k) + 0.41) / f32::from(n) - 0.5)) / 1.21;
    let of = |k: u16| {
        let [slope_x, slope_z] = [slope(k % 30, 30), slope(k / 30, 20)];
        Ray { x: slope_x * 1.21, z: slope_z * 1.21, slope_x, slope_z, pose: view, key: 0 }
    };
    (0..600).map(of).collect()
}

/// Displacement of a ray that f32 does not resolve a few times over, m: coordinates of 0.2 mm are rounded
/// by 1.5e-11 m, slopes over 1.2 m by as much. Where it changes the sums of a ray, the ray grazes a surface.
const BESIDE: f32 = 1e-10;

/// Path lengths and displacement sums of the rays of one view, displaced in x and z, by material.
fn sums(simulation: &Simulation, view: u32, [x, z]: [f32; 2]) -> Vec<[f64; 3]> {
    let mut rays = rays(view);
    rays.iter_mut().for_each(|ray| (ray.x, ray.z) = (ray.x + x, ray.z + z));
    let (results, moments) = moments(simulation, &rays).unwrap();
    let sums = |Moment { path, lever: [x, z], .. }: Moment| [path, x, z].map(f64::from);
    (0..results.len())
        .flat_map(|ray| (1..moments.materials()).map(move |material| (ray, material)))
        .map(|(ray, material)| sums(moments.of(ray, material)))
        .collect()
}

#[test]
fn sums_of_moved_and_tilted_samples_agree_to_1e_6() {
    let directory = tempfile::tempdir().unwrap();
    let cases = cases(directory.path()).into_iter().zip(backends().into_iter().cycle());
    // A single ellipsoid with `BEAMLET_ALL`.
    let cases = cases.filter(|((name, _), _)| everything() || *name != "ellipsoid");
    for ((name, mut rest), other) in cases {
        // The sums are those of the first order.
        rest.sampling.transport = Transport::FirstOrder;
        // f32 holds placements of instances, and corners of a rod of 3 mm, to a few 1e-7 of them.
        let rounded = name.contains("many places") || name.contains("upright");
        let limit = if rounded { 3e-6 } else { 1e-6 };
        let mut worst = Worst::new(name, limit);
        // One backend for each sample, by turns; both with `BEAMLET_ALL`.
        for backend in amount(vec![other], backends()) {
            let engine = engine(backend);
            let moved = engine.prepare(&moved(&rest)).unwrap();
            for view in [0, 1] {
                let got = sums(&moved, view, [0.0; 2]);
                let placed = engine.prepare(&placed(&rest, view as usize)).unwrap();
                let [want, beside, above] =
                    [[0.0; 2], [BESIDE, 0.0], [0.0, BESIDE]].map(|by| sums(&placed, 0, by));
                assert_eq!(got.len(), want.len());
                for sum in 0..3 {
                    let largest = want.iter().fold(0.0_f64, |m, s| m.max(s[sum].abs()));
                    assert!(largest > 0.0, "{name}, {backend}, view {view}: no ray has sum {sum}");
                    let mut loose = 0;
                    for (ray, (a, b)) in got.iter().zip(&want).enumerate() {
                        let off = |other: &[f64; 3]| (other[sum] - b[sum]).abs();
                        let slack = off(&beside[ray]).max(off(&above[ray]));
                        loose += usize::from(slack > 1e-5 * largest);
                        let place = || format!("{name}, {backend}, view {view}, {ray}, sum {sum}");
                        worst.take((off(a) - slack).max(0.0) / largest, place);
                    }
                    assert!(
                        loose < want.len() / 10,
                        "{name}: {loose} of {} rays graze",
                        want.len()
                    );
                }
            }
        }
        worst.holds();
    }
}

/// A scan with every motion that a scene has keys for: four views.
fn scanned(rest: &Scene) -> Scene {
    let mut scene = rest.clone();
    scene.scan.angles = ANGLES.to_vec();
    scene.scan.axis = RotationAxis::new([20e-6, -0.3e-3, 10e-6], 0.15, -0.25);
    scene.scan.travel = [50e-6, 0.0, -0.1e-3];
    scene.scan.dithers = vec![-15e-6, 25e-6];
    scene
}

/// The samples of these views at angle 0, placed by rotations about z, y and x, one after the other.
fn placed_as_scanned(rest: &Scene, view: usize) -> Scene {
    let (angle, dither) = (ANGLES[view / 2], [-15e-6, 25e-6][view % 2]);
    let turns = angle / std::f64::consts::TAU;
    let turn = |axis, angle| Motion::about(axis, angle).unwrap();
    let (about_y, about_x) = (turn([0.0, 1.0, 0.0], -0.25), turn([1.0, 0.0, 0.0], 0.15));
    let mut scene = rest.clone();
    for object in &mut scene.objects {
        let rotations =
            [([0.0, 0.0, 1.0], -angle), ([0.0, 1.0, 0.0], -0.25), ([1.0, 0.0, 0.0], 0.15)];
        object.placement.rotate.extend(rotations);
        let place = turn([0.0, 0.0, 1.0], -angle).point(object.placement.position);
        let [x, y, z] = [place[0] + 50e-6 * turns, place[1], place[2] - 0.1e-3 * turns];
        let [x, y, z] = about_x.point(about_y.point([x, y, z]));
        object.placement.position = [x + 20e-6 + dither, y - 0.3e-3, z + 10e-6];
    }
    scene
}

#[test]
fn axis_travel_and_dithers_have_the_stacks_of_placed_samples_to_5e_5() {
    let directory = tempfile::tempdir().unwrap();
    let mut worst = Worst::new("axis, travel, dithers against placed, tolerance 1e-5", 5e-5);
    let names = ["mesh", "frusta"];
    let cases = cases(directory.path()).into_iter().filter(|(name, _)| names.contains(name));
    let cases = cases.zip(backends().into_iter().cycle()).collect();
    for ((name, mut rest), backend) in sample(cases, 2) {
        rest.sampling.tolerance = Some(1e-5);
        let got = engine(backend).simulate(&scanned(&rest)).unwrap().sample;
        assert_eq!(got.dim().0, 4);
        for view in sample((0..4).collect(), 3) {
            let scene = placed_as_scanned(&rest, view);
            let want = engine(backend).simulate(&scene).unwrap().sample;
            let least = want.iter().fold(1.0_f32, |m, v| m.min(*v));
            assert!(least < 0.16, "{name}: no pixel sees the sample: {least}");
            for ((_, step, row, column), value) in want.indexed_iter() {
                let place =
                    || format!("{name}, {backend}, view {view}, step {step}, {column}, {row}");
                worst.take(f64::from(got[[view, step, row, column]] - value), place);
            }
        }
    }
    worst.holds();
}

#[test]
fn fly_scans_are_the_means_of_their_angles() {
    let directory = tempfile::tempdir().unwrap();
    let (_, rest) = cases(directory.path()).swap_remove(0);
    let sweep = 0.06;
    let middles = [0.3, 1.1];
    for (scheme, backend) in
        [Scheme::Cells, Scheme::Random].into_iter().zip(backends().into_iter().cycle())
    {
        let mut fly = rest.clone();
        fly.sampling.scheme = scheme;
        fly.sampling.rays = RandomRays::Count(40);
        fly.scan.angles = middles.to_vec();
        fly.scan.view_offsets = vec![vec![-16e-6, 7e-6], vec![-9e-6, 11e-6]];
        fly.scan.fly = Some(Fly::new(3, sweep));
        let mut single = fly.clone();
        single.scan.fly = None;
        // The same bits.
        let of_angle =
            |middle: f64| [0.5, 1.5, 2.5].map(|part| middle + sweep * (part / 3.0 - 0.5));
        single.scan.angles = middles.into_iter().flat_map(of_angle).collect();
        single.scan.view_offsets =
            (0..6).map(|pose: usize| fly.scan.view_offsets[pose / 3].clone()).collect();
        let got = engine(backend).simulate(&fly).unwrap();
        let want = engine(backend).simulate(&single).unwrap();
        assert_eq!(got.flat, want.flat);
        let mut largest = 0.0_f64;
        for ((view, step, row, column), got) in got.sample.indexed_iter() {
            let of = |pose: usize| f64::from(want.sample[[3 * view + pose, step, row, column]]);
            let mean = (of(0) + of(1) + of(2)) / 3.0;
            largest = largest.max((of(2) - of(0)).abs());
            // f32 rounds the mean.
            assert!(
                (f64::from(*got) - mean).abs() < 1e-7,
                "{scheme:?}, view {view}: {got} for {mean}"
            );
        }
        assert!(largest > 1e-3, "the sweep changes nothing: {largest}");
    }
}

/// A dithered pixel is five of a finer detector, at the place that its dither takes them to.
#[test]
fn dithers_of_wide_pixels_are_sums_of_narrow_ones() {
    let mut setup = Setup::paper([4, 1]);
    (setup.sample_mask, setup.detector_mask) = (None, None);
    let mut fine = setup.clone();
    (fine.pixels, fine.pitch) = ([40, 1], [setup.pitch[0] / 5.0, setup.pitch[1]]);
    // Thin: the magnification of its depth moves a shadow by 1e-4 of a dither.
    let star = body(star(0.11e-3, 0.17e-3, 2, 5), 30.0 * CARBON[0], CARBON[1]);
    let [mut wide, mut fine] =
        [&setup, &fine].map(|setup| scenes::scene(setup, std::slice::from_ref(&star), &[0.0]));
    let step = fine.detector.pitch[0] * setup.source_distance / setup.detector_distance;
    wide.scan.dithers = (-2..=2).map(|k| step * f64::from(k)).collect();
    for scene in [&mut wide, &mut fine] {
        scene.sampling.tolerance = Some(1e-5);
    }
    let engine = engine(Backend::Bvh);
    let [wide, fine] = [wide, fine].map(|scene| engine.simulate(&scene).unwrap().sample);
    let mut worst = Worst::new("dithers against a finer detector", 1e-4);
    let mut largest = 0.0_f64;
    for ((view, _, row, column), got) in wide.indexed_iter() {
        // The sample moved by +k columns is seen k columns to the left.
        let first = 10 + 5 * column + 2 - view;
        let narrow = (first..first + 5).map(|it| f64::from(fine[[0, 0, row, it]]));
        let want = narrow.sum::<f64>() / 5.0;
        largest = largest.max(f64::from(wide[[0, 0, row, column]] - got).abs());
        worst.take(f64::from(*got) - want, || format!("dither {view}, column {column}, row {row}"));
    }
    assert!(largest > 0.02, "dithers change nothing: {largest}");
    worst.holds();
}

#[test]
fn stacks_of_moved_and_tilted_samples_agree_to_5e_5() {
    let directory = tempfile::tempdir().unwrap();
    let mut worst = Worst::new("moved against placed, stacks at tolerance 1e-5", 5e-5);
    let cases: Vec<_> = cases(directory.path())
        .into_iter()
        .flat_map(|(name, rest)| backends().into_iter().map(move |it| (name, rest.clone(), it)))
        .collect();
    // A mesh; all on both backends with `BEAMLET_ALL`.
    for (name, mut rest, backend) in sample(cases, 16) {
        rest.sampling.tolerance = Some(1e-5);
        let got = engine(backend).simulate(&moved(&rest)).unwrap().sample;
        for view in [0, 1] {
            let want = engine(backend).simulate(&placed(&rest, view)).unwrap().sample;
            let least = want.iter().fold(1.0_f32, |m, v| m.min(*v));
            assert!(least < 0.16, "{name}: no pixel sees the sample: {least}");
            for ((_, step, row, column), value) in want.indexed_iter() {
                let place =
                    || format!("{name}, {backend}, view {view}, step {step}, {column}, {row}");
                worst.take(f64::from(got[[view, step, row, column]] - value), place);
            }
        }
    }
    worst.holds();
}

/// Rays through rough faces: 4 deviations of a variance are 11 %, and a tilt of 19 degrees, the
/// least of the views, changes the variance in the plane of incidence by 26 %.
const DRAWS: u16 = 5000;

/// Mean and variance of the displacements of rays through rough faces, x and z.
fn scattered(backend: Backend, scene: &Scene, view: u32) -> [[f64; 2]; 2] {
    let simulation = engine(backend).prepare(scene).unwrap();
    let rays: Vec<Ray> = (0..DRAWS)
        .map(|k| {
            let [x, z] = [k % 100, k / 100].map(|k| 1e-6 * (f32::from(k) - 50.0));
            Ray { x, z, slope_x: 0.0, slope_z: 0.0, pose: view, key: 0 }
        })
        .collect();
    let results = trace(&simulation, &rays).unwrap();
    let n = results.len() as f64;
    [0, 1].map(|axis| {
        let values = results.iter().map(|result| match axis {
            0 => f64::from(result.displacement_x),
            _ => f64::from(result.displacement_z),
        });
        let mean = values.clone().sum::<f64>() / n;
        [mean, values.map(|value| (value - mean).powi(2)).sum::<f64>() / (n - 1.0)]
    })
}

#[test]
fn moved_rough_faces_scatter_as_tilted_ones_within_4_deviations() {
    let mut rest = scenes::scene(&Setup::paper([4, 3]), &[], &[0.0]);
    let [mu, delta] = CARBON;
    rest.materials.insert("carbon".into(), MaterialSpec::Constants { mu, delta });
    let mut rough = Object::new("rough", Shape::Box { size: [1e-3, 0.4e-3, 1e-3] }, "carbon");
    rough.roughness = 0.05;
    rest.objects = vec![rough];
    rest.sampling.transport = Transport::Exact;
    // In deviations of a difference of two means, and of two variances of normal draws.
    let mut worst = Worst::new("moved against placed, rough faces, deviations", 4.0);
    let cases = backends().into_iter().flat_map(|it| [(it, 1), (it, 0)]).collect();
    // One view; both, on both backends, with `BEAMLET_ALL`.
    for (backend, view) in sample(cases, 4) {
        let got = scattered(backend, &moved(&rest), view);
        let want = scattered(backend, &placed(&rest, view as usize), 0);
        for (axis, ([mean, variance], [of, spread])) in got.into_iter().zip(want).enumerate() {
            assert!(spread > 0.0, "{backend}, view {view}: no ray is scattered along {axis}");
            let place = |what| format!("{backend}, view {view}, axis {axis}, {what}");
            let draws = f64::from(DRAWS);
            worst.take((mean - of) / ((variance + spread) / draws).sqrt(), || place("mean"));
            let ratio = (variance / spread).ln() / (4.0 / draws).sqrt();
            worst.take(ratio, || place("variance"));
        }
    }
    worst.holds();
}
