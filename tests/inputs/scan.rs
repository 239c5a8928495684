//! Keys of the scan: lists and files of offsets, angles and motions, and the views that they make.

use crate::kept::assert_hashed;
use crate::paper::PAPER;
use beamlet::Error;
use beamlet::scene::{Exposure, Motion, RotationAxis, Scene};
use std::collections::BTreeMap;
use std::path::Path;

/// The paper's scene with another table `[scan]`.
fn text(scan: &str) -> String {
    let mut scene: toml::Table = PAPER.parse().unwrap();
    scene.insert("scan".into(), toml::Value::Table(scan.parse().unwrap()));
    scene.to_string()
}

/// The scene with these keys of the scan, in a folder with these files.
fn scene(scan: &str, files: &[(&str, &str)]) -> Result<Scene, Error> {
    let directory = tempfile::tempdir().unwrap();
    for (name, text) in files {
        std::fs::write(directory.path().join(name), text).unwrap();
    }
    Scene::from_toml(&text(scan), directory.path())
}

/// A scene's scan after its text was written and read without the files.
#[track_caller]
fn assert_kept(scene: &Scene) {
    let text = scene.to_toml(Path::new("."), &BTreeMap::new(), &[]).unwrap();
    assert_eq!(Scene::from_toml(&text, ".").unwrap().scan, scene.scan, "{text}");
}

