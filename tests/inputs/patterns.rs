//! Masks of patterns (images, tables and texts of open and closed pixels) and of lists of rectangles, and their rotation.

use crate::kept::{assert_hashed, kept};
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
fn pixels_of_a_third_value_are_named_by_their_place() {
    let place = tempfile::tempdir().unwrap();
    let grey = array![[0.0_f32, 1.0], [0.5, 1.0]];
    write_npy(place.path().join("grey.npy"), &grey).unwrap();
    let error = load(&format!("pattern = \"grey.npy\"{PIXEL}"), place.path()).expect_err("grey");
    let text = error.to_string();
    assert!(
        text.contains("grey.npy") && text.contains("row 1, column 0 has 0.5 beside 0 and 1"),
        "{text}"
    );
}

#[test]
fn files_of_patterns_are_among_the_hashes_of_a_scene() {
    let text = text(&format!("pattern = \"of.csv\"{PIXEL}"));
    assert_hashed(&text, "of.csv", ["0,1\n1,0\n", "1,0\n0,1\n"], "sample_mask.pattern");
}

const PERIOD: &str = "\nperiod = \"40 um\"\nperiod_z = \"30 um\"";

#[test]
fn rectangles_of_a_list_and_of_a_file_are_the_same_mask_which_comes_back() {
    let place = tempfile::tempdir().unwrap();
    let file = "x_um,z_um,width_um,height_um\n# two that touch\n-10,5,8,12\n-2,5,8,12\n12,0,5,4\n";
    fs::write(place.path().join("of.csv"), file).unwrap();
    let list = r#"[["-10 um", "5 um", "8 um", "12 um"], ["-2 um", "5 um", "8 um", "12 um"], ["12 um", "0 um", "5 um", "4 um"]]"#;
    let [listed, read] = [list, "\"of.csv\""].map(|rectangles| {
        load(&format!("rectangles = {rectangles}{PERIOD}"), place.path()).unwrap()
    });
    assert!(read.files.contains_key(Path::new("of.csv")));
    assert_eq!(listed.sample_mask, read.sample_mask);
    let resolved = listed.to_toml(".", &std::collections::BTreeMap::new(), &[]).unwrap();
    let back = Scene::from_toml(&resolved, place.path()).unwrap();
    assert_eq!(back.sample_mask, listed.sample_mask);
    let mask = listed.sample_mask.unwrap();
    // The narrowest openings: the third, whose height is less than of the others.
    let close = |a: f64, b: f64| (a - b).abs() < 1e-15;
    assert!(close(mask.aperture, 5e-6) && close(mask.aperture_z.unwrap(), 4e-6), "{mask:?}");
    assert!(close(mask.open_share(), (96.0 + 96.0 + 20.0) / 1200.0));
}

#[test]
fn rotation_turns_lists_and_lattices() {
    let place = tempfile::tempdir().unwrap();
    let mask = |text: &str| load(text, place.path()).unwrap().sample_mask.unwrap();
    let of = |rows: &str| format!("pattern = {rows}\npattern_pixel = ");
    let pattern = of(r#"["110", "000"]"#) + "[\"5 um\", \"4 um\"]\nrotation = \"90 deg\"";
    assert_eq!(mask(&pattern), mask(&(of(r#"["01", "01", "00"]"#) + "[\"4 um\", \"5 um\"]")));
    // Clockwise as the source sees it: two pixels of the upper row, and the same as a rectangle.
    let list = |place: &str, period: &str| format!("rectangles = [[{place}]]\n{period}");
    let square = "period = \"6 um\"\nperiod_z = \"6 um\"";
    let turned = list(r#""-1 um", "1.5 um", "4 um", "3 um""#, square) + "\nrotation = \"90 deg\"";
    assert_eq!(mask(&turned), mask(&list(r#""1.5 um", "1 um", "3 um", "4 um""#, square)));
    let lattice = |keys: &str| format!("shape = \"rectangle\"\n{keys}");
    let turned = "aperture = \"5 um\"\naperture_z = \"9 um\"\nperiod = \"20 um\"\nperiod_z = \"30 um\"\nrotation = \"-90 deg\"";
    let want =
        "aperture = \"9 um\"\naperture_z = \"5 um\"\nperiod = \"30 um\"\nperiod_z = \"20 um\"";
    assert_eq!(mask(&lattice(turned)), mask(&lattice(want)));
}
