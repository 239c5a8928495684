//! Scene files: what loads, and what every error says.

#![allow(clippy::unwrap_used, reason = "clippy exempts tests, but not what they call")]
#![allow(clippy::float_cmp, reason = "quantities read to the nearest double, without slack")]

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

#[test]
fn unknown_key_shows_place_caret_and_suggestion() {
    let error = changed("energy = \"30", "enregy = \"30").unwrap_err().to_string();
    assert_eq!(
        error,
        "scene:5:1: source.enregy: found an unknown key; allowed: distance, spot, energy, \
         spectrum (did you mean `energy`?)\n  |\n5 | enregy = \"30 keV\"\n  | ^^^^^^"
    );
    let (_, key, _, allowed) = parts(changed("[detector]", "[detectr]"));
    assert_eq!(key, "detectr");
    assert!(allowed.contains("did you mean `detector`?"), "{allowed}");
    let (place, key, ..) = parts(changed("radius = \"1 mm\"", "radios = \"1 mm\""));
    assert_eq!(key, "object[1].shape.sphere.radios");
    assert_eq!(place.line_column, Some((43, 22)));
}

#[test]
fn number_without_a_unit_lists_the_units() {
    for bare in ["1.21", "\"1.21\""] {
        let (place, key, found, allowed) = parts(changed("\"1.21 m\"", bare));
        assert_eq!((key.as_str(), place.line_column), ("source.distance", Some((3, 12))));
        assert!(found.contains("without a unit"), "{found}");
        assert!(allowed.contains("units: m, cm, mm, um"), "{allowed}");
    }
}

#[test]
fn wrong_unit_is_named() {
    let (_, key, found, allowed) = parts(changed("\"30 keV\"", "\"30 um\""));
    assert_eq!(key, "source.energy");
    assert!(found.contains("the unit \"um\"") && allowed.contains("keV"), "{found} {allowed}");
    let (place, key, ..) = parts(changed("\"26 um\"", "\"26 keV\""));
    assert_eq!((key.as_str(), place.line_column), ("source.spot[1]", Some((4, 18))));
}

#[test]
fn late_errors_show_their_place_too() {
    let (place, key, found, allowed) =
        parts(changed("projected_aperture = \"30 um\"", "projected_aperture = \"160 um\""));
    assert_eq!((key.as_str(), place.line_column), ("sample_mask.aperture", Some((16, 22))));
    assert!(found.contains("106."), "{found}");
    assert!(allowed.contains("the period"), "{allowed}");
}

#[test]
fn planes_out_of_order_are_refused() {
    let cases = [
        ("distance = \"1.2 m\"", "distance = \"1.3 m\"", "sample_mask.distance"),
        ("distance = \"1.2 m\"", "distance = \"1.2099 m\"", "sample_mask.distance"),
        ("distance = \"1.8 m\"", "distance = \"1.1 m\"", "detector.distance"),
        ("[detector_mask]", "[detector_mask]\ndistance = \"1.8 m\"", "detector_mask.distance"),
        ("[detector_mask]", "[detector_mask]\ndistance = \"1.2 m\"", "detector_mask.distance"),
    ];
    for (from, to, expected) in cases {
        let (place, key, ..) = parts(changed(from, to));
        assert_eq!(key, expected, "{to}");
        assert!(place.line_column.is_some());
    }
}

/// The key that is wrong is named first, and not one whose value follows from it.
#[test]
fn lengths_in_a_wrong_place_or_unit_are_named() {
    let long = format!("object.ball.name=\"{}\"", "a".repeat(201));
    let unit = "is its unit right?";
    let cases: [(&[&str], &str, &str); 12] = [
        (&["detector.pitch=15um"], "detector.pitch", unit),
        (&["sample_mask.aperture=2mm"], "sample_mask.aperture", unit),
        (&["source.distance=12m"], "source.distance", unit),
        (&["source.distance=1.2mm"], "source.distance", unit),
        (&["detector.distance=1.8mm"], "detector.distance", unit),
        (&["detector.distance=0.6m"], "detector.distance", "600 mm behind the sample is 1.81 m"),
        (&["sample_mask.distance=11m"], "sample_mask.distance", unit),
        (
            &["sample_mask.distance=1.7m", "detector_mask.distance=1.1m"],
            "sample_mask.distance",
            "the two masks are swapped",
        ),
        (&["detector.pitch=1e39m"], "detector.pitch", "up to 1000000000 m"),
        (&["scan.dithers=[\"1e39 m\"]"], "scan.dithers", "up to 1000000000 m"),
        (
            &["object.ball.position=[\"0m\",\"2e9m\",\"0m\"]"],
            "object[1].position[1]",
            "up to 1000000000 m",
        ),
        (&[&long], "object[1].name", "1 to 200 characters"),
    ];
    for (sets, name, words) in cases {
        let error = with_sets(sets).expect_err("a refusal");
        let (_, key, _, allowed) = parts(with_sets(sets));
        assert!(key == name && allowed.contains(words), "{sets:?}: {error}");
        // Periods that follow from a long pixel are too long, too.
        let follow = words.starts_with("up to");
        assert!(follow || error.each().len() == 1, "{sets:?}: {error}");
    }
}