#[test]
fn files_have_the_values_of_lists() {
    let files = [
        ("angles.csv", "# stage\nview,angle_deg\n0,0\n1,12.5\n2,-7\n"),
        ("offsets.csv", "offset_um\n-25\n0.1\n25\n"),
        ("by_angle.csv", "offset_0_um,offset_1_mm,offset_2_um\n1,2e-3,3\n4,5e-3,6\n7,8e-3,9\n"),
    ];
    let of_files = scene(
        "angles = \"angles.csv\"\nmask_offsets = \"offsets.csv\"\nview_offsets = \"by_angle.csv\"",
        &files,
    );
    let lists = "angles = [\"0 deg\", \"12.5 deg\", \"-7 deg\"]
        mask_offsets = [\"-25 um\", \"0.1 um\", \"25 um\"]
        view_offsets = [[\"1 um\", \"2 um\", \"3 um\"], [\"4 um\", \"5 um\", \"6 um\"], [\"7 um\", \"8 um\", \"9 um\"]]";
    let of_files = of_files.unwrap();
    assert_eq!(of_files.scan, scene(lists, &[]).unwrap().scan);
    assert_eq!(of_files.scan.offsets_of(1), [4e-6, 5e-6, 6e-6]);
    assert_kept(&of_files);
}

/// Apertures of the sample mask end along z: the mask moves along both.
fn of_pairs(steps: &str, files: &[(&str, &str)]) -> Result<Scene, Error> {
    let mut scene: toml::Table = text(&format!("mask_offsets = {steps}")).parse().unwrap();
    let height = toml::Value::String("20 um".into());
    let mask = scene.get_mut("sample_mask").and_then(toml::Value::as_table_mut);
    mask.unwrap().insert("aperture_z".into(), height);
    let directory = tempfile::tempdir().unwrap();
    for (name, text) in files {
        std::fs::write(directory.path().join(name), text).unwrap();
    }
    Scene::from_toml(&scene.to_string(), directory.path())
}

#[test]
fn mask_offsets_are_numbers_or_pairs_along_x_and_z() {
    let scan =
        of_pairs("[[\"-10 um\", \"0 um\"], [\"0 um\", \"4 um\"], [\"1 um\", \"-4 um\"]]", &[]);
    let scan = scan.unwrap();
    assert_eq!(scan.scan.mask_offsets, [-10e-6, 0.0, 1e-6]);
    assert_eq!(scan.scan.mask_offsets_z, [0.0, 4e-6, -4e-6]);
    assert_kept(&scan);
    let file = [("pairs.csv", "offset_x_um,offset_z_mm\n-10,0\n0,4e-3\n1,-4e-3\n")];
    let of_file = of_pairs("\"pairs.csv\"", &file).unwrap();
    assert_eq!(of_file.scan, scan.scan);
    // Pairs without steps along z are steps along x, which slits take, too.
    let rests = scene("mask_offsets = [[\"1 um\", \"0 um\"], [\"2 um\", \"0 mm\"]]", &[]).unwrap();
    assert_eq!(rests.scan, scene("mask_offsets = [\"1 um\", \"2 um\"]", &[]).unwrap().scan);
}

#[test]
fn motions_by_axis_by_quaternion_and_in_the_scene_are_the_same() {
    let by_axis = "x_mm,y_mm,z_mm,axis_x,axis_y,axis_z,angle_deg,view\n1,0,-2,0,0,1,0,0\n0,0.5,0,0,3,0,90,1\n";
    let half = 0.5_f64.sqrt();
    let by_quaternion =
        format!("qw,qx,qy,qz,x_um,y_um,z_um\n2,0,0,0,1000,0,-2000\n{half},0,{half},0,0,500,0\n");
    let listed = "motions = [{ translation = [\"1 mm\", \"0 mm\", \"-2 mm\"] },
        { translation = [\"0 mm\", \"0.5 mm\", \"0 mm\"], axis = [0, 3, 0], angle = \"90 deg\" }]";
    let file = "motions = \"motions.csv\"";
    let scenes = [
        scene(file, &[("motions.csv", by_axis)]),
        scene(file, &[("motions.csv", &by_quaternion)]),
        scene(listed, &[]),
    ];
    let third = Motion::about([0.0, 1.0, 0.0], std::f64::consts::FRAC_PI_2).unwrap();
    let wanted = [
        Motion::translation([1e-3, 0.0, -2e-3]),
        third.then(&Motion::translation([0.0, 5e-4, 0.0])),
    ];
    for scene in scenes {
        let scene = scene.unwrap();
        assert_eq!(scene.scan.angles, [0.0, 0.0], "motions without angles");
        for (motion, wanted) in scene.scan.motions.iter().zip(&wanted) {
            for point in [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.2, 0.3, 1.0]] {
                let [found, wanted] = [motion.point(point), wanted.point(point)];
                let is_near = found.iter().zip(wanted).all(|(a, b)| (a - b).abs() < 1e-15);
                assert!(is_near, "{found:?} for {wanted:?}");
            }
        }
        assert_kept(&scene);
    }
}

#[test]
fn axis_travel_and_dithers_are_kept_and_make_views() {
    let scan = "angles = { from = \"0 deg\", to = \"360 deg\", count = 3 }
        axis = { shift = [\"0.1 mm\", \"-0.2 mm\", \"0 mm\"], tilt_x = \"0.3 deg\", tilt_y = \"-1 deg\" }
        travel = [\"0 mm\", \"0 mm\", \"3 mm\"]
        dithers = { from = \"-10 um\", to = \"10 um\", count = 2 }
        fly = { count = 4, sweep = \"1.5 deg\" }";
    let scene = scene(scan, &[]).unwrap();
    let radians = f64::to_radians;
    let axis = RotationAxis::new([1e-4, -2e-4, 0.0], radians(0.3), radians(-1.0));
    assert_eq!(scene.scan.axis, axis);
    assert_eq!((scene.scan.views(), scene.views().count()), (6, 6));
    assert_kept(&scene);
    // The middle of the sample at the second dither of the second angle: 1 mm along the axis.
    let [x, y, z] = scene.views().nth(3).unwrap().motion.point([0.0; 3]);
    let up = [
        radians(-1.0).sin(),
        -radians(0.3).sin() * radians(-1.0).cos(),
        radians(0.3).cos() * radians(-1.0).cos(),
    ];
    let wanted = [10e-6 + 1e-4 + 1e-3 * up[0], -2e-4 + 1e-3 * up[1], 1e-3 * up[2]];
    assert!(
        [x, y, z].iter().zip(wanted).all(|(a, b)| (a - b).abs() < 1e-16),
        "{x} {y} {z} {wanted:?}"
    );
}

#[test]
fn golden_angles_fill_the_range_evenly_at_any_count() {
    let scan = "angles = { from = \"10 deg\", to = \"190 deg\", count = 34, order = \"golden\" }";
    let angles = scene(scan, &[]).unwrap().scan.angles;
    let mut degrees: Vec<f64> = angles.iter().map(|angle| angle.to_degrees()).collect();
    assert!((degrees[1] - degrees[0] - 180.0 * 0.618_033_988_75).abs() < 1e-6, "{degrees:?}");
    degrees.sort_by(f64::total_cmp);
    // 34 is a Fibonacci number: gaps differ by no more than the square of the golden section.
    let gaps: Vec<f64> = degrees.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let [least, most] =
        [gaps.iter().copied().fold(f64::MAX, f64::min), gaps.iter().copied().fold(0.0, f64::max)];
    assert!(degrees[0] >= 10.0 && degrees[33] < 190.0 && most / least < 2.7, "{least} {most}");
}

#[test]
fn errors_are_lists_files_or_draws_and_kept_as_they_were_applied() {
    let two = "mask_offsets = [\"0 um\", \"5 um\"]\nangles = [\"0 deg\", \"1 deg\"]\n";
    let of = |errors: &str, files: &[(&str, &str)]| {
        scene(&format!("{two}errors = {{ {errors} }}"), files)
    };
    let files = [
        ("mask.csv", "view,offset_0_um,offset_1_nm\n0,1,-2000\n1,3,4000\n"),
        ("light.csv", "intensity_0,intensity_1\n1,0.9\n1.1,1\n"),
    ];
    let of_files = of("mask_offsets = \"mask.csv\", intensities = \"light.csv\"", &files).unwrap();
    let lists = "mask_offsets = [[\"1 um\", \"-2 um\"], [\"3 um\", \"4 um\"]], intensities = [[1, 0.9], [1.1, 1.0]]";
    assert_eq!(of_files.scan, of(lists, &[]).unwrap().scan);
    assert_eq!(of_files.scan.offsets_of(1), [0.0, 5e-6]);
    assert_eq!(of_files.applied_offsets(Exposure::Sample(1))[0], [3e-6, 5e-6 + 4e-6]);
    assert_eq!((of_files.scan.intensity(0, 1), of_files.scan.intensity(1, 1)), (0.9, 1.0));
    assert_kept(&of_files);
    let drawn = of("offset_sigma = \"2 um\", intensity_walk = 0.01, seed = 5", &[]).unwrap();
    assert_eq!(drawn.scan.errors.mask_offsets.len(), 2);
    assert!(drawn.scan.errors.intensities.concat().iter().all(|it| (it - 1.0).abs() < 0.1));
    assert_kept(&drawn);
    assert_eq!(
        drawn.scan,
        of("seed = 5, offset_sigma = \"2 um\", intensity_walk = 0.01", &[]).unwrap().scan
    );
    assert_ne!(
        drawn.scan,
        of("seed = 6, offset_sigma = \"2 um\", intensity_walk = 0.01", &[]).unwrap().scan
    );
    let drifting =
        of("source_x = [\"3 um\", \"-1 um\"], source_z = [\"0 um\", \"2 um\"]", &[]).unwrap();
    assert_eq!(drifting.scan.errors.source, [[3e-6, 0.0], [-1e-6, 2e-6]]);
    // The paper's set-up: s (M - 1)/M against the offset.
    let magnification = drifting.magnification();
    let [offsets, _] = drifting.applied_offsets(Exposure::Sample(0));
    let expected = drifting.scan.offsets_of(0)[0] - 3e-6 * (1.0 - 1.0 / magnification);
    assert!((offsets[0] - expected).abs() < 1e-18, "{offsets:?} {expected:e}");
    assert_kept(&drifting);
    assert_kept(&of("source_sigma = \"1 um\", source_walk = \"0.2 um\"", &[]).unwrap());
}

#[test]
fn tables_are_among_the_hashes_of_a_scene() {
    let text = text("angles = \"angles.csv\"");
    assert_hashed(&text, "angles.csv", ["angle_deg\n0\n1\n", "angle_deg\n0\n1.5\n"], "scan.angles");
}
