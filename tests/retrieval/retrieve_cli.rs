//! `beamlet retrieve` and `beamlet compare` as a user meets them, on a run of the shipped
//! cylinder and on measured files.

use crate::reference::closed_form::cylinder_deflection;
use crate::reference::fit;
use crate::support::log::commit;
use crate::support::{program, root};
use beamlet::RowsControl;
use beamlet::retrieve::{ImagesTo, Input, Record, RetrieveOptions, retrieve};
use beamlet::stack::{Format, Maps, OpenRun, StackFile};
use beamlet::{Cancel, Engine, EngineOptions, Error};
use ndarray::{Array3, Array4};
use ndarray_npy::{read_npy, write_npy};
use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::process::Output;
use std::sync::{LazyLock, OnceLock};
use tempfile::TempDir;

pub(super) static SCENE: LazyLock<String> = LazyLock::new(|| {
    let path = root().join("docs/experiments/cylinder/scene.toml").canonicalize();
    path.unwrap().into_os_string().into_string().unwrap()
});

pub(super) fn beamlet(directory: &Path, words: &[&str]) -> Output {
    program::beamlet(directory).args(words).output().unwrap()
}

pub(super) fn told(output: &Output) -> String {
    let text = [output.stdout.as_slice(), output.stderr.as_slice()].concat();
    String::from_utf8(text).unwrap()
}

pub(super) fn good(directory: &Path, words: &[&str]) -> String {
    let output = beamlet(directory, words);
    assert_eq!(output.status.code(), Some(0), "{words:?}: {}", told(&output));
    String::from_utf8(output.stdout).unwrap()
}

pub(super) fn bad(directory: &Path, words: &[&str], code: i32, word: &str) {
    let output = beamlet(directory, words);
    assert_eq!(output.status.code(), Some(code), "{words:?}: {}", told(&output));
    assert!(told(&output).contains(word), "{words:?}: {}", told(&output));
}

/// A run of the cylinder, two views, small: simulated once for all tests.
fn run() -> PathBuf {
    static RUN: OnceLock<TempDir> = OnceLock::new();
    let folder = RUN.get_or_init(|| {
        let folder = tempfile::tempdir().unwrap();
        let words = [
            "simulate",
            &*SCENE,
            "-o",
            "run",
            "--format",
            "npy",
            "-q",
            "--set",
            "detector.pixels=[64, 4]",
            "--set",
            "scan.angles=[\"0 deg\", \"90 deg\"]",
        ];
        good(folder.path(), &words);
        folder
    });
    folder.path().join("run")
}

/// A copy of the run, so that tests do not meet.
pub(super) fn copy() -> (TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let to = folder.path().join("run");
    copy_files(&run(), &to);
    (folder, to)
}

fn copy_files(from: &Path, to: &Path) {
    fs::create_dir(to).unwrap();
    for entry in fs::read_dir(from).unwrap() {
        let path = entry.unwrap().path();
        if path.is_file() {
            fs::copy(&path, to.join(path.file_name().unwrap())).unwrap();
        }
    }
}

