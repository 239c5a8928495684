//! Media that scatter along an axis by another variance than across it: fibres, and plates.
//!
//! A ray that comes across the axis a sees a cos² + b sin² of its variances a across and b along it, cos and sin of the
//! turn of the axis from z; one that comes along it sees a alone.

use super::light::{OFFSETS, TOLERANCE, compare};
use super::{Medium, SET_UP, add, disc, empty, middle, plate, truth_of};
use crate::reference::scattering::Axis;
use crate::support::{Worst, backends, engine, sample};
use beamlet::internals::trace::{Ray, trace};
use beamlet::reconstruct::Quantity;
use beamlet::scene::{Instances, MaterialSpec, RandomRays, Scattering, Scene, Scheme, Transport};
use beamlet::{Backend, IdealOptions, RowsControl, ideal};
use std::f64::consts::{FRAC_1_SQRT_2, FRAC_PI_2, FRAC_PI_6};
use std::fs;

const ACROSS: f64 = 2e-7;
const ALONG: f64 = 3e-8;

/// A body of fibres in a direction, of any length.
fn fibres(body: Medium, direction: [f64; 3]) -> Medium {
    let length = direction.iter().map(|it| it * it).sum::<f64>().sqrt();
    let direction = direction.map(|it| it / length);
    Medium { scattering: ACROSS, axis: Some(Axis { direction, excess: ALONG - ACROSS }), ..body }
}

/// Adds a body whose material has an axis of its own, in place of the one of `medium`.
fn add_with_axis(scene: &mut Scene, medium: &Medium, own: [f64; 3], sides: Option<u32>) {
    add(scene, medium, sides);
    let name = format!("medium {}", scene.objects.len() - 1);
    scene.scattering.insert(name, Scattering::new(ACROSS).with_axis(own, ALONG));
}

/// A scene of media whose axes are those of their materials.
fn scene(columns: u32, media: &[Medium], sides: Option<u32>) -> Scene {
    let mut scene = empty(columns, OFFSETS);
    for medium in media {
        match medium.axis {
            Some(axis) => {
                add_with_axis(&mut scene, medium, axis.direction.map(|it| 3.0 * it), sides)
            }
            None => add(&mut scene, medium, sides),
        }
    }
    scene
}

/// A plate whose object is turned about y, with the fibres of its own z: 0, 30 and 90 degrees.
#[test]
fn light_behind_fibres_turns_with_their_object() {
    let mut worst = Worst::new("light behind a plate of turned fibres", TOLERANCE);
    let angles = [(0.0, 1.0), (FRAC_PI_6, 0.75), (FRAC_PI_2, 0.0)];
    let ways = [Transport::Auto, Transport::Exact];
    let mut all = Vec::new();
    for backend in backends() {
        all.extend(angles.iter().flat_map(|it| ways.map(|transport| (*it, transport, backend))));
    }
    for ((angle, part), transport, backend) in sample(all, 5) {
        let body = plate([-1e-3, 1e-3], 20.0, 0.0);
        let mut scene = empty(5, OFFSETS);
        add_with_axis(&mut scene, &body, [0.0, 0.0, 1.0], None);
        scene.objects[0].placement.rotate = vec![([0.0, 1.0, 0.0], angle)];
        let variance = ACROSS * part + ALONG * (1.0 - part);
        let media = [Medium { scattering: variance, ..body }];
        scene.sampling.transport = transport;
        let what = format!("{angle} rad, {transport:?}, {backend:?}");
        let stacks = engine(backend).simulate(&scene).expect("a run");
        compare(&what, &scene, SET_UP, &media, &stacks, &mut worst);
    }
    worst.holds();
}

