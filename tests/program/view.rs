//! `beamlet view` as a user meets it: files that are pictures, with the right colours in the
//! right places, and nothing at all where something is wrong.

use super::report::run_with_maps_of;
use crate::support::log::commit;
use crate::support::program::{done, done_without_driver, run};
use beamlet::retrieve::Record;
use ndarray::{Array3, Array4};
use ndarray_npy::write_npy;
use std::fs;
use std::path::Path;
use tempfile::TempDir;
use tiny_skia::Pixmap;

const SCENE: &str = concat!(
    include_str!("../support/paper.toml"),
    r#"pixels = [16, 4]
[scan]
mask_offsets = { from = "-20 um", to = "20 um", count = 5 }
angles = ["0 deg", "90 deg"]

[[object]]
name = "ball"
shape = { sphere = { radius = "0.4 mm", sides = 128 } }
material = "water"
"#
);

/// Pixels of a picture per unit of its drawing.
const SCALE: f64 = 1.5;

fn picture(path: &Path) -> Pixmap {
    Pixmap::decode_png(&fs::read(path).unwrap()).unwrap()
}

fn colour(picture: &Pixmap, x: f64, y: f64) -> [u8; 3] {
    let pixel = picture.pixel((x * SCALE) as u32, (y * SCALE) as u32).unwrap();
    [pixel.red(), pixel.green(), pixel.blue()]
}

/// Share of pixels that are not white, within some columns.
fn inked(picture: &Pixmap, columns: std::ops::Range<u32>) -> f64 {
    let (mut inked, mut all) = (0_u32, 0_u32);
    for y in 0..picture.height() {
        for x in columns.clone() {
            let pixel = picture.pixel(x, y).unwrap();
            all += 1;
            inked += u32::from([pixel.red(), pixel.green(), pixel.blue()] != [255; 3]);
        }
    }
    f64::from(inked) / f64::from(all)
}

/// A run of two views, with retrieved images that the test knows.
fn run_with_maps() -> TempDir {
    run_with_maps_of(false)
}

#[test]
fn a_scene_is_drawn_as_set_up_and_sample() {
    let place = tempfile::tempdir().unwrap();
    fs::write(place.path().join("scene.toml"), SCENE).unwrap();
    let printed = done(place.path(), "view scene.toml -o pictures");
    assert_eq!(printed.lines().collect::<Vec<_>>(), ["pictures/set_up.png", "pictures/sample.png"]);

    let set_up = picture(&place.path().join("pictures/set_up.png"));
    assert_eq!((set_up.width(), set_up.height()), (1770, 1416));
    assert!(inked(&set_up, 0..set_up.width()) > 0.05);

    let sample = picture(&place.path().join("pictures/sample.png"));
    let [r, g, b] = colour(&sample, 390.0, 390.0);
    assert!(b > g && g > r, "the first material is blue: {r} {g} {b}");
    assert_eq!(colour(&sample, 12.0, 12.0), [255; 3]);
    // The ball fills pi / 4 of a square that it touches; the picture is 1.12 times as wide, and
    // 10 units of margin stand around it.
    let square = 760.0 / 780.0;
    let expected = std::f64::consts::FRAC_PI_4 / 1.12 / 1.12 * square;
    let found = inked(&sample, 15..15 + 1140);
    assert!((found / expected - 1.0).abs() < 5e-3, "{found} of the picture, {expected} expected");
}

/// A pattern, and its open pixels as rectangles.
const LISTS: [&str; 2] = [
    r#"pattern = ["1000", "0000", "0110", "0000"]
pattern_pixel = "20 um""#,
    r#"period = "80 um"
rectangles = [["-30 um", "30 um", "20 um", "20 um"], ["0 um", "-10 um", "40 um", "20 um"]]"#,
];

/// Row 0 of a pattern is on top of the drawing, columns ascend to the right; z of rectangles runs up.
#[test]
fn masks_of_patterns_and_rectangles_are_drawn_as_the_source_sees_them() {
    LISTS.iter().for_each(|list| assert_drawn(list));
}

