//! Materials of bodies at random places: contrast by waves at each shear, one variance by rays, against a quadrature of
//! the structure function in f64.

use super::packings::harmonics;
use super::{SET_UP, empty};
use crate::support::{Worst, engine};
use beamlet::Backend;
use beamlet::check::Check;
use beamlet::material::constants_at;
use beamlet::scene::{
    BodyShape, Instances, MaterialSpec, Microstructure, Object, Packing, PackingAmount,
    PackingKind, PackingRegion, Scene, Shape, Transport,
};
use std::f64::consts::{PI, TAU};

const STEPS: usize = 40;
/// m.
const PERIOD: f64 = 100e-6;
const THICKNESS: f64 = 2e-3;
const WAVELENGTH: f64 = 1.239_841_984e-9 / 30.0;

/// A plate across the beam of spheres in a host without constants.
fn plate(diameter: f64, fraction: f64, delta: f64) -> Scene {
    let mut scene = empty(9, "[\"0 um\"]");
    scene.scan.mask_offsets =
        (0..STEPS).map(|step| (step as f64 / STEPS as f64 - 0.5) * PERIOD).collect();
    scene.sampling.tolerance = Some(1e-4);
    scene.materials.insert("host".into(), MaterialSpec::Constants { mu: 0.0, delta: 0.0 });
    scene.materials.insert("body".into(), MaterialSpec::Constants { mu: 0.0, delta });
    let structure = Microstructure::new(BodyShape::Spheres, "body", diameter, fraction);
    scene.microstructures.insert("host".into(), structure);
    let shape = Shape::Box { size: [0.1, THICKNESS, 6e-3] };
    scene.objects.push(Object::new("plate", shape, "host"));
    scene
}

/// Loss of contrast per length by dilute spheres, 1/m: ∫∫ [1 − cos Δφ] over squares of the shadow.
fn dilute(diameter: f64, fraction: f64, delta: f64, shear: f64) -> f64 {
    let radius = 0.5 * diameter;
    let phase = 2.0 * TAU / WAVELENGTH * delta;
    let [wide, high] = [radius + 0.5 * shear, radius];
    let chord = |x: f64, z: f64| phase * (radius * radius - x * x - z * z).max(0.0).sqrt();
    let count = 1500;
    let at = |i: usize| (i as f64 + 0.5) / count as f64;
    let term = |x: f64, z: f64| 1.0 - (chord(x - 0.5 * shear, z) - chord(x + 0.5 * shear, z)).cos();
    let row = |j: usize| (0..count).map(|i| term(wide * at(i), high * at(j))).sum::<f64>();
    let sum: f64 = (0..count).map(row).sum();
    let number = fraction / (PI / 6.0 * diameter.powi(3));
    number * 4.0 * sum * wide * high / (count * count) as f64
}

/// By waves each harmonic loses the contrast of its own shear; by rays both lose that of one variance, which is that of
/// waves at the frequency of the curve. A fraction of 0.002 is dilute to 0.5 %.
#[test]
fn harmonics_behind_a_medium_lose_the_contrast_of_its_structure_function() {
    let (diameter, fraction, delta) = (4e-6, 0.002, 2e-6);
    let scale = SET_UP.analyser / SET_UP.sample_mask;
    let arm = SET_UP.analyser - SET_UP.axis;
    let mut worst = Worst::new("loss of contrast of a harmonic behind a medium, relative", 0.01);
    for transport in [Transport::Wave, Transport::Auto] {
        let mut scene = plate(diameter, fraction, delta);
        scene.sampling.transport = transport;
        let stacks = engine(Backend::Bvh).simulate(&scene).expect("a run");
        let of = |light: &dyn Fn(usize) -> f64, harmonic: f64| {
            let [re, im] = harmonics(&(0..STEPS).map(light).collect::<Vec<_>>(), harmonic);
            re.hypot(im)
        };
        let spot = SET_UP.spot * (1.0 - 1.0 / scale);
        let width = (2.0 * 20e-6_f64.powi(2) / 12.0 + spot * spot).sqrt();
        let of_curve = WAVELENGTH * arm / scale / (TAU * width);
        for harmonic in [1.0, 2.0] {
            let sample = of(&|step| f64::from(stacks.sample[[0, step, 0, 4]]), harmonic);
            let flat = of(&|step| f64::from(stacks.flat[[step, 0, 4]]), harmonic);
            let shear = WAVELENGTH * harmonic / PERIOD * arm / scale;
            let expected = match transport {
                Transport::Wave => dilute(diameter, fraction, delta, shear),
                _ => dilute(diameter, fraction, delta, of_curve) * (shear / of_curve).powi(2),
            } * THICKNESS;
            let found = -(sample / flat).ln();
            println!("{transport:?} {harmonic}: {found} {expected}");
            worst.take(found / expected - 1.0, || format!("{transport:?}, harmonic {harmonic}"));
        }
    }
    worst.holds();
}

