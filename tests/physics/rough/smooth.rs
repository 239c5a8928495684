//! Smooth normals of facets against the exact shapes that the facets stand for.

#![allow(
    clippy::cast_possible_truncation,
    reason = "rays are rounded to f32 as the engine takes them"
)]

use crate::support::{CARBON, Checked, Worst, amount, backends, engine};
use beamlet::Backend;
use beamlet::internals::trace::{Ray, RayResult, trace};
use beamlet::scene::{
    Beam, Detector, MaterialSpec, Normals, Object, RandomRays, Scene, Scheme, Shape, Source,
    Transport,
};

const RADIUS: f64 = 4e-3;

fn scene(shape: Shape, normals: Normals, transport: Transport) -> Scene {
    let source = Source::new(1.21, [0.0; 2], Beam::Energy(30.0));
    let mut scene = Scene::new(source, Detector::new(1.8, [16, 16], [150e-6; 2]));
    let [mu, delta] = CARBON;
    scene.materials.insert("carbon".to_owned(), MaterialSpec::Constants { mu, delta });
    let mut object = Object::new("body", shape, "carbon");
    object.normals = normals;
    object.placement.rotate = vec![([0.0, 0.0, 1.0], 0.1)];
    scene.objects = vec![object];
    scene.sampling.transport = transport;
    scene
}

fn cylinder(sides: Option<u32>) -> Shape {
    Shape::Cylinder { radius: RADIUS, height: 10e-3, sides }
}

fn sphere(sides: Option<u32>) -> Shape {
    Shape::Sphere { radius: RADIUS, sides }
}

/// Rays side by side through the inner nine tenths of a body.
fn rays() -> Vec<Ray> {
    let at = |i: u32| 0.9 * RADIUS * (f64::from(i) / 2000.0 - 1.0);
    (0..=4000)
        .map(|i| Ray { x: at(i) as f32, z: 0.31e-3, slope_x: 0.0, slope_z: 0.0, pose: 0, key: 0 })
        .collect()
}

fn results(engine: &Checked, scene: &Scene) -> Vec<RayResult> {
    trace(&engine.prepare(scene).expect("a sample"), &rays()).expect("results")
}

/// Root mean square of the difference of slopes along x, share of that of the slopes.
fn off(got: &[RayResult], want: &[RayResult]) -> f64 {
    let square = |f: &dyn Fn(&RayResult, &RayResult) -> f64| -> f64 {
        got.iter().zip(want).map(|(a, b)| f(a, b).powi(2)).sum()
    };
    let slope = |result: &RayResult| f64::from(result.slope_x);
    (square(&|a, b| slope(a) - slope(b)) / square(&|_, b| slope(b))).sqrt()
}

/// The coarser mesh with smooth normals refracts as the exact shape does; its facets do not.
#[test]
fn smooth_normals_refract_as_the_exact_shape() {
    let engine = engine(Backend::Bvh);
    for (what, of, sides, flat, smooth) in [
        ("cylinder", cylinder as fn(Option<u32>) -> Shape, 128, 0.01, 1e-3),
        ("sphere", sphere, 256, 0.004, 1e-3),
    ] {
        for transport in [Transport::Auto, Transport::Exact] {
            let exact = results(&engine, &scene(of(None), Normals::Facets, transport));
            let of = |normals| results(&engine, &scene(of(Some(sides)), normals, transport));
            let (facets, between) = (of(Normals::Facets), of(Normals::Smooth));
            let mut worst = Worst::new("slopes by smooth normals, rms share", smooth);
            worst.take(off(&between, &exact), || format!("{what}, {transport:?}"));
            worst.holds();
            let facetted = off(&facets, &exact);
            assert!(facetted > flat, "{what}, {transport:?}: {facetted}");
            // Paths and crossings are the geometry's.
            for (a, b) in facets.iter().zip(&between) {
                assert_eq!(a.crossings, b.crossings);
                let depth = f64::from(a.optical_depth) - f64::from(b.optical_depth);
                let most = if transport == Transport::Auto { 1e-7 } else { 1e-5 };
                assert!(depth.abs() < most, "{what}, {transport:?}: {depth}");
            }
        }
    }
}