#[track_caller]
fn assert_drawn(list: &str) {
    let place = tempfile::tempdir().unwrap();
    let scene = format!(
        r#"
source = {{ distance = "1.2 m", spot = "20 um", energy = "30 keV" }}
detector = {{ distance = "1.8 m", pixels = [9, 9], pitch = "40 um" }}
[sample_mask]
distance = "1.15 m"
transmission = 0.1
{list}
"#
    );
    fs::write(place.path().join("scene.toml"), scene).unwrap();
    done(place.path(), "view scene.toml -o pictures");
    let drawn = picture(&place.path().join("pictures/set_up.png"));
    // Without a sample its drawing is the first below: 268 units for 88 um, about (226, 710).
    let at = |x: f64, z: f64| colour(&drawn, 226.0 + x * 268.0 / 88.0, 710.0 - z * 268.0 / 88.0);
    for row in 0..4 {
        for column in 0..4 {
            let [x, z] = [20.0 * f64::from(column) - 30.0, 30.0 - 20.0 * f64::from(row)];
            let open = matches!((row, column), (0, 0) | (2, 1 | 2));
            assert_eq!(at(x, z)[0] > 200, open, "{row}, {column}: {:?}", at(x, z));
        }
    }
}

#[test]
fn instances_are_counted_by_check_and_drawn_where_they_stand() {
    let place = tempfile::tempdir().unwrap();
    let scene = SCENE.replace("0.4 mm", "0.1 mm") + "instances = \"places.csv\"\n";
    fs::write(place.path().join("scene.toml"), scene).unwrap();
    // Seen from 35 degrees to +x and 24 degrees up, the five fill a cross with a gap around it.
    let places = "x_mm,y_mm,z_mm\n0,0,0\n-0.6,0,0\n0.6,0,0\n0,0,-0.6\n0,0,0.6\n";
    fs::write(place.path().join("places.csv"), places).unwrap();
    let printed = done(place.path(), "check scene.toml --no-estimate");
    assert!(printed.contains("    instances         5\n"), "{printed}");
    let record = done(place.path(), "check scene.toml --json --no-estimate");
    let record: serde_json::Value = serde_json::from_str(&record).unwrap();
    assert_eq!(record["objects"][0]["instances"], 5);
    done(place.path(), "view scene.toml -o pictures");
    assert!(place.path().join("pictures/set_up.png").exists());
    let sample = picture(&place.path().join("pictures/sample.png"));
    let [r, g, b] = colour(&sample, 390.0, 390.0);
    assert!(b > g && g > r, "the ball in the middle is blue: {r} {g} {b}");
    // Along z the picture is 2 (0.6 cos 24 deg + 0.1) mm high, which fill 760 / 1.12 of its units.
    let unit = 760.0 / 1.12 / 1.296;
    for (z, is_ball) in [(0.548, true), (0.27, false), (-0.27, false), (-0.548, true)] {
        let found = colour(&sample, 390.0, 390.0 - z * unit) != [255; 3];
        assert_eq!(found, is_ball, "{z} mm above the middle");
    }
}

#[test]
fn inner_objects_are_visible_through_outer_ones() {
    let place = tempfile::tempdir().unwrap();
    let inner = "\n[[object]]\nname = \"seed\"\nmaterial = \"gold\"\n\
                 shape = { sphere = { radius = \"0.15 mm\", sides = 64 } }\n";
    fs::write(place.path().join("scene.toml"), format!("{SCENE}{inner}")).unwrap();
    done(place.path(), "view scene.toml -o pictures");
    let sample = picture(&place.path().join("pictures/sample.png"));
    let [r, _, b] = colour(&sample, 390.0, 390.0);
    assert!(r > b, "the second material, orange, is in the middle: red {r}, blue {b}");
    let [r, _, b] = colour(&sample, 390.0, 170.0);
    assert!(b > r, "around it is the first, blue: red {r}, blue {b}");
}

#[test]
fn retrieved_images_have_row_0_on_top_and_symmetric_colours() {
    let place = run_with_maps();
    done(place.path(), "view run -o pictures --show retrieved");
    let refraction = picture(&place.path().join("pictures/refraction_view_0000.png"));
    // Four rows of sixteen square pixels, 560 units wide, from (90, 62) on.
    let block = |column: f64, row: f64| {
        colour(&refraction, 90.0 + 35.0 * (column + 0.5), 62.0 + 35.0 * (row + 0.5))
    };
    // The ends of ColorBrewer's RdBu; a spline through its eleven colours meets them to 1.
    let is = |found: [u8; 3], wanted: [u8; 3]| {
        found.iter().zip(wanted).all(|(found, wanted)| found.abs_diff(wanted) <= 1)
    };
    let (first, last) = (block(0.0, 0.0), block(15.0, 3.0));
    assert!(is(first, [103, 0, 31]), "+ is red, on top at the left: {first:?}");
    assert!(is(last, [5, 48, 97]), "- is blue, at the bottom right: {last:?}");
    let middle = block(7.0, 1.0);
    assert!(middle.iter().all(|part| *part > 235), "zero is white: {middle:?}");
    let transmission = picture(&place.path().join("pictures/transmission_view_0000.png"));
    let grey = |column: f64| colour(&transmission, 90.0 + 35.0 * (column + 0.5), 80.0);
    // The scale is one for both views; the second one has the largest.
    assert_eq!(grey(0.0), [0; 3]);
    assert!((1..16).all(|c| grey(f64::from(c)) > grey(f64::from(c - 1))), "x to the right");
}

