//! The axis of rotation: its place along the beam and its lever arm, its column, and the search for it.

use crate::reference::blobs::Blob;
use crate::set_up::{PIXEL, blobs, fan, places, sinograms, views_over_a_turn};
use beamlet::ndarray::Array3;
use beamlet::reconstruct::{Data, Input, Quantity, ScanGeometry, find_axis, gradient_bias};
use beamlet::scene::{Motion, Scene};
use beamlet::stack::GeometryFile;
use beamlet::{Cancel, Result};
use std::path::Path;

/// Masks, and an axis 1.4 m from the source.
const SCENE: &str = r#"
[source]
distance = "1.4 m"
spot = "20 um"
energy = "30 keV"
[detector]
distance = "1.8 m"
pixels = [12, 6]
pitch = "150 um"
[sample_mask]
distance = "1.0 m"
transmission = 0.0
projected_aperture = "30 um"
[detector_mask]
distance = "1.8 m"
transmission = 0.0
projected_aperture = "30 um"
[scan]
angles = { from = "0 deg", to = "360 deg", count = 12 }
"#;

fn scene(distance: &str, scan: &str, folder: &Path) -> Scene {
    let text = SCENE.replace("1.4 m", distance);
    let text = match scan.starts_with("cone_vec") {
        true => text.split_once("angles").unwrap().0.to_owned(),
        false => text,
    };
    Scene::from_toml(&format!("{text}{scan}\n"), folder).unwrap()
}

/// One set-up in three ways, at rest and with a sample that travels along the axis.
#[test]
fn one_axis_has_one_lever_arm_however_it_is_written() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    for travel in ["", "travel = [\"0 mm\", \"0 mm\", \"2 mm\"]\n"] {
        let plain = scene("1.4 m", travel, here);
        let vectors = GeometryFile::of(&plain).astra_cone_vec_mm.unwrap();
        let lines: Vec<String> =
            vectors.iter().map(|row| row.map(|n| n.to_string()).join(" ")).collect();
        std::fs::write(here.join("vectors.txt"), lines.join("\n")).unwrap();
        let shift = format!("{travel}axis = {{ shift = [\"0 mm\", \"200 mm\", \"0 mm\"] }}");
        let wanted = ScanGeometry::of_scene(&plain);
        assert_eq!(wanted.motions.is_none(), travel.is_empty());
        let k = gradient_bias(&plain, 9e-6).unwrap();
        // (M/z)(z_s/z₁)(σ² − a²/12).
        let aperture = 30e-6 / 1.8;
        let expected = 1.8 / 0.4 * 1.4 * (81e-12 - aperture * aperture / 12.0);
        assert!((k / expected - 1.0).abs() < 1e-12, "{k:e} {expected:e}");
        for other in
            [scene("1.2 m", &shift, here), scene("1.2 m", "cone_vec = \"vectors.txt\"", here)]
        {
            let found = ScanGeometry::of_scene(&other);
            // Vectors are read from text in mm.
            let near = |a: f64, b: f64| (a - b).abs() < 1e-12;
            let at = (found.source_distance, found.lever, found.axis);
            assert!(near(found.source_distance, 1.4) && near(found.axis, 0.0), "{at:?}");
            assert!(near(found.lever, 0.4) && near(other.lever_arm(), 0.4), "{at:?}");
            assert!((gradient_bias(&other, 9e-6).unwrap() / k - 1.0).abs() < 1e-12);
            match (&found.motions, &wanted.motions) {
                (None, None) => {
                    let turns = found.angles.iter().zip(&wanted.angles);
                    // Views begin behind the widest gap.
                    let mut turns = turns.map(|(a, b)| libm::sin(0.5 * (a - b)));
                    assert!(turns.all(|half| half.abs() < 1e-12), "{:?}", found.angles);
                }
                (Some(motions), Some(wanted)) => {
                    for (motion, wanted) in motions.iter().zip(wanted) {
                        let [a, b] = [motion, wanted].map(|it| it.point([1e-3, 2e-3, 3e-3]));
                        let all = a.iter().zip(b).all(|(a, b)| near(*a, b));
                        assert!(all, "{a:?} {b:?}");
                    }
                }
                _ => panic!("a circle and motions: {found:?}"),
            }
        }
    }
    let message = Scene::from_toml(
        &format!("{SCENE}axis = {{ shift = [\"0 m\", \"0.5 m\", \"0 m\"] }}"),
        ".",
    )
    .and_then(|scene| scene.validate())
    .unwrap_err()
    .to_string();
    assert!(message.contains("scan.axis.shift") && message.contains("1.8 m"), "{message}");
}