/// A box has creases alone: its bits stay.
#[test]
fn creases_keep_the_normals_of_facets() {
    for backend in backends() {
        let engine = engine(backend);
        let cuboid = || Shape::Box { size: [6e-3, 5e-3, 4e-3] };
        let [facets, smooth] = [Normals::Facets, Normals::Smooth]
            .map(|normals| results(&engine, &scene(cuboid(), normals, Transport::Auto)));
        for (a, b) in facets.iter().zip(&smooth) {
            let off = f64::from(a.slope_x) - f64::from(b.slope_x);
            assert!(off.abs() <= 1e-6 * f64::from(a.slope_x).abs() + 1e-13, "{a:?} {b:?}");
        }
    }
}

/// Whole runs: every ray is followed to its end, silhouettes included, in cells and by random rays, on
/// one backend each and with `BEAMLET_ALL` on both.
#[test]
fn silhouettes_of_smooth_normals_are_followed() {
    let schemes = [Scheme::Cells, Scheme::Random];
    let all = backends().into_iter().flat_map(|it| schemes.map(|scheme| (scheme, it)));
    let single = schemes.into_iter().zip(backends().into_iter().cycle());
    for (scheme, backend) in amount(single.collect::<Vec<_>>(), all.collect()) {
        let mut scene = scene(sphere(Some(64)), Normals::Smooth, Transport::Auto);
        scene.sampling.scheme = scheme;
        scene.sampling.rays = RandomRays::Grid([64, 4]);
        scene.detector = Detector::new(1.8, [48, amount(2, 8)], [300e-6; 2]);
        let engine = engine(backend);
        let stacks = engine.simulate(&scene).expect("a run");
        assert!(stacks.sample.iter().all(|light| light.is_finite() && *light >= 0.0));
        let simulation = engine.prepare(&scene).expect("a sample");
        let at = |i: u32| RADIUS * (0.98 + 0.02 * f64::from(i) / 5000.0);
        let rim = |i| Ray { x: at(i) as f32, z: 0.0, slope_x: 0.0, slope_z: 0.0, pose: 0, key: 0 };
        let rays: Vec<Ray> = (0..5000).map(rim).collect();
        let results = trace(&simulation, &rays).expect("results");
        let lost = results.iter().filter(|result| result.flags & 8 != 0).count();
        assert!(lost * 1000 < results.len(), "{backend:?}, {scheme:?}: {lost} lost");
        let strong = results.iter().map(|it| it.slope_x.abs()).fold(0.0, f32::max);
        assert!(strong < 3e-3, "{strong}");
    }
}

#[test]
fn normals_are_read_written_and_refused_where_there_are_no_facets() {
    let text = |shape: &str, normals: &str| {
        format!(
            "source = {{ distance = \"1 m\", spot = \"0 um\", energy = \"30 keV\" }}\n\
             detector = {{ distance = \"2 m\", pixels = [8, 8], pitch = \"1 mm\" }}\n\
             object = [{{ name = \"a\", material = \"water\", normals = \"{normals}\", \
             shape = {{ sphere = {{ {shape} }} }} }}]\n"
        )
    };
    let read = |shape: &str, normals: &str| Scene::from_toml(&text(shape, normals), ".");
    let facets = "radius = \"1 mm\", sides = 64";
    let scene = read(facets, "smooth").expect("a scene");
    assert_eq!(scene.objects[0].normals, Normals::Smooth);
    let written = scene.to_toml(".", &std::collections::BTreeMap::new(), &[]).expect("text");
    assert!(written.contains("normals = \"smooth\""), "{written}");
    let plain = read(facets, "facets").expect("a scene");
    assert_eq!(plain.objects[0].normals, Normals::Facets);
    let error = read("radius = \"1 mm\"", "smooth").expect_err("no facets").to_string();
    assert!(error.contains("object[0].normals") && error.contains("exact"), "{error}");
    let error = read(facets, "soft").expect_err("no such normals").to_string();
    assert!(error.contains("normals") && error.contains("smooth"), "{error}");
}
