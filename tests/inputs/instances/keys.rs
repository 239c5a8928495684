//! Keys of instances: ranges, the resolved scene, hashes of files of positions.

use super::*;
use beamlet::scene::{Instances, PackingAmount, PackingKind, PackingRegion};
use std::collections::BTreeMap;

#[test]
fn packings_are_read_with_their_defaults() {
    let region = "cylinder = { radius = \"1.25 mm\", height = \"1 mm\" }";
    let text = packing("parallel-fibres", region, "fill = 0.32");
    let scene = scene_in(Path::new("."), &fibre("2.5 um", "1 mm"), &text).unwrap();
    let Some(Instances::Packing(found)) = &scene.objects[0].instances else { panic!("no packing") };
    assert_eq!(found.kind, PackingKind::ParallelFibres);
    assert_eq!(found.region, PackingRegion::Cylinder { radius: 1.25e-3, height: 1e-3 });
    assert_eq!(found.amount, PackingAmount::Fill(0.32));
    assert!(found.gap.abs() <= 0.0 && found.diameter_spread.abs() <= 0.0);
    assert_eq!(found.seed, 1);
}

#[test]
fn overrides_reach_into_a_packing() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("scene.toml");
    let cube = "box = { size = [\"1 mm\", \"1 mm\", \"1 mm\"] }";
    let scene = scene_in(Path::new("."), &sphere("10 um"), &packing("spheres", cube, "fill = 0.1"));
    let text = scene.unwrap().to_toml(directory.path(), &BTreeMap::new(), &[]).unwrap();
    std::fs::write(&path, text).unwrap();
    let sets =
        ["object.many.instances.fill=0.2".to_owned(), "object[0].instances.seed=9".to_owned()];
    let scene = Scene::load_with(&path, &sets).unwrap();
    let Some(Instances::Packing(found)) = &scene.objects[0].instances else { panic!("no packing") };
    assert_eq!((found.amount, found.seed), (PackingAmount::Fill(0.2), 9));
}

#[test]
fn resolved_instances_read_back_equal() {
    let spread = "count = 7, diameter_spread = 0.1, gap = \"0.1 um\", seed = 18446744073709551615";
    let regions = [
        "box = { size = [\"1 mm\", \"2 mm\", \"0.3 mm\"] }",
        "cylinder = { radius = \"1.25 mm\", height = \"1 mm\" }",
        "sphere = { radius = \"1 mm\" }",
    ];
    let ball = sphere("10 um");
    let packings = regions.map(|region| (ball.clone(), packing("spheres", region, spread)));
    let fibres = ["parallel-fibres", "random-fibres"]
        .map(|kind| (fibre("1 um", "0.1 mm"), packing(kind, regions[2], "fill = 0.01")));
    let file = (ball.clone(), "\"a b.csv\"".to_owned());
    for (shape, text) in packings.into_iter().chain(fibres).chain([file]) {
        let scene = scene_in(Path::new("here"), &shape, &text).unwrap();
        let resolved = scene.to_toml("here", &BTreeMap::new(), &[]).unwrap();
        assert_eq!(Scene::from_toml(&resolved, "here").unwrap(), scene, "{resolved}");
    }
}

#[test]
fn files_of_positions_are_hashed_and_compared() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("at.csv");
    std::fs::write(&path, "x_mm,y_mm,z_mm\n1,2,3\n").unwrap();
    let scene = scene_in(directory.path(), &sphere("1 mm"), "\"at.csv\"").unwrap();
    assert_eq!(scene.referenced_files(), [Path::new("at.csv")]);
    assert!(scene.input_files().contains(&path));
    let hashed = scene.with_file_hashes().unwrap();
    let elsewhere = directory.path().join("run");
    let resolved = hashed.to_toml(&elsewhere, &BTreeMap::new(), &[]).unwrap();
    let hashed = Scene::from_toml(&resolved, &elsewhere).unwrap();
    assert_eq!(transforms(&hashed, &hashed.objects[0]).unwrap().len(), 1);
    assert!(hashed.changed_files().is_empty());
    std::fs::write(&path, "x_mm,y_mm,z_mm\n1,2,3.5\n").unwrap();
    let error = transforms(&hashed, &hashed.objects[0]).unwrap_err().to_string();
    assert!(error.contains("at.csv: is not the file that the scene was made with"), "{error}");
    assert_eq!(hashed.changed_files().len(), 1);
    assert!(hashed.with_file_hashes().is_err());
}

#[test]
fn instances_are_loaded_where_the_file_says() {
    let directory = tempfile::tempdir().unwrap();
    std::fs::write(directory.path().join("at.csv"), "x_mm,y_mm,z_mm,scale\n1,2,3,1\n-4,0,1,0.5\n")
        .unwrap();
    let scene = scene_in(directory.path(), &sphere("1 mm"), "\"at.csv\"").unwrap();
    let sample = beamlet::geometry::load(&scene).unwrap();
    let object = &sample.objects[0];
    assert_eq!(object.instances, 2);
    assert_eq!(sample.components.len(), 2);
    // A faceted sphere has its volume; corners lie up to 1 % outside of it at 64 sides.
    let volume = 4.0 / 3.0 * std::f64::consts::PI * 1e-9 * (1.0 + 0.125);
    assert!((object.volume / volume - 1.0).abs() < 1e-6, "{}", object.volume);
    let box_of = [[-4.5e-3, -0.5e-3, 0.5e-3], [2e-3, 3e-3, 4e-3]];
    for (found, want) in object.bounds.as_flattened().iter().zip(box_of.as_flattened()) {
        assert!((found - want).abs() < 1e-5, "{found} for {want}");
    }
}
