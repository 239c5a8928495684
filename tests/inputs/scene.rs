//! Scene files: what loads, and what every error says.

use std::path::Path;

use crate::paper::{PAPER, load, parts, with_sets};
use beamlet::Error;
use beamlet::scene::{MaskBody, MaterialSpec, Mesh, RandomRays, Scene, Shape, ShapeOrMesh};

/// The paper's scene with one piece of text exchanged.
fn changed(from: &str, to: &str) -> Result<Scene, Error> {
    assert!(PAPER.contains(from), "{from}");
    load(&PAPER.replacen(from, to, 1))
}

fn close(value: f64, expected: f64) -> bool {
    (value - expected).abs() <= 1e-12 * expected.abs()
}

#[test]
fn paper_scene_resolves_with_its_defaults() {
    let scene = load(PAPER).unwrap();
    let mask = scene.sample_mask.as_ref().unwrap();
    assert!(close(mask.period, 100e-6) && close(mask.aperture, 20e-6), "{mask:?}");
    assert_eq!(mask.body, MaskBody::Bars { material: "gold".into(), thickness: 225e-6 });
    let mask = scene.detector_mask.as_ref().unwrap();
    assert!(close(mask.distance, 1.8 - 112.5e-6), "{mask:?}");
    assert_eq!(scene.detector.pitch, [150e-6; 2]);
    assert_eq!(scene.scan.mask_offsets.len(), 11);
    assert_eq!((scene.scan.mask_offsets[0], scene.scan.mask_offsets[10]), (-25e-6, 25e-6));
    assert_eq!(scene.scan.mask_offsets[5], 0.0);
    assert!(close(scene.scan.angles[359], 359_f64.to_radians()));
    assert_eq!(scene.surroundings, "vacuum");
    assert_eq!(scene.sampling.rays, RandomRays::Count(5000));
    assert_eq!(scene.materials["my plastic"], MaterialSpec::Constants { mu: 25.0, delta: 2.4e-7 });
    let ShapeOrMesh::Mesh(Mesh::File { path, unit, .. }) = &scene.objects[0].geometry else {
        panic!("not a mesh");
    };
    assert_eq!(scene.resolve(path), Path::new("somewhere/meshes/rod.stl"));
    assert_eq!(*unit, Some(1e-3));
    let sphere = Shape::Sphere { radius: 1e-3, sides: Some(64) };
    assert_eq!(scene.objects[1].geometry, ShapeOrMesh::Shape(sphere));
}

#[test]
fn derived_distances_follow_from_the_planes() {
    let scene = load(PAPER).unwrap();
    assert_eq!(scene.analyser_distance(), 1.8);
    assert_eq!(scene.cell_plane_distance(), 1.2);
    assert!(close(scene.magnification(), 1.5));
    assert!(close(scene.lever_arm(), 0.59));
    assert!(close(scene.fan_angle(), 2.0 * (64.0 * 150e-6 / 1.8_f64).atan()));
    let [width, height] = scene.field_of_view();
    assert!(close(width, 128.0 * 150e-6 * 1.21 / 1.8) && close(height, width * 0.75));
    assert_eq!(scene.mask_steps(), 11);
}

#[test]
fn analyser_away_from_the_detector_is_the_centre_plane_of_its_mask() {
    let scene = changed("[detector_mask]", "[detector_mask]\ndistance = \"1.7 m\"").unwrap();
    assert_eq!(scene.analyser_distance(), 1.7);
    assert!(close(scene.lever_arm(), 0.49));
}

#[test]
fn without_masks_the_cells_lie_at_the_rotation_centre() {
    let start = PAPER.find("[sample_mask]").unwrap();
    let end = PAPER.find("[materials.carbon]").unwrap();
    let scene = load(&format!("{}{}", &PAPER[..start], &PAPER[end..])).unwrap();
    assert_eq!(scene.cell_plane_distance(), 1.21);
    assert_eq!(scene.analyser_distance(), 1.8);
    assert_eq!(scene.scan.mask_offsets, [0.0]);
    assert_eq!(scene.scan.angles, [0.0]);
}

