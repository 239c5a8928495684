//! Spectrum files and spectra of scenes: what is read, and what is refused with its place.

use std::path::Path;

use beamlet::scene::Scene;
use beamlet::spectrum::{Spectrum, nodes};
use proptest::prelude::*;

fn read(text: &str) -> beamlet::Result<Spectrum> {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("tube.csv");
    std::fs::write(&path, text).unwrap();
    Spectrum::read(&path)
}

#[test]
fn the_text_export_of_spekpy_is_read_as_it_is() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/tables/spekpy_100kv.txt");
    let spectrum = Spectrum::read(path).unwrap();
    assert_eq!(spectrum.energies_kev.len(), 198);
    // SpekPy's own words in the header of the file. Its mean is that of the same rows; its
    // half-value layer takes other coefficients (PENELOPE's), hence 1 %.
    assert!((spectrum.mean_energy() / 45.0656 - 1.0).abs() < 1e-5, "{}", spectrum.mean_energy());
    let layer = spectrum.half_value_layer().unwrap() * 1e3;
    assert!((layer / 2.0684 - 1.0).abs() < 0.01, "{layer}");
}

#[test]
fn separators_headers_and_comments_do_not_matter() {
    let expected = Spectrum { energies_kev: vec![10.0, 20.0, 30.5], weights: vec![1.0, 0.0, 2e6] };
    for text in [
        "10,1\n20,0\n30.5,2e6\n",
        "# tube\nenergy_keV,weight\n10,1\n\n20,0\n# more\n30.5,2e6",
        "\u{feff}weight\tnote\tENERGY_KEV\n1\tx\t10\n0\ty\t20\n2e6\t\t30.5\n",
        "energy_keV weight\n10  1\n20  0\n30.5  2e6\n",
        "# spekpy version: 2\r\n10; 1; 0.5\r\n20; 0; 0\r\n30.5; 2e6; 0\r\n",
        "\"energy_keV\",\"weight\"\n10,1\n20,\u{2212}0\n\"30.5\",\"2e6\"\n",
        "10,1\r20,0\r30.5,2e6\r",
        "10;1\n20;0\n30.5;2e6\n\u{1a}",
    ] {
        assert_eq!(read(text).unwrap(), expected, "{text:?}");
    }
}

#[test]
fn even_energies_are_known_from_uneven_ones() {
    let rows = |step: f64| {
        (0..20)
            .map(|n| format!("{:.2},1\n", 10.0 + 0.5 * f64::from(n).powf(step)))
            .collect::<String>()
    };
    assert!(read(&rows(1.0)).unwrap().is_even() && read("10,1\n").unwrap().is_even());
    assert!(!read(&rows(1.2)).unwrap().is_even());
}

fn object(material: &str) -> String {
    format!(
        "[[object]]\nname = \"a\"\nmaterial = \"{material}\"\n\
         shape = {{ sphere = {{ radius = \"1 mm\", sides = 16 }} }}\n"
    )
}

/// Rows without photons may lie beyond the tables of the materials, and definitions that no object has may hold at one
/// energy alone.
#[test]
fn rows_without_photons_and_unused_materials_do_no_harm() {
    let directory = tempfile::tempdir().unwrap();
    std::fs::write(directory.path().join("tail.csv"), "0.05,0\n30,1\n60,1\n900,1e-20\n").unwrap();
    let text = format!(
        "[source]\ndistance = \"1 m\"\nspot = \"0 um\"\nspectrum = \"tail.csv\"\n[detector]\n\
         distance = \"2 m\"\npixels = [1, 1]\npitch = \"100 um\"\n{}\
         [materials.plastic]\nmu = \"0.25 /cm\"\ndelta = 2.4e-7\n",
        object("gold")
    );
    let scene = Scene::from_toml(&text, directory.path()).unwrap();
    assert!(nodes(&scene).unwrap().energies.len() > 1);
}

/// Rows with energies that ascend from 5 keV to 150 keV at most, and weights over 18 decades.
fn rows() -> impl Strategy<Value = Vec<(f64, f64)>> {
    let row = (0.01..3.0_f64, prop_oneof![Just(0.0), (-9.0..9.0_f64).prop_map(|x| 10_f64.powf(x))]);
    proptest::collection::vec(row, 1..48).prop_map(|steps| {
        let mut energy = 5.0;
        let row = |(step, weight): (f64, f64)| {
            energy += step;
            (energy, weight)
        };
        steps.into_iter().map(row).collect()
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn text_that_is_no_spectrum_never_panics(text in "[0-9eE.,;\\t #\\-\\naninf]{0,200}|\\PC{0,100}") {
        let _ = read(&text);
    }

    #[test]
    fn nodes_of_any_rows_are_a_spectrum_inside_them(rows in rows()) {
        let text: String = rows.iter().map(|(e, w)| format!("{e:?},{w:?}\n")).collect();
        let directory = tempfile::tempdir().unwrap();
        std::fs::write(directory.path().join("tube.csv"), text).unwrap();
        let scene = format!(
            "[source]\ndistance = \"1 m\"\nspot = \"0 um\"\nspectrum = \"tube.csv\"\n[detector]\n\
             distance = \"2 m\"\npixels = [1, 1]\npitch = \"100 um\"\n{}{}",
            object("calcium carbonate"),
            object("tin").replace("\"a\"", "\"b\""),
        );
        let scene = Scene::from_toml(&scene, directory.path()).unwrap();
        let bright = rows.iter().any(|row| row.1 > 0.0);
        let Ok(nodes) = nodes(&scene) else {
            prop_assert!(!bright);
            return Ok(());
        };
        prop_assert!(bright && (nodes.weights.iter().sum::<f64>() - 1.0).abs() < 1e-9);
        prop_assert!(nodes.weights.iter().all(|weight| *weight >= 0.0));
        let (first, last) = (rows[0].0, rows[rows.len() - 1].0);
        let inside = |energy: &f64| (first * (1.0 - 1e-9)..=last * (1.0 + 1e-9)).contains(energy);
        prop_assert!(nodes.energies.iter().all(inside), "{nodes:?}");
        prop_assert!(nodes.energies.windows(2).all(|pair| pair[0] <= pair[1]), "{nodes:?}");
        // 32 nodes of a part are enough for 47 rows, whatever they are.
        prop_assert!(nodes.estimated_error <= beamlet::spectrum::TOLERANCE, "{nodes:?}");
    }
}
