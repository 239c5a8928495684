//! The order of the frames of a folder: by all numbers in the names, or refused.

use beamlet::stack::StackFile;
use std::fs::{self, File};
use std::path::Path;
use tempfile::TempDir;
use tiff::encoder::TiffEncoder;
use tiff::encoder::colortype::Gray16;

/// A frame of one pixel.
fn frame(path: &Path, value: usize) {
    fs::create_dir_all(path.parent().unwrap()).unwrap();
    let mut encoder = TiffEncoder::new(File::create(path).unwrap()).unwrap();
    encoder.write_image::<Gray16>(1, 1, &[u16::try_from(value).unwrap()]).unwrap();
}

/// A folder of frames, each with its place in the list as its value; made in another order.
fn folder(names: &[&str]) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    for (value, name) in names.iter().enumerate().rev() {
        frame(&folder.path().join(format!("{name}.tif")), value);
    }
    folder
}

fn values(stack: &StackFile) -> Vec<f32> {
    let [views, ..] = stack.shape();
    (0..views).flat_map(|view| stack.view(view).unwrap().into_iter()).collect()
}

fn rising(count: usize) -> Vec<f32> {
    (0..count).map(|value| f32::from(u16::try_from(value).unwrap())).collect()
}

/// Names of views and steps, the views one after another.
fn grid(views: [usize; 3], steps: [usize; 3]) -> Vec<String> {
    views.iter().flat_map(|v| steps.iter().map(move |s| format!("view{v}_step{s}"))).collect()
}

#[test]
fn frames_are_in_the_order_of_all_numbers_with_signs_and_decimals() {
    let grid = grid([8, 9, 10], [9, 10, 11]);
    let grid: Vec<&str> = grid.iter().map(String::as_str).collect();
    let lists: [&[&str]; 30] = [
        &grid,
        &["scan_-10um", "scan_0um", "scan_10um"],
        &["f_-2.0um", "f_2.0um", "f_10.0um"],
        &["-1", "0", "1"],
        &["0.5", "1", "1.5", "10"],
        // A sign, since some names have none here.
        &["scan-10", "scan0", "scan10"],
        &["scan-10", "scan+0", "scan+10"],
        &["(-20)", "(-10)"],
        // No sign: behind a letter in all names, or behind a digit.
        &["scan-8", "scan-9", "scan-10"],
        &["2026-11-24_8", "2026-11-24_9", "2026-11-24_10"],
        &["2026.11.24_8", "2026.11.24_9", "2026.11.24_10"],
        // One number follows from the other.
        &["001_-7.5um", "002_0um", "003_2.5um"],
        &["24_001_0", "24_001_1", "24_002_0", "24_002_1", "25_003_0", "25_003_1"],
        &["view0_0", "view0_1", "view1_2", "view1_3"],
        // More digits than u64 holds.
        &["f_99999999999999999999", "f_100000000000000000000"],
        &["a", "b", "c"],
        // Exponents.
        &["pos_5e-06", "pos_1e-05", "pos_1.5e-05", "pos_2e-05"],
        &["pos_-1e-06", "pos_1e-06", "pos_1E-05", "pos_1e-04"],
        &["x1.5e-7m", "x2e-07m", "x1e+00m", "x1e+02m"],
        &["sample2e-1", "sample2e-2", "sample2e-3"],
        // A running number behind one that several frames share.
        &["p0_f0", "p5_f1", "p10_f2", "p5_f3", "p0_f4"],
        &["s0_v0_n1", "s1_v0_n2", "s0_v1_n3", "s1_v1_n4"],
        // Times of day whose parts roll over.
        &["t_2026-01-31_23-59-48", "t_2026-01-31_23-59-55", "t_2026-02-01_00-00-02"],
        &["t_20260101_105941", "t_20260101_105948", "t_20260101_110100"],
        &["20260101105941_k1", "20260101105948_k2", "20260101110100_k3"],
        &["10_59_41", "10_59_48", "10_59_55", "11_00_02", "11_00_09"],
        &["105941.5", "105948.5", "105955.5", "110002.5"],
        &["20260101T105941_998", "20260101T105942_003", "20260101T105942_007"],
        &["2026-01-31", "2026-02-01", "2026-02-03"],
        &["v0_20260101_105941", "v0_20260101_105948", "v1_20260101_110100"],
    ];
    for names in lists {
        let folder = folder(names);
        let stack = StackFile::open(folder.path()).unwrap();
        assert_eq!(values(&stack), rising(names.len()), "{names:?}");
        let read: Vec<String> = names.iter().map(|name| format!("{name}.tif")).collect();
        assert_eq!(stack.frame_names().unwrap(), read);
    }
}

