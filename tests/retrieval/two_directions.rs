//! `beamlet retrieve --lattice` and `--offsets-z` on measured files: images, record, and refusals. The physics
//! is in the tests of `engine/recon/retrieve/planar`.

use crate::retrieve_cli::{bad, good};
use crate::stacks::measured;
use beamlet::retrieve::{
    Background, Corrections, Method, Region, RetrieveOptions, RetrievedArrays,
};
use beamlet::scene::Scene;
use ndarray::{Array3, Array4, Axis};
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

/// Offsets along x and z, um, as lists in files.
fn write_lists(folder: &Path, grid: &[[f64; 2]]) {
    for (axis, name) in ["x.txt", "z.txt"].into_iter().enumerate() {
        let list: String = grid.iter().map(|pair| format!("{} um\n", pair[axis])).collect();
        fs::write(folder.join(name), list).unwrap();
    }
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
        (
            &["--correct", "steps", "--empty-beam", "0:32"],
            "a frame at one mask offset has one shift",
        ),
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
    let grid = grid();
    let curve = |light: f64, [x, z]: [f64; 2]| {
        Array3::from_shape_fn((25, 2, 3), |(step, ..)| {
            let square = (grid[step][0] - x).powi(2) + (grid[step][1] - z).powi(2);
            (1e4 * light * (-square / 72.0).exp() + 30.0) as f32
        })
    };
    write(path, curve(1.0, [0.0; 2]), &[curve(0.8, [1.0, -2.0]), curve(0.8, [1.0, -2.0])]);
    write_lists(path, &grid);
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
    let grid = grid();
    write_lists(path, &grid);
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

/// Images of frames of flat and sample in memory.
fn images(
    scene: &Scene,
    [flat, sample]: [&Array3<f32>; 2],
    options: &RetrieveOptions,
) -> RetrievedArrays {
    let [flat, sample] = [flat, sample].map(|of| of.clone().insert_axis(Axis(0)));
    measured(scene, [&flat, &sample], options).unwrap()
}

/// Faults of a scan over a grid of 5 x 5 offsets: doses, displacements (um) of the frames along x and z, and shifts of
/// the curves along x and z between flat and sample (um, and um for each column and row).
#[derive(Clone, Copy, Default)]
struct Faults {
    dose: f64,
    displacement: f64,
    shift: [f64; 2],
    slope: [f64; 2],
}

const COLUMNS: usize = 32;
const ROWS: usize = 24;
/// Columns of empty beam, before the others with the sample.
const EMPTY: usize = 14;
const TRANSMISSION: f64 = 0.8;
/// Shift of the curves by the sample, um.
const MOVED: [f64; 2] = [1.0, -2.0];

impl Faults {
    fn dose(&self, step: usize) -> f64 {
        1.0 + self.dose * (2.1 * step as f64 + 0.3).sin()
    }

    fn displacement(&self, step: usize) -> [f64; 2] {
        let step = step as f64;
        [(1.7 * step + 0.4).sin(), (2.9 * step + 1.1).sin()].map(|by| self.displacement * by)
    }

    /// Shift of the curve of a pixel, um.
    fn shift(&self, row: usize, column: usize) -> [f64; 2] {
        let along = self.slope[0] * (column as f64 - 15.5) + self.slope[1] * (11.5 - row as f64);
        self.shift.map(|shift| shift + along)
    }

    /// Frames of Gaussian curves of 6 um, whose centres form a fringe along x and z.
    fn frames(&self, grid: &[[f64; 2]], has_sample: bool) -> Array3<f32> {
        Array3::from_shape_fn((grid.len(), ROWS, COLUMNS), |(step, row, column)| {
            let is_sample = has_sample && column >= EMPTY;
            let (light, moved) = if is_sample { (TRANSMISSION, MOVED) } else { (1.0, [0.0; 2]) };
            let (shift, by) = (self.shift(row, column), self.displacement(step));
            let fringe = [0.3 * (column as f64 - 15.5), 0.4 * (row as f64 - 11.5)];
            let square: f64 = (0..2)
                .map(|axis| {
                    let centre = fringe[axis] + shift[axis] + moved[axis];
                    (grid[step][axis] + by[axis] - centre).powi(2)
                })
                .sum();
            (1e4 * self.dose(step) * light * (-square / 72.0).exp() + 30.0 * self.dose(step)) as f32
        })
    }
}

fn grid_scene(grid: &[[f64; 2]]) -> Scene {
    let mut scene = Scene::from_toml(&format!("{DETECTOR_MASK}{SCENE}"), ".").unwrap();
    scene.detector.pixels = [COLUMNS as u32, ROWS as u32];
    // An aperture of each mask before each pixel.
    scene.detector.pitch = [70e-6 * 1.8 / 1.7; 2];
    scene.sample_mask.as_mut().unwrap().period = 70e-6 * 1.2 / 1.7;
    scene.scan.mask_offsets = grid.iter().map(|pair| pair[0] * 1e-6).collect();
    scene.scan.mask_offsets_z = grid.iter().map(|pair| pair[1] * 1e-6).collect();
    scene.scan.angles = vec![0.0];
    scene
}

fn grid() -> Vec<[f64; 2]> {
    (0..25).map(|k| [f64::from(k % 5) * 5.0 - 10.0, f64::from(k / 5) * 5.0 - 10.0]).collect()
}

/// Greatest difference of an image from the truth in the columns of the sample, within the plane's pixels.
fn off(found: &RetrievedArrays, name: &str, truth: f64) -> f64 {
    let image = found.images[name].slice(ndarray::s![0, .., EMPTY..]).to_owned();
    image.iter().map(|value| (f64::from(*value) - truth).abs()).fold(0.0, f64::max)
}

/// Gaussian fits with a free background, and empty beam in the first columns.
fn by_empty_beam() -> RetrieveOptions {
    RetrieveOptions::default()
        .with_method(Method::Gaussian)
        .with_background(Background::Free)
        .with_empty_beam(Region::new(0..EMPTY, None))
}

/// A drift and a plane that were planted in a scan over x and z are found by the empty beam to the rounding of f32, and
/// doses and displacements to a tenth: the equations take a curve to be wrong by 1e-3 of its height. With both unknown
/// the fringe alone separates them, and they keep to their uncertainties.
#[test]
fn planted_faults_of_steps_along_x_and_z_are_found_and_undone() {
    let (grid, none) = (grid(), Faults::default());
    let scene = grid_scene(&grid);
    let flat = none.frames(&grid, false);
    let options = by_empty_beam();
    for (correct, faults) in [
        ("plane", Faults { shift: [0.4, -0.3], slope: [0.01, -0.02], ..none }),
        ("dose", Faults { dose: 0.03, ..none }),
        ("steps", Faults { displacement: 0.6, ..none }),
        ("dose,steps", Faults { dose: 0.03, displacement: 0.6, ..none }),
    ] {
        let options = options.clone().with_correct(Corrections::parse(correct).unwrap());
        let raw = options.clone().with_correct(Corrections::default());
        let sample = faults.frames(&grid, true);
        let raw = images(&scene, [&flat, &sample], &raw);
        let found = images(&scene, [&flat, &sample], &options);
        let view = &found.record.corrections[0];
        let angle = found.record.angle_per_shift;
        for (name, truth, unit) in [
            ("transmission", TRANSMISSION, 1.0),
            ("refraction", angle * MOVED[0] * 1e-6, angle.abs() * 1e-6),
            ("refraction_z", angle * MOVED[1] * 1e-6, angle.abs() * 1e-6),
        ] {
            let [left, before] = [&found, &raw].map(|of| off(of, name, truth) / unit);
            println!("{correct}: {name} {left:.2e}, uncorrected {before:.2e}");
            let most = match correct {
                "plane" => 1e-5,
                "dose" | "steps" => 0.1 * before + 1e-3,
                _ => 0.6 * before,
            };
            assert!(left < most, "{correct}: {name} {left:e}, uncorrected {before:e}");
        }
        if let Some([value, _]) = view.offset {
            let z = view.offset_z.unwrap()[0];
            let [x, z] = [value, z].map(|of| of / angle * 1e6);
            assert!((x - 0.4).abs() < 1e-5 && (z + 0.3).abs() < 1e-5, "{correct}: {x} {z}");
        }
        let doses: Vec<f64> = (0..25).map(|step| faults.dose(step)).collect();
        let [x, z] = [0, 1].map(|axis| -> Vec<f64> {
            (0..25).map(|step| 1e-6 * faults.displacement(step)[axis]).collect()
        });
        for (found, truth, tenth) in
            [(&view.dose, doses, 3e-3), (&view.steps, x, 6e-8), (&view.steps_z, z, 6e-8)]
        {
            for (step, (pair, truth)) in found.iter().zip(truth).enumerate() {
                let Some([value, sigma]) = *pair else { continue };
                let most = if correct == "dose,steps" { 4.0 * sigma } else { tenth };
                assert!((value - truth).abs() < most, "{correct}: {step}: {value:e}, {truth:e}");
            }
        }
    }
}

/// Without `--correct` the same faults are warned of and measured in the empty beam.
#[test]
fn planted_faults_of_steps_along_x_and_z_are_warned_of() {
    let (grid, none) = (grid(), Faults::default());
    let scene = grid_scene(&grid);
    let flat = none.frames(&grid, false);
    let options = by_empty_beam();
    let record =
        |faults: Faults| images(&scene, [&flat, &faults.frames(&grid, true)], &options).record;
    let warned = |faults: Faults, words: &[&str]| {
        let warnings = record(faults).warnings.join("\n");
        assert!(words.iter().all(|word| warnings.contains(word)), "{words:?}: {warnings}");
    };
    let sound = record(none);
    assert!(sound.warnings.is_empty(), "{:?}", sound.warnings);
    warned(Faults { dose: 0.03, ..none }, &["steps deviate", "dose varies by 2."]);
    warned(Faults { displacement: 0.6, ..none }, &["steps deviate", "um along x or", "um along z"]);
    let drift = Faults { shift: [0.4, -0.3], ..none };
    warned(drift, &["refraction of the empty beam", "refraction along z of the empty beam"]);
    let empty = record(drift).empty_beam.unwrap();
    let [x, z] = [empty.views[0].drift, empty.views[0].drift_z].map(|of| of.unwrap()[0] * 1e6);
    assert!((x - 0.4).abs() < 1e-3 && (z + 0.3).abs() < 1e-3, "{x} {z}");
    let doses = &record(Faults { dose: 0.03, ..none }).empty_beam.unwrap().views[0].dose;
    for (step, [dose, sigma]) in doses.iter().enumerate() {
        let truth = Faults { dose: 0.03, ..none }.dose(step);
        // Doses displace the fitted curves, and with them the flat's values that they are compared with.
        assert!((dose - truth).abs() < 3.0 * sigma + 1e-3, "{step}: {dose} +- {sigma}, {truth}");
    }
}

/// A dose and a shift of all beamlets are found in those of empty beam, and taken off all images.
#[test]
fn a_dose_and_a_drift_of_beamlets_on_a_lattice_are_found_and_undone() {
    let mut scene = Scene::from_toml(SCENE, ".").unwrap();
    scene.scan.angles = vec![0.0];
    let flat = frame(1.0, [0.0; 2]);
    // The right half behind a sample of T = 0.7.
    let mut sample = frame(0.9, [0.2, -0.1]);
    sample
        .slice_mut(ndarray::s![.., .., 32..])
        .assign(&frame(0.63, [0.45, -0.5]).slice(ndarray::s![.., .., 32..]));
    let options = RetrieveOptions::default()
        .with_lattice(beamlet::retrieve::Lattice::parse("80 um, 80 um").unwrap())
        .with_correct(Corrections::parse("offset,dose").unwrap())
        .with_empty_beam(Region::new(0..32, None));
    let found = images(&scene, [&flat, &sample], &options);
    let pixel = 10e-6 / 0.59;
    let view = &found.record.corrections[0];
    let [x, z] = [view.offset, view.offset_z].map(|of| of.unwrap()[0] / pixel);
    let dose = view.dose[0].unwrap()[0];
    assert!((dose - 0.9).abs() < 1e-3, "{dose}");
    assert!((x - 0.2).abs() < 1e-3 && (z + 0.1).abs() < 1e-3, "{x} {z}");
    let columns = found.images["transmission"].dim().2;
    for (name, truth, unit) in [
        ("transmission", [1.0, 0.7], 1.0),
        ("refraction", [0.0, 0.25], pixel),
        ("refraction_z", [0.0, -0.4], pixel),
    ] {
        for (half, column) in [(0, 0), (1, columns - 1)] {
            for value in found.images[name].slice(ndarray::s![0, .., column]) {
                let off = (f64::from(*value) / unit - truth[half]).abs();
                assert!(off < 2e-3, "{name} {value:e} in half {half}");
            }
        }
    }
}

/// Dithers are side by side, and views with offsets of their own are fitted at these, as with slits.
#[test]
fn dithers_and_offsets_of_views_are_those_of_slits() {
    let (grid, none) = (grid(), Faults::default());
    let flat = none.frames(&grid, false);
    let options =
        RetrieveOptions::default().with_method(Method::Gaussian).with_background(Background::Free);
    let of_views = |views: [&[[f64; 2]]; 2]| {
        let frames = views.map(|grid| none.frames(grid, true));
        ndarray::concatenate![Axis(0), frames[0], frames[1]]
    };
    let one = images(&grid_scene(&grid), [&flat, &none.frames(&grid, true)], &options);
    let mut dithered = grid_scene(&grid);
    dithered.scan.dithers = vec![0.0, 20e-6];
    let found = images(&dithered, [&flat, &of_views([&grid, &grid])], &options);
    assert_eq!(found.record.columns.len(), 2 * COLUMNS);
    for name in ["transmission", "refraction_z", "dark_field_xz"] {
        for (at, [column, _]) in found.record.columns.iter().enumerate() {
            let [a, b] = [(&found, at), (&one, *column)]
                .map(|(of, column)| of.images[name].slice(ndarray::s![0, .., column]).to_owned());
            assert_eq!(a, b, "{name}, column {at}");
        }
    }
    // The second view a period and 1.5 um farther.
    let mut moved = grid_scene(&grid);
    moved.scan.angles = vec![0.0, 0.1];
    let period = moved.sample_mask.as_ref().unwrap().period;
    let x = moved.scan.mask_offsets.clone();
    let farther = x.iter().map(|x| x + 1.5e-6 + period).collect();
    moved.scan.view_offsets = vec![x, farther];
    let other: Vec<[f64; 2]> = grid.iter().map(|[x, z]| [x + 1.5, *z]).collect();
    let found = images(&moved, [&flat, &of_views([&grid, &other])], &options);
    let angle = found.record.angle_per_shift;
    for (name, axis) in [("refraction", 0), ("refraction_z", 1)] {
        let truth = angle * MOVED[axis] * 1e-6;
        for value in found.images[name].slice(ndarray::s![.., .., EMPTY..]) {
            // Frames of f32.
            assert!((f64::from(*value) / truth - 1.0).abs() < 1e-5, "{name} {value:e} {truth:e}");
        }
    }
}
