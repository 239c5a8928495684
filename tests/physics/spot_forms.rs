//! Forms of a focal spot in a scene: read, overridden, and refused by file and key.

#![allow(clippy::unwrap_used, reason = "clippy exempts tests, but not what they call")]

use super::spots::{LOPSIDED, OFFSETS, part, with_spot};
use crate::reference::stack::Setup;
use beamlet::retrieve::Method;
use beamlet::scene::Scene;
use beamlet::scene::Spot;
use ndarray::array;
use std::collections::BTreeMap;

/// A small scene with this spot, and files beside it.
fn text(spot: &str) -> String {
    format!(
        "[source]\ndistance = \"1.21 m\"\nspot = {spot}\nenergy = \"30 keV\"\n[detector]\n\
         distance = \"1.8 m\"\npixels = [4, 2]\npitch = \"150 um\"\n"
    )
}

#[test]
fn every_form_is_read_and_the_resolved_scene_reads_back_equal() {
    let place = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| std::fs::write(place.path().join(name), text).unwrap();
    ndarray_npy::write_npy(place.path().join("spot.npy"), &array![[1.0, 5.0], [2.0, 3.0]]).unwrap();
    write("round.csv", "# measured\nradius_um,value\n0,1\n10,1\n10.001,0\n");
    write("lines.csv", "value\tposition_um\n1\t0\n0.5\t10\n0\t20\n");
    for (spot, fwhm, count) in [
        ("\"30 um\"", [30e-6, 30e-6], 1..=1),
        ("{ fwhm = [\"30 um\", \"26 um\"] }", [30e-6, 26e-6], 1..=1),
        ("{ fwhm = \"30 um\", points = [41, 31] }", [30e-6, 30e-6], 1271..=1271),
        ("{ gaussians = [{ fwhm = \"20 um\" }] }", [20e-6, 20e-6], 1..=1),
        (
            "{ gaussians = [{ fwhm = \"0 um\", offset = \"1 um\", weight = 2 }, \
             { weight = 2.0, fwhm = \"0 um\", offset = [\"-1 um\", \"0 um\"] }] }",
            [1e-6 / 0.424_660_9, 0.5e-6 / 0.424_660_9],
            2..=2,
        ),
        // A disc of radius R has the deviation R / 2; a triangle of half base b has b / sqrt 6.
        ("{ profile = \"round.csv\" }", [5e-6 / 0.424_660_9; 2], 2..=64),
        ("{ profile = \"lines.csv\" }", [8.165e-6 / 0.424_660_9; 2], 1..=64),
        ("{ image = \"spot.npy\", pixel = \"20 um\" }", [26.59e-6; 2], 2..=4),
        ("{ image = \"spot.npy\", pixel = \"20 um\", background = 0.5 }", [26.4e-6; 2], 2..=4),
    ] {
        let scene = Scene::from_toml(&text(spot), place.path()).unwrap();
        let got = scene.source.spot.fwhm();
        assert!(count.contains(&scene.source.spot.parts().len()), "{spot}: {count:?}");
        for axis in 0..2 {
            // The profile is sampled 121 times across; the images are compared in words only.
            let tolerance = if spot.contains("image") { 0.2 } else { 2e-3 };
            let off = (got[axis] / fwhm[axis] - 1.0).abs();
            assert!(off < tolerance, "{spot}: {got:?} for {fwhm:?}");
        }
        let resolved = scene.to_toml(place.path(), &BTreeMap::new(), &[]).unwrap();
        // Without its files: the Gaussians stand in it.
        let again = Scene::from_toml(&resolved, "elsewhere").unwrap();
        assert_eq!(again.source, scene.source, "{resolved}");
    }
}

#[test]
fn overrides_change_parts_of_a_spot() {
    let place = tempfile::tempdir().unwrap();
    ndarray_npy::write_npy(place.path().join("spot.npy"), &array![[1.0, 5.0], [2.0, 3.0]]).unwrap();
    let path = place.path().join("scene.toml");
    std::fs::write(&path, text("{ image = \"spot.npy\", pixel = \"20 um\" }")).unwrap();
    let load = |set: &str| Scene::load_with(&path, &[set.to_owned()]).unwrap().source.spot.fwhm();
    let [one, two] = ["10 um", "20 um"].map(|p| load(&format!("source.spot.pixel={p}")));
    assert!((two[0] / one[0] - 2.0).abs() < 1e-9 && (two[1] / one[1] - 2.0).abs() < 1e-9);
    let [x, z] = load("source.spot.fwhm=7 um");
    assert!((x - 7e-6).abs() < 1e-15 && (z - 7e-6).abs() < 1e-15);
}

#[test]
fn exact_curves_serve_every_spot_and_two_steps_one_gaussian() {
    let setup = Setup::paper([4, 1]);
    let check = |method: Method, spot: Spot, offsets: &[f64]| {
        method.check(&with_spot(&setup, &[], &OFFSETS, spot), offsets)
    };
    // Two heights of one width across the slits are one Gaussian there.
    let [low, high] = [part(1.0, [30e-6, 9e-6], [0.0; 2]), part(2.0, [30e-6, 0.0], [0.0, 9e-6])];
    let lopsided = || Spot::gaussians(LOPSIDED.to_vec());
    for spot in [[30e-6, 26e-6].into(), Spot::gaussians(vec![low, high]), lopsided()] {
        assert!(check(Method::ExactCurve, spot, &OFFSETS).is_ok());
    }
    let two = [-10e-6, 10e-6];
    assert!(check(Method::TwoStep, [30e-6, 26e-6].into(), &two).is_ok());
    let error = check(Method::TwoStep, lopsided(), &two).unwrap_err().to_string();
    assert!(error.contains("source.spot") && error.contains("use gaussian"), "{error}");
}

#[test]
fn values_that_no_image_of_a_spot_has_are_named_by_their_pixel() {
    let place = tempfile::tempdir().unwrap();
    for (value, words) in [(-0.5, "-0.5 in row 0, column 1"), (f64::NAN, "NaN in row 0, column 1")]
    {
        ndarray_npy::write_npy(place.path().join("spot.npy"), &array![[1.0, value]]).unwrap();
        let spot = "{ image = \"spot.npy\", pixel = \"2 um\" }";
        let error = Scene::from_toml(&text(spot), place.path()).unwrap_err().to_string();
        assert!(error.contains("spot.npy") && error.contains(words), "{error}");
    }
}
