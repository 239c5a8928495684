//! Roughness in scene files.

#![allow(clippy::float_cmp, reason = "numbers are read to the bit")]

use beamlet::scene::Scene;
use std::collections::BTreeMap;

const SCENE: &str = r#"
source = { distance = "1 m", spot = "0 um", energy = "30 keV" }
detector = { distance = "2 m", pixels = [8, 8], pitch = "1 mm" }
sampling = { scheme = "random" }
object = [{ name = "a", material = "water", shape = { sphere = { radius = "1 mm" } }, roughness = 0.002 }]
"#;

fn text_of(scene: &Scene) -> String {
    scene.to_toml(".", &BTreeMap::new(), &[]).expect("text")
}

#[test]
fn roughness_is_read_written_and_held_to_its_range() {
    let scene = Scene::from_toml(SCENE, ".").expect("a scene");
    assert_eq!(scene.objects[0].roughness, 0.002);
    let text = text_of(&scene);
    assert!(text.contains("roughness = 0.002"), "{text}");
    assert_eq!(Scene::from_toml(&text, ".").expect("a scene").objects[0].roughness, 0.002);
    for (value, found) in
        [("0.31", "0.31"), ("-0.001", "-0.001"), ("nan", "NaN"), ("\"2 um\"", "2 um")]
    {
        let error = Scene::from_toml(&SCENE.replace("0.002", value), ".").expect_err(value);
        let error = error.to_string();
        assert!(error.contains("object[0].roughness") && error.contains(found), "{error}");
    }
    let error = Scene::from_toml(&SCENE.replace("0.002", "0.31"), ".").expect_err("too rough");
    assert!(error.to_string().contains("0 to 0.3"), "{error}");
    let smooth = Scene::from_toml(&SCENE.replace(", roughness = 0.002", ""), ".").expect("a scene");
    assert!(!text_of(&smooth).contains("roughness"));
}
