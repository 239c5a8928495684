//! Files that a scene refers to: what they held when the run began is recorded, and no other
//! beam goes on with it.

use super::{SCENE, assert_says};
use crate::support::program::{Workplace, ended};
use ndarray::Array2;
use ndarray_npy::WriteNpyExt;
use std::fs;
use std::fs::File;

const FILES: [&str; 5] = ["beam.csv", "spot.csv", "blur.npy", "scatter.npy", "resin.csv"];

/// A scene that refers to a file of every kind.
fn scene() -> String {
    SCENE
        .replace("energy = \"30 keV\"", "spectrum = { file = \"beam.csv\", nodes = 2 }")
        .replace("spot = [\"30 um\", \"26 um\"]", "spot = { profile = \"spot.csv\" }")
        .replace(
            "pitch = \"150 um\"\n",
            "pitch = \"150 um\"\n\
             blur = { kernel = \"blur.npy\", pixel = \"50 um\" }\n\
             scatter = { kernel = \"scatter.npy\", pixel = \"150 um\", fraction = 0.1 }\n",
        )
        .replace("mu = \"0.25 /cm\"\ndelta = 2.4e-7", "table = \"resin.csv\"")
}

fn write_kernel(place: &Workplace, name: &str, value: f32) {
    let mut kernel = Array2::<f32>::ones((3, 3));
    kernel[[1, 1]] = value;
    kernel.write_npy(File::create(place.path(name)).unwrap()).unwrap();
}

fn place() -> Workplace {
    place_of(&scene())
}

fn place_of(scene: &str) -> Workplace {
    let place = Workplace::new(scene);
    let texts = [
        ("beam.csv", "energy_keV,weight\n20,1\n30,2\n40,1\n"),
        ("spot.csv", "radius_um,value\n0,1\n10,0.5\n20,0\n"),
        ("resin.csv", "energy_keV,mu_per_cm,delta\n5,90,9e-6\n30,0.25,2.4e-7\n60,0.2,6e-8\n"),
    ];
    for (name, text) in texts {
        fs::write(place.path(name), text).unwrap();
    }
    write_kernel(&place, "blur.npy", 4.0);
    write_kernel(&place, "scatter.npy", 2.0);
    place
}

/// Makes a file a little another one.
fn change(place: &Workplace, name: &str) {
    let path = place.path(name);
    match name {
        "beam.csv" => fs::write(path, "energy_keV,weight\n20,1\n30,2\n40,1.01\n").unwrap(),
        "spot.csv" => fs::write(path, "radius_um,value\n0,1\n10,0.51\n20,0\n").unwrap(),
        "resin.csv" => {
            let text = fs::read_to_string(&path).unwrap();
            fs::write(&path, text.replace("0.25", "0.26")).unwrap();
        }
        _ => write_kernel(place, name, 3.0),
    }
}

/// A run as if it had been interrupted before its last view.
fn interrupted(place: &Workplace, more: &[&str]) {
    let simulate = [&["--format", "npy"], more].concat();
    ended(&place.simulate(&simulate), 0);
    let log = String::from_utf8(place.bytes("progress.log")).unwrap();
    let head: String = log.split_inclusive('\n').filter(|l| !l.starts_with("sample/3")).collect();
    place.write("progress.log", head.as_bytes());
    let run = String::from_utf8(place.bytes("run.json")).unwrap();
    place.write("run.json", run.replace("\"done\"", "\"running\"").as_bytes());
}

#[test]
fn the_resolved_scene_has_the_hash_of_every_file_that_it_refers_to() {
    let place = place();
    interrupted(&place, &[]);
    let resolved = String::from_utf8(place.bytes("scene.toml")).unwrap();
    let (_, files) = resolved.split_once("[files]\n").unwrap();
    assert_eq!(files.lines().count(), FILES.len(), "{files}");
    for name in FILES {
        let line =
            files.lines().find(|line| line.contains(name)).unwrap_or_else(|| panic!("{name}"));
        let (_, hash) = line.split_once(" = ").unwrap();
        assert_eq!(hash.trim_matches('"').len(), 64, "{line}");
    }
}

