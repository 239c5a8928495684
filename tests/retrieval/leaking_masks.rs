//! Transmission through leaking masks: the light that a curve measures is softer than the open beam.

use crate::stacks::images_of;
use crate::support::engine;
use beamlet::material::{constants_at, constants_over};
use beamlet::ndarray::Axis;
use beamlet::reconstruct::{BeamEnergy, BeamHardening};
use beamlet::retrieve::{Method, RetrieveOptions};
use beamlet::scene::{Beam, Scene};
use beamlet::spectrum::{Spectrum, response};
use beamlet::{Backend, check::Check};

const SCENE: &str = r#"
sample_mask = { distance = "1.55 m", material = "gold", thickness = "150 um", aperture = "20 um" }
detector_mask = { distance = "1.97 m", material = "gold", thickness = "150 um", aperture = "20 um" }
scan = { mask_offsets = { from = "-36 um", to = "36 um", count = 13 } }
[source]
distance = "1.60 m"
spot = "40 um"
spectrum = { anode = "tungsten", kvp = "60 kV", filters = [{ material = "Al", thickness = "0.5 mm" }] }
[detector]
distance = "2.0 m"
pixels = [8, 1]
pitch = "100 um"
absorber = { material = "CsI", thickness = "500 um" }
[[object]]
name = "slab"
shape = { box = { size = ["8 mm", "4 mm", "2 mm"] } }
material = "PEEK"
"#;

/// Thickness of the slab along the beam, m.
const THICK: f64 = 4e-3;

/// Area of the curve above its background: −ln T is the f64 sum over the light that both masks modulate, (1 − e)²
/// of each energy with the leak e of 150 um of gold, and the correction of hardening gives μ at its mean energy.
/// The rest is the error of energy nodes (5e-4 at most), and bars that narrow apertures differently by energy.
#[test]
fn transmissions_are_of_the_light_that_masks_modulate() {
    let scene = Scene::from_toml(SCENE, ".").unwrap();
    let engine = engine(Backend::Bvh);
    let stacks = engine.simulate(&scene).unwrap();
    let options = RetrieveOptions::default().with_method(Method::ExactCurve);
    let frames = [stacks.flat.view(), stacks.sample.index_axis(Axis(0), 0)];
    let images = images_of(&engine, &scene, &options, frames);
    let transmission = f64::from(images.get("transmission").unwrap()[[0, 4]]);

    let Beam::Spectrum(spec) = &scene.source.beam else { panic!("a spectrum") };
    let rows = Spectrum::after_filters(&scene, spec).unwrap();
    let energies = &rows.energies_kev;
    let mu = |material: &str| constants_over(&scene, material, energies).unwrap();
    let (peek, gold) = (mu("PEEK"), mu("gold"));
    let sums = |open: bool| {
        let mut sums = [0.0; 3];
        for (n, energy) in energies.iter().enumerate() {
            let modulated = (1.0 - (-gold[n].mu * 150e-6).exp()).powi(2);
            let seen = rows.weights[n] * response(&scene, *energy).unwrap();
            let light = if open { seen } else { seen * modulated };
            sums[0] += light;
            sums[1] += light * (-peek[n].mu * THICK).exp();
            sums[2] += light * energy;
        }
        [-(sums[1] / sums[0]).ln(), sums[2] / sums[0]]
    };
    let ([expected, energy], [of_open, _]) = (sums(false), sums(true));
    let found = -transmission.ln();
    println!("measured −ln T: {found:.5}, {expected:.5} expected, {of_open:.5} of the open beam");
    assert!((found / expected - 1.0).abs() < 1e-3, "{found} {expected}");
    assert!(found / of_open - 1.0 > 0.01, "the open beam is harder: {of_open}");
    assert!((BeamEnergy::of(&scene).unwrap().kev / energy - 1.0).abs() < 1e-9);
    let hardening = BeamHardening::new(&scene, "PEEK", 2.0 * THICK).unwrap();
    let at_mean = constants_at(&scene, "PEEK", energy).unwrap().mu;
    let corrected = hardening.value(found) / THICK;
    assert!((corrected / at_mean - 1.0).abs() < 2e-3, "{corrected} {at_mean}");
    // Nodes in place of rows.
    let checked = Check::of(&scene).run().unwrap().setup.energy;
    assert!((checked / energy - 1.0).abs() < 5e-3, "{checked} {energy}");
}
