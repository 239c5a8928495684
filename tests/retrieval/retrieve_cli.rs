//! `beamlet retrieve` and `beamlet compare` as a user meets them, on a run of the shipped
//! cylinder and on measured files.

#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests")]
#![allow(clippy::print_stdout, reason = "measured figures are printed")]
#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "pixel values are small"
)]

use crate::reference::closed_form::cylinder_deflection;
use crate::reference::draws::Draws;
use crate::reference::fit;
use crate::support::log::commit;
use crate::support::program;
use beamlet::RowsControl;
use beamlet::retrieve::{ImagesTo, Input, Record, RetrieveOptions, flags, retrieve};
use beamlet::stack::{Format, Maps, OpenRun, StackFile};
use beamlet::{Cancel, Engine, EngineOptions, Error};
use ndarray::{Array3, Array4, Axis};
use ndarray_npy::{read_npy, write_npy};
use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::process::Output;
use std::sync::OnceLock;
use tempfile::TempDir;
use tiff::encoder::TiffEncoder;
use tiff::encoder::colortype::Gray16;

const SCENE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/docs/experiments/cylinder/scene.toml");

fn beamlet(directory: &Path, words: &[&str]) -> Output {
    program::beamlet(directory).args(words).output().unwrap()
}

fn told(output: &Output) -> String {
    let text = [output.stdout.as_slice(), output.stderr.as_slice()].concat();
    String::from_utf8(text).unwrap()
}

fn good(directory: &Path, words: &[&str]) -> String {
    let output = beamlet(directory, words);
    assert_eq!(output.status.code(), Some(0), "{words:?}: {}", told(&output));
    String::from_utf8(output.stdout).unwrap()
}