/// Constants are means by volume; `check` has the variance, and says what is not Gaussian, coarse or extrapolated.
#[test]
fn a_medium_has_mean_constants_and_states_its_assumptions() {
    let mut scene = plate(4e-6, 0.3, 2e-6);
    scene.materials.insert("body".into(), MaterialSpec::Constants { mu: 50.0, delta: 2e-6 });
    scene.materials.insert("host".into(), MaterialSpec::Constants { mu: 10.0, delta: 1e-6 });
    let found = constants_at(&scene, "host", 30.0).expect("constants");
    assert!((found.mu - 22.0).abs() < 1e-9 && (found.delta - 1.3e-6).abs() < 1e-18, "{found:?}");
    let report = |fraction: f64, diameter: f64| {
        let mut scene = scene.clone();
        let structure = Microstructure::new(BodyShape::Spheres, "body", diameter, fraction);
        scene.microstructures.insert("host".into(), structure);
        Check::of(&scene).without_estimate().run().expect("a report")
    };
    let fluid = report(0.3, 4e-6);
    let [described] = fluid.microstructures.as_slice() else { panic!("one medium") };
    assert_eq!(fluid.materials[1].scattering.to_bits(), described.variances[1].to_bits());
    assert!(described.rays > 1.5 * described.independent, "{described:?}");
    assert!(described.variances[1] < described.independent, "{described:?}");
    assert!(fluid.to_string().contains("hard spheres in equilibrium"), "{fluid}");
    let warned = |report: &beamlet::check::CheckReport, words: &str| {
        report.warnings.iter().any(|text| text.contains(words))
    };
    assert!(!warned(&fluid, "extrapolated") && !warned(&fluid, "of a pixel"), "{fluid}");
    assert!(warned(&report(0.6, 4e-6), "extrapolated"));
    assert!(warned(&report(0.3, 40e-6), "of a pixel"));
    assert!(warned(&report(0.3, 0.2e-6), "not that of Gaussian angles"));
}

/// `check` proposes the medium that has the dark field of small bodies; the same keys in its place give the stated
/// value. Large bodies, and those of a file, keep theirs.
#[test]
fn small_bodies_of_a_packing_have_a_medium_that_is_proposed() {
    let scene = |radius: f64| {
        let mut scene = plate(4e-6, 0.3, 2e-6);
        scene.microstructures.clear();
        scene.objects[0].name = "cuvette".into();
        let mut powder = Object::new("powder", Shape::Sphere { radius, sides: None }, "body");
        let region = PackingRegion::Box { size: [0.2e-3, 0.2e-3, 0.2e-3] };
        let amount = PackingAmount::Fill(0.2);
        powder.instances =
            Some(Instances::Packing(Packing::new(PackingKind::Spheres, region, amount)));
        scene.objects.push(powder);
        scene
    };
    let report = |scene: &Scene| Check::of(scene).without_estimate().run().expect("a report");
    let proposed = |scene: &Scene| {
        let of = |text: &String| text.contains("\"powder\"") && text.contains("microstructure = {");
        report(scene).warnings.iter().find(|text| of(text)).cloned()
    };
    let small = scene(2e-6);
    let text = proposed(&small).expect("advice");
    let keys = "{ shape = \"spheres\", diameter = \"4 um\", fraction = 0.2, of = \"body\" } in the host \"host\"";
    assert!(text.contains(keys), "{text}");
    // Bodies in the surroundings, which themselves may not scatter, have one, too.
    let mut alone = small.clone();
    alone.objects.remove(0);
    let text_alone = proposed(&alone).expect("advice");
    assert!(text_alone.contains("in the host \"vacuum\""), "{text_alone}");
    let mut instead = small;
    instead.objects.pop();
    let medium = Microstructure::new(BodyShape::Spheres, "body", 4e-6, 0.2);
    instead.microstructures.insert("host".into(), medium);
    let report = report(&instead);
    let host = report.materials.iter().find(|it| it.name == "host").expect("the host");
    assert!(text.contains(&format!("{:.3e} rad^2/m", host.scattering)), "{text}");
    let [described] = report.microstructures.as_slice() else { panic!("one medium") };
    let times = described.rays / described.variances[1];
    let stated = text.split("bodies have ").nth(1).and_then(|it| it.split(' ').next());
    let stated: f64 = stated.expect("a ratio").parse().expect("a number");
    assert!((stated / times - 1.0).abs() < 1e-3 && times > 1.5, "{text}");
    assert_eq!(proposed(&scene(20e-6)), None);
}
