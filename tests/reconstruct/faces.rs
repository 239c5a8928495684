//! Scans of a block with views along its faces, by the program and by `check`.

use super::verb::mean_about;
use crate::support::program::{done, run, stderr, workplace};
use beamlet::check::Check;
use beamlet::reconstruct::{LostUse, Quantity, VolumeRecord};
use beamlet::scene::Scene;
use std::path::Path;
use std::sync::OnceLock;
use tempfile::TempDir;

/// A block whose faces are along the beam at 0°, 90°, 180° and 270°; five dithers see all of it.
const SCENE: &str = r#"
source = { distance = "1.6 m", spot = "40 um", energy = "30 keV" }
sample_mask = { distance = "1.55 m", projected_aperture = "30 um", transmission = 0.0 }
detector_mask = { projected_aperture = "30 um", transmission = 0.0 }
detector = { distance = "2.0 m", pixels = [24, 1], pitch = "100 um" }
sampling = { tolerance = 5e-3, angle_tolerance = "1 urad" }
[scan]
mask_offsets = { from = "-24 um", to = "24 um", count = 9 }
angles = { from = "0 deg", to = "360 deg", count = 72 }
dithers = { from = "-32 um", to = "32 um", count = 5 }
[[object]]
name = "block"
shape = { box = { size = ["1.1 mm", "0.9 mm", "1 mm"] } }
material = "PEEK"
"#;
/// δ of PEEK at 30 keV.
const DELTA: f64 = 3.1674e-7;

/// A run that is retrieved, for all tests.
fn place() -> &'static Path {
    static PLACE: OnceLock<TempDir> = OnceLock::new();
    let place = PLACE.get_or_init(|| {
        let place = workplace(SCENE);
        done(place.path(), "simulate scene.toml -q -o run --format npy");
        done(place.path(), "retrieve run -q --format npy --method exact-curve");
        place
    });
    place.path()
}

/// Relative error of the mean of δ in the middle of the block, with the record of the volume and the text on stderr.
fn error(here: &Path, options: &str) -> (f64, VolumeRecord, String) {
    let name = format!("volume{}", options.replace(' ', ""));
    let line = format!("reconstruct run -o {name} --quantity mu,delta {options}");
    let output = run(here, &line);
    let message = stderr(&output);
    assert!(output.status.success(), "{line}: {message}");
    let mean = mean_about(&here.join(&name), Quantity::Delta, [0.0; 2], 3e-4);
    (mean / DELTA - 1.0, VolumeRecord::read(&here.join(name)).unwrap(), message)
}

#[test]
fn delta_of_a_block_is_right_without_the_views_along_its_faces() {
    let here = place();
    let (mended, record, message) = error(here, "");
    let (kept, _, _) = error(here, "--keep-views");
    let (weighed, of_cgls, _) = error(here, "--method cgls --iterations 12");
    let (equal, _, _) = error(here, "--method cgls --iterations 12 --keep-views");
    println!("measured: fbp {mended:.4}, {kept:.4} kept; cgls {weighed:.4}, {equal:.4} kept");
    // Four of 72 views without their refraction are 5.6 %; interpolation over 10° and k μ are right to 1 %.
    assert!(mended.abs() < 0.01, "{mended}");
    assert!(kept < -0.03, "{kept}");
    // Twelve iterations leave 1 % of the lowest frequencies.
    assert!(weighed.abs() < 0.02 && weighed - equal > 0.02, "{weighed} {equal}");
    let moment = record.refraction_moment.unwrap();
    let views: Vec<usize> = moment.lost_views.iter().map(|of| of.view).collect();
    assert_eq!(views, [0, 18, 36, 54]);
    assert!(moment.lost_views.iter().all(|of| of.left < 0.3 && of.rows == 1), "{moment:?}");
    assert_eq!(moment.lost_views_are, Some(LostUse::Interpolated));
    assert_eq!(of_cgls.refraction_moment.unwrap().lost_views_are, Some(LostUse::ZeroWeight));
    assert!(message.contains("4 views (0 at 0 deg, 18 at 90 deg"), "{message}");
}

fn doubts(sets: &[&str]) -> Vec<String> {
    let place = workplace(SCENE);
    let sets: Vec<String> = sets.iter().map(|set| (*set).to_owned()).collect();
    let scene = Scene::load_with(place.path().join("scene.toml"), &sets).unwrap();
    let report = Check::of(&scene).run().unwrap();
    report.warnings.into_iter().filter(|text| text.contains("flat faces")).collect()
}

#[test]
fn check_names_views_along_faces_and_angles_that_avoid_them() {
    let found = doubts(&[]);
    assert_eq!(found.len(), 1);
    for words in [
        "of \"block\" are within 5 mrad",
        "at 0 deg, 90 deg, 180 deg, 270 deg:",
        "half a step, 2.5 deg",
        "from = \"2.5 deg\", to = \"362.5 deg\"",
    ] {
        assert!(found[0].contains(words), "{words}: {found:?}");
    }
    let half = "scan.angles={ from = \"2.5 deg\", to = \"362.5 deg\", count = 72 }";
    assert!(doubts(&[half]).is_empty());
    // Round bodies and few views have none.
    let round = "object.block.shape={ cylinder = { radius = \"0.5 mm\", height = \"1 mm\" } }";
    assert!(doubts(&[round]).is_empty());
    assert!(doubts(&["scan.angles=[\"0 deg\", \"90 deg\"]"]).is_empty());
    // A cylinder that lies across the axis has flat ends, and straight sides.
    let lying = "object.block.rotate=[{ axis = [1, 0, 0], angle = \"90 deg\" }]";
    let found = doubts(&[round, lying]);
    assert!(found[0].contains("at 0 deg, 90 deg, 180 deg, 270 deg:"), "{found:?}");
    // Two of 72 faces have 3 % of the refraction.
    let prism =
        "object.block.shape={ prism = { radius = \"0.6 mm\", height = \"1 mm\", sides = 72 } }";
    assert!(doubts(&[prism]).is_empty());
}