/// Fibres of any direction, those towards the beam among them: alone, in one another, and crossing; both orders of
/// transport, exact shapes and facets, and a view at an angle.
#[test]
fn light_behind_fibres_of_any_direction_is_that_of_quadratures() {
    let mut worst = Worst::new("light behind fibres of any direction", TOLERANCE);
    let whole = || disc([0.0, 0.0], 1e-3, 20.0, 0.0);
    let bodies = [
        ("along x", vec![fibres(whole(), [1.0, 0.0, 0.0])]),
        ("along the beam", vec![fibres(whole(), [0.0, 1.0, 0.0])]),
        ("oblique", vec![fibres(whole(), [0.5, 0.6, -0.3])]),
        (
            "crosswise in one another",
            vec![
                fibres(whole(), [0.7, 0.7, 0.2]),
                fibres(disc([0.2e-3, 0.1e-3], 0.5e-3, 20.0, 0.0), [-0.7, 0.7, 0.2]),
            ],
        ),
        (
            "crossing powder",
            vec![disc([0.7e-3, 0.1e-3], 0.7e-3, 5.0, 1e-7), fibres(whole(), [1.0, -0.4, 0.3])],
        ),
    ];
    let ways = [
        (None, Transport::Auto),
        (Some(4096), Transport::Auto),
        (None, Transport::FirstOrder),
        (None, Transport::Exact),
    ];
    let all = bodies.iter().flat_map(|body| ways.iter().map(move |way| (body, way))).collect();
    for ((name, media), (sides, transport)) in sample(all, 3) {
        let mut scene = scene(13, media, *sides);
        scene.sampling.transport = *transport;
        let what = format!("{name}, {sides:?} sides, {transport:?}");
        let stacks = engine(Backend::Bvh).simulate(&scene).expect("a run");
        compare(&what, &scene, SET_UP, media, &stacks, &mut worst);
    }
    // The view turns the sample by the opposite angle.
    let angle = 0.6_f64;
    let media = [fibres(whole(), [0.8, 0.0, 0.6])];
    let mut scene = scene(17, &media, None);
    scene.scan.angles = vec![angle];
    let turned = [fibres(whole(), [0.8 * angle.cos(), -0.8 * angle.sin(), 0.6])];
    let stacks = engine(Backend::Bvh).simulate(&scene).expect("a run");
    compare("a view", &scene, SET_UP, &turned, &stacks, &mut worst);
    worst.holds();
}

/// Instances that turn about the axis are as those that do not; others are refused.
#[test]
fn instances_keep_the_axis_of_their_fibres() {
    let mut worst = Worst::new("light behind instances of fibres", TOLERANCE);
    let own = fibres(disc([0.0, 0.0], 0.5e-3, 5.0, 0.0), [0.0, 0.0, 1.0]);
    let folder = tempfile::tempdir().expect("a folder");
    let places = folder.path().join("places.csv");
    let rows =
        "x_mm,y_mm,z_mm,axis_x,axis_y,axis_z,angle_deg\n-0.9,0,0,0,0,1,40\n0.7,4,0,1,0,0,180\n";
    fs::write(&places, rows).expect("a file");
    let mut scene = scene(17, std::slice::from_ref(&own), None);
    scene.objects[0].instances = Some(Instances::File(places.clone()));
    let two = [[-0.9e-3, 0.0], [0.7e-3, 4e-3]]
        .map(|by| Medium { section: own.section.moved(0.0, by), ..own.clone() });
    let stacks = engine(Backend::Bvh).simulate(&scene).expect("a run");
    compare("two places", &scene, SET_UP, &two, &stacks, &mut worst);

    // An oblique axis that its object and a view turn about z, with the places.
    let oblique = fibres(own.clone(), [0.8, 0.0, 0.6]);
    fs::write(&places, "x_mm,y_mm,z_mm\n-0.9,0,0\n0.7,4,0\n").expect("a file");
    let mut turned = self::scene(17, std::slice::from_ref(&oblique), None);
    turned.objects[0].instances = Some(Instances::File(places.clone()));
    turned.objects[0].placement.rotate = vec![([0.0, 0.0, 1.0], 0.5)];
    turned.scan.angles = vec![0.3];
    // The view turns the sample by the opposite angle.
    let angle = 0.2_f64;
    let two = [[-0.9e-3, 0.0], [0.7e-3, 4e-3]].map(|by| {
        let section = oblique.section.moved(0.0, by).moved(angle, [0.0; 2]);
        fibres(Medium { section, ..own.clone() }, [0.8 * angle.cos(), 0.8 * angle.sin(), 0.6])
    });
    let stacks = engine(Backend::Bvh).simulate(&turned).expect("a run");
    compare("two places in a view", &turned, SET_UP, &two, &stacks, &mut worst);
    worst.holds();

    fs::write(&places, format!("{rows}0,8,0,1,0,0,20\n")).expect("a file");
    let refused = engine(Backend::Bvh).simulate(&scene).expect_err("a turned instance").to_string();
    for words in ["object[0].instances", "instance 3", "scattering_axis", "`rotate`"] {
        assert!(refused.contains(words), "{refused}");
    }
}

