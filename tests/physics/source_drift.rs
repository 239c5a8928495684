//! A displaced source against a spot of two parts.

#![allow(clippy::unwrap_used, reason = "tests")]

use crate::support::{Worst, amount, backends, engine, everything, sample};
use beamlet::Backend;
use beamlet::scene::{Exposure, ScanErrors, Scene, Scheme};

const OBJECTS: &str = r#"
[[object]]
name = "ball"
material = "carbon"
shape = { sphere = { radius = "0.3 mm" } }
position = ["0.1 mm", "0.2 mm", "0.15 mm"]
center = true
[[object]]
name = "rod"
material = "carbon"
shape = { cylinder = { radius = "0.2 mm", height = "5 mm" } }
position = ["-0.6 mm", "0 mm", "0 mm"]
"#;

const BOTH: &str = r#"
[sample_mask]
distance = "1.0 m"
transmission = 0.0
projected_aperture = "30 um"
[detector_mask]
distance = "1.8 m"
transmission = 0.0
projected_aperture = "30 um"
"#;

/// A scene with this spot and these masks, angles and errors of its views.
fn scene(spot: &str, masks: &str, offsets: &str, [angles, errors]: [&str; 2]) -> Scene {
    let rows = amount(3, 8);
    let text = format!(
        "[source]\ndistance = \"1.2 m\"\nspot = {spot}\nenergy = \"30 keV\"\n\
         [detector]\ndistance = \"1.8 m\"\npixels = [16, {rows}]\npitch = \"150 um\"\n{masks}\n\
         [sampling]\ntolerance = 5e-5\nangle_tolerance = \"10 nrad\"\n\
         [materials.carbon]\nformula = \"C\"\ndensity = \"2.0 g/cm3\"\n\
         [scan]\nmask_offsets = {offsets}\nangles = {angles}\n{errors}\n{OBJECTS}"
    );
    Scene::from_toml(&text, ".").unwrap()
}

/// Views of the scenes: two, and the second one alone.
const TWO: &str = "[\"0 deg\", \"40 deg\"]";
const SECOND: &str = "[\"40 deg\"]";

/// The light of a spot is the sum over its parts, and its centroid lies on the axis: three quarters of a
/// source displaced by s and a quarter of one displaced by -3 s are a spot of two such parts.
#[test]
fn displaced_sources_sum_to_a_spot_of_two_parts() {
    let spot = "[\"30 um\", \"26 um\"]";
    let parts = "{ gaussians = [{ weight = 3, fwhm = [\"30 um\", \"26 um\"], offset = [\"-7 um\", \"12 um\"] }, \
                 { weight = 1, fwhm = [\"30 um\", \"26 um\"], offset = [\"21 um\", \"-36 um\"] }] }";
    // The source is displaced in the second view.
    let near = "errors = { source_x = [\"0 um\", \"-7 um\"], source_z = [\"0 um\", \"12 um\"] }";
    let far = "errors = { source_x = [\"21 um\"], source_z = [\"-36 um\"] }";
    let cases = vec![
        ("both masks", BOTH, "[\"-9 um\", \"14 um\"]", vec![Backend::Bvh]),
        (
            "tracking",
            BOTH.split_once("[detector_mask]").unwrap().0,
            "[\"3 um\"]",
            vec![Backend::Bvh],
        ),
        ("radiograph", "", "[\"0 um\"]", amount(vec![Backend::Bvh], backends())),
    ];
    let mut rest = Worst::new("source at rest", 1e-6);
    for (name, masks, offsets, on) in sample(cases, 2) {
        for backend in on {
            let engine = engine(backend);
            let simulated = |spot: &str, views: [&str; 2]| {
                let mut scene = scene(spot, masks, offsets, views);
                // A row through the ball 0.15 mm off its middle: its edges slant along x and z.
                if !everything() {
                    scene.detector.pixels = [8, 1];
                    scene.objects.truncate(1);
                }
                engine.simulate(&scene).unwrap().sample
            };
            let near = simulated(spot, [TWO, near]);
            let far = simulated(spot, [SECOND, far]);
            let whole = simulated(parts, [SECOND, ""]);
            // Behind a mask.
            let still = (!masks.is_empty()).then(|| simulated(spot, [TWO, ""]));
            // Each of three runs errs by the tolerance of 5e-5 at most, and the shear of 3e-5 rad moves
            // the front and back of the ball by 9 nm beside one another.
            let mut worst = Worst::new("sum of displaced sources", 1.5e-4);
            let mut moved = 0.0_f32;
            for ((view, step, row, column), near) in near.indexed_iter() {
                let at = (view, step, row, column);
                if view == 0 {
                    if let Some(still) = &still {
                        rest.take(f64::from(near - still[at]), || format!("{name}, {at:?}"));
                    }
                } else {
                    let alone = (0, step, row, column);
                    let sum = 0.75 * near + 0.25 * far[alone];
                    worst.take(f64::from(sum - whole[alone]), || {
                        format!("{name}, {backend:?}, {at:?}")
                    });
                    // The spot of both parts against one at rest, or the parts against each other.
                    let by = still.as_ref().map_or(near - far[alone], |it| whole[alone] - it[at]);
                    moved = moved.max(by.abs());
                }
            }
            worst.holds();
            assert!(moved > 5e-4, "{name}: {moved}");
        }
    }
    rest.holds();
}

