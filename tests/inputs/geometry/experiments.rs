//! The shipped experiments load without a warning and fit their set-up.

use std::f64::consts::PI;
use std::path::Path;

use beamlet::geometry::{Sample, check_clearance, load, swept};
use beamlet::scene::{Mesh, Object, Scene, ShapeOrMesh};

use super::set_up::{close, object, scene};

fn mesh(name: &str) -> Object {
    let mesh = Mesh::file(format!("{name}.stl"), 1e-3);
    object(name, ShapeOrMesh::Mesh(mesh))
}

fn experiment(directory: &str, names: &[&str]) -> (Scene, Sample) {
    let mut scene = scene(names.iter().map(|name| mesh(name)).collect());
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    scene.directory = root.join("docs/experiments").join(directory);
    scene.scan.angles = (0..360).map(|angle| f64::from(angle).to_radians()).collect();
    let sample = load(&scene).unwrap();
    for object in &sample.objects {
        assert!(object.warnings.is_empty(), "{}: {:?}", object.name, object.warnings);
    }
    check_clearance(&scene, &sample).unwrap();
    (scene, sample)
}

#[test]
fn shipped_cylinder_has_the_volume_of_a_cylinder() {
    let (_, sample) = experiment("cylinder", &["cylinder"]);
    // The file holds f32: a quarter of a nanometre at 4 mm.
    assert!(close(sample.objects[0].volume, PI * 256e-9, 1e-7), "{}", sample.objects[0].volume);
    assert_eq!(sample.triangles.len(), 8188);
}

#[test]
fn shipped_bracket_holds_its_core_and_fits_the_field_of_view() {
    let (scene, sample) = experiment("bracket", &["bracket", "core"]);
    assert_eq!(sample.components.len(), 2);
    assert_eq!(sample.objects[1].inside, [Some(0)]);
    assert!(swept(&scene, &sample).fov_warnings(&scene).is_empty());
}
