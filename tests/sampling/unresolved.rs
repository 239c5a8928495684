//! Unresolved structure and roughness.

use super::kinds::{apart, few_rows, of_objects, run, sum_over_energies, tube};
use crate::support::{amount, engine, sample};
use beamlet::Backend;
use beamlet::scene::{Beam, Filter, Object, Scene, Shape, Transport};

/// A bundle of carbon fibres, of this roughness; a ray crosses up to 20.
pub(super) fn fibres(roughness: f64) -> Scene {
    of_objects(&format!(
        "[[object]]\nname = \"fibres\"\nmaterial = \"carbon\"\nroughness = {roughness}\n\
         shape = {{ cylinder = {{ radius = \"6 um\", height = \"2 mm\" }} }}\n\
         [object.instances]\npacking = \"parallel-fibres\"\nfill = 0.3\nseed = 1\n\
         region = {{ cylinder = {{ radius = \"0.3 mm\", height = \"2 mm\" }} }}\n\
         [materials.carbon]\nformula = \"C\"\ndensity = \"1.8 g/cm3\"\n"
    ))
}

/// A plate, turned a little about the axis of rotation.
fn plate() -> Scene {
    of_objects(
        "[[object]]\nname = \"plate\"\nmaterial = \"PMMA\"\nroughness = 0.2\n\
         shape = { box = { size = [\"0.6 mm\", \"1 mm\", \"2 mm\"] } }\n\
         rotate = [{ axis = [0, 0, 1], angle = \"20 deg\" }]\n",
    )
}

/// Under a tube behind 1 mm of aluminium.
fn filtered(mut scene: Scene) -> Scene {
    let Beam::Spectrum(tube) = tube(60.0, 4) else { panic!("a spectrum") };
    let aluminium = Filter::new("Al", 1e-3);
    scene.source.beam = Beam::Spectrum(tube.with_filters(vec![aluminium]));
    scene.detector.pixels[1] = 2;
    scene
}

/// Foils of gold across the beam, two of them in water: rough surfaces between two pairs of materials, as a variance
/// of 0.4 um squared.
fn foils(roughness: f64) -> Scene {
    let mut scene = of_objects("");
    let of = |name: &str, size: [f64; 3], material: &str| {
        Object::new(name, Shape::Box { size }, material)
    };
    scene.objects.push(of("bath", [2e-3, 50e-6, 2e-3], "water"));
    for (name, y) in [("a", -35e-6), ("b", -10e-6), ("c", 10e-6), ("d", 35e-6)] {
        let mut foil = of(name, [0.6e-3, 2e-6, 2e-3], "gold");
        foil.placement.position[1] = y;
        foil.roughness = roughness;
        scene.objects.push(foil);
    }
    filtered(scene)
}

/// The spread by rough surfaces grows with the square of the step of delta, for each energy.
#[test]
fn rough_surfaces_spread_light_of_each_energy() {
    let engine = engine(Backend::Bvh);
    let tolerance = 1e-4;
    let want = sum_over_energies(&engine, &foils(0.06), tolerance / 4.0);
    let (smooth, _) = run(&engine, &foils(0.0), tolerance);
    let (got, _) = run(&engine, &foils(0.06), tolerance);
    let [[seen, _], [worst, _]] = [&smooth, &got].map(|it| apart(it, &want));
    println!("measured unresolved, rough foils, a tube: worst {worst:.1e} of {seen:.1e}");
    // Light is linear over the foils: both have it to the rounding of f32.
    assert!(seen > 3e-5 && worst < 0.01 * seen, "{worst} of {seen}");
}