fn bad(directory: &Path, words: &[&str], code: i32, word: &str) {
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
            SCENE,
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
fn copy() -> (TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let to = folder.path().join("run");
    fs::create_dir(&to).unwrap();
    for entry in fs::read_dir(run()).unwrap() {
        let path = entry.unwrap().path();
        if path.is_file() {
            fs::copy(&path, to.join(path.file_name().unwrap())).unwrap();
        }
    }
    (folder, to)
}

#[test]
fn images_of_a_run_match_f64_fits() {
    let (folder, run) = copy();
    good(folder.path(), &["retrieve", "run", "--format", "npy"]);
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

fn tiff16(path: &Path, frames: &Array3<f32>, scale: f32, dark: f32) {
    let mut encoder = TiffEncoder::new(File::create(path).unwrap()).unwrap();
    for frame in frames.outer_iter() {
        let counts: Vec<u16> = frame.iter().map(|y| (y * scale + dark).round() as u16).collect();
        let (rows, columns) = frame.dim();
        encoder.write_image::<Gray16>(columns as u32, rows as u32, &counts).unwrap();
    }
}

#[test]
fn measured_16_bit_tiffs_with_a_dark_frame_give_the_runs_contrasts() {
    let (folder, run) = copy();
    let place = folder.path();
    good(place, &["retrieve", "run", "--format", "npy"]);
    let flat: Array3<f32> = read_npy(run.join("flat.npy")).unwrap();
    let sample: Array4<f32> = read_npy(run.join("sample.npy")).unwrap();
    let [views, steps, rows, columns] = [2, 11, 4, 64];
    let pages = sample.into_shape_with_order((views * steps, rows, columns)).unwrap();
    tiff16(&place.join("flat.tif"), &flat, 2e5, 100.0);
    tiff16(&place.join("sample.tif"), &pages, 2e5, 100.0);
    tiff16(&place.join("dark.tif"), &Array3::zeros((3, rows, columns)), 0.0, 100.0);
    let list: Vec<String> = (0..11).map(|i| format!("{} um", -25 + 5 * i)).collect();
    let list_in_one = list.join(", ");
    let words = ["--flat", "flat.tif", "--sample", "sample.tif", "--dark", "dark.tif"];
    let measured = [
        ["retrieve"].as_slice(),
        &words,
        &["--offsets", &list_in_one, "--geometry", SCENE, "-o", "images"],
    ]
    .concat();
    good(place, &measured);
    let simulated = Maps::open(run.join("retrieved")).unwrap();
    let images = Maps::open(place.join("images")).unwrap();
    for view in 0..2 {
        let [a, b] = [&simulated, &images].map(|maps| maps.map("transmission", view).unwrap());
        // Rounding to whole counts of 33,000 at the peak.
        assert!((&a - &b).iter().all(|d| d.abs() < 2e-3));
        let [a, b] = [&simulated, &images].map(|maps| maps.map("refraction", view).unwrap());
        assert!((&a - &b).iter().all(|d| d.abs() < 2e-8));
    }
    // The same through a file of offsets, and by comparison.
    fs::write(place.join("offsets.txt"), format!("# um\n{}\n", list.join("\n"))).unwrap();
    let from_file = [
        ["retrieve"].as_slice(),
        &words,
        &["--offsets", "offsets.txt", "--geometry", SCENE, "-o", "again"],
    ]
    .concat();
    good(place, &from_file);
    good(place, &["compare", "images", "again"]);
    bad(place, &["compare", "run/retrieved", "images"], 1, "they differ");
    // Values at the top of the curves are left out and flagged, and nothing else.
    let clipped = [
        ["retrieve"].as_slice(),
        &words,
        &["--offsets", &list_in_one, "--geometry", SCENE, "-o", "clipped"],
        &["--saturation", "31000"],
    ]
    .concat();
    good(place, &clipped);
    let flagged = Maps::open(place.join("clipped")).unwrap().map("flags", 0).unwrap();
    assert!(flagged.iter().all(|bits| *bits as u32 & 4 == 4), "{flagged:?}");

    // A sample in the place of the flat is warned of, the other way round nothing is.
    let view: Array4<f32> = read_npy(run.join("sample.npy")).unwrap();
    write_npy(place.join("view.npy"), &view.index_axis(Axis(0), 1)).unwrap();
    for (flat, sample, warns) in
        [("run/flat.npy", "view.npy", false), ("view.npy", "run/flat.npy", true)]
    {
        let words =
            ["retrieve", "--flat", flat, "--sample", sample, "--geometry", SCENE, "-o", "light"];
        let output = beamlet(place, &[words.as_slice(), &["--overwrite"]].concat());
        assert_eq!(output.status.code(), Some(0), "{}", told(&output));
        assert_eq!(told(&output).contains("may be swapped"), warns, "{}", told(&output));
    }
    refuse_bad_stacks(place, &measured, &list_in_one);
}

/// Changes of a command that retrieves stacks are refused, each with its name and nothing written.
/// `list_in_one`: offsets of the command.
fn refuse_bad_stacks(place: &Path, measured: &[&str], list_in_one: &str) {
    let swap = |from: &str, to: &str| -> Vec<String> {
        measured.iter().map(|word| if *word == from { to.into() } else { (*word).into() }).collect()
    };
    let refuse = |words: Vec<String>, code: i32, word: &str| {
        let mut words: Vec<&str> = words.iter().map(String::as_str).collect();
        let last = words.len() - 1;
        words[last] = "none";
        bad(place, &words, code, word);
        assert!(!place.join("none").exists() && !place.join("none.partial").exists());
    };
    refuse(swap(list_in_one, "-5 um, 0 um, 5 um, 9 um"), 1, "11 frames for 4");
    refuse(swap(list_in_one, "-5 um, 0 um, 5 um"), 1, "at least 4");
    refuse(swap(list_in_one, "-5 um, 7"), 1, "offsets[1]");
    write_npy(place.join("small.npy"), &Array3::<f32>::zeros((11, 4, 32))).unwrap();
    refuse(swap("sample.tif", "small.npy"), 1, "small.npy");
    write_npy(place.join("zero.npy"), &Array3::<f32>::zeros((11, 4, 64))).unwrap();
    refuse(swap("flat.tif", "zero.npy"), 1, "without beam");
    refuse(swap("dark.tif", "flat.tif"), 1, "without beam");
    refuse(swap("sample.tif", "flat.tif"), 1, "has the same values as the flat");
    refuse(swap(list_in_one, &list_in_one.replace("um", "mm")), 1, "periods of the sample mask");
    refuse(swap(list_in_one, &list_in_one.replace("um", "nm")), 1, "periods of the sample mask");
    write_npy(place.join("nan.npy"), &Array3::from_elem((11, 4, 64), f32::NAN)).unwrap();
    refuse(swap("flat.tif", "nan.npy"), 1, "not a number");
    refuse(swap("dark.tif", "nan.npy"), 1, "not finite");
    let bytes = fs::read(place.join("flat.tif")).unwrap();
    fs::write(place.join("short.tif"), &bytes[..bytes.len() / 2]).unwrap();
    refuse(swap("flat.tif", "short.tif"), 1, "short.tif");
    refuse(swap("--geometry", "--overwrite"), 2, "");
}

#[test]
fn detector_numbers_of_a_run_give_uncertainties_that_hold() {
    // Counts as a detector of 1000 photons at the peak would tell them, gain 2, dark 50.
    let (folder, run) = copy();
    let place = folder.path();
    let mut draws = Draws(5);
    let mut counts = |y: f32| (2.0 * draws.poisson(f64::from(y) / 0.17 * 1000.0) + 50.0) as f32;
    let flat: Array3<f32> = read_npy(run.join("flat.npy")).unwrap();
    let sample: Array4<f32> = read_npy(run.join("sample.npy")).unwrap();
    fs::create_dir(run.join("counts")).unwrap();
    write_npy(run.join("counts/flat.npy"), &flat.mapv(&mut counts)).unwrap();
    write_npy(run.join("counts/sample.npy"), &sample.mapv(&mut counts)).unwrap();
    write_npy(run.join("dark.npy"), &Array3::from_elem((2, 4, 64), 50.0_f32)).unwrap();
    commit(&run);
    good(place, &["retrieve", "run", "--format", "npy", "-o", "clean"]);
    let words = ["retrieve", "run", "--counts", "--gain", "2", "--weights", "poisson"];
    good(place, &[words.as_slice(), &["-o", "noisy"]].concat());
    let [clean, noisy] = ["clean", "noisy"].map(|name| Maps::open(place.join(name)).unwrap());
    for name in ["transmission", "refraction", "dark_field"] {
        let (mut sum, mut n) = (0.0, 0.0);
        for view in 0..2 {
            let truth = clean.map(name, view).unwrap();
            let got = noisy.map(name, view).unwrap();
            let sigma = noisy.map(&format!("{name}_sigma"), view).unwrap();
            for ((truth, got), sigma) in truth.iter().zip(&got).zip(&sigma) {
                sum += f64::from((got - truth) / sigma).powi(2);
                n += 1.0;
            }
        }
        // 512 pixels tell the mean square to 6 %; the Gaussian is not the curve, and its bias
        // under weights differs from that without by a part of a sigma.
        println!("{name}: mean square of deviations over sigma {}", sum / n);
        assert!((sum / n - 1.0).abs() < 0.35, "{name}: {}", sum / n);
    }
}

#[test]
fn comparisons_tell_what_differs_and_by_how_much() {
    let (folder, run) = copy();
    let place = folder.path();
    let other = place.join("other");
    fs::create_dir(&other).unwrap();
    for entry in fs::read_dir(&run).unwrap() {
        let path = entry.unwrap().path();
        fs::copy(&path, other.join(path.file_name().unwrap())).unwrap();
    }
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
fn bad_pixels_have_a_flag_of_their_own_and_change_no_other_pixel() {
    let (folder, run) = copy();
    let place = folder.path();
    good(place, &["retrieve", "run", "--format", "npy", "-o", "clean"]);
    let mut flat: Array3<f32> = read_npy(run.join("flat.npy")).unwrap();
    let sample: Array4<f32> = read_npy(run.join("sample.npy")).unwrap();
    let mut view = sample.index_axis(Axis(0), 0).to_owned();
    let mut dark = Array3::<f32>::zeros((1, 4, 64));
    // A gap of two columns, of which one is at the cylinder, and a hot pixel.
    let is_bad =
        |(row, column): (usize, usize)| [20, 21].contains(&column) || (row, column) == (2, 50);
    let mut mask = ndarray::Array2::<u8>::zeros((4, 64));
    let mut list = String::from("# row,column\n");
    for (at, value) in mask.indexed_iter_mut().filter(|(at, _)| is_bad(*at)) {
        *value = 1;
        list += &format!("{}, {}\n", at.0, at.1);
        for step in 0..11 {
            flat[[step, at.0, at.1]] = f32::NAN;
            view[[step, at.0, at.1]] = if step % 2 == 0 { 1e6 } else { f32::NAN };
        }
        dark[[0, at.0, at.1]] = f32::NAN;
    }
    write_npy(place.join("flat.npy"), &flat).unwrap();
    write_npy(place.join("view.npy"), &view).unwrap();
    write_npy(place.join("dark.npy"), &dark).unwrap();
    write_npy(place.join("mask.npy"), &mask).unwrap();
    fs::write(place.join("list.txt"), &list).unwrap();
    let stacks = ["--flat", "flat.npy", "--sample", "view.npy", "--dark", "dark.npy"];
    let words =
        [["retrieve"].as_slice(), &stacks, &["--geometry", SCENE, "--format", "npy"]].concat();
    let clean = Maps::open(place.join("clean")).unwrap();
    for file in ["mask.npy", "list.txt"] {
        let out = format!("{}_images", &file[..4]);
        good(place, &[words.as_slice(), &["--bad-pixels", file, "-o", &out]].concat());
        let images = Maps::open(place.join(&out)).unwrap();
        for name in ["transmission", "refraction", "dark_field", "flags"] {
            let [a, b] = [&clean, &images].map(|maps| maps.map(name, 0).unwrap());
            for (at, value) in b.indexed_iter() {
                match (is_bad(at), name) {
                    (true, "flags") => assert_eq!(*value as u32, flags::BAD_PIXEL, "{at:?}"),
                    (true, _) => assert!(value.is_nan(), "{name} {at:?}"),
                    (false, _) => assert_eq!(value.to_bits(), a[at].to_bits(), "{name} {at:?}"),
                }
            }
        }
        let record = Record::read(&place.join(&out).join("retrieved.json")).unwrap();
        assert_eq!(record.bad_pixels.as_deref(), Some(file));
        assert_eq!((record.without_answer, record.flagged[&flags::BAD_PIXEL]), (9, 9));
        assert!(record.inputs.contains_key(file));
    }
    // NaN of the dark is an error where no mask names its pixel.
    bad(place, &[words.as_slice(), &["-o", "none"]].concat(), 1, "row 0, column 20: --bad-pixels");
    write_npy(place.join("wide.npy"), &ndarray::Array2::<u8>::zeros((4, 65))).unwrap();
    write_npy(place.join("all.npy"), &ndarray::Array2::<u8>::ones((4, 64))).unwrap();
    fs::write(place.join("outside.txt"), "0,1\n4,1\n").unwrap();
    fs::write(place.join("word.txt"), "3|1\n").unwrap();
    for (file, word) in [
        ("wide.npy", "1 images of 4 x 65 pixels; allowed: one of 4 x 64"),
        ("all.npy", "every pixel"),
        ("outside.txt", "line 2: \"4,1\"; allowed: row,column, rows 0 to 3, columns 0 to 63"),
        ("word.txt", "line 1"),
        ("gone.txt", "gone.txt"),
    ] {
        bad(place, &[words.as_slice(), &["--bad-pixels", file, "-o", "none"]].concat(), 1, word);
        assert!(!place.join("none").exists());
    }
}

#[test]
fn arguments_that_do_not_go_together_are_usage_errors() {
    let (folder, _run) = copy();
    let place = folder.path();
    bad(place, &["retrieve"], 2, "");
    bad(place, &["retrieve", "run", "--weights", "poisson"], 2, "--counts");
    bad(place, &["retrieve", "run", "--gain", "2"], 2, "--counts");
    bad(place, &["retrieve", "run", "--flat", "a.tif"], 2, "");
    bad(place, &["retrieve", "--flat", "a.tif"], 2, "");
    let stacks = ["--flat", "run/flat.npy", "--sample", "run/sample.npy", "--geometry"];
    let words =
        [&["retrieve"][..], &stacks, &["run/scene.toml", "-o", "none", "--counts"]].concat();
    bad(place, &words, 2, "--counts belongs to a run");
    bad(place, &["retrieve", "run", "--counts"], 1, "has no counts");
    bad(place, &["retrieve", "run", "--method", "three-step"], 1, "exactly 3");
    bad(place, &["retrieve", "nowhere"], 1, "nowhere: does not exist");
    bad(place, &["retrieve", "."], 1, "not a run directory");
    assert!(!place.join("run/retrieved").exists());
}

#[test]
fn quiet_verbs_print_nothing_and_a_run_is_a_geometry() {
    let (folder, run) = copy();
    let here = folder.path();
    let again = [
        "simulate",
        SCENE,
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

/// A run of the cylinder whose detector makes numbers, `[step][row][column]` of 6,144 pixels.
fn noisy(folder: &Path, name: &str, sets: &[&str]) {
    let mut words = vec!["simulate", SCENE, "-o", name, "--format", "npy", "-q"];
    let common = ["detector.pixels=[128, 48]", "detector.photons=20000", "detector.offset=100"];
    for set in common.iter().chain(sets) {
        words.extend(["--set", set]);
    }
    good(folder, &words);
}

#[test]
fn images_of_counts_scatter_by_their_uncertainties() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let sets = ["detector.electronic_noise=12", "detector.gain=0.8", "detector.bit_depth=16"];
    noisy(folder, "run", &sets);
    good(folder, &["retrieve", "run", "--format", "npy", "-o", "light"]);
    let counts = ["retrieve", "run", "--counts", "--weights", "poisson", "--format", "npy"];
    good(folder, &[&counts[..], &["-o", "counts"]].concat());
    let record = Record::read(&folder.join("counts/retrieved.json")).unwrap();
    // From the scene's detector.
    assert_eq!((record.gain, record.read_noise), (Some(0.8), 12.0));
    let [light, counts] = ["light", "counts"].map(|name| Maps::open(folder.join(name)).unwrap());
    // Misfits, and these within a pixel of the silhouettes but for a pixel in a thousand.
    let place = |column: usize| ((column as f64 + 0.5 - 64.0) * 150e-6 * 1.21 / 1.8).abs();
    let mut elsewhere = 0;
    for ((_, column), flags) in counts.map("flags", 0).unwrap().indexed_iter() {
        assert!([0, flags::MISFIT].contains(&(*flags as u32)), "{flags}");
        elsewhere += u32::from(*flags > 0.0 && (place(column) - 4e-3).abs() > 0.15e-3);
    }
    assert!(elsewhere <= 6, "{elsewhere} of 6,144");
    for name in ["transmission", "refraction", "dark_field"] {
        let [a, b, sigma] = [
            counts.map(name, 0).unwrap(),
            light.map(name, 0).unwrap(),
            counts.map(&format!("{name}_sigma"), 0).unwrap(),
        ];
        let mut z = Vec::new();
        for row in 0..48 {
            for column in 0..128_u32 {
                // Silhouettes are no Gaussians: weights there choose another answer.
                let x = (f64::from(column) + 0.5 - 64.0) * 150e-6 * 1.21 / 1.8;
                if (x.abs() - 4e-3).abs() > 0.4e-3 {
                    let at = [row, column as usize];
                    z.push(f64::from(a[at] - b[at]) / f64::from(sigma[at]));
                }
            }
        }
        let count = z.len() as f64;
        let mean = z.iter().sum::<f64>() / count;
        let variance = z.iter().map(|z| (z - mean).powi(2)).sum::<f64>() / count;
        println!("{name}: z of mean {mean:.3} and variance {variance:.3} over {count} pixels");
        // Estimates: mean 0.014, variance 0.02, five of each at most; with weights another part
        // of what the curve has beside a Gaussian is left, which moves means by up to 0.05, and
        // sigma is to first order. Without the electronic noise the variance would be 1.4.
        assert!(mean.abs() < 0.12, "{name}: {mean}");
        assert!((variance - 1.0).abs() < 0.15, "{name}: {variance}");
    }
}

#[test]
fn clipped_numbers_are_flagged_and_left_out() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    // Curves peak at 100 + 0.5 * 0.166 * 20000 = 1760; ten bits end at 1023.
    noisy(folder, "run", &["detector.gain=0.5", "detector.bit_depth=10"]);
    good(folder, &["retrieve", "run", "--counts", "--format", "npy", "-q"]);
    let flat: Array3<f32> = read_npy(folder.join("run/counts/flat.npy")).unwrap();
    let sample: Array4<f32> = read_npy(folder.join("run/counts/sample.npy")).unwrap();
    let flags = Maps::open(folder.join("run/retrieved")).unwrap().map("flags", 0).unwrap();
    let mut clipped = 0;
    for ((row, column), flags) in flags.indexed_iter() {
        let at_the_end = |counts: &dyn Fn(usize) -> f32| (0..11).any(|s| counts(s) >= 1023.0);
        let [of_flat, of_sample] = [
            at_the_end(&|step| flat[[step, row, column]]),
            at_the_end(&|step| sample[[0, step, row, column]]),
        ];
        let bits = *flags as u32;
        assert_eq!([bits & 4 != 0, bits & 4096 != 0], [of_flat, of_sample], "{row}, {column}");
        clipped += u32::from(of_flat) + u32::from(of_sample);
    }
    assert!(clipped > 6144, "{clipped}");
    // 16 bits end above all.
    noisy(folder, "deep", &["detector.gain=0.5", "detector.bit_depth=16"]);
    good(folder, &["retrieve", "deep", "--counts", "--format", "npy", "-q"]);
    let flags = Maps::open(folder.join("deep/retrieved")).unwrap().map("flags", 0).unwrap();
    assert!(flags.iter().all(|flags| *flags as u32 & (4 | 4096) == 0));
}

#[test]
fn noise_that_nothing_uses_is_refused() {
    let (folder, _) = copy();
    bad(folder.path(), &["retrieve", "run", "--read-noise", "3"], 2, "--read-noise is for counts");
    bad(folder.path(), &["retrieve", "run", "--gain", "3"], 2, "--counts");
    let words = ["retrieve", "run", "--counts"];
    bad(folder.path(), &words, 1, "detector.photons");
}

/// A source that fades by 1 % from flat to flat, each third of a view.
#[test]
fn flats_between_views_are_interpolated_and_each_view_may_have_its_own() {
    let (folder, run) = copy();
    let place = folder.path();
    good(place, &["retrieve", "run", "--format", "npy"]);
    let flat: Array3<f32> = read_npy(run.join("flat.npy")).unwrap();
    let sample: Array4<f32> = read_npy(run.join("sample.npy")).unwrap();
    // Light at the time of a view; a flat is taken before each second one, and behind the last.
    let light = |time: f32| 1.0 - 0.01 * (time + 0.5);
    let views: Vec<Array3<f32>> = (0..5)
        .map(|view| sample.index_axis(Axis(0), view % 2).mapv(|y| y * light(view as f32)))
        .collect();
    let stack = |all: &[Array3<f32>]| {
        ndarray::stack(Axis(0), &all.iter().map(|it| it.view()).collect::<Vec<_>>()).unwrap()
    };
    write_npy(place.join("sample.npy"), &stack(&views)).unwrap();
    let flats: Vec<Array3<f32>> =
        [0.0, 2.0, 4.0, 5.0].map(|time| flat.mapv(|y| y * light(time - 0.5))).to_vec();
    write_npy(place.join("some.npy"), &stack(&flats)).unwrap();
    let own: Vec<Array3<f32>> = (0..5).map(|view| flat.mapv(|y| y * light(view as f32))).collect();
    write_npy(place.join("own.npy"), &stack(&own)).unwrap();
    let list: Vec<String> = (0..11).map(|i| format!("{} um", -25 + 5 * i)).collect();
    let offsets = list.join(", ");
    let of = |flat: &str, more: &[&str], to: &str| -> Vec<String> {
        let words = ["retrieve", "--flat", flat, "--sample", "sample.npy", "--offsets", &offsets];
        let to = ["--geometry", SCENE, "-o", to];
        words.iter().chain(&to).chain(more).map(|word| (*word).to_owned()).collect()
    };
    let simulated = Maps::open(run.join("retrieved")).unwrap();
    for (flat, more) in [("some.npy", ["--flats-every", "2"].as_slice()), ("own.npy", &[])] {
        let line = of(flat, more, &flat[..3]);
        good(place, &line.iter().map(String::as_str).collect::<Vec<_>>());
        let images = Maps::open(place.join(&flat[..3])).unwrap();
        assert_eq!(images.map("flat_amplitude", 4).unwrap().dim(), (4, 64));
        for view in 0..5 {
            let [a, b] = [(&simulated, view % 2), (&images, view)]
                .map(|(maps, view)| maps.map("transmission", view).unwrap());
            // f32 and the end of fits: 1e-5. Without the right flat T is off by 1e-2.
            assert!((&a - &b).iter().all(|d| d.abs() < 3e-5 || d.is_nan()), "{flat}, view {view}");
        }
    }
    let refused = |flat: &str, more: &[&str], word: &str| {
        let line = of(flat, more, "none");
        let output = beamlet(place, &line.iter().map(String::as_str).collect::<Vec<_>>());
        let message = told(&output);
        assert!(message.contains(word), "{word}: {message}");
    };
    refused("some.npy", &[], "4 flats for 5 views");
    refused(
        "own.npy",
        &["--flats-every", "2"],
        "5 flats for 5 views, 2 between them; allowed: 3, or 4",
    );
}
