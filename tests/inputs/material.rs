//! Materials: constants against xraylib, ranges of the tables, table files.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

use std::collections::BTreeMap;
use std::path::Path;

use beamlet::cli_support::material::{builtin, builtin_names};
use beamlet::material::constants;
use beamlet::scene::{Beam, Detector, MaterialSpec, Scene, Source};

fn scene(energy: f64) -> Scene {
    let source = Source::new(1.21, [0.0; 2], Beam::Energy(energy));
    Scene::new(source, Detector::new(1.8, [128, 128], [150e-6; 2]))
}

fn with(energy: f64, name: &str, spec: MaterialSpec) -> Scene {
    let mut scene = scene(energy);
    scene.materials.insert(name.into(), spec);
    scene
}

fn formula(formula: &str, density: f64) -> MaterialSpec {
    MaterialSpec::Formula { formula: formula.into(), density }
}

/// xraylib at 30 keV: name, formula, g/cm3, mu in 1/m, delta.
const XRAYLIB_30_KEV: [(&str, &str, f64, f64, f64); 5] = [
    ("carbon", "C", 2.0, 51.235, 4.6092e-7),
    ("water", "H2O", 1.0, 37.559, 2.5604e-7),
    ("polyethylene", "C2H4", 0.93, 25.175, 2.4462e-7),
    ("nylon 66", "C12H22N2O2", 1.14, 33.007, 2.8809e-7),
    ("gold", "Au", 19.3, 53122.0, 3.5424e-6),
];

#[test]
fn constants_at_30_kev_agree_with_xraylib() {
    for (name, text, density, mu, delta) in XRAYLIB_30_KEV {
        let by_formula = constants(&with(30.0, "x", formula(text, density)), "x").unwrap();
        let by_name = constants(&scene(30.0), name).unwrap();
        assert_eq!(by_formula, by_name, "{name}");
        let (mu_error, delta_error) = (by_name.mu / mu - 1.0, by_name.delta / delta - 1.0);
        println!("{name}: mu {:+.3} %, delta {:+.4} %", 100.0 * mu_error, 100.0 * delta_error);
        assert!(mu_error.abs() < 0.01, "{name}: mu {} against {mu}", by_name.mu);
        assert!(delta_error.abs() < 0.001, "{name}: delta {} against {delta}", by_name.delta);
    }
}

#[test]
fn vacuum_is_nothing_at_any_energy() {
    let vacuum = constants(&scene(5000.0), "vacuum").unwrap();
    assert_eq!((vacuum.mu, vacuum.delta), (0.0, 0.0));
}

#[test]
fn every_builtin_has_constants_and_a_name_of_its_own() {
    let mut seen = BTreeMap::new();
    for name in builtin_names() {
        let found = constants(&scene(30.0), name).unwrap();
        assert!(found.mu.is_finite() && found.delta.is_finite(), "{name}");
        assert!(name == "vacuum" || (found.mu > 0.0 && found.delta > 0.0), "{name}");
        let entry = builtin(name).unwrap();
        for spelling in std::iter::once(&entry.name).chain(entry.aliases) {
            let known = builtin(spelling).unwrap().name;
            assert_eq!(known, name, "\"{spelling}\" stands for two materials");
            assert!(seen.insert(spelling.to_lowercase(), name).is_none(), "{spelling} twice");
        }
    }
}

#[test]
fn spelling_of_a_builtin_does_not_matter() {
    for (a, b) in [("aluminium", "Aluminum"), ("nylon 66", "Nylon-66"), ("PMMA", "pmma")] {
        assert_eq!(constants(&scene(30.0), a).unwrap(), constants(&scene(30.0), b).unwrap());
    }
}

#[test]
fn scene_entry_shadows_a_builtin() {
    let shadowed = with(30.0, "gold", formula("Au", 9.65));
    let half = constants(&shadowed, "gold").unwrap();
    let full = constants(&scene(30.0), "gold").unwrap();
    assert!((half.mu / full.mu - 0.5).abs() < 1e-12);
}

#[test]
fn constants_given_as_numbers_come_back_as_they_are() {
    let scene = with(1e6, "x", MaterialSpec::Constants { mu: 25.0, delta: 2.4e-7 });
    let found = constants(&scene, "x").unwrap();
    assert_eq!((found.mu, found.delta), (25.0, 2.4e-7));
}

#[test]
fn unknown_name_suggests_the_nearest() {
    let text = constants(&scene(30.0), "tungsen").unwrap_err().to_string();
    assert!(text.contains("\"tungsen\"") && text.contains("did you mean \"tungsten\""), "{text}");
    let scene = with(30.0, "resin_a", formula("C", 1.0));
    let text = constants(&scene, "resin-b").unwrap_err().to_string();
    assert!(text.contains("did you mean \"resin_a\""), "{text}");
    let text = constants(&scene, "xyzzyx").unwrap_err().to_string();
    assert!(!text.contains("did you mean"), "{text}");
}