#[test]
fn every_kind_of_picture_is_drawn_and_its_file_is_printed() {
    let place = run_with_maps();
    let printed = done(place.path(), "view run -o pictures --view 1 --row 2 --pixel 3,2 --step 1");
    let names: Vec<&str> =
        printed.lines().map(|line| line.strip_prefix("pictures/").unwrap()).collect();
    assert_eq!(
        names,
        [
            "flat_step_001.png",
            "sample_view_0001_step_001.png",
            "transmission_view_0001.png",
            "refraction_view_0001.png",
            "dark_field_view_0001.png",
            "profile_view_0001_row_0002.png",
            "curve_view_0001_column_0003_row_0002.png",
            "sinogram_transmission_row_0002.png",
            "sinogram_refraction_row_0002.png",
            "sinogram_dark_field_row_0002.png",
        ]
    );
    for name in names {
        let picture = picture(&place.path().join("pictures").join(name));
        assert!(picture.width() > 600 && picture.height() > 200, "{name}");
        assert!(inked(&picture, 0..picture.width()) > 0.02, "{name} is blank");
    }
}

#[test]
fn the_curve_shows_the_intensities_of_the_pixel_at_their_places() {
    let place = run_with_maps();
    // Known intensities: a flat of 0.1 at the middle step and nothing else; no fit to stretch
    // the axis. The axis runs from a twentieth below 0 to a twentieth above 0.1.
    fs::remove_dir_all(place.path().join("run/retrieved")).unwrap();
    let mut flat = Array3::<f32>::zeros((5, 4, 16));
    flat[[2, 1, 6]] = 0.1;
    write_npy(place.path().join("run/flat.npy"), &flat).unwrap();
    write_npy(place.path().join("run/sample.npy"), &Array4::<f32>::zeros((2, 5, 4, 16))).unwrap();
    commit(&place.path().join("run"));
    done(place.path(), "view run -o pictures --show curve --pixel 6,1");
    let curve = picture(&place.path().join("pictures/curve_view_0000_column_0006_row_0001.png"));
    let down = |value: f64| 48.0 + 330.0 * (1.0 - (value + 0.005) / 0.11);
    let blue = [0, 114, 178];
    // Offsets run from -22 to 22 um over 560 units.
    assert_eq!(colour(&curve, 94.0 + 560.0 / 2.0, down(0.1)), blue);
    assert_eq!(colour(&curve, 94.0 + 560.0 / 2.0, down(0.0)), [213, 94, 0], "the sample's is 0");
    assert_ne!(colour(&curve, 94.0 + 560.0 / 2.0, down(0.05)), blue);
}