fn paper_json() -> String {
    let value: toml::Table = PAPER.parse().unwrap();
    serde_json::to_string_pretty(&value).unwrap()
}

#[test]
fn json_gives_the_same_scene_and_the_same_errors() {
    let text = paper_json();
    assert_eq!(Scene::from_json(&text, "somewhere").unwrap(), load(PAPER).unwrap());

    let broken = text.replace("\"energy\"", "\"enregy\"");
    let (place, key, _, allowed) = parts(Scene::from_json(&broken, "."));
    assert_eq!(key, "source.enregy");
    assert!(allowed.contains("did you mean `energy`?"), "{allowed}");
    let excerpt = place.excerpt.unwrap();
    assert!(
        excerpt.contains("\"enregy\": \"30 keV\"") && excerpt.contains("^^^^^^^^"),
        "{excerpt}"
    );

    let late = text.replace("\"1.2 m\"", "\"1.3 m\"");
    let (place, key, ..) = parts(Scene::from_json(&late, "."));
    assert_eq!(key, "sample_mask.distance");
    assert!(place.excerpt.unwrap().contains("1.3 m"));

    let twice = text.replacen('{', "{ \"source\": {},", 1);
    let (_, key, found, _) = parts(Scene::from_json(&twice, "."));
    assert_eq!((key.as_str(), found.as_str()), ("source", "the key a second time"));
}

#[test]
fn files_load_by_extension() {
    let directory = tempfile::tempdir().unwrap();
    let file = |name: &str, text: &str| {
        let path = directory.path().join(name);
        std::fs::write(&path, text).unwrap();
        path
    };
    let toml = Scene::load(file("a.toml", PAPER)).unwrap();
    assert_eq!(toml, Scene::load(file("a.JSON", &paper_json())).unwrap());
    assert_eq!(toml.directory, directory.path());
    let error = Scene::load(file("a.yaml", "")).unwrap_err().to_string();
    assert!(error.contains(".toml or .json"), "{error}");
    let error = Scene::load(directory.path().join("b.toml")).unwrap_err().to_string();
    assert!(error.contains("b.toml: cannot read the scene"), "{error}");
    let error = Scene::load(file("c.toml", "x = 1")).unwrap_err().to_string();
    assert!(error.contains("c.toml:1:1: x: found an unknown key"), "{error}");
}

#[test]
fn deep_nesting_is_an_error_and_not_a_stack_overflow() {
    for text in [
        format!("{}a = 1", "a.".repeat(100_000)),
        format!("[{}a]", "a . ".repeat(100_000)),
        format!("a = {}", "[".repeat(100_000)),
        format!("a = {{ {}a = 1 }}", "a.".repeat(100_000)),
    ] {
        assert!(load(&text).is_err());
    }
    assert!(with_sets(&[&format!("{}a=1", "a.".repeat(100_000))]).is_err());
    let text = format!("{{\"a\": {}", "[".repeat(100_000));
    assert!(Scene::from_json(&text, ".").is_err());
}

#[test]
fn overrides_of_texts_are_those_of_files() {
    let set = |text: &str| vec![text.to_owned()];
    let scene = Scene::from_toml_with(PAPER, ".", &set("detector.pixels=[7, 3]")).expect("a scene");
    assert_eq!(scene.detector.pixels, [7, 3]);
    let json = r#"{ "source": { "distance": "1 m", "spot": "0 um", "energy": "30 keV" },
        "detector": { "distance": "2 m", "pixels": [4, 4], "pitch": "0.1 mm" } }"#;
    let scene = Scene::from_json_with(json, ".", &set("source.energy=20 keV")).expect("a scene");
    assert_eq!(scene.source.beam.single_energy(), Some(20.0));
    let wrong = Scene::from_json_with(json, ".", &set("source.enery=20 keV")).unwrap_err();
    assert!(matches!(&wrong, Error::Scene { key, .. } if key == "source.enery"), "{wrong}");
}
