//! Motions of the sample: what it sweeps, and what is refused.

use super::set_up::{Arrays, at, cube, scene, shape};
use beamlet::geometry::{BeamExtent, check_clearance, load, swept};
use beamlet::scene::{Instances, Motion, Object, Scene, Shape};
use std::collections::BTreeMap;
use std::fmt::Write;

const AXIS: [f64; 3] = [1.0, -2.0, 0.5];
const BY: [f64; 3] = [0.3e-3, -0.4e-3, 0.2e-3];

fn tilt() -> Motion {
    Motion::about(AXIS, 0.7).unwrap().then(&Motion::translation(BY))
}

fn extents(scene: &Scene, view: usize) -> Vec<BeamExtent> {
    swept(scene, &load(scene).unwrap()).extents(view).collect()
}

/// Objects of every kind: a mesh, an exact shape, and many small ones.
fn objects(places: &std::path::Path) -> Vec<Object> {
    let mut text = String::from("x_mm,y_mm,z_mm\n");
    for k in 0..60 {
        writeln!(text, "{},{},{}", k % 5 - 2, k / 5 % 4 - 2, k / 20 - 1).unwrap();
    }
    std::fs::write(places, text).unwrap();
    let rod = Shape::Cylinder { radius: 0.05e-3, height: 0.6e-3, sides: Some(16) };
    let mut many = at(shape("many", rod), [0.0, 1e-3, 3e-3]);
    many.instances = Some(Instances::File(places.to_owned()));
    let cone = Shape::Cone { radius: 1e-3, top_radius: 0.0, height: 3e-3, sides: Some(64) };
    vec![at(Arrays::cube(1e-3).object("cube"), [3e-3, 0.0, 1e-3]), shape("cone", cone), many]
}

#[test]
fn extents_of_moved_and_placed_samples_agree_to_a_nanometre() {
    let directory = tempfile::tempdir().unwrap();
    let rest = scene(objects(&directory.path().join("places.csv")));
    let (mut moved, mut placed) = (rest.clone(), rest);
    moved.scan.angles = vec![0.0, 1.1];
    moved.scan.motions = vec![Motion::IDENTITY, tilt()];
    placed.scan.angles = vec![0.0, 1.1];
    // At rest the other outlines say the same.
    let pair = [(extents(&moved, 0), extents(&placed, 0))];
    for object in &mut placed.objects {
        object.placement.rotate.push((AXIS, 0.7));
        object.placement.position = tilt().point(object.placement.position);
    }
    for (got, want) in pair.into_iter().chain([(extents(&moved, 1), extents(&placed, 1))]) {
        assert_eq!(got.len(), 3);
        for (number, (a, b)) in got.iter().zip(&want).enumerate() {
            let near =
                |a: [f64; 2], b: [f64; 2], by| (0..2).all(|end| (a[end] - b[end]).abs() < by);
            // Meshes hold f32: a quarter of a nanometre.
            assert!(near(a.x, b.x, 1e-9) && near(a.y, b.y, 1e-9), "{a:?} {b:?}");
            // Upright outlines take z of instances from their turned boxes, which are larger.
            let z = if number == 2 { 2e-5 } else { 1e-9 };
            assert!(near(a.z, b.z, z), "{a:?} {b:?}");
            assert!(a.z[0] > b.z[0] - 1e-9 && a.z[1] < b.z[1] + 1e-9, "{a:?} {b:?}");
        }
    }
}

#[test]
fn translation_moves_upright_outlines() {
    let mut rest = scene(vec![cube("a", 2e-3)]);
    rest.scan.motions = vec![Motion::translation(BY)];
    let [extent] = extents(&rest, 0)[..] else { panic!("one object") };
    for (axis, [low, high]) in [extent.x, extent.y, extent.z].into_iter().enumerate() {
        assert!((low + 1e-3 - BY[axis]).abs() < 1e-12 && (high - 1e-3 - BY[axis]).abs() < 1e-12);
    }
}

#[test]
fn object_that_a_motion_takes_into_the_mask_is_refused_with_its_view() {
    let mut rod = scene(vec![shape("rod", Shape::Box { size: [1e-3, 1e-3, 24e-3] })]);
    rod.scan.angles = vec![0.0; 2];
    check_clearance(&rod, &load(&rod).unwrap()).unwrap();
    let tipped = Motion::about([1.0, 0.0, 0.0], std::f64::consts::FRAC_PI_2).unwrap();
    rod.scan.motions = vec![Motion::IDENTITY, tipped];
    let text = check_clearance(&rod, &load(&rod).unwrap()).unwrap_err().to_string();
    for word in ["\"rod\"", "angle 0.000 deg, moved as in view 1", "1.198000 m", "sample mask"] {
        assert!(text.contains(word), "{word}: {text}");
    }
}

#[test]
fn motions_are_one_for_each_view_and_finite() {
    let mut scene = scene(vec![cube("a", 1e-3)]);
    scene.scan.angles = vec![0.0, 1.0];
    scene.scan.motions = vec![tilt()];
    let text = scene.validate().unwrap_err().to_string();
    assert!(text.contains("1 motions") && text.contains("2, one for each angle"), "{text}");
    scene.scan.motions = vec![tilt(), Motion::translation([f64::NAN, 0.0, 0.0])];
    let text = scene.validate().unwrap_err().to_string();
    assert!(text.contains("scan.motions[1]") && text.contains("NaN"), "{text}");
    scene.scan.motions[1] = Motion::IDENTITY;
    scene.validate().unwrap();
}

#[test]
fn resolved_scene_has_every_bit_of_its_motions() {
    let mut scene = scene(vec![shape("a", Shape::Box { size: [1e-3; 3] })]);
    scene.scan.angles = vec![0.3, 1.0];
    scene.scan.motions = vec![Motion::IDENTITY, tilt()];
    let text = scene.to_toml(".", &BTreeMap::new(), &[]).unwrap();
    assert_eq!(Scene::from_toml(&text, ".").unwrap().scan, scene.scan);
}

#[test]
fn offsets_of_views_are_lists_for_each_view() {
    let mut scene = scene(vec![shape("a", Shape::Box { size: [1e-3; 3] })]);
    scene.scan.angles = vec![0.0, 1.0];
    scene.scan.mask_offsets = vec![0.0, 1e-6];
    let refusal = |scene: &Scene| scene.validate().unwrap_err().to_string();
    scene.scan.view_offsets = vec![vec![0.0, 1e-6]];
    assert!(refusal(&scene).contains("1 lists"), "{}", refusal(&scene));
    scene.scan.view_offsets = vec![vec![0.0, 1e-6], vec![0.0]];
    assert!(refusal(&scene).contains("scan.view_offsets[1]"), "{}", refusal(&scene));
    scene.scan.view_offsets[1] = vec![0.0, f64::INFINITY];
    assert!(refusal(&scene).contains("inf"), "{}", refusal(&scene));
    scene.scan.view_offsets[1] = vec![0.0, 1e6];
    assert!(refusal(&scene).contains("periods"), "{}", refusal(&scene));
    scene.scan.view_offsets[1] = vec![0.0, 1e-6];
    scene.validate().unwrap();
    scene.to_toml(".", &BTreeMap::new(), &[]).unwrap();
    scene.scan.view_offsets[1] = vec![0.0, 2e-6];
    scene.validate().unwrap();
    let text = scene.to_toml(".", &BTreeMap::new(), &[]).unwrap();
    assert_eq!(Scene::from_toml(&text, ".").unwrap().scan, scene.scan);
}