#[test]
fn curves_of_counts_are_drawn_less_their_dark() {
    let place = run_with_maps();
    let run = place.path().join("run");
    fs::create_dir(run.join("counts")).unwrap();
    // A flat of 1000 above a dark of 100 at the middle step; the fit says the same.
    let mut flat = Array3::<f32>::from_elem((5, 4, 16), 100.0);
    flat[[2, 1, 6]] = 1100.0;
    write_npy(run.join("counts/flat.npy"), &flat).unwrap();
    write_npy(run.join("counts/sample.npy"), &Array4::<f32>::from_elem((2, 5, 4, 16), 100.0))
        .unwrap();
    write_npy(run.join("dark.npy"), &Array3::<f32>::from_elem((3, 4, 16), 100.0)).unwrap();
    commit(&run);
    let mut record = Record::default();
    record.method = "moments".into();
    record.counts = true;
    let text = serde_json::to_string(&record).unwrap();
    fs::write(run.join("retrieved/retrieved.json"), text).unwrap();
    done(place.path(), "view run -o pictures --show curve,frames --pixel 6,1");
    let curve = picture(&place.path().join("pictures/curve_view_0000_column_0006_row_0001.png"));
    // From a twentieth below 0 to a twentieth above 1000; moments fit no Gaussian.
    let down = |value: f64| 48.0 + 330.0 * (1.0 - (value + 50.0) / 1100.0);
    let middle = 94.0 + 560.0 / 2.0;
    assert_eq!(colour(&curve, middle, down(1000.0)), [0, 114, 178], "the flat's peak");
    assert_eq!(colour(&curve, middle, down(0.0)), [213, 94, 0], "the sample's is dark");
    for name in ["counts_flat_step_002.png", "flat_step_002.png"] {
        assert!(inked(&picture(&place.path().join("pictures").join(name)), 0..600) > 0.1);
    }
    done(place.path(), "report run");
    let page = fs::read_to_string(run.join("report.html")).unwrap();
    assert!(page.contains("detector number less dark"));
}

#[test]
fn images_of_beamlets_are_drawn_over_their_numbers() {
    let place = run_with_maps();
    let retrieved = place.path().join("run/retrieved");
    fs::remove_dir_all(&retrieved).unwrap();
    fs::create_dir(&retrieved).unwrap();
    // Five beamlets in each of the four rows; the last one deflects most.
    let map = Array3::from_shape_fn((2, 4, 5), |(_, _, beamlet)| beamlet as f32 * 1e-6);
    write_npy(retrieved.join("refraction.npy"), &map).unwrap();
    let mut record = Record::default();
    record.method = "beamlet".into();
    record.shape = [2, 4, 5];
    fs::write(retrieved.join("retrieved.json"), serde_json::to_string(&record).unwrap()).unwrap();
    let printed = done(place.path(), "view run -o pictures");
    assert!(printed.contains("refraction_view_0000.png"), "{printed}");
    let refraction = picture(&place.path().join("pictures/refraction_view_0000.png"));
    let block = |beamlet: f64| colour(&refraction, 90.0 + 112.0 * (beamlet + 0.5), 200.0);
    assert!(block(0.0).iter().all(|part| *part > 235), "zero is white: {:?}", block(0.0));
    assert!(block(4.0)[0] > 2 * block(4.0)[2], "the last is red: {:?}", block(4.0));
    done(place.path(), "report run");
    let page = fs::read_to_string(place.path().join("run/report.html")).unwrap();
    assert!(page.contains("retrieved per beamlet") && !page.contains("No retrieved images"));
}

#[test]
fn the_same_pictures_come_from_exr_frames() {
    let place = run_with_maps();
    done(place.path(), "simulate scene.toml -o exr --format exr -q");
    done(place.path(), "view run -o a --show frames --view 1");
    done(place.path(), "view exr -o b --show frames --view 1");
    for name in ["flat_step_002.png", "sample_view_0001_step_002.png"] {
        let read = |folder: &str| fs::read(place.path().join(folder).join(name)).unwrap();
        assert_eq!(read("a"), read("b"), "{name}");
    }
}

#[test]
fn a_run_is_simulated_retrieved_and_drawn() {
    let place = tempfile::tempdir().unwrap();
    fs::write(place.path().join("scene.toml"), SCENE.replace(", sides = 128", "")).unwrap();
    done(place.path(), "simulate scene.toml -o run -q");
    for format in ["exr", "npy", "tiff"] {
        done(place.path(), &format!("retrieve run --format {format} -q --overwrite"));
        let printed = done(place.path(), &format!("view run -o {format} --pixel 7,1"));
        assert_eq!(printed.lines().count(), 10, "{printed}");
    }
    done_without_driver(place.path(), "report run -o tiff.html");
    let read = |folder: &str, name: &str| fs::read(place.path().join(folder).join(name)).unwrap();
    for name in ["refraction_view_0000.png", "curve_view_0000_column_0007_row_0001.png"] {
        assert_eq!(read("exr", name), read("npy", name), "{name}");
        assert_eq!(read("exr", name), read("tiff", name), "{name}");
    }
}