/// Masks of rectangles in place of the slits of `BOTH`.
fn rectangles() -> String {
    let of = |period: &str, height: &str| {
        format!(
            "shape = \"rectangle\"\nperiod_z = \"{period}\"\naperture_z = \"{height}\"\nprojected_aperture"
        )
    };
    let (sample, detector) = BOTH.split_once("[detector_mask]").unwrap();
    let sample = sample.replace("projected_aperture", &of("110 um", "24 um"));
    let detector = detector.replace("projected_aperture", &of("198 um", "50 um"));
    format!("{sample}[detector_mask]{detector}")
}

/// Without a sample the curve at f is that at f - s (M - 1)/M: along x, and of rectangles along z, in cells of the host
/// and of the device and in random rays.
#[test]
fn a_displaced_source_moves_curves_by_m_less_one_over_m() {
    // M = 1.8.
    const SHARE: f64 = 0.8 / 1.8;
    let rectangles = rectangles();
    let scene_at = |masks: &str, moved: [f64; 2], source: Option<[f64; 2]>| {
        let offset = |k: i32| {
            let [x, z] = moved.map(|by| 8.0 * f64::from(k) - SHARE * by);
            match masks.contains("rectangle") {
                true => format!("[\"{x} um\", \"{z} um\"]"),
                false => format!("\"{x} um\""),
            }
        };
        let offsets = (-3..=3).map(offset).collect::<Vec<_>>().join(", ");
        let errors = source.map_or_else(String::new, |[x, z]| {
            let [x, z] = [x, z].map(|by| format!("[\"{by} um\", \"{by} um\"]"));
            format!("errors = {{ source_x = {x}, source_z = {z} }}")
        });
        let mut scene = scene("\"30 um\"", masks, &format!("[{offsets}]"), [TWO, &errors]);
        scene.objects.clear();
        scene
    };
    let as_it_is: fn(&mut Scene) = |_| ();
    let random: fn(&mut Scene) = |scene| scene.sampling.scheme = Scheme::Random;
    let cases = [
        ("slits", BOTH, [25.0, 0.0], as_it_is),
        ("rectangles", &rectangles, [-25.0, 40.0], as_it_is),
        ("rectangles in random rays", &rectangles, [0.0, -40.0], random),
    ];
    for (name, masks, by, change) in cases {
        let backend = backends()[0];
        let simulated = |moved: [f64; 2], source: Option<[f64; 2]>| {
            let mut scene = scene_at(masks, moved, source);
            change(&mut scene);
            engine(backend).simulate(&scene).unwrap()
        };
        let drifted = simulated([0.0; 2], Some(by));
        let moved = simulated(by, None);
        let mut worst = Worst::new("curve of a displaced source", 1e-6);
        let mut most = 0.0_f32;
        for ((view, step, row, column), light) in drifted.sample.indexed_iter() {
            let expected = moved.sample[[view, step, row, column]];
            worst.take(f64::from(light - expected), || {
                format!("{name}: {view} {step} {row} {column}")
            });
            most = most.max((drifted.flat[[step, row, column]] - light).abs());
        }
        worst.holds();
        assert!(most > 0.01, "{name}: {most}");
    }
}

/// Drawn errors of mask offsets move rectangles along z, too, where their offsets have z: frames are those at the
/// offsets as they are.
#[test]
fn drawn_errors_of_offsets_move_rectangles_along_z() {
    let offsets = "[[\"-8 um\", \"-20 um\"], [\"8 um\", \"20 um\"]]";
    let errors = "errors = { offset_sigma = \"4 um\", seed = 3 }";
    let mut drawn = scene("\"30 um\"", &rectangles(), offsets, [SECOND, errors]);
    drawn.objects.clear();
    let [x, z] = drawn.applied_offsets(Exposure::Sample(0));
    let moved = z.iter().zip([-20e-6, 20e-6]).all(|(z, planned)| (z - planned).abs() > 1e-7);
    assert!(moved, "{z:?}");
    let mut applied = drawn.clone();
    applied.scan.errors = ScanErrors::default();
    (applied.scan.mask_offsets, applied.scan.mask_offsets_z) = (x, z);
    let [drawn, applied] =
        [drawn, applied].map(|scene| engine(Backend::Bvh).simulate(&scene).unwrap());
    assert_eq!(drawn.sample, applied.sample);
    assert_ne!(drawn.flat, applied.flat);
}