#[test]
fn folders_of_frames_are_in_the_order_of_all_numbers() {
    let folder = tempfile::tempdir().unwrap();
    let views =
        ["run1_-0.5deg", "run1_0.5deg", "run1_10deg", "run2_-0.5deg", "run2_0.5deg", "run2_10deg"];
    for (view, name) in views.iter().enumerate() {
        for step in 0..2 {
            let name = format!("{name}/f_{}.tif", 9 + step);
            frame(&folder.path().join(name), 2 * view + step);
        }
    }
    // No view.
    fs::create_dir(folder.path().join("notes of 2026")).unwrap();
    let stack = StackFile::open(folder.path()).unwrap();
    assert_eq!(stack.shape(), [6, 2, 1, 1]);
    assert_eq!(values(&stack), rising(12));
    assert_eq!(stack.frame_names().unwrap()[11], "run2_10deg/f_10.tif");
}

#[test]
fn names_whose_order_is_not_known_are_refused_with_the_names() {
    let incomplete: Vec<String> =
        grid([1, 2, 3], [0, 1, 2]).into_iter().filter(|name| name != "view2_step1").collect();
    let incomplete: Vec<&str> = incomplete.iter().map(String::as_str).collect();
    let cases: [(&[&str], &[&str]); 14] = [
        (&["f_1", "f_01"], &["f_01.tif and f_1.tif", "the same"]),
        (&["f_0", "f_-0", "f_1"], &["f_-0.tif and f_0.tif", "the same"]),
        (&["f_0", "f_1", "f_3"], &["f_1.tif", "f_3.tif: number 2 is missing"]),
        (&["f_-20um", "f_-10um", "f_10um"], &["f_-10um.tif", "number 0 is missing"]),
        (&["001_-7.5um", "002_0um", "004_2.5um"], &["002_0um.tif", "number 3 is missing"]),
        (&incomplete, &["3 x 3 different numbers", "with the numbers 2, 1 is missing"]),
        (&["v1_s0", "v1_s1", "v2_s0", "v2_s1", "v4_s0", "v4_s1"], &["number 3 is missing"]),
        (&["f_1", "f_2", "f_2_old_1"], &["f_2_old_1.tif", "different counts of numbers"]),
        (&["f_1", "thumbnails"], &["thumbnails.tif", "different counts of numbers"]),
        (&["f_500nm", "f_1um"], &["f_1um.tif", "f_500nm.tif", "more than numbers"]),
        (&["f_1.2", "f_1.9", "f_1.10"], &["f_1.10.tif", "different numbers of decimals"]),
        (&["2026-11-24_1", "2026_11-24_2"], &["more than numbers"]),
        // Views, steps and repeats, one of which is missing: no times.
        (&["00_00_00", "00_00_01", "00_01_00", "01_00_00"], &["is missing"]),
        (&["f_1e+300", "f_1e-300"], &["more than 37 digits"]),
    ];
    for (names, words) in cases {
        let folder = folder(names);
        let message = StackFile::open(folder.path()).unwrap_err().to_string();
        for word in words {
            assert!(message.contains(word), "{names:?}: {message}");
        }
    }
}

#[test]
fn views_are_of_the_last_numbers_of_the_names() {
    let names: Vec<String> =
        grid([8, 9, 10], [0, 1, 2]).into_iter().filter(|name| !name.ends_with('2')).collect();
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    let folder = folder(&names);
    let open = || StackFile::open(folder.path()).unwrap();
    assert_eq!(open().shape(), [1, 6, 1, 1]);
    let stack = open().with_steps(2).unwrap();
    assert_eq!((stack.shape(), values(&stack)), ([3, 2, 1, 1], rising(6)));
    // Three steps of two views each would be frames of several views in one.
    let message = open().with_steps(3).unwrap_err().to_string();
    assert!(message.contains("3 x 2") && message.contains("expected 3 steps"), "{message}");
}
