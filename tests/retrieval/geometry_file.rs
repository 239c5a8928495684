//! geometry.json of runs and of retrieved images, against the vectors written out by hand.

use crate::support::program::{Workplace, stderr};
use beamlet::scene::{Motion, Scene};
use beamlet::stack::GeometryFile;
use serde_json::Value;

const SCENE: &str = r#"
source = { distance = "1.2 m", spot = "10 um", energy = "30 keV" }
detector = { distance = "1.8 m", pixels = [6, 2], pitch = ["150 um", "100 um"] }
sample_mask = { distance = "1.1 m", projected_aperture = "30 um", transmission = 0.0 }
detector_mask = { distance = "1.75 m", projected_aperture = "30 um", transmission = 0.0 }
scan = { mask_offsets = { from = "-20 um", to = "20 um", count = 7 }, angles = ["0 deg", "30 deg", "90 deg"] }
[[object]]
name = "ball"
shape = { sphere = { radius = "0.2 mm" } }
material = "water"
"#;

fn geometry(work: &Workplace, folder: &str) -> GeometryFile {
    GeometryFile::read(&work.path(folder)).unwrap()
}

#[track_caller]
fn assert_near(found: &[f64], expected: &[f64], least: f64) {
    let near = found.iter().zip(expected).all(|(a, b)| (a - b).abs() <= least);
    assert!(near && found.len() == expected.len(), "{found:?}, not {expected:?}");
}

/// The row of `cone_vec` at an angle, mm, with the columns beside the axis by `moved`.
fn vector(angle: f64, moved: f64) -> Vec<f64> {
    let (sine, cosine) = angle.sin_cos();
    let turned = |x: f64, y: f64| [cosine * x - sine * y, sine * x + cosine * y];
    let [s, d, u] = [turned(0.0, -1200.0), turned(moved, 600.0), turned(0.15, 0.0)];
    vec![s[0], s[1], 0.0, d[0], d[1], 0.0, u[0], u[1], 0.0, 0.0, 0.0, -0.1]
}

#[test]
fn a_run_and_its_images_have_the_geometry_of_their_views() {
    let work = Workplace::new(SCENE);
    // The detector mask is moved by 35 um, which are 36 um on the detector.
    let simulated = work.simulate(&["--format", "npy", "--set", "detector_mask.offset=35 um"]);
    assert!(simulated.status.success(), "{}", stderr(&simulated));
    let found = geometry(&work, "run");
    let columns: Vec<f64> = (0..6).map(|c| 150e-6 * (f64::from(c) - 2.5) + 36e-6).collect();
    assert_near(&found.columns_m, &columns, 1e-12);
    assert_near(&found.rows_m, &[50e-6, -50e-6], 1e-15);
    assert_near(&[found.axis_column.unwrap()], &[2.5 - 36.0 / 150.0], 1e-9);
    assert_near(&found.angles_deg, &[0.0, 30.0, 90.0], 1e-12);
    assert_near(&[found.source_to_axis_m, found.source_to_detector_m], &[1.2, 1.8], 1e-12);
    assert_eq!(found.source_to_sample_mask_m, Some(1.1));
    assert_near(&[found.source_to_analyser_m], &[1.75], 1e-12);
    let vectors = found.astra_cone_vec_mm.clone().unwrap();
    for (angle, row) in found.angles_rad.iter().zip(vectors) {
        assert_near(&row, &vector(*angle, 0.036), 1e-9);
    }
    let done = work.beamlet(&["retrieve", "run", "-q"]);
    assert!(done.status.success(), "{}", stderr(&done));
    assert_eq!(geometry(&work, "run/retrieved"), found);
    let again = work.beamlet(&["retrieve", "run", "-q", "--overwrite"]);
    assert!(again.status.success(), "{}", stderr(&again));
    // Each key is a line of its own.
    let text = String::from_utf8(work.bytes("geometry.json")).unwrap();
    let value: Value = serde_json::from_str(&text).unwrap();
    assert_eq!(text.lines().count(), value.as_object().unwrap().len() + 2);
}

#[test]
fn measured_frames_have_a_geometry_where_each_has_an_angle() {
    let work = Workplace::new(SCENE);
    assert!(work.simulate(&["--format", "npy"]).status.success());
    for (angles, is_there) in [("[\"0 deg\", \"1 deg\", \"2 deg\"]", true), ("[\"0 deg\"]", false)]
    {
        let set = format!("scan.angles={angles}");
        let words = [
            "retrieve",
            "--flat",
            "run/flat.npy",
            "--sample",
            "run/sample.npy",
            "--geometry",
            "scene.toml",
            "--set",
            &set,
            "-o",
            "images",
            "--overwrite",
        ];
        let done = work.beamlet(&words);
        // Without a sample in the beam the frames are those of the flat.
        let message = stderr(&done);
        assert!(done.status.success(), "{message}");
        assert_eq!(work.path("images/geometry.json").exists(), is_there, "{message}");
        assert_eq!(message.contains("3 views, and 1 angle in scan.angles"), !is_there, "{message}");
    }
}

#[test]
fn moved_samples_have_no_axis_of_rotation() {
    let mut scene = Scene::from_toml(SCENE, ".").unwrap();
    assert!(GeometryFile::of(&scene).axis_column.is_some());
    scene.scan.motions = vec![Motion::IDENTITY; 2];
    scene.scan.motions.push(Motion::translation([1e-3, 0.0, 0.0]));
    let found = GeometryFile::of(&scene);
    assert_eq!(found.axis_column, None);
    // Where the sample moves by +1 mm along x, the set-up moves by -1 mm.
    let vectors = found.astra_cone_vec_mm.unwrap();
    assert_near(&vectors[2][..3], &[1200.0 - 1.0, 0.0, 0.0], 1e-9);
}
