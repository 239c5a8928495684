//! Signal of a photon by its energy.

use beamlet::detector::response;
use beamlet::scene::Scene;

const SCENE: &str = r#"
[source]
distance = "1 m"
spot = "0 um"
energy = "30 keV"
[detector]
distance = "2 m"
pixels = [4, 2]
pitch = "100 um"
[materials.sensor]
mu = "20 /cm"
delta = 1e-7
[materials.scintillator]
formula = "CsI"
density = "4.51 g/cm3"
"#;

fn scene(detector: &str) -> Scene {
    let text = SCENE.replace("pitch = \"100 um\"", &format!("pitch = \"100 um\"\n{detector}"));
    Scene::from_toml(&text, ".").unwrap()
}

fn close(got: f64, want: f64, tolerance: f64) {
    assert!((got - want).abs() <= tolerance * want.abs(), "{got} for {want}");
}

#[test]
fn every_photon_counts_once_by_default() {
    let scene = scene("");
    for energy in [1.0, 30.0, 160.0] {
        close(response(&scene, energy).unwrap(), 1.0, 0.0);
    }
}

#[test]
fn absorber_detects_what_it_absorbs() {
    // 2000 /m over 0.5 mm: 1 - 1/e.
    let counting = scene("absorber = { material = \"sensor\", thickness = \"0.5 mm\" }");
    close(response(&counting, 30.0).unwrap(), 1.0 - (-1.0_f64).exp(), 1e-14);
    // NIST XCOM, CsI, 30 keV: 9.42 cm2/g (both K edges are above 33 keV); 4.51 g/cm3, 0.1 mm.
    let csi = scene("absorber = { material = \"scintillator\", thickness = \"0.1 mm\" }");
    close(response(&csi, 30.0).unwrap(), 1.0 - (-0.425_f64).exp(), 0.04);
    // Above the edges more is absorbed than below.
    assert!(response(&csi, 37.0).unwrap() > 1.5 * response(&csi, 32.0).unwrap());
}

#[test]
fn integrating_detector_weighs_photons_by_their_energy() {
    let detector =
        "mode = \"integrating\"\nabsorber = { material = \"sensor\", thickness = \"0.5 mm\" }";
    let scene = scene(detector);
    let absorbed = 1.0 - (-1.0_f64).exp();
    for energy in [20.0, 30.0, 80.0] {
        close(response(&scene, energy).unwrap(), absorbed * energy, 1e-14);
    }
}

#[test]
fn photons_beyond_the_thresholds_are_not_counted() {
    let scene = scene("threshold_low = \"20 keV\"\nthreshold_high = \"30 keV\"");
    for (energy, want) in [(19.999, 0.0), (20.0, 1.0), (25.0, 1.0), (30.0, 1.0), (30.001, 0.0)] {
        assert_eq!(response(&scene, energy).unwrap().to_bits(), f64::to_bits(want), "{energy}");
    }
}