/// Angles refer to the plane of the lever arm: motions about an axis elsewhere stay motions.
#[test]
fn motions_about_an_axis_off_the_plane_of_the_lever_arm_are_no_circle() {
    let made = |by: [f64; 3], lever: f64| {
        let mut geometry = fan(12);
        geometry.lever = lever;
        let turn = |angle: &f64| Motion::about_z(-angle).then(&Motion::translation(by));
        let motions = geometry.angles.iter().map(turn).collect();
        geometry.with_motions(motions)
    };
    assert!(made([1e-4, 1e-3, 0.0], f64::INFINITY).motions.is_none());
    assert!(made([1e-4, 0.0, 0.0], 0.03).motions.is_none());
    let moved = made([1e-4, 1e-3, 0.0], 0.03);
    assert!(moved.motions.is_some() && (moved.lever - 0.03).abs() <= 0.0);
}

/// A column of an axis that motions displace counts from the optical axis, not from the displaced one.
#[test]
fn a_chosen_column_is_where_motions_put_the_axis() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    let path = here.join("mu.npy");
    ndarray_npy::write_npy(&path, &Array3::<f32>::zeros((12, 6, 12))).unwrap();
    let scan = "travel = [\"0 mm\", \"0 mm\", \"2 mm\"]\n\
                axis = { shift = [\"0.2 mm\", \"0 mm\", \"0 mm\"] }";
    let scene = scene("1.4 m", scan, here);
    let input = || Input::of_file(&path, Quantity::Mu, &scene).unwrap();
    let own = input();
    let column = 5.5 + 0.2e-3 * 1.8 / 1.4 / 150e-6;
    assert!((own.geometry().axis_column() - column).abs() < 1e-9);
    assert!(own.geometry().motions.is_some());
    let same = input().with_centre(column);
    assert!((same.geometry().axis - own.geometry().axis).abs() < 1e-15);
    let other = input().with_centre(column + 0.5);
    assert!((other.geometry().axis_column() - column - 0.5).abs() < 1e-9);
    assert_eq!(other.geometry().motions, own.geometry().motions);
}

fn found(geometry: &ScanGeometry, sinograms: &Array3<f32>) -> Result<f64> {
    let found = find_axis(geometry, sinograms.view(), Data::Attenuation, &Cancel::default());
    found.map(|axis| axis / PIXEL)
}

/// Uniform noise of this width.
fn noise(sinograms: &mut Array3<f32>, width: f32) {
    let mut state = 3_u32;
    sinograms.mapv_inplace(|value| {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        value + ((state >> 8) as f32 / (1 << 24) as f32 - 0.5) * width
    });
}

/// Up to 0.4 of the width from the middle, where lines in a fifth of the columns are seen twice.
#[test]
fn the_axis_is_found_all_over_the_detector() {
    for axis in [20.0, 29.0, -34.0, 38.2] {
        let mut geometry = fan(180);
        geometry.axis = axis * PIXEL;
        let found = found(&geometry, &sinograms(&geometry, &blobs(), Quantity::Mu)).unwrap();
        println!("measured: {found:.3} for {axis}");
        assert!((found - axis).abs() < 0.1, "{found} for {axis}");
    }
}

/// Rows count that the sample covers, wherever they are.
#[test]
fn the_axis_is_found_by_samples_above_the_optical_axis() {
    let pitch = 2.0 * PIXEL;
    let rows = places(24, pitch).into_iter().rev().collect();
    let mut geometry =
        ScanGeometry::new([0.2, 0.4], places(48, pitch), rows, views_over_a_turn(90));
    geometry.axis = 5.2 * PIXEL;
    let blob =
        Blob { centre: [6.0 * PIXEL, 3.0 * PIXEL, 9.0 * PIXEL], sigma: 2.0 * PIXEL, peak: 1.0 };
    let mut given = sinograms(&geometry, &[blob], Quantity::Mu);
    let most = given.iter().copied().fold(0.0, f32::max);
    noise(&mut given, 0.05 * most);
    let found = found(&geometry, &given).unwrap();
    assert!((found - 5.2).abs() < 0.1, "{found}");
}

#[test]
fn an_axis_that_fits_hardly_better_than_others_is_refused() {
    let mut geometry = fan(180);
    let mut given = Array3::<f32>::zeros((180, 1, 96));
    noise(&mut given, 1.0);
    let message = found(&geometry, &given).unwrap_err().to_string();
    assert!(
        message.contains("no axis of rotation") || message.contains("end of the search"),
        "{message}"
    );
    // An axis beside the detector.
    geometry.axis = 60.0 * PIXEL;
    let given = sinograms(&geometry, &blobs(), Quantity::Mu);
    assert!(found(&geometry, &given).is_err());
}
