//! The error that a run reports against the true one, where rims of exact bodies throw light far: random
//! scenes of small bodies before a long lever arm, which are followed ray by ray in f64.

use crate::reference::normal::SIGMA_PER_FWHM;
use crate::reference::round_bodies::{Beam, Form, Solid, Walk};
use crate::reference::surfaces::Random;
use crate::reference::vector::{Vector, turned, unit};
use crate::support::{Checked, engine};
use beamlet::scene::Scene;
use beamlet::stack::ArraySink;
use beamlet::{Backend, Control};
use std::fmt::Write as _;
use std::path::Path;

/// Lines to a row of the reference: 400 and 1,200 differ by 3e-7, and blurs are wider than 160.
const LINES: u32 = 160;
/// Number of random scenes; `BEAMLET_SCENES` is another.
const SCENES: u64 = 24;
/// Attenuation (1/m) and delta of nylon, aluminium, PTFE, silicon, water and titanium at 30 keV.
const MATERIALS: [[f64; 2]; 6] = [
    [35.0, 2.9e-7],
    [300.0, 6.0e-7],
    [110.0, 4.9e-7],
    [330.0, 5.3e-7],
    [37.0, 2.56e-7],
    [2200.0, 9.2e-7],
];

/// A scene as text, its bodies for the reference, and its tolerance.
struct Case {
    text: String,
    beam: Beam,
    solids: Vec<Solid>,
    tolerance: f64,
}

/// A length as scenes have it.
fn length(metres: f64) -> String {
    format!("\"{:.6} um\"", 1e6 * metres)
}

fn lengths<const N: usize>(metres: [f64; N]) -> String {
    format!("[{}]", metres.map(length).join(", "))
}

fn pick<T: Copy, const N: usize>(random: &mut Random, values: [T; N]) -> T {
    let drawn = random.next() * N as f64;
    values[(1..N).take_while(|&it| it as f64 <= drawn).count()]
}

fn direction(random: &mut Random) -> Vector {
    unit(std::array::from_fn(|_| random.between(-1.0, 1.0)))
}

/// Source, masks and detector, and their text.
fn set_up(random: &mut Random) -> (Beam, String) {
    let magnification = random.between(1.5_f64.ln(), 4.0_f64.ln()).exp();
    let detector_distance = random.between(1.0, 2.5);
    let source_distance = detector_distance / magnification;
    let pitch = pick(random, [75e-6, 100e-6, 150e-6]);
    let aperture = pitch * random.between(0.2, 0.6);
    let wide = random.next() < 0.2;
    let spot = [if wide { random.between(1e-6, 6e-6) } else { 0.0 }, random.between(5e-6, 12e-6)];
    let before = random.between(5e-3, 15e-3);
    let [masked, has_detector_mask] =
        pick(random, [[true; 2], [true; 2], [true; 2], [true, false], [false, true]]);
    let steps = if masked { pick(random, [1, 3]) } else { 1 };
    let period = pitch / magnification;
    let offset = |_| if masked { random.between(-0.5, 0.5) * period } else { 0.0 };
    let offsets: Vec<f64> = (0..steps).map(offset).collect();
    let beam = Beam {
        source_distance,
        detector_distance,
        pixels: [6, 2],
        pitch,
        spot: spot.map(|width| width * SIGMA_PER_FWHM),
        sample_mask: masked.then_some(source_distance - before),
        has_detector_mask,
        aperture,
        offsets,
    };
    let mut text = format!(
        "[source]\ndistance = {}\nspot = {}\nenergy = \"30 keV\"\n\
         [detector]\ndistance = {}\npixels = [6, 2]\npitch = {}\n",
        length(source_distance),
        lengths(spot),
        length(detector_distance),
        length(pitch),
    );
    let bars = format!("transmission = 0.0\nprojected_aperture = {}\n", length(aperture));
    if let Some(distance) = beam.sample_mask {
        let _ = write!(text, "[sample_mask]\ndistance = {}\n{bars}", length(distance));
    }
    if has_detector_mask {
        let _ = write!(text, "[detector_mask]\n{bars}");
    }
    let offsets: Vec<String> = beam.offsets.iter().map(|it| length(*it)).collect();
    let _ = write!(text, "[scan]\nmask_offsets = [{}]\nangles = [\"0 deg\"]\n", offsets.join(", "));
    (beam, text)
}

