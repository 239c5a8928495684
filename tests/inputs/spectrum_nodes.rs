//! Energy nodes against the sum over every row of the spectrum: transmission of slabs, deflection
//! weighted by what arrives, leakage of masks; and that the reported error is an honest one.

use beamlet::material::constants_at;
use beamlet::scene::{Beam, Scene};
use beamlet::spectrum::{Nodes, Spectrum, TOLERANCE, nodes, nodes_with};

/// Largest error, relative to 200 fine bins.
const WANTED: f64 = 1e-3;
/// Below this transmission errors are relative to it: 1e-5 of the open beam.
const FLOOR: f64 = 0.01;

/// Spectra as scenes write them; the rows of the last are 198 bins of SpekPy.
const BEAMS: [(&str, &str); 4] = [
    (
        "60 kV, 1 mm Al",
        r#"{ anode = "tungsten", kvp = "60 kV", filters = [{ material = "Al", thickness = "1 mm" }]"#,
    ),
    (
        "100 kV, 1 mm Al",
        r#"{ anode = "tungsten", kvp = "100 kV", filters = [{ material = "Al", thickness = "1 mm" }]"#,
    ),
    (
        "30 kV Mo",
        r#"{ anode = "molybdenum", kvp = "30 kV", filters = [{ material = "Mo", thickness = "30 um" }]"#,
    ),
    ("100 kV of SpekPy", r#"{ file = "tests/tables/spekpy_100kv.txt""#),
];

/// A scene with an object of each material and gold masks where `bars` has a thickness.
fn scene(beam: &str, rest: &str, materials: &[&str], bars: Option<&str>) -> Scene {
    let mut text = format!(
        "[source]\ndistance = \"1.21 m\"\nspot = \"0 um\"\nspectrum = {beam}{rest} }}\n\
         [detector]\ndistance = \"1.8 m\"\npixels = [4, 4]\npitch = \"150 um\"\n"
    );
    if let Some(thickness) = bars {
        for (mask, distance) in [("sample_mask", "1.2 m"), ("detector_mask", "1.7 m")] {
            text += &format!(
                "[{mask}]\ndistance = \"{distance}\"\nmaterial = \"gold\"\n\
                 thickness = \"{thickness}\"\nprojected_aperture = \"30 um\"\n"
            );
        }
    }
    text += "[materials.contrast]\nformula = \"C17H22I3N3O8\"\ndensity = \"0.3 g/cm3\"\n";
    for (index, material) in materials.iter().enumerate() {
        text += &format!(
            "[[object]]\nname = \"{index}\"\nmaterial = \"{material}\"\n\
             shape = {{ sphere = {{ radius = \"1 mm\", sides = 16 }} }}\n"
        );
    }
    Scene::from_toml(&text, env!("CARGO_MANIFEST_DIR")).unwrap()
}

/// Energies, weights (sum 1), and mu and delta of each material at each energy.
struct Table {
    weights: Vec<f64>,
    constants: Vec<Vec<[f64; 2]>>,
}

impl Table {
    fn of(scene: &Scene, materials: &[&str], energies: &[f64], weights: &[f64]) -> Self {
        let total: f64 = weights.iter().sum();
        let constant = |material: &str, energy: &f64| {
            let found = constants_at(scene, material, *energy).unwrap();
            [found.mu, found.delta]
        };
        let row = |m: &&str| energies.iter().map(|energy| constant(m, energy)).collect();
        Self {
            weights: weights.iter().map(|weight| weight / total).collect(),
            constants: materials.iter().map(row).collect(),
        }
    }

    /// Every row of the spectrum of the scene.
    fn fine(scene: &Scene, materials: &[&str]) -> Self {
        let Beam::Spectrum(spec) = &scene.source.beam else { panic!("one energy") };
        let spectrum = Spectrum::after_filters(scene, spec).unwrap();
        // Rows below the tables of the materials hold no photons.
        let rows = spectrum.energies_kev.iter().zip(&spectrum.weights);
        let (energies, weights): (Vec<f64>, Vec<f64>) = rows.filter(|row| *row.1 > 0.0).unzip();
        assert!(energies.len() > 110, "{} rows are not fine", energies.len());
        Self::of(scene, materials, &energies, &weights)
    }

    fn coarse(scene: &Scene, materials: &[&str], nodes: &Nodes) -> Self {
        Self::of(scene, materials, &nodes.energies, &nodes.weights)
    }

    /// Transmission of a slab and the mean delta of `bends` weighted by what passes it.
    fn slab(&self, material: usize, thickness: f64, bends: usize) -> [f64; 2] {
        let (mut passed, mut bent) = (0.0, 0.0);
        for (index, weight) in self.weights.iter().enumerate() {
            let here = weight * (-self.constants[material][index][0] * thickness).exp();
            passed += here;
            bent += here * self.constants[bends][index][1];
        }
        [passed, bent / passed]
    }

    /// Thicknesses at which the transmission falls from 0.99 to 1e-4.
    fn thicknesses(&self, material: usize) -> Vec<f64> {
        let of = |transmission: f64| {
            let (mut low, mut high) = (1e-9_f64, 100.0_f64);
            for _ in 0..100 {
                let middle = (low * high).sqrt();
                let passed = self.slab(material, middle, material)[0];
                *(if passed > transmission { &mut low } else { &mut high }) = middle;
            }
            high
        };
        (0..40).map(|step| of(0.99 * 10_f64.powf(-f64::from(step) * 0.1))).collect()
    }
}

/// Worst errors of transmission and deflection over all slabs of all materials.
fn errors(scene: &Scene, materials: &[&str], nodes: &Nodes) -> [f64; 2] {
    let fine = Table::fine(scene, materials);
    let coarse = Table::coarse(scene, materials, nodes);
    let mut worst = [0.0_f64; 2];
    for material in 0..materials.len() {
        for thickness in fine.thicknesses(material) {
            for bends in 0..materials.len() {
                let [t, alpha] = fine.slab(material, thickness, bends);
                let [t_nodes, alpha_nodes] = coarse.slab(material, thickness, bends);
                worst[0] = worst[0].max((t_nodes - t).abs() / t.max(FLOOR));
                // A direction of light that hardly arrives counts as little as the light.
                let share = (t / FLOOR).min(1.0);
                worst[1] = worst[1].max((alpha_nodes / alpha - 1.0).abs() * share);
            }
        }
    }
    worst
}

const SAMPLES: [&[&str]; 9] = [
    &["water"],
    &["polyethylene"],
    &["carbon"],
    &["aluminium"],
    &["calcium carbonate"],
    &["tin"],
    &["gold"],
    &["contrast"],
    &["water", "polyethylene", "carbon", "hydroxyapatite"],
];

#[test]
fn slabs_and_deflections_agree_with_every_row_of_the_spectrum() {
    for (name, beam) in BEAMS {
        for materials in SAMPLES {
            let scene = scene(beam, "", materials, Some("225 um"));
            let nodes = nodes(&scene).unwrap();
            let [t, alpha] = errors(&scene, materials, &nodes);
            println!(
                "{name}, {materials:?}: {} nodes, estimated {:.1e}, T {t:.1e}, alpha {alpha:.1e}",
                nodes.energies.len(),
                nodes.estimated_error
            );
            assert!(nodes.chosen && nodes.estimated_error <= TOLERANCE, "{name} {materials:?}");
            assert!((nodes.weights.iter().sum::<f64>() - 1.0).abs() < 1e-12);
            assert!(nodes.energies.windows(2).all(|pair| pair[0] < pair[1]));
            assert!(t < WANTED && alpha < WANTED, "{name} {materials:?}: {t:.1e} {alpha:.1e}");
            // Between the slabs that the estimate tries, errors may be a little greater.
            assert!(t.max(alpha) < 1.5 * nodes.estimated_error + 1e-6, "{name} {materials:?}");
        }
    }
}

#[test]
fn too_few_nodes_are_reported_with_their_true_error() {
    let materials = ["water", "aluminium"];
    for count in [1, 2, 3, 4] {
        let scene = scene(BEAMS[0].1, &format!(", nodes = {count}"), &materials, None);
        let nodes = nodes(&scene).unwrap();
        assert_eq!((nodes.energies.len(), nodes.chosen), (count, false));
        let [t, alpha] = errors(&scene, &materials, &nodes);
        println!(
            "{count} nodes: estimated {:.1e}, T {t:.1e}, alpha {alpha:.1e}",
            nodes.estimated_error
        );
        let worst = t.max(alpha);
        assert!(worst < 1.5 * nodes.estimated_error, "{count}: {worst:.1e}");
        assert!(worst > 0.3 * nodes.estimated_error, "{count}: {worst:.1e}");
    }
    // One effective energy errs by far more than is asked for.
    let scene = scene(BEAMS[0].1, ", nodes = 1", &materials, None);
    assert!(nodes(&scene).unwrap().estimated_error > 0.1);
}

#[test]
fn gold_leaks_match_all_rows_on_both_sides_of_its_edge() {
    for (name, beam) in BEAMS {
        for bars in ["225 um", "60 um", "10 um"] {
            let scene = scene(beam, "", &["water"], Some(bars));
            let nodes = nodes(&scene).unwrap();
            let (fine, coarse) =
                (Table::fine(&scene, &["gold"]), Table::coarse(&scene, &["gold"], &nodes));
            let thickness = bars.trim_end_matches(" um").parse::<f64>().unwrap() * 1e-6;
            // One mask, and both in a row.
            for thickness in [thickness, 2.0 * thickness] {
                let [leak, _] = fine.slab(0, thickness, 0);
                let [found, _] = coarse.slab(0, thickness, 0);
                println!(
                    "{name}, {:.0} um of gold: {leak:.3e}, {:+.1e}",
                    thickness * 1e6,
                    found - leak
                );
                assert!((found - leak).abs() < WANTED * leak.max(FLOOR), "{name} {bars}");
            }
        }
    }
    let scene = scene(BEAMS[1].1, "", &["water"], Some("225 um"));
    let nodes = nodes(&scene).unwrap();
    assert!(nodes.energies.iter().any(|energy| *energy > 80.725), "{nodes:?}");
    assert!(nodes.energies.iter().filter(|energy| **energy < 80.725).count() > 2, "{nodes:?}");
}

#[test]
fn one_energy_is_one_node() {
    let text = "[source]\ndistance = \"1 m\"\nspot = \"0 um\"\nenergy = \"30 keV\"\n[detector]\n\
                distance = \"2 m\"\npixels = [1, 1]\npitch = \"100 um\"\n";
    let nodes = nodes(&Scene::from_toml(text, ".").unwrap()).unwrap();
    assert_eq!((nodes.energies, nodes.weights), (vec![30.0], vec![1.0]));
}

#[test]
fn a_detector_that_weights_by_energy_moves_the_mean() {
    let scene = scene(BEAMS[1].1, "", &["water"], None);
    let Beam::Spectrum(spec) = &scene.source.beam else { panic!("one energy") };
    let photons = Spectrum::after_filters(&scene, spec).unwrap();
    let mean = |power: i32| {
        let rows = photons.energies_kev.iter().zip(&photons.weights);
        rows.map(|(energy, weight)| weight * energy.powi(power)).sum::<f64>()
    };
    let counting = nodes(&scene).unwrap().mean_energy();
    let integrating = nodes_with(&scene, Ok).unwrap().mean_energy();
    // Nodes are Gauss in ln E, so the mean of E itself is theirs only to the tolerance.
    assert!((counting / (mean(1) / mean(0)) - 1.0).abs() < WANTED, "{counting}");
    assert!((integrating / (mean(2) / mean(1)) - 1.0).abs() < WANTED, "{integrating}");
    let blind = nodes_with(&scene, |_| Ok(0.0)).unwrap_err().to_string();
    assert!(blind.contains("source.spectrum"), "{blind}");
}
