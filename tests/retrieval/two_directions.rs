//! `beamlet retrieve --lattice` and `--offsets-z` on measured files: images, record, and refusals. The physics
//! is in the tests of `engine/recon/retrieve/planar`.

#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests")]
#![allow(clippy::cast_possible_truncation, reason = "frames of f32")]

use crate::retrieve_cli::{bad, good};
use ndarray::{Array3, Array4};
use ndarray_npy::{read_npy, write_npy};
use std::fs;
use std::path::Path;

const SCENE: &str = "[source]\ndistance = \"1.21 m\"\nspot = [\"30 um\", \"30 um\"]\nenergy = \"30 keV\"\n\
    [detector]\ndistance = \"1.8 m\"\npixels = [64, 48]\npitch = \"10 um\"\n\
    [sample_mask]\ndistance = \"1.2 m\"\nperiod = \"50 um\"\naperture = \"10 um\"\ntransmission = 0.0\n\
    [scan]\nangles = [\"0 deg\", \"10 deg\"]\n";
const DETECTOR_MASK: &str = "[detector_mask]\ndistance = \"1.7 m\"\nperiod = \"70 um\"\naperture = \"15 um\"\n\
    transmission = 0.0\n";

/// Gaussian beamlets every 8 pixels, moved by so much of a pixel to the right and up, and dimmed.
fn frame(light: f64, [right, up]: [f64; 2]) -> Array3<f32> {
    Array3::from_shape_fn((1, 48, 64), |(_, row, column)| {
        let near = |at: f64| (at / 8.0).fract().mul_add(8.0, -4.0);
        let [x, z] = [column as f64 + 160.5 - right, row as f64 + 160.5 + up];
        let square = near(x).powi(2) + near(z).powi(2);
        (1e4 * light * (-square / (2.0 * 1.44)).exp() + 20.0) as f32
    })
}

fn write(folder: &Path, flat: Array3<f32>, views: &[Array3<f32>]) {
    let (steps, rows, columns) = flat.dim();
    let all =
        Array4::from_shape_fn((views.len(), steps, rows, columns), |(view, step, row, column)| {
            views[view][[step, row, column]]
        });
    write_npy(folder.join("flat.npy"), &flat).unwrap();
    write_npy(folder.join("sample.npy"), &all).unwrap();
    fs::write(folder.join("scene.toml"), SCENE).unwrap();
    fs::write(folder.join("two.toml"), format!("{DETECTOR_MASK}{SCENE}")).unwrap();
}

const WORDS: [&str; 7] =
    ["retrieve", "--flat", "flat.npy", "--sample", "sample.npy", "--format", "npy"];

fn words<'a>(more: &[&'a str]) -> Vec<&'a str> {
    WORDS.iter().copied().chain(more.iter().copied()).collect()
}

#[test]
fn beamlets_on_a_lattice_become_images_of_both_directions() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    write(path, frame(1.0, [0.0; 2]), &[frame(0.7, [0.25, -0.4]), frame(0.9, [0.0, 0.1])]);
    let lattice = ["--geometry", "scene.toml", "--lattice", "81 um, 79 um", "-o", "images"];
    let summary = good(path, &words(&lattice));
    assert!(
        summary.contains("method   gaussian") && summary.contains("noise    1 sigma"),
        "{summary}"
    );
    // A shift of a pixel over 0.59 m; points and not means of pixels change no shift: frames of f32, 1e-4.
    let pixel = 10e-6 / 0.59;
    for (name, truth, part) in [
        ("transmission", [0.7, 0.9], 1e-3),
        ("refraction", [0.25 * pixel, 0.0], 1e-3 * pixel),
        ("refraction_z", [-0.4 * pixel, 0.1 * pixel], 1e-3 * pixel),
        ("dark_field", [0.0; 2], 1e-2 * pixel * pixel),
        ("dark_field_xz", [0.0; 2], 1e-2 * pixel * pixel),
    ] {
        let image: Array3<f32> = read_npy(path.join(format!("images/{name}.npy"))).unwrap();
        assert!(
            image.dim().0 == 2 && image.dim().1 >= 4 && image.dim().2 >= 6,
            "{:?}",
            image.dim()
        );
        for ((view, row, column), value) in image.indexed_iter() {
            let off = (f64::from(*value) - truth[view]).abs();
            assert!(off < part, "{name} {value} in view {view}, row {row}, column {column}");
        }
    }
    let record = fs::read_to_string(path.join("images/retrieved.json")).unwrap();
    for word in
        ["lattice_m", "expected_sigma", "\"refraction_z\": \"rad\"", "\"dark_field_xz\": \"rad^2\""]
    {
        assert!(record.contains(word), "{word}: {record}");
    }
    assert!(!path.join("images/geometry.json").exists());
    let drawn = good(path, &["view", "images", "-o", "pictures"]);
    assert!(drawn.contains("dark_field_xz"), "{drawn}");
}

