//! The verbs `spectrum` and `material`, by the real binary.

use std::path::Path;
use std::process::{Command, Output};

fn beamlet(directory: &Path, arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_beamlet"));
    command.current_dir(directory).args(arguments).output().unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).unwrap()
}

fn json(directory: &Path, arguments: &[&str]) -> serde_json::Value {
    let output = beamlet(directory, arguments);
    assert!(output.status.success(), "{arguments:?}: {}", text(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

const SCENE: &str = r#"
[source]
distance = "1.21 m"
spot = "0 um"
spectrum = { anode = "tungsten", kvp = "60 kV", inherent_filters = [{ material = "Be", thickness = "0.2 mm" }], filters = [{ material = "Al", thickness = "1 mm" }] }
[detector]
distance = "1.8 m"
pixels = [4, 4]
pitch = "150 um"
[materials.resin]
formula = "C3H4O2"
density = "1.1 g/cm3"
[[object]]
name = "rod"
shape = { sphere = { radius = "1 mm", sides = 16 } }
material = "resin"
"#;

#[test]
fn a_scene_a_tube_and_a_file_tell_the_same_beam() {
    let directory = tempfile::tempdir().unwrap();
    let here = directory.path();
    std::fs::write(here.join("scene.toml"), SCENE).unwrap();
    let scene = json(here, &["spectrum", "scene.toml", "--json"]);
    let tube = ["spectrum", "--anode", "W", "--kvp", "60 kV", "--inherent", "Be:0.2 mm", "--json"];
    let tube = json(here, &[&tube[..], &["--filter", "Al:1 mm"]].concat());
    assert_eq!(scene["after"], tube["after"]);
    let row = |(e, w): (&serde_json::Value, &serde_json::Value)| format!("{e},{w}\n");
    let column = |key: &str| tube["before"][key].as_array().unwrap().clone();
    let rows: String = column("energies_kev").iter().zip(&column("weights")).map(row).collect();
    std::fs::write(here.join("tube.csv"), rows).unwrap();
    let file = json(here, &["spectrum", "tube.csv", "--filter", "aluminium:1 mm", "--json"]);
    for key in ["mean_energy_kev", "half_value_layer_m", "photons"] {
        let [a, b] = [&file, &scene].map(|told| told["after"][key].as_f64().unwrap());
        assert!((a / b - 1.0).abs() < 1e-9, "{key}: {a} {b}");
    }
    // Nodes are for the materials of a scene.
    let weights: f64 =
        scene["nodes"]["weights"].as_array().unwrap().iter().map(|w| w.as_f64().unwrap()).sum();
    assert!((weights - 1.0).abs() < 1e-12);
    assert!(scene["nodes"]["estimated_error"].as_f64().unwrap() < 1e-3);
    assert!(tube["nodes"].is_null());
    let told = text(&beamlet(here, &["spectrum", "scene.toml"]).stdout);
    for part in ["tungsten anode, 60 kV, 12 deg", "200 um Be", "1 mm Al", "half-value", "nodes: "] {
        assert!(told.contains(part), "{part}: {told}");
    }
}

#[test]
fn a_plot_is_written_as_its_name_ends_and_never_over_another() {
    let directory = tempfile::tempdir().unwrap();
    let here = directory.path();
    let plot = |name: &str, more: &[&str]| {
        let tube = ["spectrum", "--anode", "molybdenum", "--kvp", "30 kV", "--plot", name];
        beamlet(here, &[&tube[..], more].concat())
    };
    for (name, head) in [("a.svg", &b"<svg"[..]), ("a.png", &b"\x89PNG"[..])] {
        assert!(plot(name, &[]).status.success());
        assert!(std::fs::read(here.join(name)).unwrap().starts_with(head), "{name}");
        assert_eq!(plot(name, &[]).status.code(), Some(1));
        assert!(plot(name, &["--overwrite"]).status.success());
    }
}

#[test]
fn materials_are_told_at_energies_and_over_spectra() {
    let directory = tempfile::tempdir().unwrap();
    let here = directory.path();
    std::fs::write(here.join("scene.toml"), SCENE).unwrap();
    std::fs::write(here.join("two.csv"), "20,1\n40,3\n").unwrap();
    let at = ["material", "gold", "--energy", "30 keV", "--energy", "80 keV"];
    let gold = json(here, &[&at[..], &["--thickness", "225 um", "--json"]].concat());
    let value = |told: &serde_json::Value, index: usize, key: &str| {
        told["values"][index][key].as_f64().unwrap()
    };
    // xraylib at 30 keV; beta = mu hc / (4 pi E); T = exp(-mu t).
    assert!((value(&gold, 0, "mu_per_m") / 53122.0 - 1.0).abs() < 0.01);
    assert!((value(&gold, 0, "delta") / 3.5424e-6 - 1.0).abs() < 1e-3);
    let beta = 53122.0 * 1.239_841_984e-9 / 30.0 / (4.0 * std::f64::consts::PI);
    assert!((value(&gold, 0, "beta") / beta - 1.0).abs() < 0.01);
    assert!((value(&gold, 0, "critical_angle_rad") / 2.6618e-3 - 1.0).abs() < 1e-3);
    let passed = (-value(&gold, 1, "mu_per_m") * 225e-6).exp();
    assert!((value(&gold, 1, "transmission") - passed).abs() < 1e-12);

    let over = ["material", "water", "--spectrum", "two.csv", "--thickness", "2 cm", "--json"];
    let mean = json(here, &over);
    let ends = ["material", "water", "--energy", "20 keV", "--energy", "40 keV"];
    let ends = json(here, &[&ends[..], &["--thickness", "2 cm", "--json"]].concat());
    for key in ["energy_kev", "mu_per_m", "delta", "beta", "transmission"] {
        let expected = (value(&ends, 0, key) + 3.0 * value(&ends, 1, key)) / 4.0;
        assert!((value(&mean, 0, key) / expected - 1.0).abs() < 1e-12, "{key}");
    }
    // A formula with its density is the built-in of both; scenes bring their own materials.
    let formula = ["material", "H2O", "--density", "1 g/cm3", "--energy", "20 keV", "--json"];
    let formula = json(here, &formula);
    assert_eq!(value(&formula, 0, "mu_per_m").to_bits(), value(&ends, 0, "mu_per_m").to_bits());
    let own = json(here, &["material", "resin", "--spectrum", "scene.toml", "--json"]);
    assert_eq!(own["formula"], "C3H4O2");
    let names = json(here, &["material", "--json"]);
    assert!(names.as_array().unwrap().iter().any(|entry| entry["name"] == "aluminium"));
    assert!(text(&beamlet(here, &["material"]).stdout).contains("19.3 g/cm3"));
}