#[test]
fn energy_outside_the_tables_is_refused_with_their_range() {
    for energy in [0.05, 900.0] {
        let text = constants(&scene(energy), "gold").unwrap_err().to_string();
        assert!(text.contains("range of the tables for Au"), "{text}");
        assert!(text.contains("0.1 keV to 800 keV"), "{text}");
    }
    for energy in [0.1, 1.0, 800.0] {
        let _ = constants(&scene(energy), "gold").unwrap();
    }
    for energy in [0.0, -3.0, f64::NAN] {
        let _ = constants(&scene(energy), "gold").unwrap_err();
    }
}

#[test]
fn bad_formula_or_density_is_an_error_that_names_the_material() {
    for (text, density) in [("Xq2", 1.0), ("h2o", 1.0), ("", 1.0), ("H2O", 0.0), ("H2O(", 1.0)] {
        let error = constants(&with(30.0, "mine", formula(text, density)), "mine").unwrap_err();
        assert!(error.to_string().contains("materials.mine"), "{error}");
    }
}

fn table(directory: &Path, text: &str, energy: f64) -> beamlet::Result<(f64, f64)> {
    std::fs::write(directory.join("resin.csv"), text).unwrap();
    let mut scene = with(energy, "resin", MaterialSpec::Table { path: "resin.csv".into() });
    scene.directory = directory.into();
    constants(&scene, "resin").map(|found| (found.mu, found.delta))
}

#[test]
fn table_is_interpolated_in_the_logarithms() {
    let directory = tempfile::tempdir().unwrap();
    // Power results, so that the interpolation is exact: mu ~ E^-3, delta ~ E^-2.
    let text =
        "# measured\nenergy_keV,mu_per_cm,delta\n10,8.0,4e-6\n20,1.0,1e-6\n\n40,0.125,2.5e-7\n";
    for energy in [10.0, 14.0, 20.0, 33.0, 40.0_f64] {
        let (mu, delta) = table(directory.path(), text, energy).unwrap();
        assert!((mu / (800.0 * (energy / 10.0).powi(-3)) - 1.0).abs() < 1e-12, "mu at {energy}");
        assert!((delta / (4e-6 * (energy / 10.0).powi(-2)) - 1.0).abs() < 1e-12, "at {energy}");
    }
}

#[test]
fn table_is_not_extrapolated() {
    let directory = tempfile::tempdir().unwrap();
    let text = "energy_keV,mu_per_cm,delta\n10,8.0,4e-6\n20,1.0,1e-6\n";
    for energy in [9.99, 20.01] {
        let error = table(directory.path(), text, energy).unwrap_err().to_string();
        assert!(error.contains("10 keV to 20 keV"), "{error}");
        assert!(error.contains("resin.csv"), "{error}");
    }
}

#[test]
fn columns_of_a_table_may_come_in_any_order() {
    let directory = tempfile::tempdir().unwrap();
    let text = "delta, note, energy_keV, mu_per_cm\n1e-6, a, 20, 1.0\n";
    let (mu, delta) = table(directory.path(), text, 20.0).unwrap();
    assert_eq!((mu, delta), (100.0, 1e-6));
}

#[test]
fn table_errors_name_file_and_line() {
    let directory = tempfile::tempdir().unwrap();
    let head = "energy_keV,mu_per_cm,delta\n";
    for (text, place, what) in [
        ("energy,mu,delta\n10,1,1e-6\n".to_owned(), "resin.csv:1", "energy_keV"),
        (format!("{head}10,1,1e-6\n10,2,1e-6\n"), "resin.csv:3", "ascending"),
        (format!("{head}10,1,1e-6\n20,x,1e-6\n"), "resin.csv:3:4", "found x"),
        (format!("{head}10,1\n"), "resin.csv:2", "nothing"),
        (format!("{head}10,0,1e-6\n"), "resin.csv:2", "above 0"),
        (format!("{head}10,nan,1e-6\n"), "resin.csv:2", "above 0"),
        (head.to_owned(), "resin.csv:1", "no rows"),
        (String::new(), "resin.csv:1", "no rows"),
    ] {
        let error = table(directory.path(), &text, 10.0).unwrap_err().to_string();
        assert!(error.contains(place) && error.contains(what), "{text:?}: {error}");
    }
    let mut scene = with(30.0, "x", MaterialSpec::Table { path: "missing.csv".into() });
    scene.directory = directory.path().into();
    assert!(constants(&scene, "x").unwrap_err().to_string().contains("missing.csv"));
}