/// Variances along x and z and their covariance, at slopes, of few materials and of many.
#[test]
fn rays_have_the_variances_of_the_tensor_of_fibres() {
    let mut worst = Worst::new("variances over the largest", 2e-5);
    let direction = [0.48, 0.6, 0.64];
    for extra in [0, 5] {
        let mut media = vec![fibres(plate([-1e-3, 1e-3], 20.0, 0.0), direction)];
        for place in 0..extra {
            media.push(plate([2e-3, 2.1e-3].map(|y| y + 1e-3 * f64::from(place)), 20.0, 0.0));
        }
        let scene = scene(9, &media, None);
        for backend in backends() {
            let simulation = engine(backend).prepare(&scene).expect("a sample");
            let slopes: [[f32; 2]; 3] = [[0.0, 0.0], [0.05, -0.02], [-0.04, 0.03]];
            let rays = slopes.map(|[slope_x, slope_z]: [f32; 2]| Ray {
                x: 0.0,
                z: 0.0,
                slope_x,
                slope_z,
                pose: 0,
                key: 0,
            });
            let results = trace(&simulation, &rays).expect("results");
            for (slope, result) in slopes.iter().zip(&results) {
                let [s, t] = slope.map(f64::from);
                let square = 1.0 + s * s + t * t;
                let lever = SET_UP.analyser - SET_UP.axis;
                // ∫ (lever - y)² dy of ±1 mm.
                let arm = (2.0 * lever * lever * 1e-3 + 2.0 * 1e-9 / 3.0) * square.powf(1.5);
                let vectors = [[1.0, -s, 0.0], [0.0, -t, 1.0]];
                let dot =
                    |a: [f64; 3], b: [f64; 3]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
                let of = |a: usize, b: usize| {
                    let [a, b] = [vectors[a], vectors[b]];
                    let excess = (ALONG - ACROSS) * dot(a, direction) * dot(b, direction);
                    arm * (ACROSS * dot(a, b) + excess)
                };
                let found = [result.displacement_variance, result.variance_z, result.covariance];
                for (found, expected) in found.into_iter().zip([of(0, 0), of(1, 1), of(0, 1)]) {
                    let place = || format!("{slope:?}, {extra} more, {backend:?}");
                    worst.take((f64::from(found) - expected) / of(0, 0), place);
                }
            }
        }
    }
    worst.holds();
}

/// Masks, spot and pixels that are the same along x and z: light of fibres along z at an offset along z is that of fibres
/// along x at an offset along x, and oblique ones are mirrored.
#[test]
fn random_rays_scatter_along_z_as_along_x() {
    const RAYS: u32 = 30_000;
    let light = |direction: [f64; 3], offset: [f64; 2]| {
        let text = "[source]\ndistance = \"1.21 m\"\nspot = \"30 um\"\nenergy = \"30 keV\"\n\
             [sample_mask]\ndistance = \"1.2 m\"\ntransmission = 0.0\nprojected_aperture = \"30 um\"\n\
             shape = \"rectangle\"\nperiod_z = \"100 um\"\naperture_z = \"20 um\"\n\
             [detector_mask]\ntransmission = 0.0\nprojected_aperture = \"30 um\"\n\
             shape = \"rectangle\"\nperiod_z = \"150 um\"\naperture_z = \"30 um\"\n\
             [detector]\ndistance = \"1.8 m\"\npixels = [3, 3]\npitch = \"150 um\"\n\
             [scan]\nmask_offsets = [[\"OFFX\", \"OFFZ\"]]\n";
        let [x, z] = offset.map(|it: f64| format!("{} um", 1e6 * it));
        let text = text.replace("OFFX", &x).replace("OFFZ", &z);
        let mut scene = Scene::from_toml(&text, ".").expect("a scene");
        let body = fibres(plate([-1e-3, 1e-3], 0.0, 0.0), direction);
        add_with_axis(&mut scene, &body, direction, None);
        scene.sampling.scheme = Scheme::Random;
        scene.sampling.rays = RandomRays::Count(RAYS);
        f64::from(engine(Backend::Bvh).simulate(&scene).expect("a run").sample[[0, 0, 1, 1]])
    };
    let [x, z, even] = [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 1.0]];
    let odd = [1.0, 0.0, -1.0];
    let at = 15e-6;
    let pairs = [
        (light(x, [at, 0.0]), light(z, [0.0, at])),
        (light(z, [at, 0.0]), light(x, [0.0, at])),
        (light(even, [at, at]), light(odd, [at, -at])),
        (light(odd, [at, at]), light(even, [at, -at])),
    ];
    println!("{pairs:?}");
    for (a, b) in pairs {
        // Each ray that is recorded counts one.
        let deviation = (1.0 / a + 1.0 / b).sqrt() / f64::from(RAYS).sqrt();
        assert!((a / b - 1.0).abs() < 4.0 * deviation, "{a} {b} ± {deviation}");
    }
    // The pairs differ, by several times that.
    assert!(pairs[1].0 / pairs[0].0 > 1.2, "{pairs:?}");
    assert!((pairs[2].0 / pairs[3].0 - 1.0).abs() > 0.2, "{pairs:?}");
}