/// Rays of the two runs are at other places, so that both err by chance: mean and variance over the pixels
/// agree to the error of a mean over as many (four of its deviations). Values of the steps of a pixel have the same
/// rays and count as one. Finer runs are at half of the tolerance, at a quarter with `BEAMLET_ALL`: their own error is half
/// of that of a run, or a quarter, and both are in the differences.
#[test]
fn rough_and_unresolved_samples_have_mean_and_variance_of_finer_runs() {
    let engine = engine(Backend::Bvh);
    let cases = vec![
        ("fibres", fibres(0.0), 1e-3),
        ("rough fibres", fibres(2e-3), 1e-3),
        ("rough plate", plate(), 4e-3),
        ("rough plate, a tube", filtered(plate()), 1e-2),
        ("rough fibres, a tube", filtered(fibres(2e-3)), 1e-3),
    ];
    for (name, scene, tolerance) in sample(cases, 4) {
        let scene = few_rows(scene);
        let (want, _) = run(&engine, &scene, tolerance / amount(2.0, 4.0));
        let (got, record) = run(&engine, &scene, tolerance);
        let [worst, rms] = apart(&got, &want);
        let mean = |stack: &ndarray::Array4<f32>| stack.mapv(f64::from).mean().expect("pixels");
        let variance = |stack: &ndarray::Array4<f32>| stack.mapv(f64::from).var(0.0);
        let pixels = want.len() as f64 / scene.scan.mask_offsets.len() as f64;
        let off = mean(&got) - mean(&want);
        let spread = variance(&got) - variance(&want);
        let told = record.sampling.expect("reported errors");
        println!(
            "measured unresolved, {name}: worst {worst:.1e}, rms {rms:.1e}, mean {off:.1e}, variance {spread:.1e}, \
             told {:.1e}",
            told.worst_error
        );
        assert!(worst < 5.0 * tolerance && rms < tolerance, "{name}: {worst} {rms}");
        assert!(off.abs() < 4.0 * rms / pixels.sqrt(), "{name}: {off}");
        assert!(off.abs() < 0.5 * tolerance, "{name}: {off}");
        // A value errs by chance: the variance changes by twice the covariance of error and value.
        let most = 8.0 * rms * variance(&want).sqrt() / pixels.sqrt() + rms * rms;
        assert!(spread.abs() < most, "{name}: {spread} {most}");
        assert!(told.worst_error <= tolerance, "{name}: {told:?}");
        assert!(told.worst_error > worst / 6.0, "{name}: {told:?} for {worst:e}");
    }
}

/// A plate that lets 2 % of the light at the mean constants of an unfiltered tube pass, and 25 % of all of it: most
/// light behind it is of the highest energies. By exact transport, too, with `BEAMLET_ALL`.
#[test]
fn errors_behind_samples_that_harden_the_beam_are_reported() {
    let engine = engine(Backend::Bvh);
    let mut scene = plate();
    scene.source.beam = tube(40.0, 4);
    scene.detector.pixels = amount([3, 1], [14, 2]);
    let (tolerance, finer) = amount((8e-3, 2.0), (4e-3, 16.0));
    let (want, _) = run(&engine, &scene, tolerance / finer);
    for transport in sample(vec![Transport::Auto, Transport::Exact], 2) {
        scene.sampling.transport = transport;
        let (got, record) = run(&engine, &scene, tolerance);
        let [worst, rms] = apart(&got, &want);
        let told = record.sampling.expect("reported errors");
        println!(
            "measured {transport:?}, an unfiltered tube: worst {worst:.1e}, rms {rms:.1e}, told {told:?}"
        );
        assert!(worst < 5.0 * tolerance && rms < tolerance, "{transport:?}: {worst} {rms}");
        assert!(told.worst_error > worst / 6.0, "{transport:?}: {told:?} for {worst:e}");
    }
}

/// Runs that share a device at a time have rays, and memory, of their own.
#[test]
fn runs_side_by_side_on_one_device_are_the_same() {
    let engine = engine(Backend::Bvh);
    let of = |roughness| {
        let mut scene = fibres(roughness);
        scene.detector.pixels = amount([8, 2], [14, 5]);
        run(&engine, &scene, 4e-3).0
    };
    let cases = [0.0, 2e-3];
    let alone = cases.map(of);
    std::thread::scope(|scope| {
        let runs = cases.map(|roughness| scope.spawn(move || [0; 2].map(|_| of(roughness))));
        for (run, alone) in runs.into_iter().zip(&alone) {
            for other in run.join().expect("runs") {
                assert!(other.iter().zip(alone).all(|(a, b)| a.to_bits() == b.to_bits()));
            }
        }
    });
}
