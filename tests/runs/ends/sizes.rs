//! Detectors, samples and meshes as large and as small as may be.

use super::{code_and_stderr, is_balanced, is_refused, npy, workplace};
use crate::support::{amount, sample};
use std::fs;

#[test]
fn detectors_have_up_to_65536_pixels_a_side() {
    let place = workplace();
    for pixels in sample(vec!["[65536,1]", "[65536,2]", "[1,65536]"], 2) {
        let step = "scan.mask_offsets=[\"0 um\"]";
        is_balanced(&place, &[&format!("detector.pixels={pixels}"), step]);
    }
    for pixels in ["[65537,1]", "[1,65537]"] {
        let set = format!("detector.pixels={pixels}");
        is_refused(&place, &[&set], &["detector.pixels", "65537", "from 1 to 65536"]);
    }
}

#[test]
fn four_gigapixels_are_told_of_and_do_not_fit_in_little() {
    let place = workplace();
    let set = "detector.pixels=[65536,65536]";
    let check = ["check", "scene.toml", "--json", "--set", set, "--no-estimate"];
    // With an estimate where `BEAMLET_ALL` is set.
    let output = place.beamlet(&check[..amount(6, 5)]);
    let told: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    // Flat and one view of five steps.
    assert_eq!(told["work"]["output_bytes"], 2 * 5 * 4 * (1_u64 << 32), "{told}");
    let limited = ["--memory-limit", "1 GiB", "--set", set];
    let words = [&["simulate", "scene.toml", "-o", "run", "-q"], &limited[..]].concat();
    let (code, message) = code_and_stderr(&place.beamlet(&words));
    assert!(code == Some(1) && message.contains("MiB are available"), "{code:?}: {message}");
    assert!(!place.path("run").exists());
}

#[test]
fn a_sample_comes_as_near_to_a_mask_as_it_likes_but_does_not_touch_it() {
    let place = workplace();
    let set = |depth: f64| {
        format!("object.part.shape={{box={{size=[\"0.3 mm\",\"{depth} mm\",\"0.4 mm\"]}}}}")
    };
    // From the back of the sample mask to the rotation centre it is 9.8875 mm.
    for hair in sample(vec![1e-3, 1e-6, 1e-10], 2) {
        is_balanced(&place, &[&set(19.775 - hair)]);
        is_refused(&place, &[&set(19.775 + hair)], &["part", "back of the sample mask"]);
    }
    is_refused(&place, &[&set(19.775)], &["part", "back of the sample mask"]);
    // A corner that comes by while it turns.
    let turning = ["scan.angles=[\"0 deg\",\"0.5 deg\"]", &set(19.775 - 1e-6)];
    is_refused(&place, &turning, &["part", "at angle 0.500 deg", "back of the sample mask"]);
}

/// A set-up of 150 m, with pixels of 150 mm.
const HUGE: [&str; 6] = [
    "source.distance=100 m",
    "detector.distance=150 m",
    "detector.pitch=150 mm",
    "sample_mask.distance=80 m",
    "sample_mask.projected_aperture=30 mm",
    "detector_mask.projected_aperture=30 mm",
];

#[test]
fn samples_of_a_nanometre_and_of_ten_metres_are_in_balance_or_no_bodies() {
    let place = workplace();
    for radius in sample(vec!["1e-30 m", "1e-3 nm", "0.5 nm", "1 um"], 3) {
        let set = format!("object.part.shape={{sphere={{radius=\"{radius}\",sides=16}}}}");
        is_balanced(&place, &[&set]);
    }
    let huge = |shape: &str| {
        let set = format!("object.part.shape={shape}");
        HUGE.iter().map(|set| (*set).to_owned()).chain([set]).collect::<Vec<_>>()
    };
    let box_of = |x: &str, y: &str, z: &str| format!("{{box={{size=[\"{x}\",\"{y}\",\"{z}\"]}}}}");
    let bodies = vec![
        "{sphere={radius=\"5 m\",sides=64}}".to_owned(),
        box_of("10 m", "10 m", "10 m"),
        box_of("10 m", "10 m", "1 um"),
        box_of("1 um", "10 m", "10 m"),
    ];
    for body in sample(bodies, 3) {
        let sets = huge(&body);
        is_balanced(&place, &sets.iter().map(String::as_str).collect::<Vec<_>>());
    }
    // Ten metres and a nanometre in one body is more than numbers of 32 bits tell apart.
    let thin = vec![box_of("10 m", "10 m", "1 nm"), box_of("1 nm", "10 m", "10 m")];
    for body in sample(thin, 2) {
        let sets = huge(&body);
        let sets: Vec<&str> = sets.iter().map(String::as_str).collect();
        is_refused(&place, &sets, &["part", "encloses no volume"]);
    }
}

/// A ball as OBJ, of radius 1.
fn ball() -> String {
    let (rings, around) = (8_u32, 12_u32);
    let mut text = String::from("v 0 0 -1\n");
    for ring in 1..rings {
        let polar = std::f64::consts::PI * f64::from(ring) / f64::from(rings);
        for side in 0..around {
            let angle = std::f64::consts::TAU * f64::from(side) / f64::from(around);
            let (x, y) = (polar.sin() * angle.cos(), polar.sin() * angle.sin());
            text += &format!("v {x} {y} {}\n", -polar.cos());
        }
    }
    text += "v 0 0 1\n";
    let at = |ring: u32, side: u32| 2 + (ring - 1) * around + side % around;
    let last = 2 + (rings - 1) * around;
    for side in 0..around {
        text += &format!("f 1 {} {}\n", at(1, side + 1), at(1, side));
        for ring in 1..rings - 1 {
            let [a, b] = [at(ring, side), at(ring, side + 1)];
            text += &format!("f {a} {b} {} {}\n", at(ring + 1, side + 1), at(ring + 1, side));
        }
        text += &format!("f {last} {} {}\n", at(rings - 1, side), at(rings - 1, side + 1));
    }
    text
}

#[test]
fn meshes_from_a_nanometre_to_ten_metres_keep_their_size() {
    let place = workplace();
    fs::write(place.path("ball.obj"), ball()).unwrap();
    let mesh = |unit: &str, more: &[&str]| {
        let sets = ["object.part.mesh=ball.obj".to_owned(), format!("object.part.unit={unit}")];
        let sets: Vec<String> = sets.into_iter().chain(more.iter().map(|s| (*s).into())).collect();
        is_balanced(&place, &sets.iter().map(String::as_str).collect::<Vec<_>>());
        let [flat, sample] =
            ["flat", "sample"].map(|name| npy(&place.path(&format!("run/{name}.npy"))));
        flat.iter().zip(&sample).filter(|(a, b)| (**a - **b).abs() > 0.5 * **a).count()
    };
    assert_eq!(mesh("0.5 nm", &[]), 0);
    // 10 m of water let nothing through: pi (5 m)^2 on pixels of 100 mm in the plane of the ball,
    // of which the detector has 64 x 8.
    let dark = mesh("5 m", &HUGE);
    assert_eq!(dark, 5 * 64 * 8);
    // Units beyond what numbers hold.
    for (unit, word) in [("1e-320 m", "no volume"), ("1e300 m", "1000000000 m")] {
        let sets = ["object.part.mesh=ball.obj".to_owned(), format!("object.part.unit={unit}")];
        is_refused(&place, &sets.iter().map(String::as_str).collect::<Vec<_>>(), &[word]);
    }
}
