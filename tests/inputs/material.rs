//! Materials: constants against xraylib, ranges of the tables, table files.

use std::collections::BTreeMap;
use std::path::Path;

use beamlet::cli_support::material::{builtin, builtin_names};
use beamlet::material::{constants, constants_at};
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
        for spelling in std::iter::once(&*entry.name).chain(entry.aliases.iter().copied()) {
            let known = builtin(spelling).unwrap().name;
            assert_eq!(known, *name, "\"{spelling}\" stands for two materials");
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
fn energies_reach_to_the_ends_of_the_tables_and_a_rounding_beyond() {
    for energy in [0.1, 0.1_f64.next_down(), 1.0, 800.0, 800_f64.next_up()] {
        let _ = constants(&scene(energy), "gold").unwrap();
    }
    for energy in [0.0, -3.0, f64::NAN] {
        let _ = constants(&scene(energy), "gold").unwrap_err();
    }
}

/// Values of a formula at 25 keV.
fn of(text: &str, density: f64) -> [f64; 2] {
    let found = constants(&with(25.0, "x", formula(text, density)), "x").unwrap();
    [found.mu, found.delta]
}

#[test]
fn formulas_have_their_values_in_any_notation() {
    for (text, plain) in [
        ("CuSO4.5H2O", "CuSO4(H2O)5"),
        ("CuSO4·5H2O", "CuSO4(H2O)5"),
        ("CuSO4 * 5 H2O", "CuSO4(H2O)5"),
        ("CaSO4.0.5H2O", "CaSO4(H2O)0.5"),
        ("[Cu(NH3)4]SO4.H2O", "CuN4H12SO4H2O"),
        ("Lu2O3Eu0.1", "Eu0.1Lu2O3"),
        ("Al5O12Er3", "Er3Al5O12"),
        ("Fe2O3Er0.01", "Er0.01Fe2O3"),
        ("CaF2(Eu)", "CaF2"),
        ("CO2", "(CO2)"),
        ("CS2", "(CS2)"),
        ("MoSi2", "(MoSi2)"),
        ("CuSO₄·5H₂O", "CuSO4(H2O)5"),
        ("KAl(SO4)2.12H2O", "KAl(SO4)2(H2O)12"),
        ("CaSO4·1.5H2O", "CaSO4(H2O)1.5"),
        ("Al2O3*2SiO2.2H2O", "Al2O3(SiO2)2(H2O)2"),
        ("3CaO*Al2O3", "(CaO)3Al2O3"),
        ("CaO.SiO2", "CaOSiO2"),
        // Points inside numbers are decimal points.
        ("La.7Sr.3MnO3", "La7Sr3Mn10O30"),
        ("Fe1.5Al0.5O3", "Fe3AlO6"),
        ("(N2)0.5(O2)0.2CaO", "CaNO1.4"),
        ("FeO1.50F0.5", "FeF0.5O1.5"),
    ] {
        let ([mu, delta], [mu_plain, delta_plain]) = (of(text, 2.286), of(plain, 2.286));
        assert!((mu / mu_plain - 1.0).abs() < 1e-12, "{text}: {mu} against {mu_plain}");
        assert!((delta / delta_plain - 1.0).abs() < 1e-12, "{text}");
    }
}

#[test]
fn formulas_without_end_are_refused() {
    for text in ["(".repeat(100_000), format!("H{}", "9".repeat(400))] {
        assert!(constants(&with(25.0, "x", formula(&text, 1.0)), "x").is_err());
    }
}

/// Heavy water has the electrons of water with the same number of molecules. Molar masses have four
/// decimals or fewer in the tables: 1e-4.
#[test]
fn heavy_hydrogen_has_its_weight() {
    let factor = 18.0153 / 20.0276;
    for text in ["D2O", "(D2O)100wt%"] {
        let ([mu, delta], [wanted_mu, wanted]) = (of(text, 1.107), of("H2O", 1.107 * factor));
        assert!((mu / wanted_mu - 1.0).abs() < 1e-4, "{text}: {mu} against {wanted_mu}");
        assert!((delta / wanted - 1.0).abs() < 1e-4, "{text}: {delta} against {wanted}");
    }
    let [mu, _] = of("T2O", 1.215);
    assert!((mu / of("H2O", 1.215 * 18.0153 / 22.0315)[0] - 1.0).abs() < 1e-4);
    let parts = vec![("D2O".to_owned(), 1.0), ("water".to_owned(), 1.0)];
    let half = MaterialSpec::Mixture { parts, density: 1.05 };
    let found = constants(&with(25.0, "x", half), "x").unwrap();
    let wanted = of("H2O", 1.05 * f64::midpoint(1.0, factor))[1];
    assert!((found.delta / wanted - 1.0).abs() < 1e-4, "{} against {wanted}", found.delta);
}

#[test]
fn designations_of_alloys_are_no_formulas() {
    for text in [
        "TiAl6V4",
        "CuSn6",
        "AlMg3",
        "CuSn10Zn2",
        "Sn60Pb40",
        "MgMn2",
        "Ti13Nb13Zr",
        "WC6Co",
        "PBO",
    ] {
        let parts = vec![(text.to_owned(), 1.0)];
        let mixture = MaterialSpec::Mixture { parts, density: 8.0 };
        let mixed = constants(&with(30.0, "mine", mixture), "mine");
        assert_eq!(mixed.is_ok(), builtin(text).is_some(), "{text}");
        assert!(of(&format!("({text})"), 8.0)[0] > 0.0);
    }
    // By name they are the alloys.
    for (name, weights, density) in [
        ("TiAl6V4", "Al6wt%V4wt%Ti", 4.43),
        ("AlSi10Mg", "Si10wt%Mg0.325wt%Al", 2.67),
        ("EN AW-6082", "Si1wt%Mg0.9wt%Mn0.7wt%Al", 2.7),
        ("NiCr22Mo9Nb", "Cr21.5wt%Mo9wt%Nb3.65wt%Fe2.5wt%Ni", 8.44),
        ("CuZn37", "Cu63wt%Zn37wt%", 8.44),
    ] {
        let found = constants(&scene(25.0), name).unwrap();
        assert_eq!((found.mu, found.delta), of(weights, density).into(), "{name}");
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
    for energy in [10.0, 10_f64.next_down(), 14.0, 20.0, 33.0, 40.0, 40_f64.next_up()] {
        let (mu, delta) = table(directory.path(), text, energy).unwrap();
        assert!((mu / (800.0 * (energy / 10.0).powi(-3)) - 1.0).abs() < 1e-12, "mu at {energy}");
        assert!((delta / (4e-6 * (energy / 10.0).powi(-2)) - 1.0).abs() < 1e-12, "at {energy}");
    }
}

/// As NIST prints tables: the energy of an edge twice, below it and above.
#[test]
fn energy_that_comes_twice_in_a_table_is_an_edge() {
    let directory = tempfile::tempdir().unwrap();
    let text = "energy_keV;mu_per_cm;delta\r10;8;4e-6\r20;1;1e-6\r20;6;1e-6\r40;0.75;2.5e-7\r";
    for (energy, mu) in [(10.0, 800.0), (14.0, 800.0 / 1.4_f64.powi(3)), (20.0, 600.0)] {
        let found = table(directory.path(), text, energy).unwrap().0;
        assert!((found / mu - 1.0).abs() < 1e-12, "{found} at {energy}");
    }
    for (energy, mu) in [(19.999_999, 100.0), (20.000_001, 600.0), (40.0, 75.0)] {
        let found = table(directory.path(), text, energy).unwrap().0;
        assert!((found / mu - 1.0).abs() < 1e-6, "{found} at {energy}");
    }
    for rows in ["20,1,1e-6\n20,6,1e-6\n20,7,1e-6\n", "20,1,1e-6\n10,6,1e-6\n"] {
        let text = format!("energy_keV,mu_per_cm,delta\n{rows}");
        let error = table(directory.path(), &text, 20.0).unwrap_err().to_string();
        assert!(error.contains("twice at an absorption edge"), "{error}");
    }
}

#[test]
fn columns_of_a_table_may_come_in_any_order_and_in_quotes() {
    let directory = tempfile::tempdir().unwrap();
    for text in [
        "delta, note, energy_keV, mu_per_cm\n1e-6, a, 20, 1.0\n",
        "\"delta\";\"a; b\";\"energy_keV\";\"mu_per_cm\"\n\"1e\u{2212}6\";\"a;b\";20;1.0\n",
    ] {
        let (mu, delta) = table(directory.path(), text, 20.0).unwrap();
        assert_eq!((mu, delta), (100.0, 1e-6), "{text}");
    }
}

#[test]
fn scattering_is_read_written_and_follows_the_energy() {
    let text = "[source]\ndistance = \"1 m\"\nspot = \"0 um\"\nenergy = \"30 keV\"\n\
                [detector]\ndistance = \"2 m\"\npixels = [8, 8]\npitch = \"100 um\"\n\
                [materials.powder]\nformula = \"SiO2\"\ndensity = \"1.3 g/cm3\"\n\
                scattering = \"2 urad^2/mm\"\nscattering_exponent = -4\n\
                scattering_energy = \"20 keV\"\n\
                [materials.plain]\nformula = \"SiO2\"\ndensity = \"1.3 g/cm3\"\n";
    let scene = Scene::from_toml(text, ".").unwrap();
    let written = scene.to_toml(".", &BTreeMap::new(), &[]).unwrap();
    let again = Scene::from_toml(&written, ".").unwrap();
    assert_eq!(again.scattering, scene.scattering, "{written}");
    assert_eq!(scene.scattering.len(), 1);
    for energy in [20.0, 30.0, 40.0_f64] {
        let found = constants_at(&scene, "powder", energy).unwrap();
        let plain = constants_at(&scene, "plain", energy).unwrap();
        let expected = 2e-9 * (energy / 20.0).powi(-4);
        assert!((found.scattering / expected - 1.0).abs() < 1e-12, "{energy} keV: {found:?}");
        assert_eq!([found.mu, found.delta], [plain.mu, plain.delta]);
        assert_eq!(plain.scattering, 0.0);
    }
}

/// Constants are means by volume, and the keys survive writing.
#[test]
fn microstructures_are_read_and_written_and_have_mean_constants() {
    let text = "[source]\ndistance = \"1 m\"\nspot = \"0 um\"\nenergy = \"30 keV\"\n\
                [detector]\ndistance = \"2 m\"\npixels = [8, 8]\npitch = \"100 um\"\n\
                [materials.powder]\nmixture = { air = 1 }\ndensity = \"0.0012 g/cm3\"\n\
                microstructure = { shape = \"spheres\", diameter = \"10 um\", spread = 0.2, fraction = 0.4, \
                of = \"silica\" }\n\
                [materials.foam]\nformula = \"C8H8\"\ndensity = \"1.05 g/cm3\"\n\
                microstructure = { shape = \"voids\", diameter = \"50 um\", fraction = 0.3 }\n";
    let scene = Scene::from_toml(text, ".").unwrap();
    let written = scene.to_toml(".", &BTreeMap::new(), &[]).unwrap();
    let again = Scene::from_toml(&written, ".").unwrap();
    assert_eq!(again.microstructures, scene.microstructures, "{written}");
    assert_eq!(scene.microstructures["foam"].of, "air");
    let mut bare = scene.clone();
    bare.microstructures.clear();
    for (name, fraction, of) in [("powder", 0.4, "silica"), ("foam", 0.3, "air")] {
        let [found, host] = [&scene, &bare].map(|it| constants_at(it, name, 30.0).unwrap());
        let body = constants_at(&scene, of, 30.0).unwrap();
        let mean = |host: f64, body: f64| (1.0 - fraction) * host + fraction * body;
        assert!((found.mu / mean(host.mu, body.mu) - 1.0).abs() < 1e-12, "{found:?}");
        assert!((found.delta / mean(host.delta, body.delta) - 1.0).abs() < 1e-12, "{found:?}");
    }
}