#[test]
fn options_that_two_directions_do_not_have_are_refused_before_anything_is_written() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    write(path, frame(1.0, [0.0; 2]), &[frame(0.7, [0.25, -0.4])]);
    let lattice = ["--geometry", "scene.toml", "--lattice", "80 um, 80 um", "-o", "images"];
    let with = |more: &[&'static str]| [&lattice[..], more].concat();
    for (more, word) in [
        (&["--method", "triangle"][..], "gaussian, beamlet or moments"),
        (&["--method", "beamlet"], "size of the apertures"),
        (&["--correct", "offset"], "correct"),
        (&["--phase"], "phase"),
        (&["--columns", "0:40"], "every pixel"),
    ] {
        bad(path, &words(&with(more)), 1, word);
    }
    let other = ["--geometry", "scene.toml", "--lattice", "60 um, 80 um", "-o", "images"];
    bad(path, &words(&other), 1, "the lattice of the flat's beamlets");
    let narrow = ["--geometry", "scene.toml", "--lattice", "30 um, 30 um", "-o", "images"];
    bad(path, &words(&narrow), 1, "lattice");
    let mask = ["--geometry", "two.toml", "--lattice", "80 um, 80 um", "-o", "images"];
    bad(path, &words(&mask), 1, "a sample mask alone");
    assert!(!path.join("images").exists());
}

#[test]
fn steps_along_x_and_z_become_images_and_lists_without_a_direction_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    // A Gaussian curve of 6 um over a grid of 5 x 5 offsets, displaced by 1 um and -2 um.
    let grid: Vec<[f64; 2]> =
        (0..25).map(|k| [f64::from(k % 5) * 5.0 - 10.0, f64::from(k / 5) * 5.0 - 10.0]).collect();
    let curve = |light: f64, [x, z]: [f64; 2]| {
        Array3::from_shape_fn((25, 2, 3), |(step, ..)| {
            let square = (grid[step][0] - x).powi(2) + (grid[step][1] - z).powi(2);
            (1e4 * light * (-square / 72.0).exp() + 30.0) as f32
        })
    };
    write(path, curve(1.0, [0.0; 2]), &[curve(0.8, [1.0, -2.0]), curve(0.8, [1.0, -2.0])]);
    let list = |axis: usize| -> String {
        grid.iter().map(|pair| format!("{} um\n", pair[axis])).collect()
    };
    fs::write(path.join("x.txt"), list(0)).unwrap();
    fs::write(path.join("z.txt"), list(1)).unwrap();
    fs::write(path.join("none.txt"), "0 um\n".repeat(25)).unwrap();
    let steps = |z: &'static str| {
        let free = ["--background", "free"];
        let masks = ["--geometry", "two.toml", "--offsets", "x.txt", "--offsets-z", z];
        words(&[&masks[..], &free[..], &["-o", "images"][..]].concat())
    };
    bad(path, &steps("none.txt"), 1, "refraction along z");
    assert!(!path.join("images").exists());
    good(path, &steps("z.txt"));
    // M = 1.7/1.2 over z = 1.7 - 1.21: -2.891 rad/m.
    let slope = -(1.7 / 1.2) / (1.7 - 1.21);
    for (name, truth) in
        [("transmission", 0.8), ("refraction", slope * 1e-6), ("refraction_z", slope * -2e-6)]
    {
        let image: Array3<f32> = read_npy(path.join(format!("images/{name}.npy"))).unwrap();
        let off = image.iter().map(|value| (f64::from(*value) / truth - 1.0).abs());
        assert!(off.fold(0.0, f64::max) < 1e-3, "{name}: {image}");
    }
    assert!(path.join("images/geometry.json").exists());
}

/// Light that steps along x or z do not change: angle and dark field along that axis are NaN with a reason, the other
/// axis is right.
#[test]
fn an_axis_whose_steps_change_nothing_has_no_angle() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    let grid: Vec<[f64; 2]> =
        (0..25).map(|k| [f64::from(k % 5) * 5.0 - 10.0, f64::from(k / 5) * 5.0 - 10.0]).collect();
    let list = |axis: usize| -> String {
        grid.iter().map(|pair| format!("{} um\n", pair[axis])).collect()
    };
    fs::write(path.join("x.txt"), list(0)).unwrap();
    fs::write(path.join("z.txt"), list(1)).unwrap();
    let words = words(&[
        "--geometry",
        "two.toml",
        "--offsets",
        "x.txt",
        "--offsets-z",
        "z.txt",
        "--background",
        "free",
        "-o",
        "images",
        "--overwrite",
    ]);
    let slope = -(1.7 / 1.2) / (1.7 - 1.21);
    let names = [["refraction", "dark_field"], ["refraction_z", "dark_field_z"]];
    for seen in [0, 1] {
        let curve = |light: f64, at: f64| {
            Array3::from_shape_fn((25, 2, 3), |(step, ..)| {
                (1e4 * light * (-(grid[step][seen] - at).powi(2) / 72.0).exp() + 30.0) as f32
            })
        };
        let sample = curve(0.8, -2.0);
        write(path, curve(1.0, 0.0), &[sample.clone(), sample]);
        good(path, &words);
        let image = |name: &str| -> Array3<f32> {
            read_npy(path.join(format!("images/{name}.npy"))).unwrap()
        };
        let blind = 1 - seen;
        assert!(names[blind].iter().all(|name| image(name).iter().all(|it| it.is_nan())));
        for (name, truth) in [("transmission", 0.8), (names[seen][0], slope * -2e-6)] {
            let off = image(name).mapv(|value| (f64::from(value) / truth - 1.0).abs());
            // Frames of f32.
            assert!(off.iter().all(|off| *off < 1e-3), "{name}: {off}");
        }
        let record = fs::read_to_string(path.join("images/retrieved.json")).unwrap();
        let reason = format!("steps along {} do not change the light", ["x", "z"][blind]);
        assert!(record.contains(&reason), "{record}");
    }
}
