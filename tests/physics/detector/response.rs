//! Signal of a photon by its energy.

use beamlet::scene::Scene;
use beamlet::spectrum::response;

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

/// Three lines through a slab whose attenuation a table gives: transmissions weighted by photons,
/// by their energy, and within a threshold.
#[test]
fn spectrum_is_weighted_by_what_the_detector_sees() {
    let place = tempfile::tempdir().unwrap();
    std::fs::write(place.path().join("lines.csv"), "20, 1\n40, 2\n60, 3\n").unwrap();
    let table =
        "energy_keV,mu_per_cm,delta\n10,10,1e-12\n20,8,1e-12\n40,2,1e-12\n60,1,1e-12\n80,1,1e-12\n";
    std::fs::write(place.path().join("slab.csv"), table).unwrap();
    let absorber =
        "energy_keV,mu_per_cm,delta\n10,9,1e-12\n20,7,1e-12\n40,3,1e-12\n60,2,1e-12\n80,1,1e-12\n";
    std::fs::write(place.path().join("sensor.csv"), absorber).unwrap();
    let engine = crate::support::engine(beamlet::Backend::Bvh);
    let mut worst = crate::support::Worst::new("detector, weights of a spectrum", 1e-6);
    let layer = "absorber = { material = \"sensor\", thickness = \"2 mm\" }";
    let lines = [[20.0, 1.0, 8.0, 7.0], [40.0, 2.0, 2.0, 3.0], [60.0, 3.0, 1.0, 2.0_f64]];
    type Weight = fn([f64; 4]) -> f64;
    let cases: [(String, Weight); 4] = [
        (String::new(), |[_, photons, ..]| photons),
        ("mode = \"integrating\"".into(), |[energy, photons, ..]| photons * energy),
        (format!("mode = \"integrating\"\n{layer}"), |[energy, photons, _, mu]| {
            photons * energy * (1.0 - (-mu * 0.2).exp())
        }),
        (format!("threshold_low = \"30 keV\"\n{layer}"), |[energy, photons, _, mu]| {
            if energy > 30.0 { photons * (1.0 - (-mu * 0.2).exp()) } else { 0.0 }
        }),
    ];
    for (detector, weight) in cases {
        let text = format!(
            r#"
            [source]
            distance = "1 m"
            spot = "0 um"
            spectrum = {{ file = "lines.csv", nodes = 3 }}
            [detector]
            distance = "2 m"
            pixels = [4, 2]
            pitch = "100 um"
            {detector}
            [materials.slab]
            table = "slab.csv"
            [materials.sensor]
            table = "sensor.csv"
            [[object]]
            name = "slab"
            shape = {{ box = {{ size = ["9 mm", "3 mm", "9 mm"] }} }}
            material = "slab"
            "#
        );
        let scene = Scene::from_toml(&text, place.path()).unwrap();
        let total: f64 = lines.iter().map(|line| weight(*line)).sum();
        let want: f64 = lines.iter().map(|line| weight(*line) * (-line[2] * 0.3).exp()).sum();
        for (index, got) in engine.simulate(&scene).unwrap().sample.indexed_iter() {
            worst.take(f64::from(*got) - want / total, || format!("{detector}, {index:?}"));
        }
    }
    worst.holds();
}

/// A spectrum that ends below a threshold, and one that the thresholds leave out.
#[test]
fn thresholds_beyond_the_spectrum_are_refused() {
    let place = tempfile::tempdir().unwrap();
    std::fs::write(place.path().join("lines.csv"), "20, 1\n60, 3\n").unwrap();
    let refused = |beam: &str, detector: &str| {
        let text = SCENE
            .replace("energy = \"30 keV\"", beam)
            .replace("pitch = \"100 um\"", &format!("pitch = \"100 um\"\n{detector}"));
        match Scene::from_toml(&text, place.path()) {
            Ok(scene) => beamlet::check::Check::of(&scene).run().expect_err(detector).to_string(),
            Err(error) => error.to_string(),
        }
    };
    let file = "spectrum = { file = \"lines.csv\" }";
    let tube = "spectrum = { anode = \"tungsten\", kvp = \"80 kV\" }";
    for (beam, highest) in [(file, "60 keV"), (tube, "80 keV")] {
        for key in ["threshold_low", "threshold_high"] {
            let message = refused(beam, &format!("{key} = \"90 keV\""));
            assert!(message.contains(key) && message.contains(highest), "{message}");
        }
    }
    let between = "threshold_low = \"30 keV\"\nthreshold_high = \"50 keV\"";
    let message = refused(file, between);
    assert!(message.contains("detector"), "{message}");
}

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
fn absorber_detects_the_absorbed_fraction() {
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