/// A body at a place, and its text.
fn solid(random: &mut Random, number: usize, centre: Vector) -> (Solid, String) {
    let kind = pick(random, [0, 1, 2]);
    let sizes: [f64; 3] = std::array::from_fn(|_| random.between(20e-6, 120e-6));
    let [radius, half, _] = sizes;
    let (form, shape) = match kind {
        0 => (Form::Ellipsoid([radius; 3]), format!("sphere = {{ radius = {} }}", length(radius))),
        1 => (Form::Ellipsoid(sizes), format!("ellipsoid = {{ semi_axes = {} }}", lengths(sizes))),
        _ => (
            Form::Cylinder(radius, half),
            format!(
                "cylinder = {{ radius = {}, height = {} }}",
                length(radius),
                length(2.0 * half)
            ),
        ),
    };
    let (axis, degrees) = (direction(random), random.between(0.0, 180.0));
    let axes = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
        .map(|own| turned(own, axis, degrees.to_radians()));
    let material = pick(random, [0, 1, 2, 3, 4, 5]);
    let [mu, delta] = MATERIALS[material];
    let text = format!(
        "[[object]]\nname = \"body {number}\"\nshape = {{ {shape} }}\nmaterial = \"{material}\"\n\
         position = {}\nrotate = [{{ axis = {axis:?}, angle = \"{degrees} deg\" }}]\n",
        lengths(centre)
    );
    (Solid { form, axes, centre, mu, delta }, text)
}

/// One body, or two that cross.
fn case(seed: u64) -> Case {
    let mut random = Random::new(seed);
    let (beam, mut text) = set_up(&mut random);
    let reach = [60e-6, 40e-6, 40e-6];
    let mut centre: Vector = reach.map(|it| random.between(-it, it));
    let mut solids: Vec<Solid> = Vec::new();
    let count = if random.next() < 0.35 { 2 } else { 1 };
    for number in 0..count {
        let (solid, own) = solid(&mut random, number, centre);
        let (Form::Ellipsoid([radius, ..]) | Form::Cylinder(radius, _)) = solid.form;
        let apart = random.between(0.4, 0.9) * radius;
        let towards = direction(&mut random);
        centre = std::array::from_fn(|i| centre[i] + apart * towards[i]);
        text += &own;
        solids.push(solid);
    }
    for (number, [mu, delta]) in MATERIALS.iter().enumerate() {
        let _ = write!(text, "[materials.{number}]\nmu = \"{mu} /m\"\ndelta = {delta}\n");
    }
    let tolerance = pick(&mut random, [3e-5, 5e-5, 1e-4, 3e-4]);
    Case { text, beam, solids, tolerance }
}

/// Values of a scene at a tolerance, the estimated error and the mean number of rays of a patch.
fn run(engine: &Checked, text: &str, tolerance: f64) -> (Vec<f64>, [f64; 2]) {
    let mut scene = Scene::from_toml(text, Path::new(".")).expect("a scene");
    scene.sampling.tolerance = Some(tolerance);
    let mut sink = ArraySink::new();
    let record = engine.run(&scene, &mut sink, Control::default()).expect("a run");
    let stacks = sink.into_stacks().expect("stacks");
    let sampling = record.sampling.expect("cells");
    let values = stacks.sample.iter().map(|it| f64::from(*it)).collect();
    (values, [sampling.worst_error, sampling.mean_rays])
}

/// Largest difference of two stacks.
fn largest(a: &[f64], b: &[f64]) -> f64 {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

/// Random scenes: how often the true error exceeds the reported one and the tolerance. 8 of 32 are above six
/// times the reported error, and one above five tolerances (seed 15, 11.2; docs/developers/sampling.md).
#[test]
#[ignore = "two minutes: .ci/long scenes"]
fn reported_error_of_random_rims() {
    let engine = engine(Backend::Bvh);
    let count = std::env::var("BEAMLET_SCENES")
        .map_or(SCENES, |count| count.parse().expect("BEAMLET_SCENES is a number"));
    let (mut above, mut rays) = ([0_u32; 4], 0.0);
    for seed in 0..count {
        let Case { text, beam, solids, tolerance } = case(seed);
        let truth = Walk { solids: &solids, beam: &beam, lines: LINES }.values();
        let (values, [estimate, mean_rays]) = run(&engine, &text, tolerance);
        let error = largest(&values, &truth);
        let [of_estimate, of_tolerance] = [error / estimate.max(OWN), error / tolerance];
        println!(
            "measured rims, seed {seed}: {error:.1e}, {of_tolerance:.1} tolerances, {of_estimate:.1} times the estimate, {mean_rays:.0} rays"
        );
        let counts = [of_estimate > 3.0, of_estimate > 6.0, of_tolerance > 3.0, of_tolerance > 5.0];
        above.iter_mut().zip(counts).for_each(|(all, own)| *all += u32::from(own));
        rays += mean_rays;
    }
    println!(
        "measured rims, {count} scenes: {} above 3 and {} above 6 times the estimate, {} above 3 and {} above 5 tolerances, {:.0} rays",
        above[0],
        above[1],
        above[2],
        above[3],
        rays / count as f64
    );
    let share = above.map(|above| f64::from(above) / count as f64);
    assert!(share[1] < 0.35 && share[3] < 0.1, "{share:?}");
}

/// Error of the reference.
const OWN: f64 = 5e-6;