/// Ideal images, and the truth where all views see one variance.
#[test]
fn ideal_images_and_truth_have_the_variances_of_fibres() {
    let mut worst = Worst::new("dark field of ideal images of fibres, relative", 1e-4);
    let directions = [[0.0, 0.0, 1.0], [FRAC_1_SQRT_2, 0.0, FRAC_1_SQRT_2], [0.6, 0.8, 0.0]];
    let engine = engine(Backend::Bvh);
    for direction in directions {
        let media = [fibres(plate([-1e-3, 1e-3], 20.0, 0.0), direction)];
        let scene = scene(17, &media, None);
        let options = IdealOptions::default();
        let images = ideal(&engine, &scene, &options, &mut RowsControl::default()).expect("images");
        for ((.., column), value) in images.images["dark_field"].indexed_iter() {
            let passed = SET_UP.passed(&media, middle(17, column) / SET_UP.analyser);
            let expected = passed.variance / (SET_UP.analyser - SET_UP.axis).powi(2);
            worst.take(f64::from(*value) / expected - 1.0, || format!("{direction:?} {column}"));
        }
    }
    worst.holds();

    let mut scene = empty(32, OFFSETS);
    scene.scan.angles = (0..8).map(|k| f64::from(k) * std::f64::consts::PI / 8.0).collect();
    add_with_axis(&mut scene, &disc([0.0, 0.0], 1e-3, 20.0, 0.0), [0.0, 0.0, 2.0], None);
    add_with_axis(&mut scene, &disc([0.3e-3, 0.0], 0.4e-3, 0.0, 0.0), [1.0, 0.0, 0.0], None);
    let truth = truth_of(&engine, &scene);
    let values = truth.values(Quantity::DarkField).expect("media scatter");
    for (label, value) in truth.labels().iter().zip(&values) {
        match label {
            0 => assert!(*value == 0.0),
            1 => assert!((f64::from(*value) / ACROSS - 1.0).abs() < 1e-6, "{value}"),
            _ => assert!(value.is_nan(), "views see fibres along x differently: {value}"),
        }
    }
}

/// A material of constants that scatters in one direction alone, as plates do.
#[test]
fn plates_scatter_along_their_normal_alone() {
    let mut worst = Worst::new("light behind layers", TOLERANCE);
    for (normal, variance) in [([1.0, 0.0, 0.0], ALONG), ([0.0, 1.0, 0.0], 0.0)] {
        let body = plate([-1e-3, 1e-3], 20.0, 0.0);
        let mut scene = empty(9, OFFSETS);
        add(&mut scene, &body, None);
        let scattering = Scattering::new(0.0).with_axis(normal, ALONG);
        scene.scattering.insert("medium 0".into(), scattering);
        assert!(matches!(scene.materials["medium 0"], MaterialSpec::Constants { .. }));
        let media = [Medium { scattering: variance, ..body }];
        let stacks = engine(Backend::Bvh).simulate(&scene).expect("a run");
        compare(&format!("{normal:?}"), &scene, SET_UP, &media, &stacks, &mut worst);
    }
    worst.holds();
}
