//! Overrides, the resolved scene that a run records, and text that is no scene at all.

use std::collections::BTreeMap;
use std::path::Path;

use crate::paper::{PAPER, load, parts, with_sets};
use beamlet::scene::{Beam, MaskBody, MaterialSpec, Mesh, Scene, ShapeOrMesh};
use proptest::prelude::*;

#[test]
fn overrides_change_and_add_keys() {
    let scene = with_sets(&[
        "source.energy=40keV",
        "detector.distance = \"2 m\"",
        "detector.pixels=[64, 32]",
        "detector.pixels[1]=16",
        "object.rod.material=gold",
        "object[1].scale=2",
        "sampling.seed=18446744073709551615",
        "sample_mask.offset=1 um",
        "detector_mask.transmission=0.25",
        "materials.resin={ formula = \"C3H4O2\", density = \"1.1 g/cm3\" }",
        "materials.\"my plastic\".table=resin.csv",
        "object[1].mesh=ball.stl",
        "object[1].unit=um",
    ])
    .unwrap();
    assert_eq!(scene.source.beam, Beam::Energy(40.0));
    assert_eq!(scene.detector.distance, 2.0);
    assert_eq!(scene.detector.pixels, [64, 16]);
    assert_eq!(scene.objects[0].material, "gold");
    assert_eq!(scene.objects[1].placement.scale, 2.0);
    assert_eq!(scene.sampling.seed, u64::MAX);
    assert_eq!(scene.sample_mask.as_ref().unwrap().offset, 1e-6);
    let sheet = MaskBody::Sheet { transmission: 0.25 };
    assert_eq!(scene.detector_mask.as_ref().unwrap().body, sheet);
    assert_eq!(scene.detector_mask.as_ref().unwrap().distance, 2.0);
    assert!(scene.materials.contains_key("resin"));
    assert!(matches!(scene.materials["my plastic"], MaterialSpec::Table { .. }));
    assert!(matches!(scene.objects[1].geometry, ShapeOrMesh::Mesh(Mesh::File { .. })));
}

fn resolved(scene: &Scene, directory: &Path) -> String {
    let hashes = BTreeMap::from([("rod".to_owned(), "0123456789abcdef".repeat(4))]);
    scene.to_toml(directory, &hashes, &["source.energy=\"40 keV\"\n".to_owned()]).unwrap()
}

#[test]
fn resolved_scene_loads_back_equal_with_its_hash() {
    let mut scene = load(PAPER).unwrap();
    scene.sampling.seed = u64::MAX;
    scene.scan.mask_offsets[3] += 1e-9;
    let text = resolved(&scene, Path::new("somewhere"));
    assert!(text.contains("# --set source.energy=\"40 keV\""), "{text}");
    assert!(text.contains("{ from = \"0 deg\", to = \"360 deg\", count = 360 }"), "{text}");
    scene.objects[0].sha256 = Some("0123456789abcdef".repeat(4));
    assert_eq!(load(&text).unwrap(), scene);
    // Resolving the resolved scene changes nothing.
    let again = scene.to_toml("somewhere", &BTreeMap::new(), &[]).unwrap();
    assert_eq!(load(&again).unwrap(), scene);
}

#[test]
fn resolved_scene_elsewhere_still_finds_its_files() {
    let scene = load(PAPER).unwrap();
    let moved = Scene::from_toml(&resolved(&scene, Path::new("run")), "run").unwrap();
    let path = |scene: &Scene| match &scene.objects[0].geometry {
        ShapeOrMesh::Mesh(Mesh::File { path, .. }) => {
            std::path::absolute(scene.resolve(path)).unwrap()
        }
        _ => panic!("not a mesh"),
    };
    assert_eq!(path(&moved), path(&scene));
}

#[test]
fn mesh_arrays_are_documented_and_not_loadable() {
    let mut scene = load(PAPER).unwrap();
    let mesh = Mesh::Arrays { vertices: vec![[0.0; 3]; 4], triangles: vec![[0, 1, 2]; 4] };
    scene.objects[0].geometry = ShapeOrMesh::Mesh(mesh);
    scene.validate().unwrap();
    let text = resolved(&scene, Path::new("somewhere"));
    assert!(text.contains("# mesh given as arrays: 4 vertices, 4 triangles"), "{text}");
    assert_eq!(parts(load(&text)).1, "object[0].mesh");
}

proptest! {
    #[test]
    fn random_overrides_never_panic(set in "\\PC*") {
        let _ = with_sets(&[&set]);
    }

    #[test]
    fn scenes_round_trip_to_the_bit(
        values in prop::collection::vec(1e-9..1e-3_f64, 8),
        angles in prop::collection::vec(-10.0..10.0_f64, 1..6),
    ) {
        let mut scene = load(PAPER).unwrap();
        scene.source.spot = [values[0], values[1]].into();
        scene.source.beam = Beam::Energy(values[2] * 1e6);
        scene.detector.pitch = [values[3], values[4]];
        scene.scan.mask_offsets = values.clone();
        scene.scan.angles = angles.clone();
        scene.objects[0].placement.rotate = vec![([values[5], -values[6], 1.0], angles[0])];
        scene.objects[1].placement.position = [values[5], -values[6], values[7]];
        let text = scene.to_toml("somewhere", &BTreeMap::new(), &[]).unwrap();
        prop_assert_eq!(load(&text).unwrap(), scene);
    }
}
