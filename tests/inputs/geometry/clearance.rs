//! Does the sample clear the masks in every view, and does it fit the field of view.

use std::f64::consts::FRAC_PI_4;

use beamlet::geometry::{BeamExtent, check_clearance, load, swept};
use beamlet::scene::{MaskBody, Object, Scene, Shape};

use super::set_up::{at, cube, scene, shape};

fn check(scene: &Scene) -> Result<(), String> {
    check_clearance(scene, &load(scene).unwrap()).map_err(|error| error.to_string())
}

fn plate(length: f64) -> Object {
    shape("plate", Shape::Box { size: [length, 1e-3, 1e-3] })
}

#[test]
fn sample_between_the_masks_is_clear() {
    check(&scene(vec![cube("a", 8e-3)])).unwrap();
    check(&scene(Vec::new())).unwrap();
}

#[test]
fn thickness_of_the_bars_counts() {
    // The mask's centre is 10 mm before the rotation centre, its back 9.8875 mm.
    let mut thick = scene(vec![cube("a", 19.8e-3)]);
    assert!(check(&thick).unwrap_err().contains("sample mask"));
    thick.sample_mask.as_mut().unwrap().body = MaskBody::Sheet { transmission: 0.0 };
    check(&thick).unwrap();
}

#[test]
fn missing_masks_leave_source_and_detector_as_limits() {
    let mut bare = scene(vec![at(cube("a", 10e-3), [0.0, -1.0, 0.0])]);
    assert!(check(&bare).is_err());
    bare.sample_mask = None;
    check(&bare).unwrap();
    bare.objects[0].placement.position[1] = -1.206;
    assert!(check(&bare).unwrap_err().contains("the source"));
    bare.objects[0].placement.position[1] = 0.584_92;
    assert!(check(&bare).unwrap_err().contains("front of the detector mask"));
    bare.detector_mask = None;
    check(&bare).unwrap();
    bare.objects[0].placement.position[1] = 0.586;
    assert!(check(&bare).unwrap_err().contains("the detector"));
}

#[test]
fn positive_angle_turns_the_beam_and_not_the_sample() {
    // At +90 deg the source stands at +x: what is at +x is nearer the source.
    let mut scene = scene(vec![at(cube("a", 1e-3), [5e-3, 0.0, 0.0])]);
    scene.scan.angles = vec![2.0 * FRAC_PI_4];
    let sample = load(&scene).unwrap();
    let extents: Vec<BeamExtent> = swept(&scene, &sample).extents(0).collect();
    assert!((extents[0].y[0] + 5.5e-3).abs() < 1e-9, "{extents:?}");
    assert!((extents[0].y[1] + 4.5e-3).abs() < 1e-9, "{extents:?}");
    assert!((extents[0].x[1] - 0.5e-3).abs() < 1e-9, "{extents:?}");
}

#[test]
fn sample_outside_the_field_of_view_is_told_by_axis() {
    let warned = |object: Object, angles: &[f64]| {
        let mut scene = scene(vec![object]);
        scene.scan.angles = angles.to_vec();
        swept(&scene, &load(&scene).unwrap()).fov_warnings(&scene)
    };
    assert!(warned(cube("a", 8e-3), &[0.0]).is_empty());
    let wide = warned(plate(14e-3), &[0.0, FRAC_PI_4]);
    assert_eq!(wide.len(), 1);
    assert!(wide[0].contains("in x at angle 0.000 deg"), "{wide:?}");
    assert!(warned(plate(14e-3), &[FRAC_PI_4]).is_empty());
    // One that passes through the field along the slits is as it should be, unless it is many times
    // as long.
    let tall = |height| shape("tall", Shape::Box { size: [1e-3, 1e-3, height] });
    assert!(warned(tall(14e-3), &[0.0]).is_empty());
    let mut above = tall(14e-3);
    above.placement.position[2] = 1e-3;
    assert_eq!(warned(above, &[0.0]).len(), 1);
    let tall = warned(tall(80e-3), &[0.0]);
    assert!(
        tall.len() == 1 && tall[0].contains("\"tall\"") && tall[0].contains("in z"),
        "{tall:?}"
    );
}