#[test]
fn a_run_goes_on_only_with_the_files_that_it_began_with() {
    let place = place();
    interrupted(&place, &[]);
    let whole = place.bytes("sample.npy");
    // The hash of each file is in the scene: a table, a kernel and a material stand for all.
    for name in [FILES[0], FILES[2], FILES[4]] {
        let before = fs::read(place.path(name)).unwrap();
        change(&place, name);
        let message = ended(&place.simulate(&["--resume"]), 1);
        assert_says(&message, &["another scene", name, "sha256"]);
        assert_eq!(place.bytes("sample.npy"), whole, "{name}");
        fs::write(place.path(name), before).unwrap();
    }
    assert_eq!(ended(&place.simulate(&["--resume"]), 0), "");
    assert_eq!(place.bytes("sample.npy"), whole);
}

#[test]
fn a_run_without_hashes_does_not_go_on() {
    let place = place();
    interrupted(&place, &[]);
    let resolved = String::from_utf8(place.bytes("scene.toml")).unwrap();
    let (without, _) = resolved.split_once("\n[files]\n").unwrap();
    place.write("scene.toml", without.as_bytes());
    let message = ended(&place.simulate(&["--resume"]), 1);
    assert_says(&message, &["beam.csv", "blur.npy", "scatter.npy", "resin.csv"]);
    assert_says(&message, &["sha256 there nothing, here"]);
}

#[test]
fn a_geometry_with_hashes_is_taken_with_its_files_alone() {
    let range = "from = \"-25 um\", to = \"25 um\", count = ";
    let place = place_of(&scene().replace(&format!("{range}2"), &format!("{range}5")));
    interrupted(&place, &[]);
    ended(&place.simulate(&["--resume"]), 0);
    let retrieve = [
        "retrieve",
        "--flat",
        "run/flat.npy",
        "--sample",
        "run/sample.npy",
        "--geometry",
        "run/scene.toml",
        "-q",
        "-o",
        "images",
        "--overwrite",
    ];
    ended(&place.beamlet(&retrieve), 0);
    let record = fs::read_to_string(place.path("images/retrieved.json")).unwrap();
    for name in FILES {
        assert!(record.contains(&format!("{name}\": \"")), "{name}: {record}");
    }
    for name in ["beam.csv", "scatter.npy"] {
        let before = fs::read(place.path(name)).unwrap();
        change(&place, name);
        let message = ended(&place.beamlet(&retrieve), 1);
        assert_says(&message, &[name, "is not the file that the scene was made with"]);
        fs::write(place.path(name), before).unwrap();
    }
}

/// A scene with rods where a file says.
fn scattered() -> Workplace {
    let object = "material = \"plastic\"\ninstances = \"places.csv\"\n";
    let place = Workplace::new(&SCENE.replace("material = \"plastic\"\n", object));
    fs::write(place.path("places.csv"), "x_mm,y_mm,z_mm\n-0.3,0,0\n0.3,1,0\n").unwrap();
    place
}

#[test]
fn a_run_with_positions_goes_on_only_with_its_own() {
    let place = scattered();
    interrupted(&place, &[]);
    let whole = place.bytes("sample.npy");
    let resolved = String::from_utf8(place.bytes("scene.toml")).unwrap();
    assert_says(resolved.split_once("[files]\n").unwrap().1, &["places.csv"]);
    assert_eq!(ended(&place.simulate(&["--resume"]), 0), "");
    assert_eq!(place.bytes("sample.npy"), whole);
    let names = |checked: &std::process::Output| {
        ended(checked, 0);
        String::from_utf8_lossy(&checked.stdout).contains("places.csv: is not the file")
    };
    assert!(!names(&place.beamlet(&["check", "run"])));
    fs::write(place.path("places.csv"), "x_mm,y_mm,z_mm\n-0.3,0,0\n0.3,1.001,0\n").unwrap();
    let message = ended(&place.simulate(&["--resume"]), 1);
    assert_says(&message, &["another scene", "places.csv", "sha256"]);
    assert_eq!(place.bytes("sample.npy"), whole);
    // What is in the run is whole, and only does not go with the file any more: a note.
    assert!(names(&place.beamlet(&["check", "run"])));
}