#[test]
fn images_of_a_run_match_f64_fits() {
    let (folder, run) = copy();
    good(
        folder.path(),
        &["retrieve", "run", "--format", "npy", "--method", "gaussian", "--background", "free"],
    );
    let flat: Array3<f32> = read_npy(run.join("flat.npy")).unwrap();
    let sample: Array4<f32> = read_npy(run.join("sample.npy")).unwrap();
    let maps = Maps::open(run.join("retrieved")).unwrap();
    assert_eq!(maps.views(), 2);
    let offsets: Vec<f64> = (0..11).map(|i| -25e-6 + 5e-6 * f64::from(i)).collect();
    let curve = |get: &dyn Fn(usize) -> f32| -> Vec<f64> {
        (0..11).map(|step| f64::from(get(step))).collect()
    };
    let arm = 1.5 / 0.59;
    for view in 0..2 {
        let map = |name: &str| maps.map(name, view).unwrap();
        let [t, alpha, dark] = [map("transmission"), map("refraction"), map("dark_field")];
        let flagged = map("flags");
        for column in 0..64 {
            let f = fit::fit(&offsets, &curve(&|step| flat[[step, 1, column]]));
            let s = fit::fit(&offsets, &curve(&|step| sample[[view, step, 1, column]]));
            let at = [1, column];
            assert_eq!(flagged[at].to_bits(), 0, "column {column}");
            let expected = [
                s[0] * s[2] / (f[0] * f[2]),
                -arm * (s[1] - f[1]),
                arm * arm * (s[2] * s[2] - f[2] * f[2]),
            ];
            assert!((f64::from(t[at]) - expected[0]).abs() < 1e-6, "column {column}");
            // 1e-7 of a width of 9 um, times M/z: 2e-12 rad; its square in the dark field.
            assert!((f64::from(alpha[at]) - expected[1]).abs() < 1e-11, "column {column}");
            assert!((f64::from(dark[at]) - expected[2]).abs() < 1e-15, "column {column}");
        }
        // And of the right sign and size: 2 delta x / sqrt(R^2 - x^2), within the bias of a
        // Gaussian and the pixel's width.
        for column in [20, 40, 44] {
            let x = (f64::from(column) + 0.5 - 32.0) * 150e-6 * 1.21 / 1.8;
            let theory = -cylinder_deflection(4.6092e-7, 4e-3, x);
            let got = f64::from(alpha[[1, column as usize]]);
            assert!((got.abs() / theory.abs() - 1.0).abs() < 0.1, "{column}: {got} for {theory}");
        }
    }
    let record = Record::read(&run.join("retrieved/retrieved.json")).unwrap();
    assert_eq!((record.method.as_str(), record.shape), ("gaussian", [2, 4, 64]));
    assert_eq!(record.units["refraction"], "rad");
    assert_eq!(record.without_answer, 0);
}

#[test]
fn every_format_holds_the_same_images_with_their_units() {
    let (folder, run) = copy();
    let mut all = Vec::new();
    for format in ["npy", "exr", "tiff"] {
        good(folder.path(), &["retrieve", "run", "--format", format, "--overwrite"]);
        let maps = Maps::open(run.join("retrieved")).unwrap();
        let names: Vec<String> = maps.names().map(str::to_owned).collect();
        let images: Vec<Vec<u32>> = names
            .iter()
            .flat_map(|name| (0..2).map(|view| maps.map(name, view).unwrap()))
            .map(|map| map.iter().map(|value| value.to_bits()).collect())
            .collect();
        assert!(maps.map("refraction", 2).is_err() && maps.map("nonsense", 0).is_err());
        all.push((names, images));
    }
    assert_eq!(all[0], all[1]);
    assert_eq!(all[0], all[2]);
    // Other readers: the description of a TIFF page tells unit and geometry.
    let file = File::open(run.join("retrieved/refraction.tif")).unwrap();
    let mut pages = tiff::decoder::Decoder::new(file).unwrap();
    let about = pages.get_tag_ascii_string(tiff::tags::Tag::ImageDescription).unwrap();
    // Pixels per centimetre.
    let unit = pages.get_tag_u32(tiff::tags::Tag::ResolutionUnit).unwrap();
    assert_eq!(unit, u32::from(tiff::tags::ResolutionUnit::Centimeter.to_u16()));
    for tag in [tiff::tags::Tag::XResolution, tiff::tags::Tag::YResolution] {
        let per_cm = pages.get_tag(tag).unwrap().into_u32_vec().unwrap();
        let pitch = f64::from(per_cm[1]) / f64::from(per_cm[0]);
        assert!((pitch - 150e-4).abs() < 1e-8, "{pitch}");
    }
    let about: serde_json::Value = serde_json::from_str(&about).unwrap();
    assert_eq!(
        (about["unit"].as_str(), about["image"].as_str()),
        (Some("rad"), Some("refraction"))
    );
    assert!((about["magnification"].as_f64().unwrap() - 1.5).abs() < 1e-12);
}

#[test]
fn images_are_not_replaced_unless_asked_and_files_of_others_stop_it() {
    let (folder, run) = copy();
    good(folder.path(), &["retrieve", "run"]);
    bad(folder.path(), &["retrieve", "run"], 1, "already");
    fs::write(run.join("retrieved/notes.txt"), "mine").unwrap();
    bad(folder.path(), &["retrieve", "run", "--overwrite"], 1, "notes.txt");
    fs::remove_file(run.join("retrieved/notes.txt")).unwrap();
    good(folder.path(), &["retrieve", "run", "--overwrite", "--method", "exact-curve"]);
    let record = Record::read(&run.join("retrieved/retrieved.json")).unwrap();
    assert_eq!(record.method, "exact-curve");
    fs::create_dir(folder.path().join("mine")).unwrap();
    fs::write(folder.path().join("mine/a"), "mine").unwrap();
    bad(folder.path(), &["retrieve", "run", "-o", "mine", "--overwrite"], 1, "holds no retrieved");
}