#[test]
fn pictures_that_are_there_are_replaced_only_when_asked() {
    let place = run_with_maps();
    fs::create_dir(place.path().join("pictures")).unwrap();
    let mine = place.path().join("pictures/profile_view_0000_row_0002.png");
    fs::write(&mine, "mine").unwrap();
    let output = run(place.path(), "view run -o pictures");
    assert_eq!(output.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&output.stderr).contains("--overwrite"));
    assert_eq!(fs::read(&mine).unwrap(), b"mine");
    assert_eq!(fs::read_dir(place.path().join("pictures")).unwrap().count(), 1);
    done(place.path(), "view run -o pictures --overwrite");
    assert_ne!(fs::read(&mine).unwrap(), b"mine");
}

/// A packing and its medium, whose material keeps no structure in the picture.
#[test]
fn a_scene_with_a_microstructure_is_drawn() {
    let place = tempfile::tempdir().unwrap();
    done(place.path(), "example powder -o powder");
    done(place.path(), "view powder/scene.toml -o pictures");
    let sample = picture(&place.path().join("pictures/sample.png"));
    assert!(inked(&sample, 15..15 + 1140) > 0.2);
}

/// Exact shapes of opaque objects are found by their places, all others by rays: both are drawn alike, in front of one
/// another and inside a translucent body.
#[test]
fn exact_shapes_are_drawn_like_their_facets() {
    let draw = |sides: &str| {
        let place = tempfile::tempdir().unwrap();
        let objects = [
            ("tank", "box = { size = [\"3 mm\", \"3 mm\", \"3 mm\"] }".to_owned(), [0.0, 0.0, 0.0]),
            ("ball", format!("sphere = {{ radius = \"0.5 mm\"{sides} }}"), [-0.8, -0.6, 0.7]),
            (
                "egg",
                format!(
                    "ellipsoid = {{ semi_axes = [\"0.3 mm\", \"0.6 mm\", \"0.4 mm\"]{sides} }}"
                ),
                [0.7, 0.5, 0.8],
            ),
            (
                "rod",
                format!("cylinder = {{ radius = \"0.3 mm\", height = \"1.2 mm\"{sides} }}"),
                [-0.8, 0.6, -0.6],
            ),
            (
                "tip",
                format!("cone = {{ radius = \"0.5 mm\", height = \"1 mm\"{sides} }}"),
                [0.6, -0.5, -0.7],
            ),
            // It crosses the ball.
            ("bump", format!("sphere = {{ radius = \"0.4 mm\"{sides} }}"), [-0.4, -0.6, 0.9]),
            (
                "fibre",
                format!("cylinder = {{ radius = \"0.04 mm\", height = \"2 mm\"{sides} }}"),
                [0.1, -1.0, 0.0],
            ),
            (
                "pipe",
                format!(
                    "tube = {{ outer = \"0.6 mm\", inner = \"0.4 mm\", height = \"1 mm\"{sides} }}"
                ),
                [2.6, 0.0, 0.0],
            ),
        ];
        let mut scene = SCENE.split("[[object]]").next().unwrap().to_owned();
        for (name, shape, [x, y, z]) in objects {
            let material = if name == "tank" { "water" } else { "nylon 6" };
            scene += &format!(
                "[[object]]\nname = \"{name}\"\nmaterial = \"{material}\"\nshape = {{ {shape} }}\n\
                 position = [\"{x} mm\", \"{y} mm\", \"{z} mm\"]\n\
                 rotate = [{{ axis = [1, 2, 0], angle = \"25 deg\" }}]\n"
            );
        }
        fs::write(place.path().join("scene.toml"), scene).unwrap();
        done(place.path(), "view scene.toml -o pictures");
        picture(&place.path().join("pictures/sample.png"))
    };
    let [exact, facets] = ["", ", sides = 128"].map(draw);
    let side = 15..15 + 1140;
    let differs = |x: u32, y: u32| {
        let [a, b] = [&exact, &facets].map(|it| it.pixel(x, y).unwrap());
        [(a.red(), b.red()), (a.green(), b.green()), (a.blue(), b.blue())]
            .into_iter()
            .any(|(a, b)| a.abs_diff(b) > 24)
    };
    let pixels = side.clone().flat_map(|x| side.clone().map(move |y| (x, y)));
    let count = pixels.filter(|(x, y)| differs(*x, *y)).count();
    let share = count as f64 / 1140.0 / 1140.0;
    // Facets shade flat, and their outlines are off by up to a tenth of a pixel.
    assert!(share < 3e-3, "{share}");
    assert!(inked(&exact, side) > 0.2);
}