#[test]
fn values_out_of_range_are_refused() {
    let cases = [
        ("\"1.21 m\"", "\"-1.21 m\"", "source.distance"),
        ("\"30 keV\"", "\"0 keV\"", "source.energy"),
        ("[128, 96]", "[128, 0]", "detector.pixels[1]"),
        ("[128, 96]", "[128, 65537]", "detector.pixels[1]"),
        ("[128, 96]", "[128]", "detector.pixels"),
        ("[128, 96]", "[128.0, 96]", "detector.pixels[0]"),
        ("count = 11", "count = 100001", "scan.mask_offsets.count"),
        ("count = 360", "count = 99999999999999", "scan.angles.count"),
        ("\"2.0 g/cm3\"", "\"0 g/cm3\"", "materials.carbon.density"),
        ("\"0.25 /cm\"", "\"-1 /cm\"", "materials.\"my plastic\".mu"),
        ("\"0.25 /cm\"", "\"1 /cm\"\nformula = \"C\"", "materials.\"my plastic\".mu"),
        ("name = \"ball\"", "name = \"rod\"", "object[1].name"),
        ("sides = 64", "sides = 3", "object[1].shape.sphere.sides"),
        ("axis = [0, 0, 1]", "axis = [0, 0, 0]", "object[0].rotate[0].axis"),
        ("material = \"carbon\"", "material = \"\"", "object[0].material"),
        ("unit = \"mm\"", "", "object[0].unit"),
        ("unit = \"mm\"", "unit = \"foot\"", "object[0].unit"),
        ("unit = \"mm\"", "unit = \"mm\"\nscale = -1", "object[0].scale"),
        ("unit = \"mm\"", "unit = \"mm\"\nscale = nan", "object[0].scale"),
        ("unit = \"mm\"", "unit = \"mm\"\nsha256 = \"12\"", "object[0].sha256"),
        ("thickness = \"225 um\"", "transmission = 0.5", "sample_mask.material"),
        (
            "thickness = \"225 um\"",
            "thickness = \"225 um\"\nlayers = [{ material = \"gold\", thickness = \"9 um\" }]",
            "sample_mask.layers",
        ),
        (
            "thickness = \"225 um\"",
            "thickness = \"225 um\"\ntaper = \"50 deg\"",
            "sample_mask.taper",
        ),
        ("projected_aperture = \"30 um\"", "", "sample_mask.aperture"),
        (
            "projected_aperture = \"30 um\"",
            "projected_aperture = \"30 um\"\naperture = \"20 um\"",
            "sample_mask.projected_aperture",
        ),
        (
            "projected_aperture = \"30 um\"",
            "projected_aperture = \"-3 um\"",
            "sample_mask.projected_aperture",
        ),
    ];
    for (from, to, expected) in cases {
        let (place, key, ..) = parts(changed(from, to));
        assert_eq!(key, expected, "{to}");
        assert!(place.line_column.is_some(), "{to}");
    }
}

#[test]
fn mask_offset_without_a_sample_mask_is_refused() {
    let start = PAPER.find("[sample_mask]").unwrap();
    let end = PAPER.find("[detector_mask]").unwrap();
    let (place, key, ..) = parts(load(&format!("{}{}", &PAPER[..start], &PAPER[end..])));
    assert_eq!(key, "scan.mask_offsets");
    assert!(place.line_column.is_some());
}

#[test]
fn broken_syntax_shows_its_place() {
    let (place, ..) = parts(changed("\"1.21 m\"", "\"1.21 m"));
    assert_eq!(place.line_column.map(|at| at.0), Some(3));
    let (place, _, found, _) = parts(Scene::from_json("{\n  \"source\": }", "."));
    assert_eq!(place.line_column, Some((2, 13)));
    assert!(found.contains("expected value"), "{found}");
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