#[test]
fn a_retrieval_that_is_stopped_or_fails_leaves_nothing() {
    let (_folder, run) = copy();
    let engine = Engine::open(&EngineOptions::default()).unwrap();
    let images = run.join("retrieved");
    let to = ImagesTo::new(&images, Format::Npy);
    let cancel = Cancel::default();
    cancel.cancel();
    let input = || Input::of_run(&OpenRun::open(&run).unwrap(), false).unwrap();
    let mut control = RowsControl::default().with_cancel(cancel.clone());
    let stopped = retrieve(&engine, input(), &RetrieveOptions::default(), to, &mut control);
    assert!(matches!(stopped, Err(Error::Interrupted)));
    // Stopped between the views.
    let later = Cancel::default();
    let mut progress = |done: u64, _: u64| {
        if done >= 8 {
            later.cancel();
        }
    };
    let mut control =
        RowsControl::default().with_cancel(later.clone()).with_progress(&mut progress);
    let stopped = retrieve(&engine, input(), &RetrieveOptions::default(), to, &mut control);
    assert!(matches!(stopped, Err(Error::Interrupted)));
    let left: Vec<String> = fs::read_dir(&run)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .filter(|name| name.contains("retrieved"))
        .collect();
    assert!(left.is_empty(), "{left:?}");
}

#[test]
fn comparisons_tell_what_differs_and_by_how_much() {
    let (folder, run) = copy();
    let place = folder.path();
    let other = place.join("other");
    copy_files(&run, &other);
    good(place, &["compare", "run", "other"]);
    let mut sample: Array4<f32> = read_npy(other.join("sample.npy")).unwrap();
    sample[[1, 3, 2, 40]] += 0.01;
    write_npy(other.join("sample.npy"), &sample).unwrap();
    commit(&other);
    bad(place, &["compare", "run", "other"], 1, "sample");
    good(place, &["compare", "run", "other", "--tolerance", "0.011"]);
    let words = ["compare", "run", "other", "--json", "--difference", "gone", "--format", "tiff"];
    let output = beamlet(place, &words);
    assert_eq!(output.status.code(), Some(1));
    let found: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(found[1]["name"], "sample");
    assert_eq!(found[1]["largest_at"], serde_json::json!([1, 3, 2, 40]));
    assert!((found[1]["largest"].as_f64().unwrap() - 0.01).abs() < 1e-6);
    assert_eq!(found[0]["largest"], 0.0);
    let image = StackFile::open(place.join("gone/sample.tif")).unwrap();
    let frame = image.frame(0, 11 + 3, 0..4).unwrap();
    assert!((frame[[2, 40]] - 0.01).abs() < 1e-6 && frame[[2, 41]].to_bits() == 0);
    bad(place, &["compare", "run", "run/flat.npy"], 2, "compare like with like");
    bad(place, &["compare", "run/flat.npy", "run/sample.npy"], 2, "has [");
    bad(place, &["compare", "run", "nowhere"], 2, "nowhere: does not exist");
    good(place, &["compare", "run/sample.npy", "run/sample.npy"]);
}

#[test]
fn quiet_verbs_print_nothing_and_a_run_is_a_geometry() {
    let (folder, run) = copy();
    let here = folder.path();
    let again = [
        "simulate",
        &*SCENE,
        "-o",
        "again",
        "--format",
        "npy",
        "-q",
        "--set",
        "detector.pixels=[4, 1]",
    ];
    let of_run = ["retrieve", "run", "--format", "npy", "-q"];
    let of_files =
        ["retrieve", "--flat", "run/flat.npy", "--sample", "run/sample.npy", "--geometry", "run"];
    let of_files = [&of_files[..], &["-o", "images", "--format", "npy", "-q"]].concat();
    for words in [&again[..], &of_run[..], &of_files[..]] {
        let output = beamlet(here, words);
        assert_eq!(output.status.code(), Some(0), "{}", told(&output));
        assert_eq!(told(&output), "", "{words:?}");
    }
    let image = |place: &Path| fs::read(place.join("refraction.npy")).unwrap();
    assert_eq!(image(&run.join("retrieved")), image(&here.join("images")));
}
