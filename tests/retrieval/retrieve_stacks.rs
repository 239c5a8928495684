//! `beamlet retrieve` of measured stacks: 16-bit TIFF, dark frames, bad pixels, flats between views.

use super::retrieve_cli::{SCENE, bad, beamlet, copy, good, told};
use beamlet::retrieve::{Record, flags};
use beamlet::stack::Maps;
use ndarray::{Array3, Array4, Axis};
use ndarray_npy::{read_npy, write_npy};
use std::fs::{self, File};
use std::path::Path;
use tiff::encoder::TiffEncoder;
use tiff::encoder::colortype::Gray16;

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
        &["--offsets", &list_in_one, "--geometry", &*SCENE, "-o", "images"],
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
        &["--offsets", "offsets.txt", "--geometry", &*SCENE, "-o", "again"],
    ]
    .concat();
    good(place, &from_file);
    good(place, &["compare", "images", "again"]);
    bad(place, &["compare", "run/retrieved", "images"], 1, "they differ");
    // Values at the top of the curves are left out and flagged, and nothing else.
    let clipped = [
        ["retrieve"].as_slice(),
        &words,
        &["--offsets", &list_in_one, "--geometry", &*SCENE, "-o", "clipped"],
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
            ["retrieve", "--flat", flat, "--sample", sample, "--geometry", &*SCENE, "-o", "light"];
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
    refuse(swap(list_in_one, "-5 um, 5 um"), 1, "at least 4");
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
        [["retrieve"].as_slice(), &stacks, &["--geometry", &*SCENE, "--format", "npy"]].concat();
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
        let to = ["--geometry", &*SCENE, "-o", to];
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
