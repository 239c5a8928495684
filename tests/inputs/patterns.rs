//! Masks of patterns: images, tables and texts of open and closed pixels.

#![allow(clippy::unwrap_used, reason = "tests")]

use crate::kept::kept;
use beamlet::Error;
use beamlet::ndarray::array;
use beamlet::scene::Scene;
use ndarray_npy::write_npy;
use std::fs;
use std::path::Path;

/// A scene with these keys of its sample mask.
fn text(mask: &str) -> String {
    format!(
        "[source]\ndistance = \"1.2 m\"\nspot = \"20 um\"\nenergy = \"30 keV\"\n\
         [detector]\ndistance = \"1.8 m\"\npixels = [8, 6]\npitch = \"20 um\"\n\
         [sample_mask]\ndistance = \"1.15 m\"\ntransmission = 0.1\n{mask}\n"
    )
}

const PIXEL: &str = "\npattern_pixel = [\"5 um\", \"4 um\"]";

fn load(mask: &str, directory: &Path) -> Result<Scene, Error> {
    let text = text(mask);
    let path = directory.join("scene.toml");
    fs::write(&path, &text).unwrap();
    kept(&text, Scene::load(&path))
}

#[test]
fn images_tables_and_texts_are_the_same_mask_which_comes_back() {
    let place = tempfile::tempdir().unwrap();
    fs::write(place.path().join("of.csv"), "# a line\n0,1,1,0\n1,0,0,1\n1, 0, 0, 1\n").unwrap();
    let image = array![[3.0_f32, 7.0, 7.0, 3.0], [7.0, 3.0, 3.0, 7.0], [7.0, 3.0, 3.0, 7.0]];
    write_npy(place.path().join("of.npy"), &image).unwrap();
    let masks = [r#"["0110", "1001", "1001"]"#, "\"of.csv\"", "\"of.npy\""].map(|pattern| {
        load(&format!("pattern = {pattern}{PIXEL}"), place.path()).unwrap().sample_mask.unwrap()
    });
    assert!(masks.iter().all(|mask| *mask == masks[0]));
    let close = |a: f64, b: f64| (a - b).abs() < 1e-15;
    assert!(close(masks[0].period, 20e-6) && close(masks[0].period_z.unwrap(), 12e-6));
    // Open pixels at the ends of rows 1 and 2 are one opening of two, and the top row is one pixel high.
    assert!(close(masks[0].aperture, 10e-6) && close(masks[0].aperture_z.unwrap(), 4e-6));
}

#[test]
fn faults_of_patterns_are_named_with_their_place() {
    let place = tempfile::tempdir().unwrap();
    fs::write(place.path().join("two.csv"), "0,1\n1,2\n").unwrap();
    fs::write(place.path().join("ragged.csv"), "0,1\n1\n").unwrap();
    fs::write(place.path().join("empty.csv"), "\n").unwrap();
    let grey = array![[0.0_f32, 1.0], [0.5, 1.0]];
    write_npy(place.path().join("grey.npy"), &grey).unwrap();
    let cases = [
        ("pattern = \"two.csv\"", "two.csv:2", "0 or 1 in each cell"),
        ("pattern = \"ragged.csv\"", "ragged.csv:2", "2 cells, as in the first row"),
        ("pattern = \"empty.csv\"", "empty.csv", "holds no pattern"),
        ("pattern = \"grey.npy\"", "grey.npy", "row 1, column 0 has 0.5 beside 0 and 1"),
        ("pattern = \"none.png\"", "none.png", "cannot"),
        ("pattern = [\"01\", \"011\"]", "sample_mask.pattern", "rows"),
        ("pattern = [\"01\", \"0x\"]", "sample_mask.pattern", "rows"),
        ("pattern = []", "sample_mask.pattern", "rows"),
        ("pattern = [\"11\", \"11\"]", "a pattern without bars", "open and closed pixels"),
        ("pattern = [\"00\", \"00\"]", "a pattern without openings", "open and closed pixels"),
        ("pattern = [\"01\", \"10\"]\nperiod = \"10 um\"", "sample_mask.period", "pattern_pixel"),
        ("pattern = [\"01\", \"10\"]\nshape = \"round\"", "sample_mask.shape", "pattern_pixel"),
        ("pattern = [\"01\", \"10\"]\naperture = \"5 um\"", "sample_mask", "aperture"),
        ("pattern = [\"01\", \"10\"]\nlattice = \"hexagonal\"", "sample_mask.lattice", "no value"),
    ];
    for (mask, found, allowed) in cases {
        let error = load(&format!("{mask}{PIXEL}"), place.path()).expect_err(mask);
        let (text, errors) = (error.to_string(), error.each().len());
        assert!(text.contains(found) && text.contains(allowed) && errors == 1, "{mask}: {text}");
    }
    let error = load("pattern = [\"01\", \"10\"]", place.path()).expect_err("no size").to_string();
    assert!(error.contains("pattern_pixel"), "{error}");
    let error = load("aperture = \"5 um\"\npattern_pixel = \"5 um\"", place.path());
    assert!(error.expect_err("no pattern").to_string().contains("pattern"));
}

#[test]
fn files_of_patterns_are_among_the_hashes_of_a_scene() {
    let place = tempfile::tempdir().unwrap();
    let text = text(&format!("pattern = \"of.csv\"{PIXEL}"));
    let of = |values: &str| {
        fs::write(place.path().join("of.csv"), values).unwrap();
        Scene::from_toml(&text, place.path()).unwrap()
    };
    let hash = |scene: &Scene| scene.files[Path::new("of.csv")].clone();
    let [first, second] = ["0,1\n1,0\n", "1,0\n0,1\n"].map(of);
    assert_ne!(hash(&first), hash(&second));
    // A scene that has the hash of another pattern is refused.
    let recorded = format!("{text}\n[files]\n\"of.csv\" = \"{}\"\n", hash(&first));
    let error = Scene::from_toml(&recorded, place.path()).unwrap_err().to_string();
    for word in ["sample_mask.pattern", "sha256", "as in [files]"] {
        assert!(error.contains(word), "{word:?} in: {error}");
    }
}
